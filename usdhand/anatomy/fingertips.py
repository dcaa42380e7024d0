"""Where the fingertips are: from the wrist, in the axes of the palm."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from usdhand.anatomy.angles import inverse, turned
from usdhand.anatomy.frames import HandFrames
from usdhand.anatomy.hand import HandMap
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.rotations import Array


def fingertips(
    clip: Clip,
    hand: HandMap,
    frames: HandFrames,
    rotations: Mapping[int, Array] | None = None,
) -> Array:
    """(frames, digits, 3) positions of the tips from the wrist in the axes of the palm, cm.

    Parameters
    ----------
    rotations : local rotations (4, frames) of skeleton joints to use in place of the clip's

    Every tip is carried from its own joint up to the wrist, so only the joints between are
    computed; where a digit does not hang off the wrist, up to the joint above both and down again.
    """
    skeleton = clip.skeleton
    scaled = scaled_joints(clip)
    own = rotations or {}

    def rotation(joint: int) -> Array:
        return own[joint] if joint in own else np.ascontiguousarray(clip.rotations[:, joint].T)

    def scale(joint: int) -> Array | float:
        return clip.scales[:, joint].T if joint in scaled else 1.0

    result = np.empty((3, len(frames.digits), len(clip)))
    for i, digit in enumerate(frames.digits):
        last = frames.last_joint(digit)
        base = skeleton.common_ancestor([last, hand.wrist])
        point = np.broadcast_to(frames.tips[i][:, None], (3, len(clip)))
        for j in _up_to(skeleton, last, base):
            point = clip.translations[:, j].T + turned(rotation(j), scale(j) * point)
        for j in reversed(_up_to(skeleton, hand.wrist, base)):
            point = turned(inverse(rotation(j)), point - clip.translations[:, j].T) / scale(j)
        result[:, i] = point
    for j in (hand.wrist, *skeleton.ancestors(hand.wrist)):
        if j in scaled:  # the size of the hand in the world
            result *= clip.scales[:, j].mean(axis=1)
    to_palm = rot.to_matrix(rot.conjugate(frames.palm))
    return np.asarray(np.einsum("ij,jdt->tdi", to_palm, result))


def _up_to(skeleton: Skeleton, joint: int, base: int | None) -> list[int]:
    """A joint and those above it, without ``base`` and what is above that."""
    line = [joint, *skeleton.ancestors(joint)]
    return line if base is None else line[: line.index(base)]
