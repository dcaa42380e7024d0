"""Joint limits of a human hand, widened by what was captured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.anatomy.channels import all_channels, is_flexion
from usdhand.fill.library import MotionLibrary, Part
from usdhand.motion.rotations import Array

# Flexion limits in degrees by joint (Palastanga et al., Anatomy and Human Movement): a little more
# than people can, since rigs and gloves are not exact. Other angles are limited by the library.
FLEXION_LIMITS = {"MCP": (-30.0, 100.0), "PIP": (-10.0, 120.0), "DIP": (-15.0, 90.0)}


def channel_limits(
    library: MotionLibrary, part: Part, joints: Sequence[tuple[str, ...]]
) -> tuple[Array, Array]:
    """Smallest and largest angle (channels,) of each channel, degrees.

    What some clip of the library does is possible; flexion may go to its anatomical limit too.
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
        limits = FLEXION_LIMITS.get(name[-4:-1])
        if limits and is_flexion(name) and not name[2:].startswith("Thumb"):
            low[i], high[i] = min(low[i], limits[0]), max(high[i], limits[1])
    return low, high
