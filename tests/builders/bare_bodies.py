"""Bodies without fingers, fingers put on them, and how their palms lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from builders.clips import joints_of
from builders.moving_hands import at_bind
from builders.rigs import Joint, build
from pxr import Usd, UsdSkel, Vt

import usdhand
from usdhand.anatomy import Hands, Side
from usdhand.anatomy.hand import digit_joints
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


BODY_ROLES = ("hips", "chest", "neck", "head", "clavicle", "shoulder", "elbow", "wrist")


def named_body(names: Mapping[Joint, str], frames: int = 60, digits: Sequence[str] = ()) -> Clip:
    """A body whose arms move and which has no fingers, with the joint names of some rig.

    ``digits`` are fingers that it has all the same.
    """
    roles = {*BODY_ROLES, *(d + joint for d in digits for joint in digit_joints(d))}
    rig, index = build({joint: name for joint, name in names.items() if joint[1] in roles})
    order = list(rig.order)
    place = {old: new for new, old in enumerate(order)}
    clip = at_bind(
        Skeleton(
            tuple(rig.joints[j] for j in order),
            np.array([place.get(int(rig.parents[j]), -1) for j in order]),
            rig.bind[order],
            rig.rest[order],
        ),
        frames,
    )
    rotations = clip.rotations.copy()
    swing = 0.6 * np.sin(np.arange(frames) / 10.0)
    for (side, role), joint in index.items():
        if role in ("shoulder", "elbow"):
            angle = swing if side == "left" else -swing
            turn = rot.from_axis_angle(np.tile([0.0, 0.6, 0.8], (frames, 1)), angle)
            at = place[joint]
            rotations[:, at] = rot.multiply(rotations[:, at], turn)
    return replace(clip, rotations=rotations)


def with_raw_names(path: Path, joints: tuple[str, ...]) -> None:
    """Give the joints of a file names that USD does not take as prims, as some exporters do."""
    stage = Usd.Stage.Open(str(path))
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Skeleton) or prim.IsA(UsdSkel.Animation):
            prim.GetAttribute("joints").Set(Vt.TokenArray(list(joints)))
            for attribute in [
                a.GetName() for a in prim.GetAttributes() if "usdhand" in a.GetName()
            ]:
                prim.RemoveProperty(attribute)
    stage.GetRootLayer().Save()
