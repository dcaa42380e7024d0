"""What `compare` is to do."""

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
class CompareRequest(Request):
    """Compare motion B with motion A: degrees, fingertips, smoothness, lag.

    Characters may differ: hands are compared by anatomical channels, fingertips in the palm's
    axes. Both are taken from their first frame on, at A's frame rate.

    \b
    Example:
      usdhand compare talk_01_full.usdc talk_01_filled.usda
    """

    verb: ClassVar[str] = "compare"
    verbose: ClassVar[str] = "Print every channel."
    a: Path = argument("The reference motion.")
    b: Path = argument("The motion to compare with it.")
    align: bool = option("Shift B by the measured lag, then compare.", default=False)
    max_rms: float | None = option(
        "Exit code 5 if the RMS over channels is larger.", default=None, metavar="DEG"
    )
    skel: str | None = shared.skel()
    skel_b: str | None = shared.skel("Skeleton of B, if it is a different one.")
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    force: bool = shared.force("a report")
