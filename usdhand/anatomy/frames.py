"""Anatomical frames: axes on every bone of a hand that do not depend on how the rig was built.

Built from the geometry of the bind pose alone (methods: Wu et al. 2005, ISB recommendation on joint
coordinate systems, part II, adapted to what rigs have). A frame's columns are abduction axis,
flexion axis and long axis of the bone, so that a positive flexion brings the fingertip toward the
palm on both hands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.hand import DIGITS, FINGERS, HAND_JOINTS, HandMap, Side, digit_joints
from usdhand.anatomy.links import HandLinks, Link, hand_links
from usdhand.anatomy.local_motion import LocalMotion
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit

# A thumb bone closer to the palm's normal than this has no flexion axis from geometry.
UNDECIDED_SINE = 0.35
# Joints that turn less than this tell nothing about their axis.
LEAST_MOTION_DEG = 1.0
# Direction of a relaxed thumb's metacarpal: along the hand, to the radial side, toward the palm.
NEUTRAL_THUMB = (0.70, 0.60, 0.40)
# A tip joint counts if its bone is this long relative to the bone before it.
TIP_LENGTH_RANGE = (0.15, 2.5)
# Length of the last bone to the fingertip relative to the bone before it, where no tip joint says.
LAST_BONE_RATIO = 0.85


@displayed(
    lambda frames: {
        "side": frames.side,
        "joints": len(frames.names),
        "notes": frames.notes,
    }
)
@dataclass(frozen=True, eq=False)
class HandFrames:
    """Anatomical frames of one hand, as quaternions in the joints' own axes.

    Attributes
    ----------
    names : hand joints in anatomical order, those that the rig has
    joints : (n,) their indices in the skeleton
    references : (n,) the joint that each rotation is measured from: the parent, or where the rig
        has something else there, the joint before it in its digit, its metacarpal or the wrist
    reference_frames : (n, 4) the frame of zero rotation, in the reference joint's axes
    joint_frames : (n, 4) the bone's frame, in its own axes
    palm : (4,) frame of the palm, in the wrist joint's axes
    tips : (digits, 3) position of each digit's tip in the axes of its last joint, cm
    links : what moves with the channels, and what must be moved along
    notes : what geometry could not decide, in words
    """

    side: Side
    names: tuple[str, ...]
    joints: NDArray[np.intp]
    references: NDArray[np.intp]
    reference_frames: Array
    joint_frames: Array
    palm: Array
    tips: Array
    links: HandLinks
    notes: tuple[str, ...] = ()

    @property
    def digits(self) -> tuple[str, ...]:
        """Digits that have joints, thumb first."""
        return tuple(d for d in DIGITS if any(n.startswith(d) for n in self.names))

    def last_joint(self, digit: str) -> int:
        """Index in the skeleton of the outermost joint of a digit."""
        return int(
            [j for n, j in zip(self.names, self.joints, strict=True) if n.startswith(digit)][-1]
        )


def hand_frames(skeleton: Skeleton, hand: HandMap, *clips: Clip) -> HandFrames:
    """Build the anatomical frames of a hand at the bind pose.

    Parameters
    ----------
    clips : motion of this skeleton; decides a thumb's flexion axis where geometry cannot, that
        is for a bone that stands on the palm

    Raises
    ------
    HandNotFoundError
        if joints that should be apart lie on one spot, so that there are no directions, or the
        joints of a flat rig hang off each other in another order than that of a hand.
    """
    palm = _Palm.of(skeleton, hand)
    names = tuple(n for n in HAND_JOINTS if n in hand.joints)
    notes: list[str] = []
    reference_frames, joint_frames, tips = [], [], []
    links = hand_links(skeleton, hand)
    reference_of = dict(links.joints)
    for digit in DIGITS:
        chain = [digit + j for j in digit_joints(digit) if digit + j in hand.joints]
        if not chain:
            continue
        points, tip = _digit_points(skeleton, hand, digit, chain)
        if digit == "Thumb":
            above = palm.neutral_thumb()
        else:
            above = palm.frame(_direction(skeleton, hand.wrist, points[0] - palm.wrist))
        for name, start, end in zip(chain, points[:-1], points[1:], strict=True):
            j = hand.joints[name]
            bone = _direction(skeleton, j, end - start)
            first, reference = name == chain[0], reference_of[j]
            if digit == "Thumb" and not first and palm.is_normal(bone):
                above, note = _frame_from_motion(skeleton, (j, reference), bone, above, clips)
                notes.append(f"{hand.side} {name}: {note}")
            own = (
                _swung_frame(above, bone)
                if digit == "Thumb" and first
                else _bent_frame(above, bone)
            )
            reference_frames.append(skeleton.bind_rotations[reference].T @ above)
            joint_frames.append(skeleton.bind_rotations[j].T @ own)
            above = own
        last = hand.joints[chain[-1]]
        tips.append(skeleton.bind_rotations[last].T @ (tip - skeleton.bind_positions[last]))
    return HandFrames(
        hand.side,
        names,
        np.array([hand.joints[n] for n in names], dtype=np.intp),
        np.array([reference_of[hand.joints[n]] for n in names], dtype=np.intp),
        rot.from_matrix(np.array(reference_frames)),
        rot.from_matrix(np.array(joint_frames)),
        rot.from_matrix(skeleton.bind_rotations[hand.wrist].T @ palm.frame(palm.forward)),
        np.array(tips),
        links,
        tuple(notes),
    )


@dataclass(frozen=True, eq=False)
class _Palm:
    """Directions of the palm at the bind pose, world space."""

    wrist: Array
    forward: Array  # from the wrist to the knuckles
    radial: Array  # from the little finger to the index, across `forward`
    normal: Array  # out of the palm

    @classmethod
    def of(cls, skeleton: Skeleton, hand: HandMap) -> _Palm:
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
        return _frame(bone, np.cross(unit(bone), self.normal))

    def is_normal(self, bone: Array) -> bool:
        """Whether a bone stands on the palm, so that it has no flexion axis from geometry."""
        return bool(np.linalg.norm(np.cross(unit(bone), self.normal)) < UNDECIDED_SINE)

    def neutral_thumb(self) -> Array:
        """Frame (3, 3) of a relaxed thumb's metacarpal, from which the CMC is measured."""
        along, radial, palmar = NEUTRAL_THUMB
        return self.frame(along * self.forward + radial * self.radial + palmar * self.normal)


def _frame(bone: Array, flexion_axis: Array) -> Array:
    z = unit(bone)
    y = unit(flexion_axis - z * (flexion_axis @ z))
    return np.stack([np.cross(y, z), y, z], axis=1)


def _bent_frame(above: Array, bone: Array) -> Array:
    """Frame (3, 3) of a bone that is bent from the one before it, without twist.

    Flexion and abduction alone lead from ``above`` to the bone, so that how far the digits were
    bent at the bind pose does not matter, be it a fist.
    """
    x, y, z = above.T @ unit(bone)
    flexion, abduction = np.arctan2(x, z), np.arcsin(np.clip(-y, -1.0, 1.0))
    turn = rot.multiply(_rotation_about(1, flexion), _rotation_about(0, abduction))
    return np.asarray(above @ rot.to_matrix(turn))


def _swung_frame(above: Array, bone: Array) -> Array:
    """Frame (3, 3) of a bone that the shortest rotation brings there from ``above``."""
    return np.asarray(rot.to_matrix(rot.between_vectors(above[:, 2], unit(bone))) @ above)


def _rotation_about(axis: int, radians: float) -> Array:
    return rot.from_axis_angle(np.eye(3)[axis], radians)


def _frame_from_motion(
    skeleton: Skeleton, link: Link, bone: Array, above: Array, clips: Sequence[Clip]
) -> tuple[Array, str]:
    """Frame of the bone before a joint, turned to the principal axis of the joint's motion.

    Only where there is no other way: frames from motion differ from clip to clip and from rig to
    rig, which is worse than an axis that is somewhat off.
    """
    unknown = "geometry does not give its flexion axis, which is taken from"
    kept = above, f"{unknown} the bone before it"
    rotations = [LocalMotion(c).turn(*link).T for c in clips]
    if sum(map(len, rotations)) < 2:
        return kept
    together = np.concatenate(rotations)
    away = rot.multiply(together, rot.conjugate(rot.mean(together)))
    turns = rot.to_rotation_vector(away) @ skeleton.bind_rotations[link[1]].T
    z = unit(bone)
    turns = turns - np.outer(turns @ z, z)
    axis = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    if np.degrees(np.abs(turns @ axis).max()) < LEAST_MOTION_DEG:
        return kept
    axis = axis * np.sign(axis @ _bent_frame(above, bone)[:, 1] or 1.0)
    return _frame(above[:, 2], axis), f"{unknown} its motion"


def _digit_points(
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


def _direction(skeleton: Skeleton, joint: int, bone: Array) -> Array:
    if np.linalg.norm(bone) < 1e-6:
        raise HandNotFoundError(
            f"Joint '{skeleton.joints[joint]}' and the next one of its digit are at the same "
            "point at the bind pose, so its bone has no direction. The bind transforms are "
            "probably missing."
        )
    return bone
