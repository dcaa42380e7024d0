"""Local transforms of a clip, some of them replaced, and what follows for joints far apart."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from usdhand.anatomy.angles import inverse, product, rotate
from usdhand.motion import Clip, Skeleton
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.rotations import IDENTITY, Array

WORLD = -1  # as a joint: what roots hang off


@dataclass(eq=False)
class LocalMotion:
    """A clip as it would be with other local transforms of some joints.

    Arrays have their components first, as in `usdhand.anatomy.angles`.

    Attributes
    ----------
    rotations : joint -> (4, frames) in place of the clip's
    translations : joint -> (3, frames) in place of the clip's, cm
    """

    clip: Clip
    rotations: dict[int, Array] = field(default_factory=dict)
    translations: dict[int, Array] = field(default_factory=dict)

    @cached_property
    def scaled(self) -> frozenset[int]:
        """Joints that have a scale."""
        return scaled_joints(self.clip)

    def rotation(self, joint: int) -> Array:
        """(4, frames) from a joint's axes to its parent's."""
        if joint in self.rotations:
            return self.rotations[joint]
        return np.ascontiguousarray(self.clip.rotations[:, joint].T)

    def translation(self, joint: int) -> Array:
        """(3, frames) in the parent's axes, cm."""
        if joint in self.translations:
            return self.translations[joint]
        return self.clip.translations[:, joint].T

    def scale(self, joint: int) -> Array | float:
        """(3, frames), or 1."""
        return self.clip.scales[:, joint].T if joint in self.scaled else 1.0

    def between(self, joint: int, other: int) -> Array:
        """Rotation (4, frames) from the axes of ``other`` to those of ``joint``."""
        up, down = self._path(other, joint)
        steps = [self.rotation(j) for j in up]
        steps += [inverse(self.rotation(j)) for j in down]
        if not steps:
            return np.broadcast_to(IDENTITY[:, None], (4, len(self.clip)))
        result = steps[0]
        for step in steps[1:]:
            result = product(step, result)
        return result

    def change_axes(self, points: Array, start: int, end: int) -> Array:
        """Points (3, frames) in the axes of one joint, in those of another one."""
        up, down = self._path(start, end)
        for j in up:
            if j in self.clip.shears:
                points = self.clip.shears[j] @ points
            points = self.translation(j) + rotate(self.rotation(j), self.scale(j) * points)
        for j in down:
            points = rotate(inverse(self.rotation(j)), points - self.translation(j)) / self.scale(j)
            if j in self.clip.shears:
                points = np.linalg.inv(self.clip.shears[j]) @ points
        return points

    def turn(self, joint: int, reference: int) -> Array:
        """Rotation (4, frames) of a joint as measured from ``reference`` in place of its parent."""
        parent, q = int(self.clip.skeleton.parents[joint]), self.rotation(joint)
        return q if parent == reference else product(inverse(self.between(parent, reference)), q)

    def _path(self, start: int, end: int) -> tuple[list[int], list[int]]:
        """Joints from one up to below the lowest that is above both, and down to the other."""
        skeleton = self.clip.skeleton
        base = None if WORLD in (start, end) else skeleton.common_ancestor([start, end])
        return _up_to(skeleton, start, base), _up_to(skeleton, end, base)[::-1]


def _up_to(skeleton: Skeleton, joint: int, base: int | None) -> list[int]:
    """A joint and those above it, without ``base`` and what is above that."""
    if joint == WORLD:
        return []
    line = [joint, *skeleton.ancestors(joint)]
    return line if base is None else line[: line.index(base)]
