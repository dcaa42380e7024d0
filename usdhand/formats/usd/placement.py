"""A whole stage turned to another up axis, and scaled."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from pxr import Gf, Sdf, Usd, UsdGeom, Vt

RESET = "!resetXformStack!"
TURN, SCALE = "xformOp:rotateX:usdhandUpAxis", "xformOp:scale:usdhandScale"


@dataclass(frozen=True)
class Ops:
    """The transform ops that a prim is to have: their order, and values of those that are new."""

    order: tuple[str, ...]
    values: Mapping[str, float] = field(default_factory=dict)


def turn_and_scale(stage: Usd.Stage, up: str | None, scale: float) -> None:
    """Turn a stage's up axis to ``up``, "Y" or "Z", and scale all that is on it.

    Transforms on the uppermost prims that have any do it, and on those that reset the transform
    stack, so that skeletons, meshes, cameras and lights are each placed once in the world.
    """
    old = str(UsdGeom.GetStageUpAxis(stage))
    turn = 0.0
    if up is not None and up != old:
        turn = 90.0 if up == "Z" else -90.0
        UsdGeom.SetStageUpAxis(stage, up)
    if turn == 0.0 and scale == 1.0:
        return
    # All is planned before anything is authored, since prims may refer to each other.
    wanted = {
        prim.GetPath(): _placed(prim, turn, scale) if top else Ops(_order(prim))
        for prim, top in _xformables(stage)
    }
    domes = [prim.GetPath() for prim in _every(stage) if _follows_up_axis(prim)]
    for path in (*(path for path, ops in wanted.items() if ops.values), *(domes if turn else ())):
        _open_instances(stage, path)
    for path, ops in wanted.items():
        if ops.values:
            _author(stage.GetPrimAtPath(path), ops)
    for path in domes if turn else ():
        stage.GetPrimAtPath(path).GetAttribute("poleAxis").Set(old)
    # What refers to a prim that is placed now may be below another one.
    for path, ops in wanted.items():
        if not ops.values and _order(stage.GetPrimAtPath(path)) != ops.order:
            _open_instances(stage, path)
            _author(stage.GetPrimAtPath(path), ops)


def _every(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    yield from stage.Traverse(Usd.TraverseInstanceProxies())


def _xformables(stage: Usd.Stage) -> Iterator[tuple[Usd.Prim, bool]]:
    """All prims with a transform, and whether nothing above them places them."""
    below: set[Sdf.Path] = set()  # prims with a transform, and all that is below
    for prim in _every(stage):
        inside = prim.GetParent().GetPath() in below
        xformable = UsdGeom.Xformable(prim)
        if xformable:
            yield prim, not inside or RESET in _order(prim)
        if xformable or inside:
            below.add(prim.GetPath())


def _follows_up_axis(prim: Usd.Prim) -> bool:
    """Whether a light turns with the up axis by itself."""
    return bool(
        prim.GetTypeName() == "DomeLight_1" and prim.GetAttribute("poleAxis").Get() == "scene"
    )


def _order(prim: Usd.Prim) -> tuple[str, ...]:
    return tuple(map(str, UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get() or ()))


def _placed(prim: Usd.Prim, turn: float, scale: float) -> Ops:
    """Put a turn and a scale in front of a prim's ops; what did so before takes them up."""
    order = _order(prim)
    start = len(order) - order[::-1].index(RESET) if RESET in order else 0
    reset, own = order[:start], list(order[start:])
    values: dict[str, float] = {}
    for base, neutral in ((TURN, 0.0), (SCALE, 1.0)):
        if own and own[0].startswith(base) and not prim.GetAttribute(own[0]).GetNumTimeSamples():
            name, before = own[0], _value(prim, own.pop(0))
        else:
            name, before = _free(prim, base), neutral
        after = before + turn if base == TURN else before * scale
        if after != neutral or before != neutral:
            values[name] = after
    return Ops((*reset[-1:], *values, *own), values)


def _value(prim: Usd.Prim, name: str) -> float:
    value = prim.GetAttribute(name).Get()
    return float(value[0]) if name.startswith(SCALE) else float(value)


def _free(prim: Usd.Prim, base: str) -> str:
    names = (base + (str(number) if number > 1 else "") for number in itertools.count(1))
    return next(name for name in names if not prim.HasAttribute(name))


def _author(prim: Usd.Prim, ops: Ops) -> None:
    for name, value in ops.values.items():
        scales = name.startswith(SCALE)
        kind = Sdf.ValueTypeNames.Double3 if scales else Sdf.ValueTypeNames.Double
        attribute = prim.CreateAttribute(name, kind, custom=False)
        attribute.Set(Gf.Vec3d(value) if scales else value)
    UsdGeom.Xformable(prim).CreateXformOpOrderAttr().Set(Vt.TokenArray(ops.order))


def _open_instances(stage: Usd.Stage, path: Sdf.Path) -> None:
    """Make a prim editable: nothing can be authored inside an instance."""
    for above in path.GetPrefixes()[:-1]:
        prim = stage.GetPrimAtPath(above)
        if prim.IsInstance():
            prim.SetInstanceable(False)
