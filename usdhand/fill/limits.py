"""Joint limits of a human hand, widened by what was captured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.anatomy.channels import all_channels, is_flexion
from usdhand.fill.library import MotionLibrary, Part
from usdhand.motion.rotations import Array

# Largest flexion in degrees by joint (Palastanga et al., Anatomy and Human Movement): a little more
# than people can, since rigs and gloves are not exact. Other angles, and how far a finger bends
# back, which few people do and every eye sees, are limited by the library.
LARGEST_FLEXION = {"MCP": 100.0, "PIP": 120.0, "DIP": 90.0}


def channel_limits(
    library: MotionLibrary, part: Part, joints: Sequence[tuple[str, ...]]
) -> tuple[Array, Array]:
    """Smallest and largest angle (channels,) of each channel, degrees.

    What some clip of the library does is possible; fingers may bend to their anatomical limit, too.
    """
    names = [n for side, own in zip(part, joints, strict=True) for n in all_channels(side, own)]
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    start = 0
    for side, wanted in zip(part, joints, strict=True):
        span = slice(start, start := start + 3 * len(wanted))
        for clip in library.clips:
            hand = clip.hands.get(side)
            if hand is not None and set(wanted) <= set(hand.joints):
                curves = hand.curves_of(wanted)
                low[span] = np.minimum(low[span], curves.min(axis=0))
                high[span] = np.maximum(high[span], curves.max(axis=0))
    for i, name in enumerate(names):
        most = LARGEST_FLEXION.get(name[-4:-1])
        if most and is_flexion(name) and not name[2:].startswith("Thumb"):
            high[i] = max(high[i], most)
    return low, high
