"""What `preview` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import argument, option, settings
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True)
class PreviewSettings:
    """What goes into a page.

    Attributes
    ----------
    max_frames : longer clips keep every second, third, ... frame, down to this number
    max_points : characters with larger meshes are shown as bones; 0 for no meshes at all
    """

    max_frames: int = option(
        "Largest number of frames; longer clips keep every second, third, ... frame.",
        default=10_800,
        at_least=2,
    )
    max_points: int = option(
        "Largest number of mesh points; larger characters are shown as bones, 0 shows bones only.",
        default=40_000,
        at_least=0,
    )

    def __post_init__(self) -> None:
        if self.max_frames < 2:
            raise UsageError(f"A page of {self.max_frames} frames shows no motion: give 2 or more.")


@displayed()
@dataclass(frozen=True, kw_only=True)
class PreviewRequest(Request):
    """Make a page that shows clips: one HTML file that opens offline in any browser.

    Files play side by side or over each other, in sync from their first frames, with close-up
    cameras on the hands and curves of their channels. Alternatives that fill wrote into a file
    are lanes of their own.

    \b
    Example:
      usdhand preview samples/gestures/ok_01.usdc samples/gestures/ok_02.usdc -o ok.html
    """

    verb: ClassVar[str] = "preview"
    files: tuple[str, ...] = argument("Files, folders and wildcards.", several="files")
    output: Path = shared.output("The page (.html).")
    reports: tuple[Path, ...] = option(
        "JSON report of fill or splice of one of the files: shows its segments, phases and pins on "
        "the timeline; repeatable.",
        "--with-report",
        default=(),
        metavar="FILE",
        reported=False,
    )
    figures: tuple[Path, ...] = option(
        "SVG or PNG to show below; repeatable.",
        "--figure",
        default=(),
        metavar="FILE",
        reported=False,
    )
    title: str | None = option("Heading of the page.  [default: names of the files]", default=None)
    settings: PreviewSettings = settings(PreviewSettings())
    skel: str | None = shared.skel()
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    force: bool = shared.force()
