"""What `inspect` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class InspectRequest(Request):
    """Show skeletons, timing, units, hands and problems of files.

    Of a hand rig, also what follows what; with --plots as a picture of the hands.

    \b
    Examples:
      usdhand inspect samples/characters samples/gestures/ok_01.usdc
      usdhand inspect ok_rig.usda --plots pictures
    """

    verb: ClassVar[str] = "inspect"
    verbose: ClassVar[str] = "Print every channel."
    files: tuple[str, ...] = argument("Files, folders and wildcards.", several="files")
    skel: str | None = shared.skel()
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    plots: Path | None = shared.plots()
    force: bool = shared.force("a plot")
