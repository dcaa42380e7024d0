"""The HIERARCHY of a BVH file: joints, offsets and channels."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.motion import leaf_name
from usdhand.motion.rotations import Array

# Far beyond any character; what is beyond them is damage, and would only cost memory.
MOST_JOINTS, DEEPEST, LONGEST_NAME = 10_000, 500, 200

_TOKEN = re.compile(rb"[{}]|[^\s{}]+")
# Lines of comment; only where a line starts: "Arm #2" is a name.
_COMMENTS = re.compile(rb"(?:(?:#|//|;)[^\r\n]*+\s*+)++")
_REST_OF_LINE = re.compile(rb"[^\r\n{}]*")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_CHANNEL = re.compile(r"([xyz])(position|rotation|scale)", re.IGNORECASE)


@dataclass
class Node:
    """A joint as it stands in the file; ``channels`` are (kind, axis) in their order."""

    name: str
    parent: int
    is_end: bool
    place: int  # in the file, to find its line if need be
    offset: Array | None = None
    channels: list[tuple[str, int]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Joints of a BVH file, every parent before its children, in units and axes of the file.

    Attributes
    ----------
    joints : full paths
    parents : (joints,) -1 for roots
    offsets : (joints, 3)
    channels : of each joint, its (kind, axis) in their order: "position", "rotation" or "scale"
        and 0, 1 or 2
    motion : where in the file MOTION ends
    """

    joints: tuple[str, ...]
    parents: NDArray[np.intp]
    offsets: Array
    channels: tuple[tuple[tuple[str, int], ...], ...]
    motion: int

    @property
    def width(self) -> int:
        """Number of values of a frame."""
        return sum(map(len, self.channels))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Leaf names of the joints."""
        return tuple(map(leaf_name, self.joints))

    def below(self, root: int) -> tuple[Hierarchy, NDArray[np.intp]]:
        """One root with all joints below it, and the columns of their channels."""
        inside = np.zeros(len(self.joints), dtype=bool)
        for joint, parent in enumerate(self.parents):
            inside[joint] = joint == root or (parent >= 0 and inside[parent])
        kept = np.flatnonzero(inside)
        parents = np.cumsum(inside)[self.parents[kept]] - 1
        parents[0] = -1
        column_joints = np.repeat(np.arange(len(self.joints)), list(map(len, self.channels)))
        part = replace(
            self,
            joints=tuple(self.joints[j] for j in kept),
            parents=parents,
            offsets=self.offsets[kept],
            channels=tuple(self.channels[j] for j in kept),
        )
        return part, np.flatnonzero(inside[column_joints])


def line_at(data: bytes, position: int) -> int:
    """Line number of a place in a file, from 1."""
    return sum(1 for _ in _LINE_END.finditer(data, 0, position)) + 1


def parse_hierarchy(data: bytes, path: Path, encoding: str = "utf-8") -> Hierarchy:
    """Read up to the word MOTION, with names in an encoding.

    Raises
    ------
    InputError
        naming the line.
    """
    parser = _Parser(data, path, encoding)
    nodes = parser.nodes()
    kept = _without_empty_ends(nodes)
    return Hierarchy(
        _paths(kept),
        np.array([node.parent for node in kept], dtype=np.intp),
        np.array([node.offset for node in kept]),
        tuple(tuple(node.channels) for node in kept),
        parser.position,
    )


class _Parser:
    """Words one after the other, with an own stack: depth costs no recursion."""

    def __init__(self, data: bytes, path: Path, encoding: str) -> None:
        self.data, self.path, self.encoding = data, path, encoding
        self.position = self.start = 3 if data.startswith(b"\xef\xbb\xbf") else 0

    def nodes(self) -> list[Node]:
        """Read all joints."""
        if self.word().upper() != "HIERARCHY":
            self.fail("this is not a BVH file: it does not begin with HIERARCHY")
        found: list[Node] = []
        stack: list[int] = []
        while True:
            word = self.word()
            key = word.upper()
            if key in ("ROOT", "JOINT", "END"):
                found.append(self.joint(key, found, stack))
                stack.append(len(found) - 1)
            elif key == "OFFSET" and stack:
                found[stack[-1]].offset = np.array([self.number() for _ in range(3)])
            elif key == "CHANNELS" and stack:
                self.channels(found[stack[-1]])
            elif word == "}" and stack:
                self.finished(found[stack.pop()])
            elif key == "MOTION" and found and not stack:
                return found
            elif not word:
                self.fail("the file ends before MOTION: it is cut off")
            else:
                place = f"in joint '{found[stack[-1]].name}'" if stack else "outside any joint"
                self.fail(f"'{word[:40]}' does not belong here, {place}")

    def joint(self, key: str, found: list[Node], stack: list[int]) -> Node:
        """Read a name and the brace behind it."""
        if (key == "ROOT") == bool(stack):
            self.fail("a ROOT inside a joint" if stack else f"{key} without a ROOT around it")
        if len(found) >= MOST_JOINTS or len(stack) >= DEEPEST:
            self.fail(f"more than {MOST_JOINTS} joints, or {DEEPEST} levels of joints")
        place = self.start
        rest = _REST_OF_LINE.match(self.data, self.position)
        assert rest is not None
        self.position = rest.end()
        name = " ".join(self.text(rest[0]).split())
        parent = stack[-1] if stack else -1
        if key != "END" and not 0 < len(name) <= LONGEST_NAME:
            self.fail(f"{key} has no name, or one that is too long")
        if self.word() != "{":
            self.fail(f"no brace after {key} of line {line_at(self.data, place)}")
        if key == "END":
            return Node(f"{found[parent].name}_End", parent, True, place)
        return Node(name.replace("/", "_"), parent, False, place)

    def channels(self, node: Node) -> None:
        """Read the number of channels and their names."""
        count = self.number()
        if node.channels or not 0 <= count <= 100 or count != int(count):
            self.fail(f"the CHANNELS of joint '{node.name}' are not plausible")
        for _ in range(int(count)):
            word = self.word()
            match = _CHANNEL.fullmatch(word)
            if match is None:
                self.fail(f"'{word[:40]}' is not a channel of '{node.name}', which needs {count:g}")
            channel = (match[2].lower(), "xyz".index(match[1].lower()))
            if channel[0] == "position" and channel in node.channels:
                self.fail(f"joint '{node.name}' has the channel {word} twice")
            node.channels.append(channel)

    def finished(self, node: Node) -> None:
        """Check a joint whose brace was closed."""
        if node.offset is None:
            line = line_at(self.data, node.place)
            self.fail(f"joint '{node.name}' of line {line} has no OFFSET")

    def number(self) -> float:
        """Read a finite number."""
        word = self.word()
        try:
            value = float(word)
        except ValueError:
            value = np.nan
        if not np.isfinite(value) or "_" in word or abs(value) > 1e9:
            self.fail(f"'{word[:40]}' is not a usable number")
        return value

    def word(self) -> str:
        """Next word, without comments; empty at the end of the file."""
        while (match := _TOKEN.search(self.data, self.position)) is not None:
            comments = _COMMENTS.match(self.data, match.start())
            if comments is None or not self.starts_line(match.start()):
                self.start, self.position = match.span()
                return self.text(match[0])
            self.position = comments.end()
        self.start = self.position = len(self.data)
        return ""

    def starts_line(self, position: int) -> bool:
        """Whether only blanks stand before a place in its line."""
        while position > 0 and self.data[position - 1] in b" \t":
            position -= 1
        return position == 0 or self.data[position - 1] in b"\r\n"

    def text(self, data: bytes) -> str:
        """What bytes of the file say; what is not in its encoding is marked."""
        return data.decode(self.encoding, "replace")

    def fail(self, what: str) -> NoReturn:
        """Refuse the file at the last word read."""
        raise InputError(f"{self.path}, line {line_at(self.data, self.start)}: {what}.")


def _without_empty_ends(nodes: list[Node]) -> list[Node]:
    """Nodes without End Sites that lie on their joint: they say nothing."""
    parents = {node.parent for node in nodes}
    places: dict[int, int] = {-1: -1}
    kept: list[Node] = []
    for i, node in enumerate(nodes):
        empty = node.is_end and not node.channels and i not in parents
        if empty and not np.any(node.offset):
            continue
        places[i] = len(kept)
        kept.append(node)
    for node in kept:
        node.parent = places[node.parent]
    return kept


def _paths(nodes: list[Node]) -> tuple[str, ...]:
    """Full paths, siblings of one name numbered from the second on."""
    paths: list[str] = []
    for node, name in zip(nodes, _distinct(nodes), strict=True):
        paths.append(name if node.parent < 0 else f"{paths[node.parent]}/{name}")
    return tuple(paths)


def _distinct(nodes: list[Node]) -> Iterator[str]:
    used: set[tuple[int, str]] = {(node.parent, node.name) for node in nodes}
    seen: dict[tuple[int, str], int] = {}
    for node in nodes:
        key = (node.parent, node.name)
        number = seen.get(key, 0) + 1
        name = node.name
        while number > 1 and (node.parent, name := f"{node.name}_{number}") in used:
            number += 1
        seen[key] = number
        used.add((node.parent, name))
        yield name
