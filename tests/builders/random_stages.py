"""Random stages of several files, drawn by hypothesis: arcs, rates, offsets, variants, clips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from hypothesis import strategies as st
from pxr import Gf, Sdf, Ts, Vt

T = TypeVar("T")
Draw = Callable[[st.SearchStrategy[T]], T]
TYPES = Sdf.ValueTypeNames

RATES = (None, 24.0, 30.0, 48.0, 12.5)
CLASSES = ("/_Base", "/_Look")
PLACES = ("/A", "/A/K", "/A/K/L", "/B", *CLASSES, "/_Base/K")
TARGETS = ("/A", "/A/K", "/B", "/A/K.x")
numbers = st.integers(-40, 40).map(float)
times = st.lists(st.integers(-10, 40), min_size=1, max_size=3, unique=True)
offsets = st.builds(
    Sdf.LayerOffset, st.sampled_from([0.0, 3.0, -7.5]), st.sampled_from([1.0, 0.5, 2.0])
)


@dataclass(frozen=True, eq=False)
class Recipe:
    """A stage that is being drawn: its files in order, each of which refers to later ones only."""

    folder: Path
    names: tuple[str, ...]
    draw: Draw[Any]

    def chance(self, one_in: int) -> bool:
        """Whether something happens; never, in the simplest stage."""
        return bool(self.draw(st.integers(0, one_in - 1)) == one_in - 1)


def random_stage(folder: Path, draw: Draw[Any]) -> Path:
    """Write a random stage to a folder and return its root file."""
    count = draw(st.integers(2, 3))
    recipe = Recipe(folder, tuple(f"file{i}.usda" for i in range(count)), draw)
    (folder / "pixel.png").write_bytes(b"no pixel")
    _write_clip(folder / "clip.usda", draw(st.sampled_from(RATES)))
    for number in range(count):
        _write_file(recipe, number)
    return folder / recipe.names[0]


def _write_file(recipe: Recipe, number: int) -> None:
    layer = Sdf.Layer.CreateNew(str(recipe.folder / recipe.names[number]))
    rate = recipe.draw(st.sampled_from(RATES))
    if rate is not None:
        layer.framesPerSecond = rate
        if not recipe.chance(4):
            layer.timeCodesPerSecond = rate
    if not recipe.chance(6):
        layer.defaultPrim = recipe.draw(st.sampled_from(["A", "B", "/A/K"]))
    later = recipe.names[number + 1 :]
    if later and recipe.chance(2):
        layer.subLayerPaths.append(f"./{recipe.draw(st.sampled_from(later))}")
        layer.subLayerOffsets[0] = recipe.draw(offsets)
    for place in PLACES:
        if place == "/A" or recipe.chance(2):
            prim = Sdf.CreatePrimInLayer(layer, place)
            _fill(recipe, prim, later)
            if recipe.chance(4):
                _add_variants(recipe, prim, later)
    for prim in layer.rootPrims:
        if str(prim.path) in CLASSES:
            prim.specifier = Sdf.SpecifierClass
    layer.Save()


def _fill(recipe: Recipe, prim: Sdf.PrimSpec, later: tuple[str, ...]) -> None:
    draw = recipe.draw
    if prim.path.IsPrimPath() and not recipe.chance(3):
        prim.specifier = Sdf.SpecifierDef
        if type_name := draw(st.sampled_from(["Xform", "Scope", ""])):
            prim.typeName = type_name
    for name in draw(st.lists(st.sampled_from(sorted(OPINIONS)), max_size=3, unique=True)):
        OPINIONS[name](recipe, prim, name)
    own_class = str(prim.path.GetPrimPath().GetPrefixes()[0]) in CLASSES
    if recipe.chance(3) and not own_class:
        paths = recipe.draw(st.sampled_from([prim.inheritPathList, prim.specializesList]))
        paths.prependedItems = [draw(st.sampled_from(CLASSES))]
    if later and recipe.chance(3):
        _add_arc(recipe, prim, draw(st.sampled_from(later)))
    if str(prim.path).startswith("/A") and recipe.chance(6):
        prim.referenceList.prependedItems = [Sdf.Reference("", "/B", draw(offsets))]
    if recipe.chance(8):
        prim.SetInfo("instanceable", True)
    if recipe.chance(8):
        _add_clips(recipe, prim)


def _add_arc(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    path = recipe.draw(st.sampled_from(["", "/A", "/A/K", "/B"]))
    offset = recipe.draw(offsets)
    if recipe.chance(3):
        prim.payloadList.prependedItems = [Sdf.Payload(f"./{name}", path, offset)]
    else:
        prim.referenceList.prependedItems = [Sdf.Reference(f"./{name}", path, offset)]


def _add_variants(recipe: Recipe, prim: Sdf.PrimSpec, later: tuple[str, ...]) -> None:
    name = recipe.draw(st.sampled_from(["look", "kind"]))
    prim.variantSetNameList.prependedItems = [name]
    variants = Sdf.VariantSetSpec(prim, name)
    for variant in ("one", "two"):
        _fill(recipe, Sdf.VariantSpec(variants, variant).primSpec, later)
    if not recipe.chance(4):
        prim.variantSelections[name] = recipe.draw(st.sampled_from(["one", "two"]))


def _attribute(prim: Sdf.PrimSpec, name: str, of_type: Sdf.ValueTypeName) -> Sdf.AttributeSpec:
    return Sdf.AttributeSpec(prim, name, of_type)


def _varying(
    of_type: Sdf.ValueTypeName, value: Callable[[float], Any]
) -> Callable[[Recipe, Sdf.PrimSpec, str], None]:
    def author(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
        attribute = _attribute(prim, name, of_type)
        layer, draw = prim.layer, recipe.draw
        if recipe.chance(3):
            attribute.default = value(draw(numbers))
        if not recipe.chance(3):
            for time in draw(times):
                blocked = recipe.chance(8)
                sample = Sdf.ValueBlock() if blocked else value(draw(numbers))
                layer.SetTimeSample(attribute.path, float(time), sample)

    return author


def _author_spline(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    attribute = _attribute(prim, name, TYPES.Double)
    spline = Ts.Spline("double")
    for time in recipe.draw(times):
        knot = Ts.Knot("double", Ts.CurveTypeBezier)
        knot.SetTime(float(time))
        knot.SetValue(recipe.draw(numbers))
        knot.SetNextInterpolation(
            recipe.draw(st.sampled_from([Ts.InterpHeld, Ts.InterpLinear, Ts.InterpCurve]))
        )
        spline.SetKnot(knot)
    attribute.spline = spline


def _author_still(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    _attribute(prim, name, TYPES.String).default = recipe.draw(st.sampled_from(["a", "b"]))


def _author_file(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    file = recipe.draw(st.sampled_from(["./clip.usda", "./pixel.png", ""]))
    _attribute(prim, name, TYPES.Asset).default = Sdf.AssetPath(file)


def _author_relationship(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    spec = Sdf.RelationshipSpec(prim, name, custom=True)
    spec.targetPathList.prependedItems = [recipe.draw(st.sampled_from(TARGETS))]


def _author_connection(recipe: Recipe, prim: Sdf.PrimSpec, name: str) -> None:
    spec = _attribute(prim, name, TYPES.Double)
    spec.connectionPathList.prependedItems = [recipe.draw(st.sampled_from(TARGETS))]


OPINIONS: dict[str, Callable[[Recipe, Sdf.PrimSpec, str], None]] = {
    "x": _varying(TYPES.Double, lambda v: v),
    "y": _varying(TYPES.Float3Array, lambda v: Vt.Vec3fArray([(v, 0, 1)] * 2)),
    "q": _varying(TYPES.Quatf, lambda v: Gf.Quatf(1, v, 0, 0).GetNormalized()),
    "t": _varying(TYPES.TimeCode, Sdf.TimeCode),
    "ts": _varying(TYPES.TimeCodeArray, lambda v: Sdf.TimeCodeArray([v, 1.0])),
    "spline": _author_spline,
    "name": _author_still,
    "file": _author_file,
    "about": _author_relationship,
    "inputs:in": _author_connection,
}


def _write_clip(path: Path, rate: float | None) -> None:
    layer = Sdf.Layer.CreateNew(str(path))
    if rate is not None:
        layer.timeCodesPerSecond = rate
    prim = Sdf.CreatePrimInLayer(layer, "/Clip")
    attribute = Sdf.AttributeSpec(prim, "x", TYPES.Double)
    for time, value in ((0.0, 1.0), (10.0, 30.0), (20.0, 5.0)):
        layer.SetTimeSample(attribute.path, time, value)
    layer.Save()


def _add_clips(recipe: Recipe, prim: Sdf.PrimSpec) -> None:
    """Let the attribute x come from two clips, one after the other."""
    start = recipe.draw(st.integers(-5, 5))
    cut, end = start + 12.0, start + 30.0
    clips = {
        "primPath": "/Clip",
        "assetPaths": Sdf.AssetPathArray([Sdf.AssetPath("./clip.usda")] * 2),
        "manifestAssetPath": Sdf.AssetPath("./clip.usda"),
        "active": Vt.Vec2dArray([(start, 0), (cut, 1)]),
        "times": Vt.Vec2dArray([(start, 0), (cut, 12), (cut, 0), (end, 18)]),
    }
    prim.SetInfo("clips", {"default": clips})
