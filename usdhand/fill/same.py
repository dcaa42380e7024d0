"""Library clips that are the very performance that is filled, under whatever name or on any rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from usdhand.anatomy import Side
from usdhand.fill.arm import ArmMotion
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.motion.rotations import Array

# Two takes are one performance if the wrists' paths are this alike, but for a small offset.
SAME_CM = 1.0
LONGEST_OFFSET_S = 1.0
SMALLEST_OVERLAP = 0.7
# What lies still tells nothing of being the same.
SMALLEST_PATH_CM = 5.0


def same_motion(
    library: MotionLibrary, arms: Mapping[Side, ArmMotion], content_hash: str | None
) -> list[int]:
    """Clips with the same content, or with the same motion as a body's ``arms`` at `ARM_FPS`.

    Taking fingers from them would be copying the answer, which is what nobody wants to measure.
    """
    paths = {side: arm.hips_position for side, arm in arms.items()}
    return [
        i
        for i, clip in enumerate(library.clips)
        if (content_hash is not None and clip.content_hash == content_hash)
        or _same_paths(
            [(paths[s], h.arm.hips_position) for s, h in clip.hands.items() if s in paths]
        )
    ]


def _same_paths(pairs: list[tuple[Array, Array]]) -> bool:
    """Whether all pairs of paths (frames, 3) are alike at one offset, and some of them moves."""
    if not pairs or max(np.ptp(a, axis=0).max() for a, _ in pairs) < SMALLEST_PATH_CM:
        return False
    most = int(LONGEST_OFFSET_S * ARM_FPS)
    if any(min(len(a), len(b)) < SMALLEST_OVERLAP * max(len(a), len(b)) for a, b in pairs):
        return False

    def apart(offset: int) -> float:
        distances = []
        for a, b in pairs:
            count = min(len(a) - max(-offset, 0), len(b) - max(offset, 0))
            if count < SMALLEST_OVERLAP * min(len(a), len(b)):
                return np.inf
            first, second = a[max(-offset, 0) :][:count], b[max(offset, 0) :][:count]
            distances.append(float(np.sqrt(np.mean((first - second) ** 2))))
        return max(distances)

    return any(apart(offset) < SAME_CM for offset in range(-most, most + 1))
