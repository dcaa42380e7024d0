"""Forward kinematics: local transforms to world space, vectorised over frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from usdhand.motion import rotations as rot
from usdhand.motion.clip import Clip
from usdhand.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class Pose:
    """World transforms of some joints over time.

    ``positions`` (frames, n, 3) in cm and ``rotations`` (frames, n, 4), in the order of ``joints``.
    """

    joints: tuple[int, ...]
    positions: Array
    rotations: Array

    def position(self, joint: int) -> Array:
        """(frames, 3) world position of one joint, cm."""
        return self.positions[:, self.joints.index(joint)]

    def rotation(self, joint: int) -> Array:
        """(frames, 4) world rotation of one joint."""
        return self.rotations[:, self.joints.index(joint)]


def forward_kinematics(
    clip: Clip, joints: Iterable[int] | None = None, base: int | None = None
) -> Pose:
    """World positions and rotations of ``joints`` (all, by default).

    With ``base``, a joint above all of them, they are relative to that joint. Only the joints
    asked for and those above them are computed. Joint scales move descendants as
    UsdSkel does (scale, then rotate, then translate, then the parent's); the shear that a
    non-uniform scale gives to turned descendants is left out of their rotations, not of positions.
    """
    skeleton = clip.skeleton
    wanted = tuple(range(len(skeleton))) if joints is None else tuple(joints)
    rotations: dict[int, Array] = {}
    positions: dict[int, Array] = {}
    linear: dict[int, Array] = {}  # 3x3 part including scales, only where there are any
    scaled = scaled_joints(clip)
    above_base = frozenset() if base is None else frozenset(skeleton.ancestors(base))
    for j in skeleton.with_ancestors(wanted):
        if j in above_base:
            continue
        p = -1 if j == base else int(skeleton.parents[j])
        q, t = clip.rotations[:, j], clip.translations[:, j]
        if j == base:
            q, t = np.broadcast_to(rot.IDENTITY, q.shape), np.zeros_like(t)
        if p < 0:
            rotations[j], positions[j] = q, t
        else:
            rotations[j] = rot.multiply(rotations[p], q)
            moved = (
                np.einsum("tij,tj->ti", linear[p], t)
                if p in linear
                else rot.rotate(rotations[p], t)
            )
            positions[j] = positions[p] + moved
        if j in scaled or p in linear:
            linear[j] = _scaled_matrix(clip, j, linear.get(p), rotations[p] if p >= 0 else None)
    return Pose(
        wanted,
        np.stack([positions[j] for j in wanted], axis=1),
        np.stack([rotations[j] for j in wanted], axis=1),
    )


def scaled_joints(clip: Clip, tolerance: float = 1e-4) -> frozenset[int]:
    """Joints whose scale differs from one somewhere, or that have a shear."""
    scales = clip.scales[:1] if clip.scales.strides[0] == 0 else clip.scales  # one value for all
    # Thirty times faster than the largest difference from one over frames and axes at once.
    rows = scales.reshape(len(scales), -1)
    away = np.maximum(rows.max(axis=0) - 1.0, 1.0 - rows.min(axis=0)) > tolerance
    return frozenset(np.flatnonzero(away.reshape(-1, 3).any(axis=1)).tolist()) | clip.shears.keys()


def _scaled_matrix(
    clip: Clip, joint: int, parent_matrix: Array | None, parent_rotation: Array | None
) -> Array:
    own = rot.to_matrix(clip.rotations[:, joint]) * clip.scales[:, joint, None, :]
    if joint in clip.shears:
        own = own @ clip.shears[joint]
    if parent_matrix is None:
        parent_matrix = None if parent_rotation is None else rot.to_matrix(parent_rotation)
    return own if parent_matrix is None else np.asarray(parent_matrix @ own)
