"""What stands above a skeleton on its stage: placement, units, up axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from usdhand.errors import InputError
from usdhand.formats.above import scale_problems
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import affine, mean_scale, nearest_rotation, to_y_up
from usdhand.problems import Problem

PLAUSIBLE_CM = (1e-6, 1e9)  # of one unit


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

    @property
    def first(self) -> Array:
        """(4, 4) of the first frame, without the scale."""
        return affine(self.rotation[0], self.translation[0])


def world_above(skeleton: Usd.Prim, times: Array | None = None) -> World:
    """Return the transform above a skeleton, at each of ``times`` if something above moves.

    Raises
    ------
    InputError
        if it is no transform that could be undone.
    """
    stage = skeleton.GetStage()
    matrices = _matrices(skeleton, times)
    scales = mean_scale(matrices[:, :3, :3])
    if not scales.all():
        raise InputError(
            f"{stage.GetRootLayer().realPath}: {skeleton.GetPath()} is below a zero scale."
        )
    axes = to_y_up(str(UsdGeom.GetStageUpAxis(stage)))
    cm = 100.0 * UsdGeom.GetStageMetersPerUnit(stage)
    if not PLAUSIBLE_CM[0] < cm < PLAUSIBLE_CM[1]:
        raise InputError(
            f"{stage.GetRootLayer().realPath}: metersPerUnit is {cm / 100.0:g}, "
            "which is not plausible."
        )
    return World(
        scale=float(scales[0]) * cm,
        rotation=axes @ nearest_rotation(matrices[:, :3, :3]),
        translation=matrices[:, :3, 3] @ axes.T * cm,
        axes=axes,
    )


def world_problems(skeleton: Usd.Prim, times: Array | None = None) -> tuple[Problem, ...]:
    """Return what a clip cannot represent of the transforms above a skeleton."""
    return scale_problems(_matrices(skeleton, times)[:, :3, :3], str(skeleton.GetPath()))


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
            f"{prim.GetStage().GetRootLayer().realPath}: the transforms above {prim.GetPath()} "
            "have values that are not numbers."
        )
    return matrices


def _moves(prim: Usd.Prim) -> bool:
    while prim and not prim.IsPseudoRoot():
        xformable = UsdGeom.Xformable(prim)
        if xformable and xformable.TransformMightBeTimeVarying():
            return True
        prim = prim.GetParent()
    return False
