"""Two rigs that agree on nothing but anatomy: names, axes, units, bind pose, extra joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .body import (
    ADA,
    BEN,
    DIGITS,
    FINGERS,
    MIRROR,
    PARENT,
    SIDES,
    Array,
    Body,
    Pose,
    axis_angle,
    make_body,
    mirrored,
    unit,
)
from .hand import bend_bones, shape

Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Rig:
    """A skeleton that can play canonical poses.

    Attributes
    ----------
    name
        Name of the character and of its prim.
    body
        Its anatomy.
    joints
        Rig name of each anatomical joint it has, parents first.
    axes
        Joint axes in the zero pose, canonical world, by anatomical name.
    bind
        The pose its skin is bound in; one frame.
    stage
        Rotation from canonical axes to those of its stage.
    scale
        Stage units in a centimetre.
    start
        First time code of its clips.
    root
        Name of a joint at the origin above the hips, if any.
    """

    name: str
    body: Body
    joints: Mapping[str, str]
    axes: Mapping[str, Array]
    bind: Pose
    stage: Array
    scale: float
    start: int
    root: str = ""

    @property
    def up_axis(self) -> str:
        """Up axis of its stage."""
        return "Y" if np.allclose(self.stage, np.eye(3)) else "Z"

    def above(self, joint: str) -> str | None:
        """The next anatomical joint up that this rig has."""
        parent = PARENT[joint]
        while parent is not None and parent not in self.joints:
            parent = PARENT[parent]
        return parent

    def paths(self) -> dict[str, str]:
        """USD joint paths by anatomical name; the root joint under the name `root`."""
        out = {"root": self.root} if self.root else {}
        for joint, name in self.joints.items():
            parent = self.above(joint)
            prefix = out[parent] + "/" if parent else (self.root + "/" if self.root else "")
            out[joint] = prefix + name
        return out

    def world(self, pose: Pose) -> tuple[dict[str, Array], dict[str, Array]]:
        """Rotations and positions of the joints on the rig's stage, over time."""
        turn = {j: self.stage @ pose.turn[j] @ self.axes[j] for j in self.joints}
        points = pose.positions(self.body)
        at = {j: self.scale * points[j] @ self.stage.T for j in self.joints}
        if self.root:
            turn = {"root": np.broadcast_to(np.eye(3), turn["hips"].shape)} | turn
            at = {"root": np.zeros_like(at["hips"])} | at
        return turn, at

    def local(self, pose: Pose) -> tuple[dict[str, Array], dict[str, Array]]:
        """Rotations and translations of the joints under their parents, over time."""
        turn, at = self.world(pose)
        turns, shifts = {}, {}
        for joint in turn:
            parent = None
            if joint != "root":
                parent = self.above(joint) or ("root" if self.root else None)
            if parent is None:
                turns[joint], shifts[joint] = turn[joint], at[joint]
                continue
            back = np.swapaxes(turn[parent], -1, -2)
            turns[joint] = back @ turn[joint]
            shifts[joint] = (back @ (at[joint] - at[parent])[..., None])[..., 0]
        return turns, shifts


def _bones(body: Body) -> dict[str, tuple[Array, Array]]:
    """Direction along each bone and one across it (dorsal, forward), center and left."""
    up, front = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    chain = ["hips", "spine1", "spine2", "spine3", "neck", "head"]
    out = {"head": (up, front)}
    for joint, after in pairwise(chain):
        out[joint] = (unit(body.zero[after] - body.zero[joint]), front)
    zero = {j[2:]: p for j, p in body.zero.items() if j[0] == "L"}
    for joint, after, across in [
        ("clavicle", "arm", up), ("arm", "forearm", up), ("forearm", "hand", up),
        ("hand", "middle1", up), ("thigh", "shin", front), ("shin", "foot", front),
        ("foot", "toe", up),
    ]:  # fmt: skip
        out[f"L_{joint}"] = (unit(zero[after] - zero[joint]), across)
    out["L_toe"] = (front, up)
    for digit in DIGITS:
        for number in range(5):
            bone = body.directions[digit]
            if number == 0 and digit != "thumb":
                bone = unit(zero[f"{digit}1"] - zero[f"{digit}0"])
            out[f"L_{digit}{number}"] = (bone, -body.bend[digit])
    return out


def _axes(body: Body, along: str, flip: Array) -> dict[str, Array]:
    """Joint axes: the bone along x or y, its back along the next axis; mirrored on the right."""
    out = {}
    for joint, (bone, across) in _bones(body).items():
        second = unit(across - (across @ bone) * bone)
        third = np.cross(bone, second)
        columns = (bone, second, third) if along == "x" else (third, bone, second)
        out[joint] = np.stack(columns, axis=-1)
        if joint[0] == "L":
            out["R" + joint[1:]] = MIRROR @ out[joint] @ flip
    return out


def zero_pose(body: Body) -> Pose:
    """The zero pose, one frame."""
    turn = {joint: np.eye(3)[None] for joint in PARENT}
    return Pose(turn, body.zero["hips"][None])


def _a_pose(body: Body) -> Pose:
    """Arms 45 degrees down, elbows and fingers slightly bent."""
    turn = dict(zero_pose(body).turn)
    z = np.array([0.0, 0.0, 1.0])
    fingers = shape((12, 10, 10, 10, 14), (12, 14, 16, 18), (16, 19, 22, 24), (-1, 0, -1, -3))
    left = {
        "clavicle": axis_angle(z, -3.0),
        "arm": axis_angle(z, -45.0) @ axis_angle(np.array([0.0, 1.0, 0.0]), -5.0),
    }
    left["forearm"] = left["arm"] @ axis_angle(np.array([0.0, 1.0, 0.0]), -10.0)
    left["hand"] = left["forearm"] @ axis_angle(z, 4.0)
    left |= bend_bones(body, left["hand"], fingers[None])
    for joint, value in left.items():
        value = value.reshape(1, 3, 3)
        turn[f"L_{joint}"], turn[f"R_{joint}"] = value, mirrored(value)
    return Pose(turn, body.zero["hips"][None])


def ada() -> Rig:
    """HumanIK names, Y up, centimetres, T-pose, x along the bones, no metacarpals."""
    body = make_body(ADA)
    names = {"hips": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2",
             "neck": "Neck", "head": "Head"}  # fmt: skip
    word = {"clavicle": "Shoulder", "arm": "Arm", "forearm": "ForeArm", "hand": "Hand",
            "thigh": "UpLeg", "shin": "Leg", "foot": "Foot", "toe": "ToeBase"}  # fmt: skip
    for s, side in zip(SIDES, ("Left", "Right"), strict=True):
        for joint in ("clavicle", "arm", "forearm", "hand"):
            names[f"{s}_{joint}"] = side + word[joint]
        for digit in DIGITS:
            for number in range(1, 5):
                names[f"{s}_{digit}{number}"] = f"{side}Hand{digit.title()}{number}"
    for s, side in zip(SIDES, ("Left", "Right"), strict=True):
        for joint in ("thigh", "shin", "foot", "toe"):
            names[f"{s}_{joint}"] = side + word[joint]
    # All axes negated: equal rotations on both sides are then mirror images.
    axes = _axes(body, "x", -np.eye(3))
    axes["hips"] = np.eye(3)
    return Rig("Ada", body, names, axes, zero_pose(body), np.eye(3), 1.0, 1)


def ben() -> Rig:
    """Unreal-like names, Z up, metres, A-pose, y along the bones, metacarpals, no tips."""
    body = make_body(BEN)
    names = {"hips": "pelvis", "spine1": "spine_01", "spine2": "spine_02", "spine3": "spine_03",
             "neck": "neck_01", "head": "head"}  # fmt: skip
    word = {"clavicle": "clavicle", "arm": "upperarm", "forearm": "lowerarm", "hand": "hand",
            "thigh": "thigh", "shin": "calf", "foot": "foot", "toe": "ball"}  # fmt: skip
    for s in SIDES:
        for joint in ("clavicle", "arm", "forearm", "hand"):
            names[f"{s}_{joint}"] = f"{word[joint]}_{s.lower()}"
        for finger in FINGERS:
            names[f"{s}_{finger}0"] = f"{finger}_metacarpal_{s.lower()}"
            for number in range(1, 4):
                names[f"{s}_{finger}{number}"] = f"{finger}_0{number}_{s.lower()}"
        for number in range(1, 4):
            names[f"{s}_thumb{number}"] = f"thumb_0{number}_{s.lower()}"
    for s in SIDES:
        for joint in ("thigh", "shin", "foot", "toe"):
            names[f"{s}_{joint}"] = f"{word[joint]}_{s.lower()}"
    axes = _axes(body, "y", np.diag([-1.0, 1.0, 1.0]))
    return Rig("Ben", body, names, axes, _a_pose(body), Z_UP, 0.01, 0, "root")


def only_hands(rig: Rig, sides: str = "LR") -> Rig:
    """The forearms and hands of a rig, each forearm a root of its own.

    Parameters
    ----------
    rig
        The whole.
    sides
        `L`, `R` or both.
    """
    keep = tuple(f"{s}_{part}" for s in sides for part in ("forearm", "hand", *DIGITS))
    joints = {j: name for j, name in rig.joints.items() if j.startswith(keep)}
    return replace(rig, name=rig.name + ("Hands" if len(sides) == 2 else "Hand"), joints=joints)
