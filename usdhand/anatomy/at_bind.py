"""Frames in which a hand is in its bind pose, as many clips start and end: no motion of a hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.frames import HandFrames
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.transforms import decompose_trs

# Fingers all of whose joints are turned by less from the bind pose are in it.
AT_BIND_DEG = 3.0


def at_bind(clip: Clip, frames: HandFrames) -> NDArray[np.bool_]:
    """(frames,) whether all fingers but the thumb are in the bind pose; False if there are none."""
    pairs = zip(frames.names, frames.joints, strict=True)
    joints = [int(joint) for name, joint in pairs if not name.startswith("Thumb")]
    if not joints:
        return np.zeros(len(clip), dtype=bool)
    bind = decompose_trs(clip.skeleton.bind_locals[joints])[1]
    away = rot.to_rotation_vector(rot.multiply(rot.conjugate(bind), clip.rotations[:, joints]))
    return np.asarray(np.linalg.norm(away, axis=-1).max(axis=1) < np.radians(AT_BIND_DEG))


def moved_frames(clip: Clip, frames: HandFrames) -> tuple[int, int] | None:
    """First and last frame of a hand that is not in its bind pose; None if it always is."""
    moved = np.flatnonzero(~at_bind(clip, frames))
    return (int(moved[0]), int(moved[-1])) if len(moved) else None
