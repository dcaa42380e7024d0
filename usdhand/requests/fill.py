"""What `fill` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from usdhand.display import displayed
from usdhand.fill.settings import PAPER, FillSettings
from usdhand.options import argument, option, settings
from usdhand.requests import shared
from usdhand.requests.base import Request

Preset = Literal["default", "paper"]
PRESETS = {"default": FillSettings(), "paper": PAPER}


@displayed()
@dataclass(frozen=True, kw_only=True)
class FillRequest(Request):
    """Give a body clip the fingers of similar motions from a library.

    Cuts the body's arm motion into segments, finds the most similar segments of the library,
    chooses the smoothest path through them and joins the pieces (Joerg, Hodgins and Safonova
    2012). The body stays as it is; library clips of the same performance are left out.

    \b
    Example:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand fill samples/conversations/talk_01_body.usdc --library gestures.usdc -o talk.usda
    """

    verb: ClassVar[str] = "fill"
    verbose: ClassVar[str] = "Print every segment."
    body: Path = argument("The clip whose fingers are missing or still.")
    library: Path = option(
        "Library with the fingers; see `usdhand library build`.",
        metavar="LIB",
        reported=False,
    )
    output: Path = shared.output("The body with fingers (.usda, .usdc, .usd, .usdz).")
    preset: Preset = option(
        "All settings at once: the measured best, or the paper's.", default="default"
    )
    settings: FillSettings = settings(FillSettings(), bases=PRESETS, chosen_by="preset")
    replace: bool = option("Replace fingers that already move.", default=False)
    add_fingers: bool = option(
        "Give a body without finger joints those of the library's character, scaled to it.",
        default=False,
    )
    fingers_from: Path | None = option(
        "Add the finger joints of this character instead of the library's.",
        default=None,
        metavar="CHARACTER",
    )
    replace_fingers: bool = option(
        "Add whole hands also where the body has a whole thumb or finger, which stays still.",
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
