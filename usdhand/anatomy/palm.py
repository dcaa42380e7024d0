"""Directions of a palm, and the frames of bones that follow from them.

A frame's columns are abduction axis, flexion axis and long axis of the bone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.hand import FINGERS, HandMap, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.motion import Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit

# A thumb bone closer to the palm's normal than this has no flexion axis from geometry.
UNDECIDED_SINE = 0.35
# A tip joint counts if its bone is this long relative to the bone before it.
TIP_LENGTH_RANGE = (0.15, 2.5)
# Length of the last bone to the fingertip relative to the bone before it, where no tip joint says.
LAST_BONE_RATIO = 0.85


@dataclass(frozen=True, eq=False)
class Palm:
    """Directions of the palm at the bind pose, world space."""

    wrist: Array
    forward: Array  # from the wrist to the knuckles
    radial: Array  # from the little finger to the index, across `forward`
    normal: Array  # out of the palm

    @classmethod
    def of(cls, skeleton: Skeleton, hand: HandMap) -> Palm:
        """Directions that the wrist and the knuckles give."""
        knuckles = {d: hand.joints[d + "MCP"] for d in FINGERS if d + "MCP" in hand.joints}
        position = skeleton.bind_positions
        if len(knuckles) < 2:
            raise HandNotFoundError(
                f"The {hand.side} hand has {len(knuckles)} knuckles; at least two fingers are "
                "needed to know which way the palm faces."
            )
        joints = list(knuckles.values())
        inner, outer = position[joints[0]], position[joints[-1]]
        middle = position[knuckles["Middle"]] if "Middle" in knuckles else (inner + outer) / 2
        wrist = position[hand.wrist]
        forward, across = middle - wrist, inner - outer
        normal = np.cross(forward, across) * (1.0 if hand.side == "left" else -1.0)
        if np.linalg.norm(normal) < max(1e-6 * float(np.linalg.norm(forward)), 1e-12):
            raise HandNotFoundError(
                f"The wrist and the knuckles of the {hand.side} hand lie on one line at the bind "
                "pose, so the palm has no direction. The bind transforms are probably missing."
            )
        forward, normal = unit(forward), unit(normal)
        radial = np.cross(forward, normal) * (-1.0 if hand.side == "left" else 1.0)
        return cls(wrist, forward, unit(radial), normal)

    def frame(self, bone: Array) -> Array:
        """Frame (3, 3) of a bone along the palm: flexion across it, in the palm's plane."""
        return frame_of(bone, np.cross(unit(bone), self.normal))

    def is_normal(self, bone: Array) -> bool:
        """Whether a bone stands on the palm, so that it has no flexion axis from geometry."""
        return bool(np.linalg.norm(np.cross(unit(bone), self.normal)) < UNDECIDED_SINE)


def frame_of(bone: Array, flexion_axis: Array) -> Array:
    """Frame (3, 3) of a bone, its flexion axis as near as can be to one that is given."""
    z = unit(bone)
    y = unit(flexion_axis - z * (flexion_axis @ z))
    return np.stack([np.cross(y, z), y, z], axis=1)


def bent_frame(above: Array, bone: Array) -> Array:
    """Frame (3, 3) of a bone that is bent from the one before it, without twist.

    Flexion and abduction alone lead from ``above`` to the bone, so that how far the digits were
    bent at the bind pose does not matter, be it a fist.
    """
    x, y, z = above.T @ unit(bone)
    flexion, abduction = np.arctan2(x, z), np.arcsin(np.clip(-y, -1.0, 1.0))
    turn = rot.multiply(_rotation_about(1, flexion), _rotation_about(0, abduction))
    return np.asarray(above @ rot.to_matrix(turn))


def swung_frame(above: Array, bone: Array) -> Array:
    """Frame (3, 3) of a bone that the shortest rotation brings there from ``above``."""
    return np.asarray(rot.to_matrix(rot.between_vectors(above[:, 2], unit(bone))) @ above)


def _rotation_about(axis: int, radians: float) -> Array:
    return rot.from_axis_angle(np.eye(3)[axis], radians)


def digit_points(
    skeleton: Skeleton, hand: HandMap, digit: str, chain: list[str]
) -> tuple[list[Array], Array]:
    """Bind positions of a digit's joints and of its tip, which is estimated where it is missing."""
    points = [skeleton.bind_positions[hand.joints[name]] for name in chain]
    before = points[-1] - (points[-2] if len(points) > 1 else skeleton.bind_positions[hand.wrist])
    tip = points[-1] + LAST_BONE_RATIO * before
    if digit in hand.tips:
        authored = skeleton.bind_positions[hand.tips[digit]]
        ratio = np.linalg.norm(authored - points[-1]) / np.linalg.norm(before)
        if TIP_LENGTH_RANGE[0] < ratio < TIP_LENGTH_RANGE[1]:
            tip = authored
    return [*points, tip], tip


def digit_chain(hand: HandMap, digit: str) -> list[str]:
    """Names of a digit's joints that the rig has, from the palm outwards."""
    return [digit + j for j in digit_joints(digit) if digit + j in hand.joints]


def digit_bones(skeleton: Skeleton, hand: HandMap, digit: str) -> list[Array]:
    """Bones (3,) of a digit at the bind pose, one a joint, the last one to its tip."""
    chain = digit_chain(hand, digit)
    if not chain:
        return []
    points, _ = digit_points(skeleton, hand, digit, chain)
    steps = zip(chain, points[:-1], points[1:], strict=True)
    return [bone_direction(skeleton, hand.joints[n], end - start) for n, start, end in steps]


def bone_direction(skeleton: Skeleton, joint: int, bone: Array) -> Array:
    """The bone (3,) of a joint, refused if it has no length."""
    if np.linalg.norm(bone) < 1e-6:
        raise HandNotFoundError(
            f"Joint '{skeleton.joints[joint]}' and the next one of its digit are at the same "
            "point at the bind pose, so its bone has no direction. The bind transforms are "
            "probably missing."
        )
    return bone
