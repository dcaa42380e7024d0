"""The thumb's axes: how far it is pronated at the bind pose of a rig.

A thumb may be modelled flat, its nail up beside those of the fingers, or pronated as anatomy has
it, by about 80 degrees (Cooney et al. 1981, "The kinesiology of the thumb trapeziometacarpal
joint"). The hinges of MCP and IP are then as far apart, and geometry, the places of joints, does
not tell. It is asked of several witnesses, and always for a rig as a whole: one take moves its
thumb too oddly to tell.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from usdhand.anatomy.hand import FINGERS, HandMap, Side
from usdhand.anatomy.local_motion import LocalMotion
from usdhand.anatomy.palm import Palm, bent_frame, digit_bones, digit_chain, swung_frame
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit

# Direction of a relaxed thumb's metacarpal: along the hand, to the radial side, toward the palm.
NEUTRAL_THUMB = (0.70, 0.60, 0.40)
# Pronation of that relaxed thumb, from which the CMC is measured.
NEUTRAL_PRONATION_DEG = -75.0
# Pronation of rigs, seen from a thumb that is flat.
FLAT_DEG, PRONATED_DEG = 0.0, -80.0

# Twist that the CMC is given at a bind pose that is a gesture, where nothing better is known.
GESTURE_TWIST_DEG = 5.0

# What a rig's own axes tell: an axis across the thumb, turned the way that thumbs are pronated.
# One within a few degrees of flat says nothing: that is how programs orient joints by themselves.
SQUARE_DEG = 18.0
PRONATED_AXES = (-125.0, -45.0)
FLAT_AXES, FLAT_AXES_APART = (-40.0, -8.0), 8.0
FINGER_AXES_APART = 25.0
# What motion tells: all of it about one axis at MCP and IP alike, so that it was made with hinges.
HINGE_SHARE, HINGE_LEAST_DEG, HINGES_APART = 0.97, 0.5, 12.0
# Or most of the IP's rotation in all clips of a rig.
IP_SHARE, IP_LEAST_DEG = 0.8, 5.0
FLAT_MOTION, PRONATED_MOTION = (-35.0, 45.0), (-125.0, -45.0)
# Digits that are straighter than this at the bind pose are of a zero pose, not of a modelled hand.
STRAIGHT_DEG = 3.0


@dataclass(frozen=True)
class Pronation:
    """How far a rig's thumb is turned about its bone at the bind pose, and how that is known.

    Attributes
    ----------
    degrees : 0 for a flat thumb, -80 for one whose pad faces the fingers
    witness : what decided, in words
    """

    degrees: float
    witness: str


def neutral_thumb(palm: Palm) -> Array:
    """Frame (3, 3) of a relaxed thumb's metacarpal that is flat."""
    along, radial, palmar = NEUTRAL_THUMB
    return palm.frame(along * palm.forward + radial * palm.radial + palmar * palm.normal)


def rolled(frame: Array, degrees: float, side: Side) -> Array:
    """A frame (3, 3) turned about its bone, the mirrored way on the left hand."""
    turn = rot.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.radians(_sign(side) * degrees))
    return np.asarray(frame @ rot.to_matrix(turn))


def thumb_pronation(
    skeleton: Skeleton,
    hands: Iterable[HandMap],
    clips: Sequence[Clip] = (),
    named: float | None = None,
    is_gesture: bool = False,
) -> Pronation:
    """Decide how far the thumbs of a rig are pronated.

    The rig's own axes decide, if the axis that bends its fingers lies across its thumbs as one
    that was put there; then motion that was made with hinges, the convention of the joint names,
    and most of the motion of the IP in all clips. Else it is pronated as most rigs are, or flat
    where all digits are straight, as in the zero poses of motion capture.

    Parameters
    ----------
    clips : all there are of this skeleton
    named : pronation that the convention of the joint names has; None if that is not known
    is_gesture : whether hands are bound in a gesture, of which only its own axes and hinges tell
    """
    thumbs = [t for hand in hands if (t := _Thumb.of(skeleton, hand)) is not None]
    by_axes = _by_own_axes(thumbs)
    moves = [_Moves.of(thumb, clips) for thumb in thumbs]
    if by_axes is not None:
        return _said(by_axes, "the rig's own axes", named)
    if (by_hinges := _by_hinges(moves)) is not None:
        return _said(by_hinges, "motion about one hinge", named)
    if is_gesture:
        guess = NEUTRAL_PRONATION_DEG + GESTURE_TWIST_DEG
        return Pronation(guess, "a guess, since the bind pose is a gesture")
    if named is not None:
        return Pronation(float(named), "the convention of the joint names")
    if (by_motion := _by_ip_motion(moves)) is not None:
        return Pronation(by_motion, "motion of the IP")
    if thumbs and all(_is_straight(skeleton, t.hand) for t in thumbs):
        return Pronation(FLAT_DEG, "a bind pose with all digits straight")
    return Pronation(PRONATED_DEG, "what most rigs have; nothing else tells it")


def _said(degrees: float, witness: str, named: float | None) -> Pronation:
    other = named is not None and named != degrees
    return Pronation(
        degrees, f"{witness}; rigs with such names have {named:g}" if other else witness
    )


@dataclass(frozen=True, eq=False)
class _Thumb:
    """A thumb's frames (3, 3) at the bind pose if it were flat, by joint, world space."""

    skeleton: Skeleton
    hand: HandMap
    frames: Mapping[str, Array]

    @classmethod
    def of(cls, skeleton: Skeleton, hand: HandMap) -> _Thumb | None:
        chain = digit_chain(hand, "Thumb")
        if not chain:
            return None
        above = neutral_thumb(Palm.of(skeleton, hand))
        frames: dict[str, Array] = {}
        for name, bone in zip(chain, digit_bones(skeleton, hand, "Thumb"), strict=True):
            above = bent_frame(above, bone) if frames else swung_frame(above, bone)
            frames[name] = above
        return cls(skeleton, hand, frames)

    def own_axes(self) -> Array | None:
        """(joints, 2) where the axis that bends the fingers lies in each of the thumb's frames.

        Angle about the bone, seen from flexion, -135 to 45, and from square to the bone; degrees.
        None if fingers bend about no axis of their own.
        """
        turns, palm = self.skeleton.bind_rotations, Palm.of(self.skeleton, self.hand)
        axes = []
        for digit in FINGERS:
            chain = digit_chain(self.hand, digit)
            bones = digit_bones(self.skeleton, self.hand, digit)
            above = palm.frame(bones[0]) if bones else np.eye(3)
            for name, bone in zip(chain, bones, strict=True):
                above = bent_frame(above, bone)
                axes.append(turns[self.hand.joints[name]].T @ above[:, 1])
        local = np.array(axes)
        if not np.isfinite(local).all():
            return None
        axis = np.linalg.eigh(local.T @ local)[1][:, -1]
        if np.abs(local @ axis).min() < np.cos(np.radians(FINGER_AXES_APART)):
            return None
        rows = []
        for name, frame in self.frames.items():
            x, y, z = frame.T @ turns[self.hand.joints[name]] @ axis
            angle = _sign(self.hand.side) * np.degrees(np.arctan2(-x, y))
            rows.append((_half_turn(angle), np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))))
        return np.array(rows)


@dataclass(frozen=True)
class _Moves:
    """How a thumb's joints move: (3, 3) mean squares of their rotations, square degrees.

    In their flat frames, those of the left hand mirrored; by joint, 0 where it does not move.
    """

    squares: Mapping[str, Array]

    @classmethod
    def of(cls, thumb: _Thumb, clips: Sequence[Clip]) -> _Moves:
        squares = {}
        bind, sign = thumb.skeleton.bind_rotations, _sign(thumb.hand.side)
        for above, name in pairwise(thumb.frames):
            joint, reference = (thumb.hand.joints[n] for n in (name, above))
            turns = [_numbers(LocalMotion(clip).turn(joint, reference).T) for clip in clips]
            total, count = np.zeros((3, 3)), sum(map(len, turns))
            to_frame = (bind[joint].T @ thumb.frames[name]) * [sign, 1.0, sign]
            for q in filter(len, turns):
                away = rot.multiply(rot.conjugate(rot.mean(q)), q)
                vectors = np.degrees(rot.to_rotation_vector(away)) @ to_frame
                total += vectors.T @ vectors
            squares[name] = total / max(count, 1)
        return cls(squares)


def _by_own_axes(thumbs: Sequence[_Thumb]) -> float | None:
    found = [thumb.own_axes() for thumb in thumbs]
    if not found or any(rows is None for rows in found):
        return None
    rows = np.concatenate([rows for rows in found if rows is not None])
    if np.abs(rows[:, 1]).max() > SQUARE_DEG:
        return None
    angles = rows[:, 0]
    if _within(angles, PRONATED_AXES):
        return PRONATED_DEG
    if _within(angles, FLAT_AXES) and np.ptp(angles) < FLAT_AXES_APART:
        return FLAT_DEG
    return None


def _by_hinges(moves: Sequence[_Moves]) -> float | None:
    axes, joints = [], set()
    for name, square in ((n, s) for own in moves for n, s in own.squares.items()):
        if np.sqrt(np.trace(square)) > HINGE_LEAST_DEG:
            share, axis = _principal(square)
            if share < HINGE_SHARE:
                return None
            axes.append(axis)
            joints.add(name)
    if len(joints) < 2:
        return None
    mean = unit(np.sum(axes, axis=0))
    if np.min(np.array(axes) @ mean) < np.cos(np.radians(HINGES_APART)):
        return None
    return _nearest(mean)


def _by_ip_motion(moves: Sequence[_Moves]) -> float | None:
    squares = [own.squares["ThumbIP"] for own in moves if "ThumbIP" in own.squares]
    square = np.sum(squares, axis=0) if squares else np.zeros((3, 3))
    if not np.trace(square) > IP_LEAST_DEG**2:
        return None
    share, axis = _principal(square)
    return _nearest(axis) if share > IP_SHARE else None


def _principal(square: Array) -> tuple[float, Array]:
    """Share of the motion that is about one axis, and this axis (3,), its flexion positive."""
    values, vectors = np.linalg.eigh(square)
    axis = vectors[:, -1]
    x, y = axis[:2]
    # Of both directions the one between flat and pronated: -135 to 45 degrees.
    return float(values[-1] / values.sum()), axis * np.sign(x + y or 1.0)


def _nearest(axis: Array) -> float | None:
    angle = np.array([_half_turn(float(np.degrees(np.arctan2(-axis[0], axis[1]))))])
    if abs(axis[2]) > np.sin(np.radians(45.0)):
        return None
    if _within(angle, FLAT_MOTION):
        return FLAT_DEG
    return PRONATED_DEG if _within(angle, PRONATED_MOTION) else None


def _is_straight(skeleton: Skeleton, hand: HandMap) -> bool:
    """Whether each digit is a straight line at the bind pose."""
    for digit in hand.digits:
        bones = [unit(bone) for bone in digit_bones(skeleton, hand, digit)]
        if any(a @ b < np.cos(np.radians(STRAIGHT_DEG)) for a, b in pairwise(bones)):
            return False
    return True


def _numbers(rows: Array) -> Array:
    """Rows (n, 4) without those that are no numbers, which writing refuses later."""
    return rows[np.isfinite(rows).all(axis=1)]


def _sign(side: Side) -> float:
    return -1.0 if side == "left" else 1.0


def _half_turn(degrees: float) -> float:
    """The angle of an axis without direction, -135 to 45."""
    return float((degrees + 135.0) % 180.0 - 135.0)


def _within(angles: Array, limits: tuple[float, float]) -> bool:
    return bool((angles >= limits[0]).all() and (angles <= limits[1]).all())
