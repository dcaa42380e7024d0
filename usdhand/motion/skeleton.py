"""The skeleton of a character: joints, parents, rest and bind pose, in centimetres and Y up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdhand.display import displayed
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import local_matrices, orientation


def leaf_name(joint: str) -> str:
    """Last part of a joint path: ``Hips/Spine/Head`` -> ``Head``."""
    return joint.rsplit("/", 1)[-1]


def parents_from_paths(joints: Iterable[str]) -> NDArray[np.intp]:
    """Index of each joint's nearest ancestor in the list, -1 for roots; shape (joints,).

    Paths are parsed as text: USD's own parser gives -1 for tokens that are no valid prim names,
    and real files have those. An ancestor that is not listed is passed over, as UsdSkel does.
    """
    joints = list(joints)
    index = {joint: i for i, joint in enumerate(joints)}

    def nearest(joint: str) -> int:
        while "/" in joint:
            joint = joint.rsplit("/", 1)[0]
            if joint in index:
                return index[joint]
        return -1

    return np.array([nearest(joint) for joint in joints], dtype=np.intp)


@displayed(
    lambda skeleton: {
        "joints": len(skeleton),
        "roots": [name for name, p in zip(skeleton.names, skeleton.parents, strict=True) if p < 0],
    }
)
@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints and their two reference poses.

    Attributes
    ----------
    joints : full paths (``Hips/Spine``), in the file's order
    parents : (joints,) index of the parent, -1 for a root
    bind : (joints, 4, 4) joint-to-world matrices of the bind pose, for column vectors, cm
    rest : (joints, 4, 4) joint-to-parent matrices of the rest pose, cm
    aliases : names that a file gives to its joints besides their own, such as the humanoid bones of
        a VRM avatar: one per joint ("" for none), or empty
    originals : the joints' names in the file where they are not legal in USD: one per joint, or
        empty if all are unchanged
    """

    joints: tuple[str, ...]
    parents: NDArray[np.intp]
    bind: Array
    rest: Array
    aliases: tuple[str, ...] = ()
    originals: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.joints)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Leaf names of the joints."""
        return tuple(leaf_name(joint) for joint in self.joints)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Indices of each joint's children."""
        found: list[list[int]] = [[] for _ in self.joints]
        for child, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(child)
        return tuple(tuple(c) for c in found)

    @cached_property
    def bind_positions(self) -> Array:
        """(joints, 3) world positions at the bind pose, cm."""
        return self.bind[:, :3, 3]

    @cached_property
    def bind_rotations(self) -> Array:
        """(joints, 3, 3) world orientations at the bind pose, without scale, shear or mirroring."""
        return orientation(self.bind[:, :3, :3])

    @cached_property
    def bind_locals(self) -> Array:
        """(joints, 4, 4) joint-to-parent matrices of the bind pose."""
        return local_matrices(self.bind, self.parents)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """Joint indices by depth, so that every parent comes before its children."""
        found: list[int] = []
        level = np.flatnonzero(self.parents < 0).tolist()
        while level:
            found += level
            level = sorted(child for joint in level for child in self.children[joint])
        return tuple(found)

    def ancestors(self, joint: int) -> tuple[int, ...]:
        """Return the joints above ``joint``, the parent first."""
        found = []
        while (joint := int(self.parents[joint])) >= 0:
            found.append(joint)
        return tuple(found)

    def descendants(self, joint: int) -> tuple[int, ...]:
        """Return the joints below ``joint``, branch by branch."""
        found: list[int] = []
        open_joints = list(reversed(self.children[joint]))
        while open_joints:
            found.append(open_joints.pop())
            open_joints.extend(reversed(self.children[found[-1]]))
        return tuple(found)

    def with_ancestors(self, joints: Iterable[int]) -> tuple[int, ...]:
        """Return ``joints`` and all joints above them, every parent before its children."""
        wanted: set[int] = set()
        for joint in joints:
            while joint >= 0 and joint not in wanted:
                wanted.add(joint)
                joint = int(self.parents[joint])
        return tuple(j for j in self.order if j in wanted)

    def common_ancestor(self, joints: Iterable[int]) -> int | None:
        """Return the lowest joint that is above or equal to all of ``joints``."""
        lines = [(joint, *self.ancestors(joint)) for joint in joints]
        shared = set(lines[0]).intersection(*lines[1:])
        return next((joint for joint in lines[0] if joint in shared), None)

    def accumulated(self, local: Array) -> Array:
        """Return world matrices (joints, 4, 4) of joint-to-parent ones."""
        world = local.copy()
        for joint in self.order:
            parent = int(self.parents[joint])
            if parent >= 0:
                world[joint] = world[parent] @ local[joint]
        return world

    def find(self, name: str) -> int | None:
        """Index of the joint with this full path or, if only one has it, this leaf name."""
        if name in self.joints:
            return self.joints.index(name)
        matches = [i for i, leaf in enumerate(self.names) if leaf == name]
        return matches[0] if len(matches) == 1 else None


def same_bind(a: Skeleton, b: Skeleton) -> bool:
    """Whether two skeletons are bound in one pose."""
    return a is b or (a.joints == b.joints and np.allclose(a.bind, b.bind, atol=1e-4))
