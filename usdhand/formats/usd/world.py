"""What stands above a skeleton on its stage: placement, units, up axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from usdhand.errors import InputError
from usdhand.formats.usd.stage import Character
from usdhand.motion import Problem
from usdhand.motion.rotations import Array

UNIFORM_SCALE_TOLERANCE = 0.01
Y_UP_FROM_Z_UP: Array = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@dataclass(frozen=True, eq=False)
class World:
    """Skeleton space to Y-up centimetres: ``scale``, then ``rotation``, then ``translation``.

    Rotations (n, 3, 3) and translations (n, 3) in cm; n = 1 where nothing above moves.
    ``axes`` (3, 3) turns the stage's own axes to Y up.
    """

    scale: float
    rotation: Array
    translation: Array
    axes: Array


def world_above(character: Character, times: Array | None = None) -> World:
    """Return the transform above a skeleton, at each of ``times`` if something above moves."""
    stage, prim = character.stage, character.skeleton
    moving = times is not None and _moves(prim)
    codes = [Usd.TimeCode(t) for t in times] if moving and times is not None else [_earliest(times)]
    cache = UsdGeom.XformCache()
    matrices = np.empty((len(codes), 4, 4))
    for i, code in enumerate(codes):
        cache.SetTime(code)
        matrices[i] = np.array(cache.GetLocalToWorldTransform(prim)).T
    u, singular, vt = np.linalg.svd(matrices[:, :3, :3])
    if not np.isfinite(singular).all() or singular.min() < 1e-12:
        raise InputError(f"{character.path}: {prim.GetPath()} stands under a zero scale.")
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    axes = Y_UP_FROM_Z_UP if str(UsdGeom.GetStageUpAxis(stage)) == "Z" else np.eye(3)
    cm = 100.0 * UsdGeom.GetStageMetersPerUnit(stage)
    return World(
        scale=float(np.exp(np.log(singular[0]).mean())) * cm,
        rotation=axes @ u @ vt,
        translation=matrices[:, :3, 3] @ axes.T * cm,
        axes=axes,
    )


def world_problems(skeleton: Usd.Prim) -> tuple[Problem, ...]:
    """Return what a clip cannot represent of the transforms above a skeleton."""
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(skeleton)
    linear = np.array(matrix)[:3, :3]
    singular = np.linalg.svd(linear, compute_uv=False)
    where = str(skeleton.GetPath())
    problems = []
    if singular.max() > singular.min() * (1.0 + UNIFORM_SCALE_TOLERANCE):
        problems.append(
            Problem("non-uniform-scale", "a non-uniform scale stands above the skeleton", where)
        )
    if np.linalg.det(linear) < 0:
        problems.append(
            Problem("mirrored", "a mirroring stands above the skeleton: sides may swap", where)
        )
    return tuple(problems)


def _earliest(times: Array | None) -> Usd.TimeCode:
    return Usd.TimeCode.EarliestTime() if times is None else Usd.TimeCode(times[0])


def _moves(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False
