"""A Clip written as a BVH file: joints with the axes of the world, the bind pose at zero."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.bvh.euler import zxy_angles
from usdhand.motion import Clip, Pose, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import to_y_up
from usdhand.problems import Problem, counted

MOVES_CM = 5e-4  # a joint that is farther from its place at the bind pose gets position channels
TURNS_DEG = 1e-3  # an end that turns more is a joint
BLOCK = 512  # frames

_POSITIONS = "Xposition Yposition Zposition"
_ROTATIONS = "Zrotation Xrotation Yrotation"


def write_clip(clip: Clip, path: Path, *, up: str = "Y") -> tuple[Problem, ...]:
    """Write a BVH file.

    All channels zero is the bind pose, each joint with the axes of the world, so that other
    programs show a rest pose that makes sense. Roots, and joints that leave their place at the bind
    pose, have position channels, which stand in place of the OFFSET. Leaves that are named after
    their parent, as in ``Head_End``, and do not move are End Sites. Several roots are several
    ROOTs, the largest first, because some programs read only one.

    Parameters
    ----------
    up : "Y" or "Z", the up axis of the file

    Returns
    -------
    tuple of Problem
        what the format, or many of those who read it, do not keep.
    """
    skeleton = clip.skeleton
    aligned = _Aligned.of(clip, up)
    order = _depth_first(skeleton)
    names, renamed = _file_names(skeleton, order)
    parts: list[Array] = []
    with_positions: set[int] = set()
    ends: set[int] = set()
    for j in order:
        angles, positions = aligned.angles(j), aligned.positions(j)
        moves = np.abs(positions - aligned.offsets[j]).max() > MOVES_CM
        if not moves and _is_end(skeleton, j, aligned) and np.abs(angles).max() < TURNS_DEG:
            ends.add(j)
            continue
        if moves or skeleton.parents[j] < 0:
            with_positions.add(j)
            parts.append(positions)
        parts.append(angles)
    layout = _Layout(order, names, frozenset(with_positions), frozenset(ends))
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("HIERARCHY\n")
        file.writelines(f"{line}\n" for line in _hierarchy(skeleton, aligned.offsets, layout))
        file.write(f"MOTION\nFrames: {len(clip)}\nFrame Time: {1.0 / clip.fps:.10f}\n")
        _write_rows(file, parts)
    return tuple(_problems(clip, layout, renamed))


@dataclass(frozen=True, eq=False)
class _Aligned:
    """A clip whose joints have the world's axes at the bind pose.

    Attributes
    ----------
    bind : (joints, 4) world rotations at the bind pose
    offsets : (joints, 3) from the parent's place at the bind pose, in the file's axes
    axes : (3, 3) the clip's axes to those of the file, for row vectors
    pose : of all joints, None where none is scaled
    """

    clip: Clip
    bind: Array
    offsets: Array
    axes: Array
    pose: Pose | None

    @classmethod
    def of(cls, clip: Clip, up: str) -> _Aligned:
        skeleton = clip.skeleton
        axes = to_y_up(up)
        places, parents = skeleton.bind_positions, skeleton.parents
        above = np.where(parents[:, None] < 0, 0.0, places[parents])
        pose = forward_kinematics(clip) if scaled_joints(clip) else None
        bind = rot.from_matrix(skeleton.bind_rotations)
        return cls(clip, bind, (places - above) @ axes, axes, pose)

    def angles(self, joint: int) -> Array:
        """(frames, 3) degrees about Z, X and Y."""
        parent = int(self.clip.skeleton.parents[joint])
        q = rot.multiply(self.clip.rotations[:, joint], rot.conjugate(self.bind[joint]))
        if parent >= 0:
            q = rot.multiply(self.bind[parent], q)
        return zxy_angles(np.concatenate([q[:, :3] @ self.axes, q[:, 3:]], axis=1))

    def positions(self, joint: int) -> Array:
        """(frames, 3) from the parent, in its axes, cm; scales are made part of it."""
        parent = int(self.clip.skeleton.parents[joint])
        if parent < 0:
            return np.asarray(self.clip.translations[:, joint] @ self.axes)
        if self.pose is None:
            way, turn = self.clip.translations[:, joint], self.bind[parent]
        else:
            way = self.pose.position(joint) - self.pose.position(parent)
            turn = rot.multiply(self.bind[parent], rot.conjugate(self.pose.rotation(parent)))
        return np.asarray(rot.rotate(turn, way) @ self.axes)


@dataclass(frozen=True)
class _Layout:
    """Joints in the order of the file with their names there, and what each of them is."""

    order: tuple[int, ...]
    names: tuple[str, ...]
    with_positions: frozenset[int]
    ends: frozenset[int]


def _depth_first(skeleton: Skeleton) -> tuple[int, ...]:
    """Joints in the order of the file: the root with most joints first."""
    sizes = np.ones(len(skeleton), dtype=int)
    for j in reversed(skeleton.order):
        if skeleton.parents[j] >= 0:
            sizes[skeleton.parents[j]] += sizes[j]
    roots = [int(j) for j in np.flatnonzero(skeleton.parents < 0)]
    stack = sorted(roots, key=lambda j: sizes[j])  # stable: then the last first
    found = []
    while stack:
        found.append(stack.pop())
        stack.extend(reversed(skeleton.children[found[-1]]))
    return tuple(found)


def _file_names(skeleton: Skeleton, order: tuple[int, ...]) -> tuple[tuple[str, ...], int]:
    """Names without blanks and braces, each once, because many programs tell joints by them.

    Also how many of them are not the joints' own.
    """
    wanted = skeleton.originals or skeleton.names
    legal = [re.sub(r"[\s{}]+", "_", name.strip()) or "_" for name in wanted]
    used, names = set(legal), dict[int, str]()
    taken: set[str] = set()
    for j in order:
        name, number = legal[j], 1
        while name in taken or (number > 1 and name in used):
            number += 1
            name = f"{legal[j]}_{number}"
        taken.add(name)
        names[j] = name
    in_order = tuple(names[j] for j in range(len(skeleton)))
    return in_order, sum(a != b for a, b in zip(in_order, wanted, strict=True))


def _is_end(skeleton: Skeleton, joint: int, aligned: _Aligned) -> bool:
    parent = int(skeleton.parents[joint])
    if parent < 0 or skeleton.children[joint] or np.abs(aligned.offsets[joint]).max() < 1e-6:
        return False
    pattern = rf"{re.escape(skeleton.names[parent])}_End(_\d+)?"
    return re.fullmatch(pattern, skeleton.names[joint]) is not None


def _hierarchy(skeleton: Skeleton, offsets: Array, layout: _Layout) -> Iterator[str]:
    open_joints: list[int] = []

    def offset(values: NDArray[np.float64]) -> str:
        return "OFFSET " + " ".join(f"{v:.6f}" for v in np.round(values, 6) + 0.0)

    def closed(above: int) -> Iterator[str]:
        while open_joints and open_joints[-1] != above:
            open_joints.pop()
            yield "\t" * len(open_joints) + "}"

    for j in layout.order:
        yield from closed(int(skeleton.parents[j]))
        margin = "\t" * len(open_joints)
        kind = "JOINT" if open_joints else "ROOT"
        yield f"{margin}End Site" if j in layout.ends else f"{margin}{kind} {layout.names[j]}"
        yield f"{margin}{{"
        yield f"{margin}\t{offset(offsets[j])}"
        open_joints.append(j)
        if j in layout.ends:
            continue
        moves = j in layout.with_positions
        yield f"{margin}\tCHANNELS " + (
            f"6 {_POSITIONS} {_ROTATIONS}" if moves else f"3 {_ROTATIONS}"
        )
        if not skeleton.children[j]:
            nothing = ("End Site", "{", "\t" + offset(np.zeros(3)), "}")
            yield from (f"{margin}\t{line}" for line in nothing)
    yield from closed(-1)


def _write_rows(file: TextIO, parts: list[Array]) -> None:
    width = sum(part.shape[1] for part in parts)
    row = " ".join(["%.6f"] * width) + "\n"
    for start in range(0, len(parts[0]), BLOCK):
        values = np.concatenate([part[start : start + BLOCK] for part in parts], axis=1)
        values = np.round(values, 6) + 0.0  # no minus zero
        file.write(row * len(values) % tuple(values.ravel().tolist()))


def _problems(clip: Clip, layout: _Layout, renamed: int) -> Iterator[Problem]:
    parents = clip.skeleton.parents
    scaled = scaled_joints(clip)
    if scaled:
        message = (
            f"BVH has no scales: those of {counted(len(scaled), 'joint')} move the joints below, "
            "but do not make anything larger"
        )
        yield Problem("scales", message, clip.skeleton.joints[min(scaled)])
    roots = int((parents < 0).sum())
    if roots > 1:
        message = f"the file has {roots} ROOTs, the largest first: some programs read only that"
        yield Problem("several-roots", message)
    moving = [j for j in sorted(layout.with_positions) if parents[j] >= 0]
    if moving:
        message = (
            "joints below the root move in their parents and have position channels, which some "
            f"programs do not read: {counted(len(moving), 'joint')}"
        )
        yield Problem("moving-joints", message, clip.skeleton.joints[moving[0]], "note")
    if renamed:
        message = "names in the file have no spaces and are unique; renamed: " + counted(
            renamed, "joint"
        )
        yield Problem("renamed-joints", message, severity="note")
    if abs(clip.start) > 1e-9:
        message = f"BVH has no start time: the clip began at {clip.start:g} s and begins at 0"
        yield Problem("start-time", message, severity="note")
