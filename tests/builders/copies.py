"""Copies of a clip that move the same on rigs that were built otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array


def reaxed(clip: Clip, turns: Array) -> Clip:
    """The same motion on a rig whose joints have other axes: (joints, 4) turns of the old ones."""
    rig = clip.skeleton
    matrices = np.tile(np.eye(4), (len(rig), 1, 1))
    matrices[:, :3, :3] = rot.to_matrix(turns)
    above = np.array([turns[p] if p >= 0 else rot.IDENTITY for p in rig.parents])
    local = rot.multiply(rot.multiply(rot.conjugate(above), clip.rotations), turns)
    back = np.array([matrices[p].T if p >= 0 else np.eye(4) for p in rig.parents])
    return replace(
        clip,
        skeleton=replace(rig, bind=rig.bind @ matrices, rest=back @ rig.rest @ matrices),
        rotations=local,
        translations=rot.rotate(rot.conjugate(above), clip.translations),
    )


def renamed(clip: Clip) -> Clip:
    rig = clip.skeleton
    names = [f"joint{i}" for i in range(len(rig))]
    paths: list[str] = []
    for joint, parent in enumerate(rig.parents):
        paths.append((f"{paths[parent]}/" if parent >= 0 else "") + names[joint])
    return replace(clip, skeleton=replace(rig, joints=tuple(paths)))


def random_turns_of(rig: Skeleton, seed: int) -> Array:
    return rot.normalize(np.random.default_rng(seed).normal(size=(len(rig), 4)))
