"""How fill chooses: what a user may set, and the paper's own values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import check_values, option

Blend = Literal["smooth", "linear"]

# What can be compared of two arms, in centimetres or degrees; `usdhand.fill.metric` makes it.
Feature = Literal[
    "hips_position",
    "chest_position",
    "shoulder_position",
    "elbow_position",
    "shoulder_from_hips",
    "elbow_from_hips",
    "upper_arm",
    "forearm",
    "hips_palm",
    "chest_palm",
    "euler_palm",
    "wrist",
]


@displayed()
@dataclass(frozen=True)
class Metric:
    """How similar two arm motions are: the weighted sum of squared distances of features.

    Attributes
    ----------
    name : for reports
    weights : feature -> weight above 0; positions are in cm, rotations in degrees. One of
        hips_position, chest_position, shoulder_position, elbow_position (of the wrist, relative to
        there), shoulder_from_hips, elbow_from_hips, upper_arm, forearm, hips_palm, chest_palm,
        euler_palm (rotations) and wrist (how it bends)
    """

    name: str
    weights: Mapping[Feature, float]

    def __post_init__(self) -> None:
        if unknown := set(self.weights) - set(get_args(Feature)):
            raise UsageError(
                f"The metric {self.name} has no feature '{min(unknown)}' to compare; there are "
                f"{', '.join(get_args(Feature))}."
            )
        if not self.weights or not all(0.0 < w < math.inf for w in self.weights.values()):
            raise UsageError(f"The metric {self.name} needs at least one weight above 0.")


METRICS: Mapping[str, Metric] = {
    m.name: m
    for m in (
        # The paper's own: position and Euler angles of the wrist relative to the root, 1 and 0.5.
        Metric("euler", {"hips_position": 1.0, "euler_palm": 0.5}),
        Metric("chordal", {"hips_position": 1.0, "hips_palm": 0.5}),
        # The default: from the shoulder, with the elbow, and how the wrist bends.
        Metric(
            "arm",
            {"shoulder_position": 1.0, "elbow_position": 0.5, "chest_palm": 0.5, "wrist": 1.0},
        ),
    )
}
DEFAULT_METRIC = "arm"


@displayed()
@dataclass(frozen=True)
class Segmentation:
    """Where to cut. The default was chosen by the error on real takes (docs/fill-figures.md).

    Attributes
    ----------
    speed : cm / s at reference height; a border is where the speed of the wrist crosses it
    shortest, longest : seconds
    smoothing : seconds, standard deviation of the Gaussian that positions are smoothed with
    """

    speed: float = 15.0
    shortest: float = 0.25
    longest: float = 0.5
    smoothing: float = 0.05

    def __post_init__(self) -> None:
        if not (self.speed > 0 and self.shortest > 0 and 2 * self.shortest <= self.longest):
            raise UsageError(
                "Segments need a speed above 0, and a longest of at least twice the shortest."
            )


# Section 3.1: no segment under 0.33 s, none over 2 s.
PAPER_SEGMENTATION = Segmentation(speed=10.0, shortest=0.33, longest=2.0)


@displayed()
@dataclass(frozen=True)
class FillSettings:
    """How fingers are chosen; `PAPER` has the paper's own values.

    Attributes
    ----------
    metric : of arm motion: the name of one of `METRICS`, or one of your own
    k : candidates per segment
    factor : largest ratio of lengths of a segment and its candidate
    pool : nearest segments whose fingers tell which of them is typical; 0: none, the cost alone
    segmentation : how the motion is cut; None: as the library is
    sharpness : how fast the weight of one of the pool falls with its cost
    segment_weight, transition_weight : of both costs on the path
    scaled : bring both costs to the same average first, as in the paper
    repeat_weight : of playing one piece of the library twice in a row, in usual transition costs
    angle_weight, velocity_weight : of the transition cost
    alternatives : how many results
    couple : take both hands from the same clip
    """

    metric: str | Metric = option(
        "How arm motions are compared: arm, chordal or euler (the paper's).", default=DEFAULT_METRIC
    )
    k: int = option("Candidates per segment.", default=5, at_least=1)
    factor: float = 1.5
    pool: int = 20
    sharpness: float = 0.5
    segmentation: Segmentation | None = None
    segment_weight: float = 1.0
    transition_weight: float = 0.5
    scaled: bool = True
    repeat_weight: float = 1.0
    angle_weight: float = 1.0
    velocity_weight: float = 0.5
    blend: Blend = "smooth"
    alternatives: int = option(
        "Distinct results, as variants of the animation.", default=1, at_least=1
    )
    couple: bool = option("Take both hands from the same clip.", default=False)

    def __post_init__(self) -> None:
        check_values(self)
        if isinstance(self.metric, str) and self.metric not in METRICS:
            raise UsageError(f"There is no metric '{self.metric}'; there are {', '.join(METRICS)}.")
        if self.k < 1 or self.alternatives < 1:
            raise UsageError("Give at least one candidate and one alternative.")
        if self.factor < 1.0:
            raise UsageError(
                f"A length factor of {self.factor:g} leaves no candidates: give 1 or more."
            )


PAPER = FillSettings(
    metric="euler",
    pool=0,
    repeat_weight=0.0,
    scaled=False,
    blend="linear",
    segmentation=PAPER_SEGMENTATION,
)
