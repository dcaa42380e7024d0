"""Where the fingertips are: from the wrist, in the axes of the palm."""

from __future__ import annotations

import numpy as np

from usdhand.anatomy.frames import HandFrames
from usdhand.anatomy.hand import HandMap
from usdhand.anatomy.local_motion import LocalMotion
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array


def fingertips(
    clip: Clip, hand: HandMap, frames: HandFrames, motion: LocalMotion | None = None
) -> Array:
    """(frames, digits, 3) positions of the tips from the wrist in the axes of the palm, cm.

    Parameters
    ----------
    motion : the clip with other local transforms

    Every tip is carried from its own joint up to the wrist, so only the joints between are
    computed; where a digit does not hang off the wrist, up to the joint above both and down again.
    """
    motion = motion or LocalMotion(clip)
    result = np.empty((3, len(frames.digits), len(clip)))
    for i, digit in enumerate(frames.digits):
        tip = np.broadcast_to(frames.tips[i][:, None], (3, len(clip)))
        result[:, i] = motion.change_axes(tip, frames.last_joint(digit), hand.wrist)
    for j in (hand.wrist, *clip.skeleton.ancestors(hand.wrist)):
        if j in motion.scaled:  # the size of the hand in the world
            result *= clip.scales[:, j].mean(axis=1)
    to_palm = rot.to_matrix(rot.conjugate(frames.palm))
    return np.asarray(np.einsum("ij,jdt->tdi", to_palm, result))
