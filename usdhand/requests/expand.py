"""What `expand` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class ExpandRequest(Request):
    """Turn a reduced rig back into motion, on its own or another character.

    Dependent channels are computed from the free ones (also after someone edited those) and
    baked, with the body, into a SkelAnimation. With --motion, the free ones are those of a clip
    that need have nothing else.

    \b
    Examples:
      usdhand expand ok_rig.usda -o ok.usda
      usdhand expand ok_rig.usda --onto samples/characters/ben.usdc -o ben_ok.usda
      usdhand expand show_rig.usdc --motion few_markers.usdc -o hands.usdc
    """

    verb: ClassVar[str] = "expand"
    rig: Path = argument("A rig that `reduce` wrote.")
    output: Path = shared.output("The motion (.usda, .usdc, .usd, .usdz).")
    onto: Path | None = option(
        "Put the hands on this character, whatever its rig.", default=None, metavar="CHARACTER"
    )
    motion: Path | None = option(
        "Take the free channels from this clip instead, and make the rest of its hands.",
        default=None,
        metavar="CLIP",
    )
    variation: float = option(
        "Put back so much of the motion that the rig does not keep, as noise with its spectrum "
        "and correlation; 1 is as much as there was.",
        default=0.0,
        metavar="X",
    )
    seed: int = option("Another seed is another variation.", default=0, metavar="N", at_least=0)
    skel: str | None = shared.skel(
        "Path or name of the skeleton where there are several (with --onto: of CHARACTER)."
    )
    rig_skel: str | None = option(
        "With --onto: skeleton of the rig, where the rig file has several.",
        default=None,
        metavar="PRIM",
    )
    refresh: bool = option(
        "Take the body from the clip that the rig was made from, as it is now.", default=False
    )
    flatten: bool = shared.flatten()
    allow_outside: bool = shared.allow_outside()
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    dry_run: bool = shared.dry_run()
    force: bool = shared.force()
