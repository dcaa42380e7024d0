"""How well arm motion tells what a gesture is: Joerg, Hodgins & Safonova 2012, section 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.display import displayed
from usdhand.errors import InputError
from usdhand.fill.arm import ArmMotion, mirrored
from usdhand.fill.candidates import part_segments
from usdhand.fill.library import LibraryClip, MotionLibrary
from usdhand.fill.metric import feature_rows
from usdhand.fill.settings import PAPER_SEGMENTATION, Metric, Segmentation
from usdhand.motion.rotations import Array
from usdhand.search import pack, prepare, search

# Single features and weighted combinations, as in the paper's figure 7.
COMPARED: tuple[Metric, ...] = (
    Metric("shoulder position", {"shoulder_from_hips": 1.0}),
    Metric("shoulder rotation", {"upper_arm": 1.0}),
    Metric("elbow position", {"elbow_from_hips": 1.0}),
    Metric("elbow rotation", {"forearm": 1.0}),
    Metric("wrist position (P)", {"hips_position": 1.0}),
    Metric("wrist rotation (R)", {"hips_palm": 1.0}),
    Metric("P + 0.1 R", {"hips_position": 1.0, "hips_palm": 0.1}),
    Metric("P + 0.25 R", {"hips_position": 1.0, "hips_palm": 0.25}),
    Metric("P + 0.5 R", {"hips_position": 1.0, "hips_palm": 0.5}),
    Metric("P + R", {"hips_position": 1.0, "hips_palm": 1.0}),
    Metric("P + 2 R", {"hips_position": 1.0, "hips_palm": 2.0}),
)


@displayed(
    lambda agreement: {
        "metric": agreement.metric,
        "share": agreement.share,
        "labels": len(agreement.labels),
        "segments": agreement.segments,
    }
)
@dataclass(frozen=True, eq=False)
class Agreement:
    """Labels of the nearest segments of other clips.

    Attributes
    ----------
    share : of the ``k`` nearest that have the segment's own label, mean over segments
    confusion : (labels, labels) share of each label (column) among the nearest of each (row)
    """

    metric: str
    labels: tuple[str, ...]
    share: float
    confusion: Array
    segments: int


def label_agreement(
    library: MotionLibrary,
    metrics: Sequence[Metric] = COMPARED,
    k: int = 5,
    segmentation: Segmentation = PAPER_SEGMENTATION,
) -> list[Agreement]:
    """Share of same-label segments among the ``k`` nearest, each clip left out in turn.

    Of each clip the hand that gestures counts, or both; left hands are mirrored.

    Raises
    ------
    InputError
        if fewer than two labels are in the library.
    """
    labels = tuple(sorted({c.label for c in library.clips if c.label}))
    if len(labels) < 2:
        raise InputError(
            f"The library has {len(labels)} labels; at least two are needed. Name files "
            "LABEL_NUMBER, or give --labels FILE.csv to 'library build'."
        )
    number_of = {label: number for number, label in enumerate(labels)}
    gestures = [
        (arm, number_of[clip.label], number)
        for number, clip in enumerate(library.clips)
        if clip.label
        for arm in _gesturing_arms(clip)
    ]
    return [_agreement(gestures, metric, k, segmentation, labels) for metric in metrics]


def _gesturing_arms(clip: LibraryClip) -> list[ArmMotion]:
    """Arms that move at least half as far as the one that moves most, as right arms."""
    arms = {
        side: mirrored(hand.arm) if side == "left" else hand.arm
        for side, hand in clip.hands.items()
    }
    reach = {
        side: float(np.linalg.norm(np.ptp(arm.hips_position, axis=0))) for side, arm in arms.items()
    }
    return [arm for side, arm in arms.items() if reach[side] >= 0.5 * max(reach.values())]


def _agreement(
    gestures: Sequence[tuple[ArmMotion, int, int]],
    metric: Metric,
    k: int,
    segmentation: Segmentation,
    labels: tuple[str, ...],
) -> Agreement:
    pieces: list[NDArray[np.float32]] = []
    own: list[int] = []
    clips: list[int] = []
    for arm, label, clip in gestures:
        rows = feature_rows(metric, arm)
        for first, last in part_segments([arm], segmentation):
            pieces.append(rows[first : last + 1])
            own.append(label)
            clips.append(clip)
    groups = np.array(clips, dtype=np.int32)
    packed = pack(pieces, groups=groups)
    matches = search(prepare(packed), packed, k=k, exclude=groups[:, None])
    counts = np.zeros((len(labels), len(labels)))
    for row, ids in zip(own, matches.ids, strict=True):
        for found in ids[ids >= 0]:
            counts[row, own[int(found)]] += 1.0
    totals = np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    share = float(np.trace(counts) / max(counts.sum(), 1.0))
    return Agreement(metric.name, labels, share, counts / totals, len(own))
