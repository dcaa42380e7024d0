"""What stands above a skeleton in its file and cannot be part of a clip."""

from __future__ import annotations

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.motion.transforms import FLAT
from usdhand.problems import Problem

UNEVEN = 0.01  # relative difference of scales


def scale_problems(linear: Array, where: str) -> tuple[Problem, ...]:
    """Tell what a clip leaves out of the transforms (frames, 3, 3) above its skeleton."""
    singular = np.linalg.svd(linear, compute_uv=False)
    largest, smallest = singular.max(axis=1), singular.min(axis=1)
    uneven = UNEVEN * smallest
    found = []
    if (smallest <= FLAT).any():
        found.append(Problem("zero-scale", "there is a zero scale above the skeleton", where))
    if (largest > smallest + uneven).any():
        message = "a non-uniform scale is above the skeleton: its mean is used for bone lengths"
        found.append(Problem("non-uniform-scale", message, where))
    if (np.linalg.det(linear) < 0).any():
        message = "a transform above the skeleton mirrors it: left and right may be swapped"
        found.append(Problem("mirrored", message, where))
    if (np.abs(smallest - smallest[0]) > uneven[0]).any():
        message = "the scale above the skeleton changes over time: that of the first frame is used"
        found.append(Problem("animated-scale", message, where))
    return tuple(found)
