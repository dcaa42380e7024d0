"""Rows of channel values as rotations and translations of joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.bvh.hierarchy import Hierarchy
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

BLOCK = 256  # frames; what is in work stays in the processor's cache


def local_motion(hierarchy: Hierarchy, rows: Array) -> tuple[Array, Array]:
    """Joint-to-parent rotations (frames, joints, 4) and translations (frames, joints, 3).

    Channels turn in the order in which they stand, the first outermost. Position channels stand in
    place of the OFFSET, axis by axis.
    """
    frames, joints = len(rows), len(hierarchy.joints)
    rotations = np.empty((frames, joints, 4))
    groups = _rotation_groups(hierarchy)
    for start in range(0, frames, BLOCK):
        block = slice(start, start + BLOCK)
        for axes, (members, columns) in groups.items():
            rotations[block, members] = from_euler(axes, np.radians(rows[block][:, columns]))
        # Each block goes on in the half space that the one before it ended in.
        joined = slice(max(start - 1, 0), start + BLOCK)
        rotations[joined] = rot.make_continuous(rotations[joined])
    return rotations, local_translations(hierarchy, rows)


def local_translations(hierarchy: Hierarchy, rows: Array, added: bool = False) -> Array:
    """Joint-to-parent translations (frames, joints, 3); positions of inner joints may be added."""
    shape = (len(rows), len(hierarchy.joints), 3)
    translations = np.broadcast_to(hierarchy.offsets, shape)
    places = position_columns(hierarchy)
    if places:
        translations = translations.copy()
        for joint, axis, column in places:
            inner = added and hierarchy.parents[joint] >= 0
            translations[:, joint, axis] = rows[:, column] + inner * hierarchy.offsets[joint, axis]
    return translations


def from_euler(axes: tuple[int, ...], angles: Array) -> Array:
    """Quaternions (..., 4) of angles (..., n) in radians about ``axes``, the first outermost."""
    x = np.zeros((4, *angles.shape[:-1]))
    x[3] = 1.0
    for n, axis in enumerate(axes):
        half = angles[..., n] / 2.0
        c, s = np.cos(half), np.sin(half)
        k, i, j = axis, (axis + 1) % 3, (axis + 2) % 3
        x[i], x[j] = x[i] * c + x[j] * s, x[j] * c - x[i] * s
        x[k], x[3] = x[k] * c + x[3] * s, x[3] * c - x[k] * s
    return np.moveaxis(x, 0, -1)


def _rotation_groups(
    hierarchy: Hierarchy,
) -> dict[tuple[int, ...], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Joints with the same axes, in the same order, and the columns (joints, axes) of these."""
    found: dict[tuple[int, ...], tuple[list[int], list[list[int]]]] = {}
    column = 0
    for joint, channels in enumerate(hierarchy.channels):
        turns = [(a, column + n) for n, (kind, a) in enumerate(channels) if kind == "rotation"]
        members, columns = found.setdefault(tuple(a for a, _ in turns), ([], []))
        members.append(joint)
        columns.append([c for _, c in turns])
        column += len(channels)
    return {
        axes: (np.array(members, np.intp), np.array(columns, np.intp).reshape(len(members), -1))
        for axes, (members, columns) in found.items()
    }


def position_columns(hierarchy: Hierarchy) -> list[tuple[int, int, int]]:
    """(joint, axis, column) of each position channel."""
    kinds = [
        (joint, *channel)
        for joint, channels in enumerate(hierarchy.channels)
        for channel in channels
    ]
    return [(j, axis, column) for column, (j, kind, axis) in enumerate(kinds) if kind == "position"]
