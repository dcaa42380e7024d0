"""What a user may set of reduce, and the paper's four steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import check_choices, option

Fit = Literal["paper", "least-squares"]


@dataclass(frozen=True)
class Thresholds:
    """What counts as barely moving (``range`` in degrees) and as following (``rmsd``)."""

    range: float
    rmsd: float


# The paper's four steps (section 5). Steps 2 and 4 work on the curves left by steps 1 and 3.
PRESETS: dict[int, Thresholds] = {
    1: Thresholds(1.0, 0.0),
    2: Thresholds(1.0, 0.3),
    3: Thresholds(5.0, 0.0),
    4: Thresholds(5.0, 0.5),
}


@dataclass(frozen=True)
class Target:
    """What a reduction aims at: exactly one of the three."""

    thresholds: Thresholds | None = None
    free_channels: int | None = None
    max_error: float | None = None

    def __post_init__(self) -> None:
        given = [x is not None for x in (self.thresholds, self.free_channels, self.max_error)]
        if sum(given) != 1:
            raise UsageError("Give either thresholds, a number of channels, or a largest error.")


@displayed()
@dataclass(frozen=True)
class ReduceSettings:
    """How a rig is fitted: one measure of its size; step 4 of the paper by default.

    Attributes
    ----------
    preset : 1 to 4, the paper's steps
    range_deg, rmsd : own thresholds, in degrees and for standardised curves
    free_channels : how many channels stay free
    max_error : largest RMS error of any channel, degrees
    fit : "paper" keeps standard deviations, "least-squares" has the smallest error
    controllers : how many channels a channel may follow, with least squares
    """

    preset: int | None = option(
        "The paper's steps: 1 range<1; 2 and rmsd<0.3; 3 range<5; 4 and rmsd<0.5. [default: 4]",
        default=None,
        at_least=1,
        at_most=4,
    )
    range_deg: float | None = option(
        "Channels with a smaller range are constant.",
        "--range",
        default=None,
        metavar="DEG",
        key="range",
    )
    rmsd: float | None = option(
        "Channels with a smaller RMS deviation (0 to 2) are linear.", default=None, metavar="X"
    )
    free_channels: int | None = option(
        "Leave N channels free.", "--target-dofs", default=None, metavar="N", key="target_dofs"
    )
    max_error: float | None = option(
        "Largest RMS error of any channel allowed.", default=None, metavar="DEG"
    )
    fit: Fit = option(
        "Slopes that keep standard deviations, or slopes with the smallest error.", default="paper"
    )
    controllers: int = option(
        "How many channels a channel may follow (needs --fit least-squares).", default=1, at_least=1
    )

    def __post_init__(self) -> None:
        check_choices(self)

    @property
    def target(self) -> Target:
        """What these settings aim at.

        Raises
        ------
        UsageError
            if more than one way is used, or a preset or threshold is out of range.
        """
        preset, thresholds = self.preset, None
        own = self.range_deg is not None or self.rmsd is not None
        if preset is not None and preset not in PRESETS:
            raise UsageError(
                f"There is no preset {preset}; presets are {', '.join(map(str, PRESETS))}."
            )
        if preset is not None and own:
            raise UsageError(
                "A preset sets both thresholds; give a preset or thresholds, not both."
            )
        if own:
            thresholds = Thresholds(self.range_deg or 0.0, self.rmsd or 0.0)
            if not (thresholds.range >= 0 and 0 <= thresholds.rmsd <= 2):
                raise UsageError("Thresholds: a range of 0 degrees or more, an rmsd from 0 to 2.")
        elif preset is not None:
            thresholds = PRESETS[preset]
        elif self.free_channels is None and self.max_error is None:
            thresholds = PRESETS[4]
        return Target(thresholds, self.free_channels, self.max_error)
