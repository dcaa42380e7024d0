"""A library of motions as values: clips with what search and assembly need of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.anatomy.at_bind import moved_frames
from usdhand.anatomy.channels import all_channels, fingers_move
from usdhand.display import displayed
from usdhand.errors import InputError
from usdhand.fill.arm import FARTHEST_WRIST_CM, ArmMotion, arm_motion
from usdhand.fill.segment import segments, wrist_speed
from usdhand.fill.settings import Segmentation
from usdhand.motion import Clip
from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.problems import Problem
from usdhand.rigs.graft import HandShape, hand_shapes
from usdhand.rigs.height import body_height

# Arms are searched at this rate; fingers keep that of their clip.
ARM_FPS = 30.0
# Angles are continuous in time, so that some go beyond a turn; no finger turns ten times.
LARGEST_ANGLE_DEG = 3600.0

# How far from 1 a length may be for a unit vector of single precision.
ROUNDED = 1e-6

# Parts of a body that are filled on their own, or both hands as one.
Part = tuple[Side, ...]


@displayed(
    lambda hand: {
        "joints": len(hand.joints),
        "frames": len(hand.fingers),
        "segments": len(hand.segments),
    }
)
@dataclass(frozen=True, eq=False)
class LibraryHand:
    """One hand of a library clip.

    Attributes
    ----------
    arm : the arm's motion at `ARM_FPS`
    joints : hand joints that the rig has
    fingers : (frames, 3 joints) all channels in degrees, at the clip's rate
    segments : first and last frame of each segment, at `ARM_FPS`
    used : first and last frame at `ARM_FPS` between the bind poses that a clip starts and ends
        with; None for all frames
    """

    arm: ArmMotion
    joints: tuple[str, ...]
    fingers: Array
    segments: tuple[tuple[int, int], ...]
    used: tuple[int, int] | None = None

    def curves_of(self, joints: Sequence[str]) -> Array:
        """(frames, 3 joints) channels of some of its joints."""
        if tuple(joints) == self.joints:
            return self.fingers
        columns = [3 * self.joints.index(joint) + axis for joint in joints for axis in range(3)]
        return self.fingers[:, columns]


@displayed(
    lambda clip: {
        "name": clip.name,
        "label": clip.label,
        "actor": clip.actor,
        "hands": tuple(clip.hands),
        "fps": clip.fps,
        "seconds": clip.duration,
    }
)
@dataclass(frozen=True, eq=False)
class LibraryClip:
    """A clip in a library.

    Attributes
    ----------
    name : unique in the library
    path : the clip's file, as it is in the library
    skel : path of its skeleton
    label, actor : "" if there is none
    height : cm, of the character
    fps : of the fingers
    duration : seconds
    content_hash : SHA-256 of the file
    shapes : hands of the character at its bind pose, those that do not move among them
    doubt : what is doubtful about its unit of length, "" if nothing
    """

    name: str
    path: str
    skel: str
    label: str
    actor: str
    height: float
    fps: float
    duration: float
    content_hash: str
    hands: Mapping[Side, LibraryHand]
    shapes: Mapping[Side, HandShape] = field(default_factory=dict)
    doubt: str = ""


@displayed(
    lambda library: {
        "clips": len(library.clips),
        "minutes": library.minutes,
        "segments": sum(len(hand.segments) for c in library.clips for hand in c.hands.values()),
        "left_out": len(library.left_out),
        "damaged": len(library.damaged),
    }
)
@dataclass(frozen=True, eq=False)
class MotionLibrary:
    """Clips in the order of their names, and how they were cut into segments.

    ``left_out`` could not be used when the library was built; ``damaged`` are prims that could not
    be read from it.
    """

    clips: tuple[LibraryClip, ...]
    segmentation: Segmentation = field(default_factory=Segmentation)
    left_out: tuple[Problem, ...] = ()
    damaged: tuple[Problem, ...] = ()

    @property
    def minutes(self) -> float:
        """Minutes of motion."""
        return sum(c.duration for c in self.clips) / 60.0


def damage(arm: Array, fingers: Array) -> str:
    """What no hand has in rows of arm motion and finger channels; "" if nothing."""
    for name, values, most in (
        ("arm", arm, FARTHEST_WRIST_CM),
        ("fingers", fingers, LARGEST_ANGLE_DEG),
    ):
        if not (worst := float(np.abs(values).max())) < most:
            return f"a value of the {name} is {worst:.3g}, which is not plausible"
    return ""


def library_hands(clip: Clip, hands: Hands, segmentation: Segmentation) -> dict[Side, LibraryHand]:
    """What a library keeps of a clip's hands: those whose fingers move away from the bind pose."""
    found: dict[Side, LibraryHand] = {}
    channels = hands.encode(clip)
    for side, frames in hands.frames.items():
        curves = channels.select(all_channels(side, frames.names)).values
        moved = moved_frames(clip, frames)
        if moved is None or not fingers_move(curves):
            continue
        arm = at_arm_rate(arm_motion(clip, hands, side), clip.fps)
        if reason := damage(pack_arm(arm), curves):
            raise InputError(f"{clip.origin.path or clip.name}: {side} hand: {reason}.")
        used = None if moved == (0, len(clip) - 1) else _at_arm_rate(moved, clip.fps, arm)
        hand = LibraryHand(arm, frames.names, curves, (), used)
        found[side] = replace(hand, segments=hand_segments([hand], segmentation))
    return found


def hand_segments(
    hands: Sequence[LibraryHand], segmentation: Segmentation
) -> tuple[tuple[int, int], ...]:
    """Segments of hands together: cut where the faster arm comes to rest, in frames of use."""
    speeds = [wrist_speed(h.arm.hips_position, ARM_FPS, segmentation.smoothing) for h in hands]
    speed = np.max(speeds, axis=0)
    ends = [hand.used or (0, len(speed) - 1) for hand in hands]
    start, end = max(first for first, _ in ends), min(last for _, last in ends)
    if end <= start:
        return ()
    cut = segments(speed[start : end + 1], ARM_FPS, segmentation)
    return tuple((first + start, last + start) for first, last in cut)


def _at_arm_rate(moved: tuple[int, int], fps: float, arm: ArmMotion) -> tuple[int, int]:
    first, last = (frame * ARM_FPS / fps for frame in moved)
    end = len(arm.hips_position) - 1
    return min(int(np.ceil(first)), end), min(int(last), end)


def _is_doubt(problem: Problem) -> bool:
    return problem.code == "guessed-units" and problem.severity == "warning"


def library_clip(
    clip: Clip,
    hands: Hands,
    segmentation: Segmentation,
    *,
    path: str,
    content_hash: str,
    label: str = "",
    actor: str = "",
) -> LibraryClip:
    """Make a library clip of a clip that was read."""
    return LibraryClip(
        clip.name,
        path,
        clip.origin.skeleton_path,
        label,
        actor,
        body_height(clip.skeleton, hands.character),
        clip.fps,
        clip.duration,
        content_hash,
        library_hands(clip, hands, segmentation),
        hand_shapes(clip.skeleton, hands),
        next((p.message for p in clip.problems if _is_doubt(p)), ""),
    )


def at_arm_rate(arm: ArmMotion, fps: float) -> ArmMotion:
    """Arm motion at `ARM_FPS`; frame i is at i / ARM_FPS seconds, the end is rounded down.

    Two frames at least, since nothing shorter can be a segment.
    """
    packed = pack_arm(arm)
    count = max(2, int(np.floor((len(packed) - 1) * ARM_FPS / fps + 1e-6)) + 1)
    frames = np.arange(count, dtype=np.float64) * (fps / ARM_FPS)
    return unpack_arm(interpolate(packed, frames))


_ARM_FIELDS: tuple[tuple[str, int], ...] = (
    ("hips_position", 3),
    ("chest_position", 3),
    ("shoulder_position", 3),
    ("elbow_position", 3),
    ("hips_shoulder", 3),
    ("hips_elbow", 3),
    ("hips_palm", 4),
    ("chest_palm", 4),
    ("upper_arm", 4),
    ("forearm", 4),
    ("wrist", 3),
)
ARM_WIDTH = sum(width for _, width in _ARM_FIELDS)


def pack_arm(arm: ArmMotion) -> Array:
    """(frames, ARM_WIDTH) of an arm's motion."""
    return np.concatenate([getattr(arm, name) for name, _ in _ARM_FIELDS], axis=1)


def unpack_arm(packed: Array) -> ArmMotion:
    """Arm motion of packed rows; quaternions and directions are brought to unit length."""
    borders = np.cumsum([width for _, width in _ARM_FIELDS])[:-1]
    columns = np.split(np.asarray(packed, dtype=np.float64), borders, axis=1)
    named = dict(zip((name for name, _ in _ARM_FIELDS), columns, strict=True))
    for name in ("hips_palm", "chest_palm", "upper_arm", "forearm", "wrist"):
        length = np.linalg.norm(named[name], axis=1, keepdims=True)
        # What was rounded to single precision stays: a library that is read is written to the bit.
        off = (np.abs(length - 1.0) > ROUNDED) & (length > 1e-9)
        named[name] = named[name] / np.where(off, length, 1.0)
    return ArmMotion(**named)
