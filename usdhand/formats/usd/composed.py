"""What two stages compose to, compared value by value."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pxr import Sdf, Usd

from usdhand.formats.usd.stage import compose

Selection = tuple[Sdf.Path, str, str]  # a prim, its variant set, a variant
_JUST = 1e-7  # time codes after a sample
_TIME_TYPES = ("timecode", "timecode[]")  # rounding moves these as it moves times


def first_difference(one: Sdf.Layer, other: Sdf.Layer, variants: bool) -> str | None:
    """Return where the stages of two root layers differ, None if they show the same.

    Compared are the prims, what they are, and all values of their attributes at their own times,
    targets and connections; as selected, and if ``variants`` for each other variant as well.
    """
    a, b = compose(one), compose(other)  # with session layers of their own
    for chosen in selections(a) if variants else [()]:
        _select(b, chosen)
        top = chosen[-1][0] if chosen else Sdf.Path.absoluteRootPath
        found = _difference(a.GetPrimAtPath(top), b.GetPrimAtPath(top))
        if found is not None:
            return " with ".join([found, *(f"variant {v} of {name}" for _, name, v in chosen)])
    return None


def selections(stage: Usd.Stage) -> Iterator[tuple[Selection, ...]]:
    """Select each variant of a stage in its session layer, and those that only come up by others.

    First there is nothing selected anew, which is ``()``; last it is so again.
    """
    seen: set[tuple[Sdf.Path, str]] = set()
    pending: list[tuple[Selection, ...]] = [()]
    while pending:
        chosen = pending.pop()
        _select(stage, chosen)
        yield chosen
        top = chosen[-1][0] if chosen else Sdf.Path.absoluteRootPath
        for prim, name in _variant_sets(stage.GetPrimAtPath(top), Usd.PrimAllPrimsPredicate):
            if (prim.GetPath(), name) in seen:
                continue
            seen.add((prim.GetPath(), name))
            there = prim.GetVariantSets().GetVariantSet(name)
            pending += [
                (*chosen, (prim.GetPath(), name, variant))
                for variant in there.GetVariantNames()
                if variant != there.GetVariantSelection()
            ]
    _select(stage, ())


@contextmanager
def selected(stage: Usd.Stage, chosen: Iterable[Selection]) -> Iterator[None]:
    """Select variants in a stage's session layer for a while."""
    _select(stage, chosen)
    try:
        yield
    finally:
        _select(stage, ())


def variant_places(stage: Usd.Stage) -> list[tuple[Usd.Prim, str]]:
    """Prims of a stage and the names of their variant sets; what instances share comes once."""
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
    found: dict[tuple[Sdf.Path, str], tuple[Usd.Prim, str]] = {}
    for prim, name in _variant_sets(stage.GetPseudoRoot(), everything):
        shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        found.setdefault((shared.GetPath(), name), (prim, name))
    return list(found.values())


def _variant_sets(root: Usd.Prim, predicate: Any) -> list[tuple[Usd.Prim, str]]:
    return [
        (prim, name)
        for prim in Usd.PrimRange(root, predicate)
        for name in prim.GetVariantSets().GetNames()
    ]


def _select(stage: Usd.Stage, chosen: Iterable[Selection]) -> None:
    stage.GetSessionLayer().Clear()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for path, name, variant in chosen:
            stage.GetPrimAtPath(path).GetVariantSets().SetSelection(name, variant)


def _difference(a: Usd.Prim, b: Usd.Prim) -> str | None:
    """First path below two prims where they differ."""
    ranges = [Usd.PrimRange(prim, Usd.TraverseInstanceProxies()) for prim in (a, b)]
    prims, others = ({prim.GetPath(): prim for prim in each} for each in ranges)
    if differing := prims.keys() ^ others.keys():
        return str(min(differing))
    for path, prim in prims.items():
        if found := _prim_difference(prim, others[path]):
            return found
    return None


def _prim_difference(a: Usd.Prim, b: Usd.Prim) -> str | None:
    for what in (Usd.Prim.GetTypeName, Usd.Prim.GetAppliedSchemas, Usd.Prim.GetKind):
        if what(a) != what(b):
            return str(a.GetPath())
    names = a.GetAuthoredPropertyNames()
    if names != b.GetAuthoredPropertyNames():
        differing = set(names) ^ set(b.GetAuthoredPropertyNames())
        return f"{a.GetPath()}.{sorted(differing)[0]}" if differing else str(a.GetPath())
    for name in names:
        if not _same_property(a.GetProperty(name), b.GetProperty(name)):
            return str(a.GetPath().AppendProperty(name))
    return None


def _same_property(a: Usd.Property, b: Usd.Property) -> bool:
    if type(a) is not type(b):
        return False
    if isinstance(a, Usd.Relationship):
        return bool(a.GetTargets() == b.GetTargets())
    if a.GetConnections() != b.GetConnections() or a.GetTypeName() != b.GetTypeName():
        return False
    if a.HasSpline() or b.HasSpline():
        return bool(a.HasSpline() and b.HasSpline() and _same_spline(a.GetSpline(), b.GetSpline()))
    times, others = a.GetTimeSamples(), b.GetTimeSamples()
    if len(times) != len(others) or not all(map(_close, times, others)):
        return False
    of_type = a.GetTypeName()
    return _same(a.Get(), b.Get(), of_type) and all(
        _same(a.Get(t), b.Get(u), of_type)
        # USD may round the time of a sample to just before it, where another one holds.
        or _same(a.Get(t + _JUST), b.Get(u + _JUST), of_type)
        for t, u in zip(times, others, strict=True)
    )


def _same_spline(a: Any, b: Any) -> bool:
    knots, others = a.GetKnots(), b.GetKnots()
    times = list(knots.keys())
    if len(times) != len(others.keys()) or not all(map(_close, times, others.keys())):
        return False
    middles = [(s + t) / 2.0 for s, t in itertools.pairwise(times)]
    probes = [times[0] - 1.0, *times, *middles, times[-1] + 1.0] if times else []
    return all(_close(a.Eval(t) or 0.0, b.Eval(t) or 0.0) for t in probes)


def _same(a: Any, b: Any, of_type: Sdf.ValueTypeName) -> bool:
    if isinstance(a, Sdf.AssetPath) and isinstance(b, Sdf.AssetPath):
        return _file(a) == _file(b)
    if isinstance(a, Sdf.AssetPathArray) and isinstance(b, Sdf.AssetPathArray):
        return list(map(_file, a)) == list(map(_file, b))
    if a is None or b is None or a == b:
        return a is b or a == b
    if of_type not in _TIME_TYPES and not _holds_nan(a):
        return False
    x, y = np.asarray(a, float), np.asarray(b, float)
    tolerance = 1e-9 if of_type in _TIME_TYPES else 0.0
    return x.shape == y.shape and np.allclose(x, y, tolerance, tolerance, equal_nan=True)


def _file(asset: Sdf.AssetPath) -> str:
    """A file that is found, else the last name of the path: how it leads there may differ."""
    return str(asset.resolvedPath) or re.split(r"[/\[]", str(asset.path).rstrip("]"))[-1]


def _holds_nan(value: Any) -> bool:
    try:
        return bool(np.isnan(np.asarray(value, float)).any())
    except (TypeError, ValueError):
        return False


def _close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)
