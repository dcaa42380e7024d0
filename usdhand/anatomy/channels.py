"""Rotations to channel angles and back: the 45 and 25 channels of a hand.

Every joint's rotation is taken apart about its anatomical axes: flexion, abduction and rotation
about the bone, in this intrinsic order, which keeps the middle angle small. The thumb's CMC, which
turns far about its own bone, is taken apart into swing (a rotation vector) and twist instead, so
that no pose of a thumb comes near a gimbal lock. Angles of the left hand are mirrored: the same
gesture has the same angles on both hands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.frames import HandFrames, hand_frames
from usdhand.anatomy.hand import SIDE_PREFIX, SIDES, CharacterMap, HandMap, Side
from usdhand.errors import UsageError
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

# Order of the three angles of a joint in arrays, and the letter each has in a channel's name.
ABDUCTION, FLEXION, TWIST = range(3)
FINGER_AXES = ("x", "y", "z")
THUMB_AXES = ("x", "z", "y")

# Beyond this abduction the other two angles are nearly one and the same; follow them in time.
NEAR_LOCK_DEG = 75.0


@dataclass(frozen=True, eq=False)
class Channels:
    """Named curves: ``values`` (frames, channels) in degrees."""

    names: tuple[str, ...]
    values: Array

    def __len__(self) -> int:
        return len(self.names)

    def select(self, names: Sequence[str]) -> Channels:
        """Return only the channels named, in that order."""
        index = {name: i for i, name in enumerate(self.names)}
        missing = [name for name in names if name not in index]
        if missing:
            raise UsageError(f"There is no channel '{missing[0]}' on this hand.")
        return Channels(tuple(names), self.values[:, [index[name] for name in names]])


def all_channels(side: Side, joints: Sequence[str]) -> tuple[str, ...]:
    """Three channels of every joint in x, y, z order: 45 for a whole hand."""
    return tuple(SIDE_PREFIX[side] + joint + letter for joint in joints for letter in "xyz")


def model_channels(side: Side, joints: Sequence[str]) -> tuple[str, ...]:
    """Channels of the papers' model: 25 for a whole hand (Joerg & O'Sullivan 2009, section 3)."""
    keep = []
    for name in all_channels(side, joints):
        joint, letter = name[2:-1], name[-1]
        three = joint == "ThumbCMC" or (joint.endswith("MCP") and not joint.startswith("Thumb"))
        if three or letter == ("z" if joint.startswith("Thumb") else "y"):
            keep.append(name)
    return tuple(keep)


def is_flexion(channel: str) -> bool:
    """Whether a channel is the flexion of its joint."""
    return channel[-1] == ("z" if channel[2:].startswith("Thumb") else "y")


def encode(clip: Clip, frames: HandFrames) -> Channels:
    """All channel angles of one hand.

    Returns
    -------
    Channels
        (frames, 3 n) degrees, continuous in time, n the number of joints the rig has.
    """
    angles = _relative_to_frames(clip, frames)
    return _as_channels(frames, _angles(angles, frames))


def decode(channels: Channels, clip: Clip, frames: HandFrames) -> Clip:
    """Put channel angles on a clip's hand; all other joints keep their rotations.

    Parameters
    ----------
    channels : all channels of `frames` (see `all_channels`), as many frames as the clip has

    Raises
    ------
    UsageError
        if channels are missing or the number of frames differs.
    """
    if len(channels.values) != len(clip):
        raise UsageError(
            f"Channels of {len(channels.values)} frames do not fit a clip of {len(clip)}."
        )
    wanted = all_channels(frames.side, frames.names)
    angles = _from_channels(frames, channels.select(wanted).values)
    measured = _rotations(angles, frames)
    relative = rot.multiply(
        rot.multiply(frames.reference_frames, measured), rot.conjugate(frames.joint_frames)
    )
    rotations = clip.rotations.copy()
    foreign = _foreign(clip, frames)
    for i, j in enumerate(frames.joints):
        rotations[:, j] = (
            rot.multiply(foreign[i], relative[:, i]) if i in foreign else relative[:, i]
        )
    rotations[:, frames.joints] = rot.make_continuous(rotations[:, frames.joints])
    return clip.with_rotations(rotations)


@dataclass(frozen=True, eq=False)
class Hands:
    """A clip's hands with their frames: what every method starts from."""

    character: CharacterMap
    frames: Mapping[Side, HandFrames]

    @classmethod
    def of(cls, clip: Clip, character: CharacterMap, sides: Sequence[Side] = SIDES) -> Hands:
        """Build the frames of the hands that are there."""
        found = {
            side: hand_frames(clip.skeleton, character.hands[side], clip)
            for side in sides
            if side in character.hands
        }
        return cls(character, found)

    @property
    def all_names(self) -> tuple[str, ...]:
        """Names of all channels: 90 for two whole hands."""
        return tuple(n for f in self.frames.values() for n in all_channels(f.side, f.names))

    @property
    def model_names(self) -> tuple[str, ...]:
        """Names of the modelled channels: 50 for two whole hands."""
        return tuple(n for f in self.frames.values() for n in model_channels(f.side, f.names))

    def encode(self, clip: Clip) -> Channels:
        """All channels of all hands."""
        parts = [encode(clip, f) for f in self.frames.values()]
        return Channels(
            tuple(n for p in parts for n in p.names), np.concatenate([p.values for p in parts], 1)
        )

    def decode(self, channels: Channels, clip: Clip) -> Clip:
        """Put channels of all hands on a clip."""
        for frames in self.frames.values():
            clip = decode(channels, clip, frames)
        return clip

    def fingertips(self, clip: Clip) -> Array:
        """(frames, hands * digits, 3) fingertip positions, see `fingertips`."""
        return np.concatenate(
            [fingertips(clip, self.character.hands[s], f) for s, f in self.frames.items()], axis=1
        )


def fingertips(clip: Clip, hand: HandMap, frames: HandFrames) -> Array:
    """(frames, digits, 3) tip positions from the wrist in the axes of the palm, cm."""
    last = [frames.last_joint(digit) for digit in frames.digits]
    joints = [hand.wrist, *last]
    pose = forward_kinematics(clip, joints, base=clip.skeleton.common_ancestor(joints))
    wrist_q, wrist_p = pose.rotations[:, :1], pose.positions[:, :1]
    world = pose.positions[:, 1:] + rot.rotate(pose.rotations[:, 1:], frames.tips[None])
    palm = rot.multiply(wrist_q, frames.palm)
    return rot.rotate(rot.conjugate(palm), world - wrist_p)


def _relative_to_frames(clip: Clip, frames: HandFrames) -> Array:
    """(frames, n, 4) rotations from the reference frame to the bone's frame."""
    local = clip.rotations[:, frames.joints].copy()
    for i, q in _foreign(clip, frames).items():
        local[:, i] = rot.multiply(rot.conjugate(q), local[:, i])
    return rot.multiply(
        rot.multiply(rot.conjugate(frames.reference_frames), local), frames.joint_frames
    )


def _foreign(clip: Clip, frames: HandFrames) -> dict[int, Array]:
    """Rotation from parent to reference joint, (frames, 4), of digits not below the wrist."""
    parents = clip.skeleton.parents[frames.joints]
    found = {}
    for i in np.flatnonzero(parents != frames.references):
        pair = [int(parents[i]), int(frames.references[i])]
        base = clip.skeleton.common_ancestor(pair)
        parent, reference = np.moveaxis(forward_kinematics(clip, pair, base).rotations, 1, 0)
        found[int(i)] = rot.multiply(rot.conjugate(parent), reference)
    return found


def _mirror(frames: HandFrames) -> Array:
    return np.array([-1.0, 1.0, -1.0]) if frames.side == "left" else np.ones(3)


def _angles(q: Array, frames: HandFrames) -> Array:
    """(frames, n, 3) degrees of rotations (frames, n, 4), continuous in time."""
    result = np.empty((*q.shape[:-1], 3))
    for i, name in enumerate(frames.names):
        take_apart = _swing_twist_angles if name == "ThumbCMC" else _euler_angles
        result[:, i] = take_apart(q[:, i])
    return result * _mirror(frames)


def _rotations(angles: Array, frames: HandFrames) -> Array:
    """(frames, n, 4) rotations of angles (frames, n, 3) in degrees."""
    radians = np.radians(angles * _mirror(frames))
    result = np.empty((*angles.shape[:-1], 4))
    for i, name in enumerate(frames.names):
        put_together = _from_swing_twist if name == "ThumbCMC" else _from_euler
        result[:, i] = put_together(radians[:, i])
    return result


def _euler_angles(q: Array) -> Array:
    m = rot.to_matrix(q)
    abduction = np.arctan2(-m[:, 1, 2], np.hypot(m[:, 1, 0], m[:, 1, 1]))
    flexion = np.arctan2(m[:, 0, 2], m[:, 2, 2])
    twist = np.arctan2(m[:, 1, 0], m[:, 1, 1])
    angles = np.degrees(np.stack([abduction, flexion, twist], axis=-1))
    if np.abs(angles[:, ABDUCTION]).max() > NEAR_LOCK_DEG:
        angles = _followed(angles, m)
    return _unwrapped(angles)


def _followed(angles: Array, m: Array) -> Array:
    """Choose, frame by frame, the one of both equivalent triples that is nearer to the last."""
    result = angles.copy()
    for t in range(1, len(angles)):
        last = result[t - 1]
        other = angles[t] * [-1.0, 1.0, 1.0] + 180.0
        if np.hypot(m[t, 1, 0], m[t, 1, 1]) < 1e-6:  # locked: only flexion -+ twist is known
            sign = np.sign(angles[t, ABDUCTION])
            total = np.degrees(np.arctan2(sign * m[t, 0, 1], m[t, 0, 0]))
            angles[t] = [angles[t, ABDUCTION], last[TWIST] * sign + total, last[TWIST]]
            result[t] = angles[t]
            continue
        near = [c + 360.0 * np.round((last - c) / 360.0) for c in (angles[t], other)]
        result[t] = min(near, key=lambda c: float(np.abs(c - last).sum()))
    return result


def _swing_twist_angles(q: Array) -> Array:
    length = np.hypot(q[:, 2], q[:, 3])
    known = length > 1e-9
    safe = np.where(known, length, 1.0)
    zero = np.zeros_like(length)
    twist = np.stack(
        [zero, zero, np.where(known, q[:, 2] / safe, 0), np.where(known, q[:, 3] / safe, 1)], -1
    )
    swing = rot.multiply(q, rot.conjugate(twist))
    vector = np.degrees(rot.to_rotation_vector(swing))
    angle = np.degrees(2.0 * np.arctan2(twist[:, 2], twist[:, 3]))
    return _unwrapped(np.stack([vector[:, 0], vector[:, 1], angle], axis=-1))


def _from_euler(radians: Array) -> Array:
    axes = np.eye(3)
    turns = [rot.from_axis_angle(axes[a], radians[:, a]) for a in (FLEXION, ABDUCTION, TWIST)]
    return rot.multiply(rot.multiply(turns[0], turns[1]), turns[2])


def _from_swing_twist(radians: Array) -> Array:
    swing = np.hypot(radians[:, ABDUCTION], radians[:, FLEXION])
    axis = np.stack([radians[:, ABDUCTION], radians[:, FLEXION], np.zeros_like(swing)], axis=-1)
    axis /= np.maximum(swing, 1e-12)[:, None]
    return rot.multiply(
        rot.from_axis_angle(axis, swing), rot.from_axis_angle(np.eye(3)[TWIST], radians[:, TWIST])
    )


def _unwrapped(degrees: Array) -> Array:
    """No jump by a turn, and the mean within half a turn of zero."""
    continuous = np.unwrap(degrees, period=360.0, axis=0)
    return np.asarray(continuous - 360.0 * np.round(continuous.mean(axis=0) / 360.0))


def _letter_order(joint: str) -> list[int]:
    """Axes of a joint in the order x, y, z of their letters."""
    letters = THUMB_AXES if joint.startswith("Thumb") else FINGER_AXES
    return [letters.index(letter) for letter in "xyz"]


def _as_channels(frames: HandFrames, angles: Array) -> Channels:
    columns = [angles[:, i, _letter_order(name)] for i, name in enumerate(frames.names)]
    return Channels(all_channels(frames.side, frames.names), np.concatenate(columns, axis=1))


def _from_channels(frames: HandFrames, values: Array) -> Array:
    angles = np.empty((len(values), len(frames.names), 3))
    for i, name in enumerate(frames.names):
        angles[:, i, _letter_order(name)] = values[:, 3 * i : 3 * i + 3]
    return angles
