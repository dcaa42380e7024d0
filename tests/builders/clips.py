"""Clips cut out of other clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from usdhand.motion import Clip, Skeleton


def frames_of(clip: Clip, frames: slice | np.ndarray) -> Clip:
    """Some frames of a clip, in the order given; its origin stays as it is."""
    return replace(
        clip,
        rotations=clip.rotations[frames],
        translations=clip.translations[frames],
        scales=clip.scales[frames],
    )


def joints_of(clip: Clip, joints: Sequence[int] | slice, skeleton: Skeleton) -> Clip:
    """The motion of some joints of a clip, as that of another skeleton."""
    return replace(
        clip,
        skeleton=skeleton,
        rotations=clip.rotations[:, joints],
        translations=clip.translations[:, joints],
        scales=clip.scales[:, joints],
    )
