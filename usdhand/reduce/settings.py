"""What a user may set of reduce, and the paper's four steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import check_values, option

Fit = Literal["paper", "least-squares"]
MeasureName = Literal["deg", "mm"]
Preference = Literal["flexion"]


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


@dataclass(frozen=True)
class Criteria:
    """What counts where the free channels are chosen directly, as the best ones.

    Attributes
    ----------
    measure : "deg": squared degrees of all channels; "mm": squared millimetres of the fingertips
    keep : channels that stay free in any case
    prefer : "flexion": twists and spreads must be worth more than a flexion
    symmetric : the same channels of both hands
    """

    measure: MeasureName = "deg"
    keep: tuple[str, ...] = ()
    prefer: Preference | None = None
    symmetric: bool = False


@displayed()
@dataclass(frozen=True)
class ReduceSettings:
    """How a rig is fitted: one measure of its size; step 4 of the paper by default.

    A number of channels or a largest error is met with the channels that tell the others best; by
    the paper's rules, with thresholds searched for it, where ``fit`` is "paper".

    Attributes
    ----------
    preset : 1 to 4, the paper's steps
    range_deg, rmsd : own thresholds, in degrees and for standardised curves
    free_channels : how many channels stay free
    max_error : largest RMS error of any channel, degrees (of any fingertip, mm)
    fit : "paper" keeps standard deviations, "least-squares" has the smallest error; by default the
        paper's for thresholds, least squares for a number of channels or a largest error
    controllers : how many channels a channel may follow, with least squares; by default one for
        thresholds, else as many as serve takes left out
    measure, keep, prefer, symmetric : see `Criteria`
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
        "Largest RMS error of any channel allowed (with --measure mm of any fingertip, in mm).",
        default=None,
        metavar="DEG",
    )
    fit: Fit | None = option(
        "Slopes that keep standard deviations (the paper's), or slopes with the smallest error. "
        "[default: paper for presets and thresholds, else least-squares]",
        default=None,
    )
    controllers: int | None = option(
        "How many channels a channel may follow (needs least squares). [default: 1 for presets "
        "and thresholds, else what serves takes left out]",
        default=None,
        at_least=1,
    )
    measure: MeasureName = option(
        "What --target-dofs and --max-error make small: degrees of all channels, or millimetres "
        "at the fingertips.",
        default="deg",
    )
    keep: tuple[str, ...] = option(
        "Channel that stays free in any case, for example riThumbCMCx; repeatable.",
        default=(),
        metavar="CHANNEL",
    )
    prefer: Preference | None = option(
        "Twists and spreads are left free only where they are worth more than a flexion.",
        default=None,
    )
    symmetric: bool = option("Leave the same channels of both hands free.", default=False)

    def __post_init__(self) -> None:
        check_values(self)
        if self.max_error is not None and not 0.0 < self.max_error < math.inf:
            raise UsageError(
                f"A largest error of {self.max_error:g} is not possible: give a number above 0."
            )

    @property
    def choice(self) -> Criteria:
        """What counts where the free channels are chosen directly."""
        return Criteria(self.measure, self.keep, self.prefer, self.symmetric)

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
        target = Target(thresholds, self.free_channels, self.max_error)
        by_rules = thresholds is not None or self.fit == "paper"
        if by_rules and self.choice != Criteria():
            raise UsageError(
                "--measure, --keep, --prefer and --symmetric are for the channels that "
                "--target-dofs and --max-error choose by least squares; the paper's rules have no "
                "such choice."
            )
        if (self.controllers or 1) > 1 and by_rules and self.fit != "least-squares":
            raise UsageError("Several controllers per channel need the least-squares fit.")
        return target
