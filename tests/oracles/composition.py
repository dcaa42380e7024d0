"""Everything that a stage composes to, asked of USD one value at a time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

from pxr import Gf, Sdf, Usd, Vt

LEAST_GAP = 1e-3  # between two samples; a jump between value clips is narrower
JUST = 1e-7  # time codes
DIGITS = 1e-5  # of time codes in text
ADDED = ("/Embedded_", "/Flattened_Prototype_")  # what one file needs, and nothing else shows


def assert_composes_alike(a: Usd.Stage, b: Usd.Stage, *, targets: bool = True) -> None:
    """Assert that two stages have the same prims, and all of these the same values at all times."""
    prims, others = _prims(a), _prims(b)
    assert prims.keys() == others.keys()
    for path, prim in prims.items():
        other = others[path]
        assert prim.GetTypeName() == other.GetTypeName(), path
        assert prim.GetAppliedSchemas() == other.GetAppliedSchemas(), path
        assert prim.GetPropertyNames() == other.GetPropertyNames(), path
        for attribute in prim.GetAttributes():
            _assert_same_attribute(attribute, other.GetAttribute(attribute.GetName()))
        if not targets:
            continue
        for attribute in prim.GetAttributes():
            there = other.GetAttribute(attribute.GetName())
            assert attribute.GetConnections() == there.GetConnections(), attribute.GetPath()
        for relationship in prim.GetRelationships():
            there = other.GetRelationship(relationship.GetName())
            assert relationship.GetTargets() == there.GetTargets(), relationship.GetPath()


def moments(times: Sequence[float]) -> list[float]:
    """Samples' own times, moments between them, before them and after them."""
    between = [(s + t) / 2.0 for s, t in itertools.pairwise(times) if t - s > LEAST_GAP]
    return [*times, *between, times[0] - 1.0, times[-1] + 1.0] if times else []


def _prims(stage: Usd.Stage) -> dict[str, Usd.Prim]:
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    found = {str(prim.GetPath()): prim for prim in everything}
    return {path: prim for path, prim in found.items() if not path.startswith(ADDED)}


def _assert_same_attribute(a: Usd.Attribute, b: Usd.Attribute) -> None:
    path = a.GetPath()
    assert a.GetTypeName() == b.GetTypeName(), path
    times, others = a.GetTimeSamples(), b.GetTimeSamples()
    assert len(times) == len(others), (path, times, others)
    assert all(math.isclose(s, t, abs_tol=1e-6) for s, t in zip(times, others, strict=True)), path
    assert a.HasSpline() == b.HasSpline(), path
    if a.HasSpline():
        times = others = [float(t) for t in a.GetSpline().GetKnots().keys()]  # noqa: SIM118
    assert _alike(a.Get(), b.Get()), (path, a.Get(), b.Get())
    for s, t in zip(moments(times), moments(others), strict=True):
        assert _alike_about(a, s, b, t), (path, s, a.Get(s), b.Get(t))


def _alike_about(a: Usd.Attribute, s: float, b: Usd.Attribute, t: float) -> bool:
    """Whether values agree at a moment; USD may round an own time to just before its sample."""
    return any(_alike(a.Get(s + i), b.Get(t + j)) for i in (0.0, JUST) for j in (0.0, JUST))


def _alike(a: Any, b: Any) -> bool:
    if isinstance(a, Sdf.AssetPath) and isinstance(b, Sdf.AssetPath):
        return _file_name(a) == _file_name(b)
    if a is None or b is None or isinstance(a, (str, Vt.TokenArray, Vt.StringArray)):
        return bool(a == b)
    flat_a, flat_b = _floats(a), _floats(b)
    if isinstance(a, Gf.Quatf) and flat_a[0] * flat_b[0] < 0:
        flat_b = [-number for number in flat_b]  # half a turn may be made either way
    return len(flat_a) == len(flat_b) and all(
        math.isclose(x, y, rel_tol=DIGITS, abs_tol=DIGITS)
        for x, y in zip(flat_a, flat_b, strict=True)
    )


def _file_name(asset: Sdf.AssetPath) -> str:
    """Name of a file that is found: packages have copies."""
    return PurePath(asset.resolvedPath.rstrip("]")).name.split("[")[-1]


def _floats(value: Any) -> list[float]:
    if isinstance(value, Sdf.TimeCode):
        return [float(value.GetValue())]
    if hasattr(value, "GetReal"):
        return [float(value.GetReal()), *_floats(value.GetImaginary())]
    if hasattr(value, "__len__") and not isinstance(value, str):
        return [number for each in value for number in _floats(each)]
    return [float(value)]
