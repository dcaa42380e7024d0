"""A skeleton's joints by their names, in forms that do not depend on spelling."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from usdhand.anatomy.hand import SIDES, Side
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.rigs.body import joint_points
from usdhand.rigs.conventions import name_key, without_side

# Role ("wrist", "IndexMCP") -> the joints that bear one of its names.
Candidates = Mapping[str, tuple[int, ...]]

ADVICE = "name the joints in a file and pass it with --map FILE"


@dataclass(frozen=True, eq=False)
class NamedJoints:
    """A skeleton with what the search asks again and again.

    ``aliased``: the joints' names are those that the file gives them besides their own.
    """

    skeleton: Skeleton
    aliased: bool = False

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Leaf names, without the running numbers that some exporters append to each joint."""
        if self.aliased:
            return self.skeleton.aliases
        names = self.skeleton.names
        numbers = [m.group() for n in names if (m := re.search(r"[._]\d+$", n))]
        if len(numbers) < 0.8 * len(names) or len(set(numbers)) < len(numbers):
            return names
        return tuple(re.sub(r"[._]\d+$", "", n) for n in names)

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Spelling-free forms of the names."""
        return tuple(map(name_key, self.names))

    @cached_property
    def by_key(self) -> dict[str, tuple[int, ...]]:
        """Joints of each key, in the file's order."""
        found: dict[str, list[int]] = {}
        for joint, key in enumerate(self.keys):
            if key:
                found.setdefault(key, []).append(joint)
        return {key: tuple(joints) for key, joints in found.items()}

    @cached_property
    def by_sideless_key(self) -> dict[Side | None, dict[str, tuple[int, ...]]]:
        """Side -> key without the word for the side -> joints, in the file's order."""
        found: dict[Side | None, dict[str, list[int]]] = {side: {} for side in SIDES}
        for joint, name in enumerate(self.names):
            side, key = without_side(name)
            if side is not None and key:
                found[side].setdefault(key, []).append(joint)
        return {
            side: {key: tuple(joints) for key, joints in keys.items()}
            for side, keys in found.items()
        }

    @cached_property
    def above(self) -> tuple[frozenset[int], ...]:
        """Ancestors of each joint."""
        return tuple(frozenset(self.skeleton.ancestors(j)) for j in range(len(self.skeleton)))

    @cached_property
    def points(self) -> Array:
        """World positions (joints, 3) at the bind pose."""
        return joint_points(self.skeleton)

    def path(self, joint: int) -> str:
        """Full path of a joint."""
        return self.skeleton.joints[joint]
