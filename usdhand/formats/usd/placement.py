"""A whole stage turned to another up axis, and scaled."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from usdhand.errors import UsageError
from usdhand.formats.usd.composed import Selection, selected, selections
from usdhand.motion.rotations import Array

RESET = "!resetXformStack!"
TURN, SCALE = "xformOp:rotateX:usdhandUpAxis", "xformOp:scale:usdhandScale"
EXACT = 1e-9
Worlds = dict[Sdf.Path, Array]


@dataclass(frozen=True)
class Ops:
    """The transform ops that a prim is to have: their order, and values of those that are new.

    A light that follows the up axis is to have the pole axis ``pole`` instead, if there is one.
    """

    order: tuple[str, ...]
    values: Mapping[str, float] = field(default_factory=dict)
    pole: str = ""


Plan = dict[Sdf.Path, Ops]


def turn_and_scale(stage: Usd.Stage, up: str | None, scale: float, of: Path) -> None:
    """Turn a stage's up axis to ``up``, "Y" or "Z", and scale all that is on it.

    Transforms on the uppermost prims that have any do it, and on those that reset the transform
    stack, so that skeletons, meshes, cameras and lights are each placed once in the world.

    Raises
    ------
    UsageError
        about the file ``of``, if not all variants can be placed.
    """
    old = str(UsdGeom.GetStageUpAxis(stage))
    turn = 0.0
    if up is not None and up != old:
        turn = 90.0 if up == "Z" else -90.0
        UsdGeom.SetStageUpAxis(stage, up)
    if turn == 0.0 and scale == 1.0:
        return
    # All is planned before anything is authored, since prims may refer to each other.
    alone = list(selections(stage))
    plans: dict[tuple[Selection, ...], Plan] = {}
    before: dict[tuple[Selection, ...], Worlds] = {}
    for chosen in (*alone, *_pairs(alone)):
        with selected(stage, chosen):
            plans[chosen], before[chosen] = _planned(stage, turn, scale, old), _worlds(stage)
    base = plans[()]
    varying = _varying(base, {chosen[0]: plans[chosen] for chosen in alone if len(chosen) == 1})
    inside = {path for paths in varying.values() for path in paths}
    _carry_out(stage, {path: ops for path, ops in base.items() if path not in inside})
    for (place, name), paths in varying.items():
        chosen_now = stage.GetPrimAtPath(place).GetVariantSet(name).GetVariantSelection()
        for variant in stage.GetPrimAtPath(place).GetVariantSet(name).GetVariantNames():
            selection = (place, name, variant)
            plan = base if variant == chosen_now else plans[(selection,)]
            with selected(stage, [selection]):
                target = stage.GetPrimAtPath(place).GetVariantSet(name).GetVariantEditTarget()
                with Usd.EditContext(stage, target):
                    _carry_out(stage, {path: plan[path] for path in paths if path in plan})
    placing = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d.XAxis(), turn))
    placing *= Gf.Matrix4d().SetScale(scale)
    for chosen, plan in plans.items() if len(plans) > 1 else ():
        wanted = {path: matrix @ np.array(placing) for path, matrix in before[chosen].items()}
        with selected(stage, chosen):
            if place := _misplaced(stage, plan, wanted):
                raise UsageError(_refusal(of, place, chosen))


def _pairs(chosen: Iterable[tuple[Selection, ...]]) -> list[tuple[Selection, ...]]:
    """Variants of two sets that may bear on one prim."""
    alone = [each[0] for each in chosen if len(each) == 1]
    return [
        (a, b)
        for a, b in itertools.combinations(alone, 2)
        if a[:2] != b[:2] and (a[0].HasPrefix(b[0]) or b[0].HasPrefix(a[0]))
    ]


def _planned(stage: Usd.Stage, turn: float, scale: float, old: str) -> Plan:
    plan = {
        prim.GetPath(): _placed(prim, turn, scale) if top else Ops(_order(prim))
        for prim, top in _xformables(stage)
    }
    for prim in filter(_follows_up_axis, _every(stage)) if turn else ():
        plan[prim.GetPath()] = replace(plan[prim.GetPath()], pole=old)
    return plan


def _varying(
    base: Plan, plans: Mapping[Selection, Plan]
) -> dict[tuple[Sdf.Path, str], list[Sdf.Path]]:
    """Prims whose ops depend on a variant set, for each of these that has any."""
    found: dict[tuple[Sdf.Path, str], dict[Sdf.Path, None]] = {}
    for (place, name, _), plan in plans.items():
        for path in (*base, *plan):
            if path.HasPrefix(place) and base.get(path) != plan.get(path):
                found.setdefault((place, name), {})[path] = None
    return {key: list(paths) for key, paths in found.items()}


def _carry_out(stage: Usd.Stage, plan: Plan) -> None:
    for path, ops in plan.items():
        if ops.values or ops.pole:
            _open_instances(stage, path)
    for path, ops in plan.items():
        if ops.values:
            _author(stage.GetPrimAtPath(path), ops)
        if ops.pole:
            stage.GetPrimAtPath(path).GetAttribute("poleAxis").Set(ops.pole)
    # What refers to a prim that is placed now may be below another one.
    for path, ops in plan.items():
        if not ops.values and _order(stage.GetPrimAtPath(path)) != ops.order:
            _open_instances(stage, path)
            _author(stage.GetPrimAtPath(path), ops)


def _worlds(stage: Usd.Stage) -> Worlds:
    """World transforms (4, 4) of all prims that have one, at the earliest time."""
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    return {
        prim.GetPath(): np.array(cache.GetLocalToWorldTransform(prim))
        for prim, _ in _xformables(stage)
    }


def _misplaced(stage: Usd.Stage, plan: Plan, wanted: Worlds) -> Sdf.Path | None:
    """First prim that has not the ops of a plan, or that they do not place where it is wanted."""
    worlds = _worlds(stage)
    for path, matrix in wanted.items():
        close = EXACT * max(1.0, float(np.abs(matrix).max()))
        if path not in worlds or not np.allclose(worlds[path], matrix, EXACT, close):
            return path
        if _order(stage.GetPrimAtPath(path)) != plan[path].order:
            return path
    return None


def _refusal(of: Path, path: Sdf.Path, chosen: Iterable[Selection]) -> str:
    names = " and ".join(f"variant '{variant}' of '{name}'" for _, name, variant in chosen)
    return (
        f"{of}: {path} cannot be turned or scaled with {names or 'no variant'} selected, since "
        "its transforms depend on several variant sets. Convert without --up and --scale, or "
        "flatten the file first with the variants that are wanted."
    )


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
    with Usd.EditContext(stage, stage.GetRootLayer()):
        for above in path.GetPrefixes()[:-1]:
            prim = stage.GetPrimAtPath(above)
            if prim.IsInstance():
                prim.SetInstanceable(False)
