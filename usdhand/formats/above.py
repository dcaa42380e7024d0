"""What stands above a skeleton in its file and cannot be part of a clip."""

from __future__ import annotations

import numpy as np

from usdhand.motion import Problem
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import FLAT

UNEVEN = 0.01  # relative difference of scales


def scale_problems(linear: Array, where: str) -> tuple[Problem, ...]:
    """Tell what a clip leaves out of the transforms (frames, 3, 3) above its skeleton."""
    singular = np.linalg.svd(linear, compute_uv=False)
    largest, smallest = singular.max(axis=1), singular.min(axis=1)
    uneven = UNEVEN * smallest
    found = {
        "zero-scale": ((smallest <= FLAT).any(), "a zero scale stands above the skeleton"),
        "non-uniform-scale": (
            (largest > smallest + uneven).any(),
            "a non-uniform scale stands above the skeleton: bones are read with its mean",
        ),
        "mirrored": (
            (np.linalg.det(linear) < 0).any(),
            "a mirroring stands above the skeleton: sides may swap",
        ),
        "animated-scale": (
            (np.abs(smallest - smallest[0]) > uneven[0]).any(),
            "the scale above the skeleton changes over time: that of the first frame is read",
        ),
    }
    return tuple(Problem(code, text, where) for code, (there, text) in found.items() if there)
