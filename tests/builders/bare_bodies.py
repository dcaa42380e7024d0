"""Bodies without fingers, fingers put on them, and how their palms lie."""

from __future__ import annotations

import numpy as np
from builders.clips import joints_of

import usdhand
from usdhand.anatomy import Hands, Side
from usdhand.motion import Clip, Skeleton, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.rigs.graft import Grafted, add_finger_joints


def below_wrists(clip: Clip) -> set[int]:
    wrists = {h.wrist for h in usdhand.find_hands(clip).character.hands.values()}
    return {j for j in range(len(clip.skeleton)) if wrists & set(clip.skeleton.ancestors(j))}


def without(clip: Clip, joints: set[int]) -> Clip:
    keep = [j for j in range(len(clip.skeleton)) if j not in joints]
    s = clip.skeleton
    names = tuple(s.joints[j] for j in keep)
    rig = Skeleton(names, parents_from_paths(names), s.bind[keep], s.rest[keep])
    return joints_of(clip, keep, rig)


def bare(clip: Clip) -> Clip:
    return without(clip, below_wrists(clip))


def grafted(body: Clip, donor: Clip) -> Grafted:
    return add_finger_joints(body, donor.skeleton, usdhand.find_hands(donor))


def palm(skeleton: Skeleton, hands: Hands, side: Side) -> np.ndarray:
    wrist = hands.character.hands[side].wrist
    return skeleton.bind_rotations[wrist] @ rot.to_matrix(hands.frames[side].palm)


def degrees_apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1))))
