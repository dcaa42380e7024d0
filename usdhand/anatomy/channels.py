"""Rotations to channel angles and back: the 45 and 25 channels of a hand.

Every joint's rotation is taken apart about its anatomical axes: flexion, abduction and rotation
about the bone, in this intrinsic order, which keeps the middle angle small. The thumb's CMC, which
turns far about its own bone, is taken apart into swing (a rotation vector) and twist instead, so
that no pose of a thumb comes near a gimbal lock. Angles of the left hand are mirrored: the same
gesture has the same angles on both hands.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdhand.anatomy.angles import (
    euler_angles,
    from_euler,
    from_swing_twist,
    product,
    same_signs,
    swing_twist_angles,
)
from usdhand.anatomy.fingertips import fingertips
from usdhand.anatomy.frames import HandFrames, hand_frames
from usdhand.anatomy.hand import SIDE_PREFIX, SIDES, CharacterMap, Side
from usdhand.anatomy.local_motion import LocalMotion
from usdhand.anatomy.neutral import Neutral, neutral_bind
from usdhand.anatomy.thumb import Pronation, thumb_pronation
from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import same_bind
from usdhand.problems import Problem, counted

# The letters that abduction, flexion and twist have in a channel's name.
FINGER_AXES = ("x", "y", "z")
THUMB_AXES = ("x", "z", "y")
# Fingers none of whose channels changes by more are still; gloves and solvers leave some noise.
STILL_FINGERS_DEG = 2.0


@displayed(
    lambda channels: {
        "channels": len(channels),
        "frames": len(channels.values),
    }
)
@dataclass(frozen=True, eq=False)
class Channels:
    """Named curves: ``values`` (frames, channels) in degrees, every curve one run of memory."""

    names: tuple[str, ...]
    values: Array

    def __len__(self) -> int:
        return len(self.names)

    def select(self, names: Sequence[str]) -> Channels:
        """Return only the channels named, in that order."""
        if tuple(names) == self.names:
            return self
        index = {name: i for i, name in enumerate(self.names)}
        missing = [name for name in names if name not in index]
        if missing:
            raise UsageError(f"There is no channel '{missing[0]}' on this hand.")
        return Channels(tuple(names), self.values.T[[index[name] for name in names]].T)

    def replaced(self, others: Channels) -> Channels:
        """Return these channels with the curves of ``others``, which must be among them."""
        index = {name: i for i, name in enumerate(self.names)}
        rows = self.values.T.copy()
        rows[[index[name] for name in others.names]] = others.values.T
        return Channels(self.names, rows.T)


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


def fingers_move(curves: Array) -> bool:
    """Whether finger channels (frames, channels) in degrees have motion of their own."""
    return bool(np.ptp(curves, axis=0).max(initial=0.0) > STILL_FINGERS_DEG)


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
    rows = np.empty((3 * len(frames.names), len(clip)))
    to_frames = _frame_matrices(frames)
    for i, (name, turn) in enumerate(zip(frames.names, joint_rotations(clip, frames), strict=True)):
        take_apart = swing_twist_angles if _is_ball(name) else euler_angles
        angles = take_apart(to_frames[i] @ turn)
        rows[3 * i : 3 * i + 3] = (angles * _mirror(frames))[_letters(name)]
    return Channels(all_channels(frames.side, frames.names), rows.T)


def joint_rotations(clip: Clip, frames: HandFrames) -> list[Array]:
    """Rotation (4, frames) of every joint of a hand from the joint that it is measured from."""
    motion = LocalMotion(clip)
    pairs = zip(frames.joints, frames.references, strict=True)
    return [motion.turn(int(joint), int(reference)) for joint, reference in pairs]


def local_motion(channels: Channels, clip: Clip, frames: HandFrames) -> LocalMotion:
    """The clip with the local transforms that all channels of a hand give to its joints.

    The clip gives the motion of what lies between a digit and the wrist where it does not hang
    off it.
    """
    rows = channels.select(all_channels(frames.side, frames.names)).values.T
    to_frames = _frame_matrices(frames)
    wanted = {}
    for i, (name, joint) in enumerate(zip(frames.names, frames.joints, strict=True)):
        angles = np.empty((3, rows.shape[1]))
        angles[_letters(name)] = rows[3 * i : 3 * i + 3]
        put_together = from_swing_twist if _is_ball(name) else from_euler
        wanted[int(joint)] = to_frames[i].T @ put_together(angles * _mirror(frames))
    return _posed(clip, clip, frames, wanted)


def carry_followers(before: Clip, after: Clip, frames: HandFrames) -> Clip:
    """``after``, whose wrist moves differently, with what does not hang off it carried along.

    Only the joints of a flat hand follow (see `HandFrames.followers`).
    """
    return _with(after, [_posed(before, after, frames, {})]) if frames.links.followers else after


def _posed(
    before: Clip, after: Clip, frames: HandFrames, wanted: Mapping[int, Array]
) -> LocalMotion:
    """``after`` with the joints of a hand turned as wanted, else as they are in ``before``.

    From the wrist outwards, as followers move with joints that have moved already: turned from
    their reference, and as far from it as they were.
    """
    old, new = LocalMotion(before), LocalMotion(after)
    for joint, reference in frames.links.joints:
        parent = int(after.skeleton.parents[joint])
        turn = wanted[joint] if joint in wanted else old.turn(joint, reference)
        if parent != reference:
            turn = product(new.between(parent, reference), turn)
        if joint in frames.links.followers:
            offset = old.change_axes(old.translation(joint), parent, reference)
            new.translations[joint] = new.change_axes(offset, reference, parent)
        new.rotations[joint] = turn
    return new


def decode(channels: Channels, clip: Clip, frames: HandFrames) -> Clip:
    """Put channel angles on a clip's hand; all other joints keep their transforms.

    Followers (see `HandLinks`) get new translations as well.

    Parameters
    ----------
    channels : all channels of `frames` (see `all_channels`), as many frames as the clip has

    Raises
    ------
    UsageError
        if channels are missing or the number of frames differs.
    """
    return _decode(channels, clip, [frames])


def _decode(channels: Channels, clip: Clip, hands: Iterable[HandFrames]) -> Clip:
    if len(channels.values) != len(clip):
        raise UsageError(
            f"Channels of {counted(len(channels.values), 'frame')} do not match a clip of "
            f"{len(clip)}."
        )
    return _with(clip, [local_motion(channels, clip, frames) for frames in hands])


def _with(clip: Clip, motions: Sequence[LocalMotion]) -> Clip:
    """The clip with the local transforms that motions of it have in place of its own."""
    rotations, translations = clip.rotations.copy(), clip.translations
    if any(motion.translations for motion in motions):
        translations = translations.copy()
    for motion in motions:
        for joint, q in motion.rotations.items():
            rotations[:, joint] = same_signs(q).T
        for joint, t in motion.translations.items():
            translations[:, joint] = t.T
    return replace(clip, rotations=rotations, translations=translations)


@displayed(
    lambda hands: {
        "convention": hands.character.convention,
        **{side: f"{len(frames.names)} joints" for side, frames in hands.frames.items()},
        "channels": len(hands.all_names),
    }
)
@dataclass(frozen=True, eq=False)
class Hands:
    """A clip's hands with their frames: what every method starts from."""

    character: CharacterMap
    frames: Mapping[Side, HandFrames]

    @classmethod
    def of(
        cls,
        clip: Clip,
        character: CharacterMap,
        sides: Sequence[Side] = SIDES,
        others: Sequence[Clip] = (),
        neutral: Neutral | None = None,
    ) -> Hands:
        """Build the frames of the hands that are there.

        Parameters
        ----------
        others : more clips of the same joints, the clip itself among them or not: what the bind
            pose cannot decide is then the same for all of them that share it
        neutral : a pose to measure from in place of the bind pose

        Raises
        ------
        HandNotFoundError
            see `hand_frames`; or the neutral pose lacks a joint of a hand.
        """
        together = others if any(other is clip for other in others) else (clip, *others)
        own = [c for c in together if same_bind(c.skeleton, clip.skeleton)]
        strangers = [c.skeleton for c in together if not same_bind(c.skeleton, clip.skeleton)]
        binds, skeleton = {}, clip.skeleton
        for side, hand in character.hands.items():
            binds[side] = neutral_bind(skeleton, hand, own, strangers, neutral)
            skeleton = binds[side].skeleton
        hands, named = tuple(character.hands.values()), character.pronation
        pronation = {
            is_neutral: thumb_pronation(skeleton, hands, own, named, is_gesture=not is_neutral)
            for is_neutral in {bind.is_neutral for bind in binds.values()}
        }
        found = {}
        for side in (side for side in sides if side in character.hands):
            turned = pronation[binds[side].is_neutral]
            frames = hand_frames(skeleton, character.hands[side], *own, pronation=turned)
            if note := binds[side].note:
                frames = replace(frames, notes=(f"{side} hand: {note}", *frames.notes))
            found[side] = frames
        return cls(character, found)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was guessed about the hands and their frames, in words."""
        return (*self.character.notes, *(n for f in self.frames.values() for n in f.notes))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """What was guessed, as notes, and names that the bind pose contradicts, as warnings."""
        warned = set(self.character.contradictions)
        guesses = (note for note in self.notes if note not in warned)
        return (
            *self.character.problems,
            *(Problem("hands", guess, severity="note") for guess in guesses),
        )

    @property
    def pronation(self) -> Pronation | None:
        """Of the rig's thumbs; None where there are none."""
        return next((f.pronation for f in self.frames.values() if f.pronation), None)

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
            tuple(n for p in parts for n in p.names),
            np.concatenate([p.values.T for p in parts]).T,
        )

    def decode(self, channels: Channels, clip: Clip) -> Clip:
        """Put channels of all hands on a clip."""
        return _decode(channels, clip, self.frames.values())

    def fingertips(self, clip: Clip, channels: Channels | None = None) -> Array:
        """(frames, hands * digits, 3) positions of the tips from their wrist, in its palm, cm.

        With ``channels``, of the clip as these would move its hands.
        """
        return np.concatenate(
            [
                fingertips(
                    clip,
                    self.character.hands[side],
                    frames,
                    local_motion(channels, clip, frames) if channels else None,
                )
                for side, frames in self.frames.items()
            ],
            axis=1,
        )


def _frame_matrices(frames: HandFrames) -> Array:
    """(n, 4, 4) orthogonal matrices from local rotations to those between anatomical frames."""
    units = np.eye(4)[None]  # the products of the four unit quaternions are the columns
    before, after = rot.conjugate(frames.reference_frames)[:, None], frames.joint_frames[:, None]
    return np.swapaxes(rot.multiply(rot.multiply(before, units), after), 1, 2)


def _is_ball(joint: str) -> bool:
    return joint == "ThumbCMC"


def _mirror(frames: HandFrames) -> Array:
    """Signs (3, 1) of the angles, by which both hands have the same for the same gesture."""
    return np.array([[-1.0], [1.0], [-1.0]]) if frames.side == "left" else np.ones((3, 1))


def _letters(joint: str) -> list[int]:
    """Where a joint's angles named x, y and z stand among abduction, flexion and twist."""
    axes = THUMB_AXES if joint.startswith("Thumb") else FINGER_AXES
    return [axes.index(letter) for letter in "xyz"]
