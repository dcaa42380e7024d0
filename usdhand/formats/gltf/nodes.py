"""The node tree of a glTF file: names, parents and default transforms."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.gltf.document import LARGEST, Document, Element
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import compose_trs, decompose_trs

MOST_DEEP = 500
SHORTEST = 1e-6  # norm below which a quaternion has no direction


@dataclass(frozen=True, eq=False)
class Tree:
    """All nodes of a file.

    Attributes
    ----------
    elements : (nodes) as they stand in the file
    parents : (nodes,) -1 for roots
    children : of each node
    order : all nodes, parents first, as one meets them going down the tree
    translations, rotations, scales : (nodes, n) default local transforms, in file units
    """

    elements: list[Element]
    parents: NDArray[np.intp]
    children: tuple[tuple[int, ...], ...]
    order: tuple[int, ...]
    translations: Array
    rotations: Array
    scales: Array

    def __len__(self) -> int:
        return len(self.elements)

    @cached_property
    def world(self) -> Array:
        """(nodes, 4, 4) node-to-world matrices of the default pose, file units."""
        world = compose_trs(self.translations, self.rotations, self.scales)
        for node in self.order:
            parent = self.parents[node]
            if parent >= 0:
                world[node] = world[parent] @ world[node]
                # Products of sane numbers may still overflow, along the tree.
                if not (np.abs(world[node]) <= LARGEST).all():
                    self.elements[node].refuse("is beyond any plausible distance or scale")
        return world

    def name(self, node: int) -> str:
        """Name of a node, made up from its number where it has none."""
        return self.elements[node].text("name").replace("/", "_") or f"node_{node}"

    @cached_property
    def spans(self) -> NDArray[np.intp]:
        """(nodes, 2) places in ``order`` of each node, and behind the last one below it."""
        spans = np.zeros((len(self), 2), dtype=np.intp)
        spans[list(self.order), 0] = np.arange(len(self))
        spans[:, 1] = spans[:, 0] + 1
        for node in reversed(self.order):
            if self.children[node]:
                spans[node, 1] = spans[self.children[node][-1], 1]
        return spans

    def above(self, node: int) -> tuple[int, ...]:
        """Return the nodes above a node, from the root down."""
        found = []
        while node >= 0:
            found.append(node)
            node = int(self.parents[node])
        return tuple(reversed(found[1:]))

    def below(self, node: int) -> tuple[int, ...]:
        """Return a node and all nodes below it, parents first."""
        start, end = self.spans[node]
        return self.order[start:end]

    def holds(self, top: int, node: int) -> bool:
        """Whether ``node`` is ``top`` or below it; -1 stands for what is above all roots."""
        start, end = self.spans[top] if top >= 0 else (0, len(self))
        return bool(start <= self.spans[node, 0] < end)

    def common(self, nodes: Iterable[int]) -> int:
        """Return the lowest node that is above or equal to all of some nodes, -1 if none is."""
        top, *others = nodes
        for node in others:
            while not self.holds(top, node):
                top = int(self.parents[top])
        return top


def read_tree(document: Document) -> Tree:
    """Read all nodes.

    Raises
    ------
    InputError
        if they form no tree, or have transforms that are no numbers.
    """
    elements = document.lists["nodes"]
    parents = np.full(len(elements), -1, dtype=np.intp)
    children = []
    for i, element in enumerate(elements):
        below = [child.whole(0, len(elements)) for child in element.items("children")]
        for child in below:
            if parents[child] >= 0:
                element.refuse(f"has node {child} as a child, which has a parent already")
            parents[child] = i
        children.append(tuple(below))
    depth = np.zeros(len(elements), dtype=np.intp)
    order, waiting = [], [int(i) for i in np.flatnonzero(parents < 0)[::-1]]
    while waiting:
        node = waiting.pop()
        order.append(node)
        depth[node] = depth[parents[node]] + 1 if parents[node] >= 0 else 1
        if depth[node] > MOST_DEEP:
            elements[node].refuse(f"is below {MOST_DEEP} others, which is not plausible")
        waiting += reversed(children[node])
    if len(order) < len(elements):
        lost = min(set(range(len(elements))) - set(order))
        elements[lost].refuse("is below itself")
    translations, rotations, scales = _transforms(elements)
    return Tree(elements, parents, tuple(children), tuple(order), translations, rotations, scales)


def _transforms(elements: list[Element]) -> tuple[Array, Array, Array]:
    count = len(elements)
    translations, rotations = np.zeros((count, 3)), np.tile(rot.IDENTITY, (count, 1))
    scales = np.ones((count, 3))
    for i, element in enumerate(elements):
        if (matrix := element.get("matrix")) is not None:
            m = np.array(matrix.numbers(16)).reshape(4, 4).T
            translations[i], rotations[i], scales[i] = decompose_trs(m)
            continue
        if (found := element.get("translation")) is not None:
            translations[i] = found.numbers(3)
        if (found := element.get("scale")) is not None:
            scales[i] = found.numbers(3)
        if (found := element.get("rotation")) is not None:
            rotations[i] = found.numbers(4)
            length = float(np.linalg.norm(rotations[i]))
            if length < SHORTEST:
                found.refuse("has length zero, so it is not a rotation")
            rotations[i] /= length
    return translations, rotations, scales
