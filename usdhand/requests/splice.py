"""What `splice` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option, settings
from usdhand.requests import shared
from usdhand.requests.base import Request
from usdhand.splice.settings import SpliceSettings


@displayed()
@dataclass(frozen=True, kw_only=True)
class SpliceRequest(Request):
    """Put the fingers of a hand clip on a body clip, both of the same performance.

    Finds which moments belong together from how both arms move, whatever their size, timing
    and direction in the room, retimes the hand clip and puts its fingers on the body (Majkowska,
    Zordan and Faloutsos 2006). The body's own motion and timing stay as they are.

    \b
    Example:
      usdhand splice samples/conversations/talk_01_body.usdc samples/hands/talk_01_hands_a.usdc \\
        --pin 1:1 --pin 181:403 -o talk.usda --report talk.json

    The hand clip of the example shows the first six seconds of the body: pins say where it begins
    and ends. Clips that begin and end together, or of which one clearly shows a part of the other,
    need no pin.
    """

    verb: ClassVar[str] = "splice"
    verbose: ClassVar[str] = "Print every phase."
    body: Path | None = argument("The clip that gets the fingers.", default=None)
    hands: Path | None = argument("The clip that has them.", default=None)
    output: Path = shared.output(
        "The body with the hand clip's fingers (.usda, .usdc, .usd, .usdz)."
    )
    manifest: Path | None = option(
        "Several hand clips for the body instead of one: a file (JSON), as `usdhand schema "
        "--of-takes` describes it.",
        default=None,
        metavar="FILE",
    )
    pins: tuple[str, ...] = option(
        "Time codes of both clips that belong together, exactly or within a tolerance in time "
        "codes of the hand clip; for one hand with left: or right: before it; repeatable.",
        "--pin",
        default=(),
        metavar="BODY:HAND[:TOL]",
    )
    claps: tuple[str, ...] = option(
        "Time codes at which both recordings show the same clap: the timing is that of their "
        "clocks, and motion has no influence; repeatable.",
        "--clap",
        default=(),
        metavar="BODY:HAND",
    )
    edits: Path | None = option(
        "A file of edits (JSON) with more pins, as `usdhand schema --of-edits` describes it.",
        default=None,
    )
    settings: SpliceSettings = settings(SpliceSettings())
    side: shared.Sides = shared.side()
    flatten: bool = shared.flatten()
    allow_outside: bool = shared.allow_outside()
    skel: str | None = shared.skel()
    hands_skel: str | None = shared.skel("Skeleton of the hand clip where there are several.")
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    plots: Path | None = shared.plots()
    dry_run: bool = shared.dry_run()
    force: bool = shared.force()
