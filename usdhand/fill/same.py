"""Library clips that are the very performance that is filled, under whatever name or on any rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from usdhand.anatomy import Side
from usdhand.fill.arm import ArmMotion
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.fill.metric import FEATURES
from usdhand.motion.rotations import Array

# Feature of the arm -> root mean square by which two takes of one performance differ at most, and
# the least range that tells anything: what is still is alike for no reason. Positions are the same
# after retargeting by the hands' places, rotations on a body of other proportions. Of 24 takes on
# two rigs, palms turn alike within 0.04 degrees; those of different takes differ by 8 or more. (A
# root mean square of 1 over the nine numbers of a rotation is 3 degrees.)
ALIKE: Mapping[str, tuple[float, float]] = {"hips_position": (1.0, 5.0), "hips_palm": (1.0, 15.0)}
LONGEST_OFFSET_S = 1.0
SMALLEST_OVERLAP = 0.7

Rows = Mapping[str, Array]  # feature -> (frames, n) in cm or degrees


def same_motion(
    library: MotionLibrary, arms: Mapping[Side, ArmMotion], content_hash: str | None
) -> list[int]:
    """Clips with the same content, or with the same motion as a body's ``arms`` at `ARM_FPS`.

    Taking fingers from them would be copying the answer, which is what nobody wants to measure.
    """
    ours = {side: _rows(arm) for side, arm in arms.items()}
    return [
        i
        for i, clip in enumerate(library.clips)
        if (content_hash is not None and clip.content_hash == content_hash)
        or _same([(ours[s], hand.arm) for s, hand in clip.hands.items() if s in ours])
    ]


def _rows(arm: ArmMotion) -> Rows:
    return {name: FEATURES[name](arm) for name in ALIKE}


def _same(pairs: list[tuple[Rows, ArmMotion]]) -> bool:
    """Whether all pairs are alike in one of the features."""
    lengths = [sorted((len(ours["hips_palm"]), len(arm.wrist))) for ours, arm in pairs]
    if not pairs or any(short < SMALLEST_OVERLAP * long for short, long in lengths):
        return False
    both = [(ours, _rows(arm)) for ours, arm in pairs]
    return any(_alike([(a[name], b[name]) for a, b in both], *ALIKE[name]) for name in ALIKE)


def _alike(pairs: list[tuple[Array, Array]], tolerance: float, least: float) -> bool:
    """Whether all pairs of rows (frames, n) are alike at one offset, and some of them moves."""
    if max(np.ptp(a, axis=0).max() for a, _ in pairs) < least:
        return False
    most = int(LONGEST_OFFSET_S * ARM_FPS)

    def apart(offset: int) -> float:
        distances = []
        for a, b in pairs:
            count = min(len(a) - max(-offset, 0), len(b) - max(offset, 0))
            if count < SMALLEST_OVERLAP * min(len(a), len(b)):
                return np.inf
            first, second = a[max(-offset, 0) :][:count], b[max(offset, 0) :][:count]
            distances.append(float(np.sqrt(np.mean((first - second) ** 2))))
        return max(distances)

    return any(apart(offset) < tolerance for offset in range(-most, most + 1))
