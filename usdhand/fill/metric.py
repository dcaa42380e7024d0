"""Distances of two arm motions: the features that metrics of fill weigh.

A metric turns an `ArmMotion` into feature rows whose squared Euclidean distance is the local cost
of Joerg, Hodgins & Safonova 2012, section 3.2: centimetres and degrees, weighted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import UsageError
from usdhand.fill.arm import ArmMotion
from usdhand.fill.settings import METRICS, Feature, Metric
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array


def _chordal(q: Array) -> Array:
    """Rotation matrices scaled so that a small angle between two is their distance in degrees."""
    return np.asarray(np.degrees(rot.to_matrix(q).reshape(len(q), 9)) / np.sqrt(2.0))


def _euler(q: Array) -> Array:
    """Intrinsic XYZ angles in degrees, continuous in time: the paper's, with their weaknesses."""
    m = rot.to_matrix(q)
    angles = [
        np.arctan2(-m[:, 1, 2], m[:, 2, 2]),
        np.arcsin(np.clip(m[:, 0, 2], -1.0, 1.0)),
        np.arctan2(-m[:, 0, 1], m[:, 0, 0]),
    ]
    return np.degrees(np.unwrap(np.stack(angles, axis=1), axis=0))


# Name of a feature -> how it is made from the arm's motion, in cm or degrees.
FEATURES: Mapping[Feature, Callable[[ArmMotion], Array]] = {
    "hips_position": lambda a: a.hips_position,
    "chest_position": lambda a: a.chest_position,
    "shoulder_position": lambda a: a.shoulder_position,
    "elbow_position": lambda a: a.elbow_position,
    "shoulder_from_hips": lambda a: a.hips_shoulder,
    "elbow_from_hips": lambda a: a.hips_elbow,
    "upper_arm": lambda a: _chordal(a.upper_arm),
    "forearm": lambda a: _chordal(a.forearm),
    "hips_palm": lambda a: _chordal(a.hips_palm),
    "chest_palm": lambda a: _chordal(a.chest_palm),
    "euler_palm": lambda a: _euler(a.hips_palm),
    "wrist": lambda a: np.degrees(a.wrist),
}


def feature_rows(metric: Metric, arm: ArmMotion) -> NDArray[np.float32]:
    """(frames, D) float32 rows; the squared distance of two is the cost of the metric."""
    columns = [np.sqrt(w) * FEATURES[name](arm) for name, w in metric.weights.items()]
    return np.concatenate(columns, axis=1).astype(np.float32)


def metric_of(named: str | Metric) -> Metric:
    """Return a metric as it is, or the one with this name.

    Raises
    ------
    UsageError
        if there is none.
    """
    if isinstance(named, Metric):
        return named
    if named not in METRICS:
        raise UsageError(f"There is no metric '{named}'; there are {', '.join(METRICS)}.")
    return METRICS[named]
