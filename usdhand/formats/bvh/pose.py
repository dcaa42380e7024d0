"""The bind pose of a BVH file, which has none: its zero pose, or a frame where that is no body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.guess import FOOT, HEAD, bone_ways
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import compose_trs
from usdhand.problems import Problem

# A body stands if head and feet are at least so much of the length of the bones between them and
# the hips above and below these. Rest poses of real files have 0.85 and more, or about nothing.
STANDS = 0.5


def posed_skeleton(
    joints: tuple[str, ...], parents: NDArray[np.intp], rotations: Array, translations: Array
) -> Skeleton:
    """Skeleton whose bind and rest pose is this one.

    Parameters
    ----------
    parents : parents before their children
    rotations, translations : (joints, 4) and (joints, 3), joint-to-parent
    """
    rest = compose_trs(translations, rotations)
    skeleton = Skeleton(joints, parents, rest, rest)
    return replace(skeleton, bind=skeleton.accumulated(rest))


def choose_bind(zero: Clip, clip: Clip) -> tuple[Skeleton, tuple[Problem, ...]]:
    """Skeleton at the zero pose or, if a body does not stand in it, at the first frame it stands.

    Parameters
    ----------
    zero : one frame, all channels zero
    clip : the motion, of the same joints; may have no frames
    """
    kept = posed_skeleton(
        zero.skeleton.joints, zero.skeleton.parents, zero.rotations[0], zero.translations[0]
    )
    if standing(zero).all() or not len(clip):
        return kept, ()
    frames = np.flatnonzero(standing(clip))
    if not len(frames):
        message = (
            "no body can stand in the pose of all channels zero, nor in any frame: the zero pose "
            "is used as the bind pose anyway, and fingers may be misread"
        )
        return kept, (Problem("zero-pose", message),)
    first = int(frames[0])
    message = (
        f"in the pose of all channels zero no body can stand: frame {first + 1} is used as "
        "the bind pose"
    )
    skeleton = posed_skeleton(
        kept.joints, kept.parents, clip.rotations[first], clip.translations[first]
    )
    return skeleton, (Problem("zero-pose", message, severity="note"),)


def standing(clip: Clip) -> NDArray[np.bool_]:
    """(frames,) whether head and feet are above and below what joins them.

    By names; a skeleton without a head or feet by name is given the benefit of the doubt.
    """
    skeleton = clip.skeleton
    heads, feet = (
        [j for j, name in enumerate(skeleton.names) if pattern.search(name)]
        for pattern in (HEAD, FOOT)
    )
    hips = skeleton.common_ancestor([*heads, *feet]) if heads and feet else None
    if hips is None:
        return np.ones(len(clip), dtype=bool)
    ways = bone_ways(clip.translations[0], skeleton.parents)
    pose = forward_kinematics(clip, [hips, *heads, *feet])
    heights = pose.positions[:, :, 1] - pose.positions[:, :1, 1]
    up, down = np.split(heights[:, 1:], [len(heads)], axis=1)
    least = STANDS * (ways[[*heads, *feet]] - ways[hips])
    head_up = up.mean(axis=1) > least[: len(heads)].mean()
    feet_down = -down.mean(axis=1) > least[len(heads) :].mean()
    return np.asarray(head_up & feet_down)
