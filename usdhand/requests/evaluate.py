"""What `evaluate` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option
from usdhand.requests import shared
from usdhand.requests.base import Request
from usdhand.requests.fill import Preset


@displayed()
@dataclass(frozen=True, kw_only=True)
class EvaluateRequest(Request):
    """Measure how well a library predicts fingers from arms, leaving out one clip at a time.

    Reports how many of the nearest segments have the same label, for single features and
    combinations, with the confusion matrix (Joerg, Hodgins and Safonova 2012, section 4); and the
    errors of filled fingers, compared with the nearest segment, a random take, the mean pose, the
    rest pose and the best of the candidates.

    \b
    Example:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand evaluate gestures.usdc
    """

    verb: ClassVar[str] = "evaluate"
    library: Path = argument("A library that `library build` wrote.")
    k: int = option("Nearest segments.", default=5, at_least=1)
    takes: tuple[str, ...] = option(
        "Fill these clips instead of the library's own, such as those of another rig.",
        default=(),
        metavar="PATH",
        reported=False,
        several="files",
    )
    preset: Preset = option("Settings of fill; see `usdhand fill`.", default="default")
    metric: str | None = option("Metric of fill instead of the preset's.", default=None)
    labels_only: bool = option("Measure label agreement only, no reconstruction.", default=False)
    maps: tuple[Path, ...] = shared.maps()
    neutral: Path | None = shared.neutral()
    report: Path | None = shared.report()
    plots: Path | None = shared.plots()
    force: bool = shared.force()
