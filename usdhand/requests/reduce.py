"""What `reduce` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option, settings
from usdhand.reduce.settings import ReduceSettings
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class ReduceRequest(Request):
    """Reduce hands to a rig of a few free channels.

    Finds which finger rotations barely move and which follow others linearly (Joerg & O'Sullivan
    2009), over all clips together, and writes the rig as custom attributes over each clip, with
    the reduced motion baked beside it.

    \b
    Examples:
      usdhand reduce samples/gestures/ok_01.usdc -o ok_rig.usda
      usdhand reduce takes/*.usdc -o rigs/ --target-dofs 20 --fit least-squares
      usdhand reduce new_take.usdc --rig rigs/take_01.rig.usdc -o new_rig.usdc
      usdhand reduce takes/*.usdc --fit-only --target-dofs 15 -o show_rig.usdc
    """

    verb: ClassVar[str] = "reduce"
    verbose: ClassVar[str] = "Print every channel."
    clips: tuple[str, ...] = argument("Clips, folders and wildcards.", several="files")
    output: Path = shared.output(
        "The rig file (.usda, .usdc, .usd, .usdz); for several clips a folder."
    )
    settings: ReduceSettings = settings(ReduceSettings())
    rig: Path | None = option(
        "Apply the relations of this rig instead of fitting one.", default=None, metavar="RIG"
    )
    fit_only: bool = option(
        "Write one file with the relations alone, to apply with --rig; takes in any number of "
        "clips, one at a time.",
        default=False,
    )
    side: shared.Sides = shared.side()
    flatten: bool = shared.flatten()
    allow_outside: bool = shared.allow_outside()
    skel: str | None = shared.skel()
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    plots: Path | None = shared.plots()
    dry_run: bool = shared.dry_run()
    force: bool = shared.force()
