"""What stands above a skeleton on its stage: placement, units, up axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from usdhand.errors import InputError
from usdhand.motion import Problem
from usdhand.motion.rotations import Y_UP_FROM_Z_UP, Array

UNIFORM_SCALE_TOLERANCE = 0.01


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


def world_above(skeleton: Usd.Prim, times: Array | None = None) -> World:
    """Return the transform above a skeleton, at each of ``times`` if something above moves.

    Raises
    ------
    InputError
        if it is no transform that could be undone.
    """
    stage = skeleton.GetStage()
    matrices = _matrices(skeleton, times)
    u, singular, vt = np.linalg.svd(matrices[:, :3, :3])
    if singular.min() < 1e-12:
        raise InputError(
            f"{stage.GetRootLayer().realPath}: {skeleton.GetPath()} stands under a zero scale."
        )
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]
    axes = Y_UP_FROM_Z_UP if str(UsdGeom.GetStageUpAxis(stage)) == "Z" else np.eye(3)
    cm = 100.0 * UsdGeom.GetStageMetersPerUnit(stage)
    if not 0 < cm < np.inf:
        raise InputError(f"{stage.GetRootLayer().realPath}: metersPerUnit is {cm / 100.0:g}.")
    return World(
        scale=float(np.exp(np.log(singular[0]).mean())) * cm,
        rotation=axes @ u @ vt,
        translation=matrices[:, :3, 3] @ axes.T * cm,
        axes=axes,
    )


def world_problems(skeleton: Usd.Prim, times: Array | None = None) -> tuple[Problem, ...]:
    """Return what a clip cannot represent of the transforms above a skeleton."""
    linear = _matrices(skeleton, times)[:, :3, :3]
    singular = np.linalg.svd(linear, compute_uv=False)
    largest, smallest = singular.max(axis=1), singular.min(axis=1)
    uneven = UNIFORM_SCALE_TOLERANCE * smallest
    found = {
        "zero-scale": ((smallest < 1e-12).any(), "a zero scale stands above the skeleton"),
        "non-uniform-scale": (
            (largest > smallest + uneven).any(),
            "a non-uniform scale stands above the skeleton: bones are read with its mean",
        ),
        "mirrored": (
            (np.linalg.det(linear) < 0).any(),
            "a mirroring stands above the skeleton: sides may swap",
        ),
        "animated-scale": (
            (np.abs(smallest - smallest[0]) > uneven[0]).any(),
            "the scale above the skeleton changes over time: that of the first frame is read",
        ),
    }
    where = str(skeleton.GetPath())
    return tuple(Problem(code, text, where) for code, (there, text) in found.items() if there)


def _matrices(prim: Usd.Prim, times: Array | None) -> Array:
    """Local-to-world matrices (n, 4, 4) for column vectors; one where nothing above moves."""
    if times is None:
        codes = [Usd.TimeCode.EarliestTime()]
    else:
        codes = [Usd.TimeCode(time) for time in (times if _moves(prim) else times[:1])]
    cache = UsdGeom.XformCache()
    matrices = np.empty((len(codes), 4, 4))
    for i, code in enumerate(codes):
        cache.SetTime(code)
        matrices[i] = np.array(cache.GetLocalToWorldTransform(prim)).T
    if not np.isfinite(matrices).all():
        raise InputError(
            f"{prim.GetStage().GetRootLayer().realPath}: not-a-number in the transforms above "
            f"{prim.GetPath()}."
        )
    return matrices


def _moves(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False
