"""A clip: a skeleton and its local transforms sampled at a steady rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.motion.arrays import ArrayRig, Quaternions, rate_of
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.timing import time_codes
from usdhand.motion.transforms import decompose, with_even_signs
from usdhand.problems import Problem
from usdhand.units import UpAxis


@displayed()
@dataclass(frozen=True, eq=False)
class Origin:
    """Where a clip was read from, and the units of its file: enough to write it back.

    Attributes
    ----------
    path : the file, None for a clip made in memory
    skeleton_path, animation_path : prims in that file ("" if there are none)
    time_codes_per_second : of the stage
    first_time_code : time code of the clip's first frame
    time_codes_per_frame : distance of two frames in time codes
    cm_per_unit : centimetres of one unit of the joints' own space
    up_axis : "Y" or "Z", of the stage
    clock : seconds of the recording's clock at the clip's first frame, None if the file has none
    """

    path: Path | None = None
    skeleton_path: str = ""
    animation_path: str = ""
    time_codes_per_second: float = 24.0
    first_time_code: float = 0.0
    time_codes_per_frame: float = 1.0
    cm_per_unit: float = 1.0
    up_axis: str = "Y"
    clock: float | None = None


def shears_of(matrices: Array) -> dict[int, Array]:
    """Return those of the shears (joints, 3, 3) that are any, by joint."""
    return {j: matrix for j, matrix in enumerate(matrices) if (matrix != np.eye(3)).any()}


@displayed(
    lambda clip: {
        "name": clip.name,
        "joints": len(clip.skeleton),
        "frames": len(clip),
        "fps": clip.fps,
        "seconds": clip.duration,
    }
)
@dataclass(frozen=True, eq=False)
class Clip:
    """Motion of one character: centimetres, seconds, Y up.

    Whatever is above the skeleton in its file (units, axes, placement, animated or not) is
    part of the root joints' transforms, so that forward kinematics gives world space.

    Attributes
    ----------
    rotations : (frames, joints, 4) joint-to-parent unit quaternions (x, y, z, w), continuous
    translations : (frames, joints, 3) joint-to-parent, cm
    scales : (frames, joints, 3); all ones for nearly every clip, all negative for a mirrored joint
    shears : joint -> (3, 3), before its scale in all frames; only of joints that are not animated
        and whose rest transform has one
    fps : frames a second
    source : what the clip was read from, to be written over; None for a clip made in memory. Only
        `usdhand.formats` looks inside. The stage of a USD file is held open by it: replace it by
        None in clips that are kept in great numbers and not written
    """

    skeleton: Skeleton
    rotations: Array
    translations: Array
    scales: Array
    fps: float
    name: str = ""
    origin: Origin = field(default_factory=Origin)
    problems: tuple[Problem, ...] = ()
    source: object | None = field(default=None, repr=False)
    shears: Mapping[int, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def at_bind_pose(
        cls, skeleton: Skeleton, name: str, origin: Origin, problems: tuple[Problem, ...] = ()
    ) -> Clip:
        """Return one frame of a skeleton at its bind pose, with a time code a frame."""
        translations, rotations, scales, shears = decompose(skeleton.bind_locals[None])
        return cls(
            skeleton,
            rotations,
            translations,
            scales,
            origin.time_codes_per_second,
            name,
            origin,
            problems,
            shears=shears_of(shears[0]),
        )

    @classmethod
    def from_arrays(
        cls,
        joints: Sequence[str],
        rotations: ArrayLike,
        *,
        quaternions: Quaternions,
        fps: float,
        units: str | float,
        up: UpAxis = "Y",
        parents: ArrayLike | None = None,
        bind: ArrayLike | None = None,
        rest: ArrayLike | None = None,
        translations: ArrayLike | None = None,
        scales: ArrayLike | None = None,
        name: str = "clip",
    ) -> Clip:
        """Make a clip of arrays in memory, such as a body model or a solver gives.

        Joints may come in any order; in the clip, parents come before their children.

        Parameters
        ----------
        joints : paths ("Hips/Spine/Head"), or names if ``parents`` are given
        rotations : (frames, joints, 4) joint-to-parent unit quaternions
        quaternions : the order of their numbers, "xyzw" (scipy, USD arrays) or "wxyz" (many others)
        fps : frames a second
        units : of length: "mm", "cm", "m", "in", "ft", or a number of centimetres
        up : "Y" or "Z", the axis that is up in the space of the roots
        parents : (joints,) index of the parent, -1 for a root
        bind : joint-to-world transforms of the bind pose, (joints, 4, 4) for column vectors, or
            (joints, 3) where no joint is turned there; made of ``rest`` if None
        rest : joint-to-parent transforms of the rest pose, likewise; made of ``bind`` if None
        translations : (frames, joints, 3) joint-to-parent, or (joints, 3) for all frames; those of
            the rest pose if None
        scales : likewise
        name : for messages and reports, and of the character in files

        Raises
        ------
        UsageError
            if shapes, names or parents do not fit each other, or the order of the quaternions is
            not the one of the arrays.
        InputError
            if a value is not finite, a quaternion is not of unit length (within 0.001, which is
            mended), or a transform has no inverse.

        Examples
        --------
        Three joints at rest, and how the last one bends by a quarter of a turn:

        >>> clip = Clip.from_arrays(
        ...     ["hips", "chest", "head"],
        ...     [[[1, 0, 0, 0]] * 3, [[1, 0, 0, 0], [1, 0, 0, 0], [0.7071, 0.7071, 0, 0]]],
        ...     quaternions="wxyz",
        ...     parents=[-1, 0, 1],
        ...     bind=[[0, 1.0, 0], [0, 1.4, 0], [0, 1.7, 0]],
        ...     fps=30,
        ...     units="m",
        ... )
        >>> clip.translations[0].tolist()
        [[0.0, 100.0, 0.0], [0.0, 40.0, 0.0], [0.0, 30.0, 0.0]]
        """
        if not isinstance(name, str):
            raise UsageError(f"name: {name!r} is no text.")
        rig = ArrayRig.of(joints, parents, bind, rest, units, up)
        turned = rig.rotations(rotations, quaternions)
        moved = rig.translations(translations, len(turned))
        turned, scaled = with_even_signs(turned, rig.scales(scales, len(turned)))
        return cls(
            rig.skeleton,
            turned,
            moved,
            scaled,
            rate := rate_of(fps),
            name,
            Origin(time_codes_per_second=rate),
            rig.doubts(),
        )

    def __len__(self) -> int:
        return len(self.rotations)

    @property
    def start(self) -> float:
        """Time of the first frame in its file, seconds."""
        return self.origin.first_time_code / self.origin.time_codes_per_second

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.fps

    @property
    def times(self) -> Array:
        """(frames,) seconds in the time of its file."""
        return self.start + np.arange(len(self)) / self.fps

    @property
    def time_codes(self) -> Array:
        """(frames,) time codes in its file."""
        origin = self.origin
        frames = np.arange(len(self), dtype=np.float64)
        return time_codes(frames, origin.first_time_code, origin.time_codes_per_frame)

    def time_code(self, frame: float) -> float:
        """Time code of a frame in its file."""
        origin = self.origin
        return float(time_codes(frame, origin.first_time_code, origin.time_codes_per_frame))

    def with_rotations(self, rotations: Array) -> Clip:
        """Return the same clip with other joint rotations."""
        return replace(self, rotations=rotations)
