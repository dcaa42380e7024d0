"""Anatomical frames: axes on every bone of a hand that do not depend on how the rig was built.

Built from the geometry of the bind pose alone (methods: Wu et al. 2005, ISB recommendation on joint
coordinate systems, part II, adapted to what rigs have). A frame's columns are abduction axis,
flexion axis and long axis of the bone, so that a positive flexion brings the fingertip toward the
palm on both hands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.hand import DIGITS, FINGERS, HAND_JOINTS, HandMap, Side, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

# A thumb bone closer to the palm's normal than this has no flexion axis from geometry.
UNDECIDED_SINE = 0.35
# Direction of a relaxed thumb's metacarpal: along the hand, to the radial side, toward the palm.
NEUTRAL_THUMB = (0.70, 0.60, 0.40)
# A tip joint counts if its bone is this long relative to the bone before it.
TIP_LENGTH_RANGE = (0.15, 2.5)
# Length of the last bone to the fingertip relative to the bone before it, where no tip joint says.
LAST_BONE_RATIO = 0.85


@dataclass(frozen=True, eq=False)
class HandFrames:
    """Anatomical frames of one hand, as quaternions in the joints' own axes.

    Attributes
    ----------
    names : hand joints in anatomical order, those that the rig has
    joints : (n,) their indices in the skeleton
    references : (n,) the joint that each rotation is measured from: the parent, or the wrist for
        a digit that does not hang off it
    reference_frames : (n, 4) the frame of zero rotation, in the reference joint's axes
    joint_frames : (n, 4) the bone's frame, in its own axes
    palm : (4,) frame of the palm, in the wrist joint's axes
    tips : (digits, 3) position of each digit's tip in the axes of its last joint, cm
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


def hand_frames(skeleton: Skeleton, hand: HandMap, clip: Clip | None = None) -> HandFrames:
    """Build the anatomical frames of a hand at the bind pose.

    Parameters
    ----------
    clip : motion of this skeleton; decides a thumb's flexion axis where geometry cannot

    Raises
    ------
    HandNotFoundError
        if joints that should be apart lie on one spot, so that there are no directions.
    """
    palm = _Palm.of(skeleton, hand)
    names = tuple(n for n in HAND_JOINTS if n in hand.joints)
    notes: list[str] = []
    reference_frames, joint_frames, references, tips = [], [], [], []
    for digit in DIGITS:
        chain = [digit + j for j in digit_joints(digit) if digit + j in hand.joints]
        if not chain:
            continue
        points, tip = _digit_points(skeleton, hand, digit, chain)
        above = palm.neutral_thumb() if digit == "Thumb" else palm.frame(points[0] - palm.wrist)
        for name, start, end in zip(chain, points[:-1], points[1:], strict=True):
            j = hand.joints[name]
            bone = _direction(skeleton, j, end - start)
            own = palm.frame(bone, None if digit == "Thumb" else above)
            if digit == "Thumb" and palm.is_normal(bone):
                own, note = _frame_from_motion(skeleton, j, bone, above, clip)
                notes.append(f"{hand.side} {name}: {note}")
            first = name == chain[0]
            parent = int(skeleton.parents[j])
            reference = hand.wrist if first and not _below(skeleton, j, hand.wrist) else parent
            reference_frames.append(skeleton.bind_rotations[reference].T @ above)
            joint_frames.append(skeleton.bind_rotations[j].T @ own)
            references.append(reference)
            above = own
        last = hand.joints[chain[-1]]
        tips.append(skeleton.bind_rotations[last].T @ (tip - skeleton.bind_positions[last]))
    return HandFrames(
        hand.side,
        names,
        np.array([hand.joints[n] for n in names], dtype=np.intp),
        np.array(references, dtype=np.intp),
        rot.from_matrix(np.array(reference_frames)),
        rot.from_matrix(np.array(joint_frames)),
        rot.from_matrix(skeleton.bind_rotations[hand.wrist].T @ palm.frame(palm.forward)),
        np.array(tips),
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
        if np.linalg.norm(normal) < 1e-6 * max(np.linalg.norm(forward), 1e-6):
            raise HandNotFoundError(
                f"The wrist and the knuckles of the {hand.side} hand lie on one line at the bind "
                "pose, so the palm has no direction. The bind transforms are probably missing."
            )
        forward, normal = _unit(forward), _unit(normal)
        radial = np.cross(forward, normal) * (-1.0 if hand.side == "left" else 1.0)
        return cls(wrist, forward, _unit(radial), normal)

    def frame(self, bone: Array, above: Array | None = None) -> Array:
        """Frame (3, 3) of a bone: flexion across the bone in the palm's plane.

        A bone that stands on the palm takes the flexion axis of the bone before it.
        """
        axis = np.cross(_unit(bone), self.normal)
        if above is not None and np.linalg.norm(axis) < UNDECIDED_SINE:
            axis = above[:, 1]
        return _frame(bone, axis)

    def is_normal(self, bone: Array) -> bool:
        """Whether a bone stands on the palm, so that it has no flexion axis from geometry."""
        return bool(np.linalg.norm(np.cross(_unit(bone), self.normal)) < UNDECIDED_SINE)

    def neutral_thumb(self) -> Array:
        """Frame (3, 3) of a relaxed thumb's metacarpal, from which the CMC is measured."""
        along, radial, palmar = NEUTRAL_THUMB
        return self.frame(along * self.forward + radial * self.radial + palmar * self.normal)


def _frame(bone: Array, flexion_axis: Array) -> Array:
    z = _unit(bone)
    y = _unit(flexion_axis - z * (flexion_axis @ z))
    return np.stack([np.cross(y, z), y, z], axis=1)


def _frame_from_motion(
    skeleton: Skeleton, joint: int, bone: Array, above: Array, clip: Clip | None
) -> tuple[Array, str]:
    """Frame whose flexion axis is the principal axis of the joint's motion across the bone."""
    z = _unit(bone)
    fallback = _frame(bone, above[:, 1] if abs(above[:, 1] @ z) < 0.9 else above[:, 0])
    if clip is None or len(clip) < 2:
        return fallback, "geometry does not tell its flexion axis; taken from the bone before it"
    rotations = clip.rotations[:, joint]
    away = rot.multiply(rotations, rot.conjugate(rot.mean(rotations)))
    parent = int(skeleton.parents[joint])
    to_world = skeleton.bind_rotations[parent] if parent >= 0 else np.eye(3)
    turns = rot.to_rotation_vector(away) @ to_world.T
    turns = turns - np.outer(turns @ z, z)
    axis = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    if np.degrees(np.abs(turns @ axis).max()) < 1.0:
        return fallback, "geometry does not tell its flexion axis; taken from the bone before it"
    axis = axis * np.sign(axis @ fallback[:, 1] or 1.0)
    return _frame(bone, axis), "geometry does not tell its flexion axis; taken from its motion"


def _digit_points(
    skeleton: Skeleton, hand: HandMap, digit: str, chain: list[str]
) -> tuple[list[Array], Array]:
    """Bind positions of a digit's joints and of its tip, which is estimated where it is missing."""
    points = [skeleton.bind_positions[hand.joints[name]] for name in chain]
    before = points[-1] - (points[-2] if len(points) > 1 else skeleton.bind_positions[hand.wrist])
    tip = points[-1] + LAST_BONE_RATIO * before
    if digit in hand.tips:
        authored = skeleton.bind_positions[hand.tips[digit]]
        ratio = np.linalg.norm(authored - points[-1]) / max(np.linalg.norm(before), 1e-9)
        if TIP_LENGTH_RANGE[0] < ratio < TIP_LENGTH_RANGE[1]:
            tip = authored
    return [*points, tip], tip


def _direction(skeleton: Skeleton, joint: int, bone: Array) -> Array:
    if np.linalg.norm(bone) < 1e-6:
        raise HandNotFoundError(
            f"Joint '{skeleton.joints[joint]}' and the next one of its digit lie on one spot at "
            "the bind pose, so its bone has no direction. The bind transforms are probably missing."
        )
    return bone


def _below(skeleton: Skeleton, joint: int, ancestor: int) -> bool:
    return ancestor in skeleton.ancestors(joint)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
