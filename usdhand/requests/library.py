"""What `library build` and `library info` are to do."""

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
class LibraryBuildRequest(Request):
    """Read clips with body and fingers into a library.

    A folder stands for all clips in it and in the folders below. Run again, it reads only what
    changed and keeps labels that someone edited; clips of the old library that are not given any
    more are removed and listed. A clip that cannot be used is reported and left out. The library
    is a USD stage with a prim a clip.

    \b
    Examples:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand library build takes/*.usdc -o takes.usdc --jobs 2 --labels takes.csv
    """

    verb: ClassVar[str] = "library build"
    clips: tuple[str, ...] = argument("Clips, folders and wildcards.", several="below")
    output: Path = shared.output("The library (.usdc, .usda, .usd).")
    labels: Path | None = option(
        "Columns file, label and optionally actor; without it labels come from file names.",
        default=None,
        metavar="FILE.csv",
    )
    speed: float | None = option(
        "Cut where the wrist is slower than this.", default=None, metavar="CM/S", reported=False
    )
    shortest: float | None = option("Shortest segment.", default=None, metavar="S", reported=False)
    longest: float | None = option("Longest segment.", default=None, metavar="S", reported=False)
    jobs: int = option("Processes.", default=1, at_least=1)
    rebuild: bool = option("Read all clips again; labels are kept.", default=False)
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    force: bool = shared.force()


@displayed()
@dataclass(frozen=True, kw_only=True)
class LibraryInfoRequest(Request):
    """Show minutes, clips, actors, segments, labels and problems of a library.

    \b
    Example:
      usdhand library info gestures.usdc
    """

    verb: ClassVar[str] = "library info"
    library: Path = argument("A library that `library build` wrote.")
