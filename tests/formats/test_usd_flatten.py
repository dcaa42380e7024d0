"""Stages as one file: all that is composed, whichever variants are selected."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from builders import stages
from builders.cli_runner import run
from conftest import REPOSITORY
from oracles.composition import assert_composes_alike
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from usdhand.formats.usd.check import check_file
from usdhand.formats.usd.composed import variant_places
from usdhand.formats.usd.convert import StageEdit, motion_variants, placed, write_placed
from usdhand.formats.usd.flatten import flat_layer
from usdhand.formats.usd.read import clip_from_character
from usdhand.formats.usd.stage import find_character

TALK = REPOSITORY / "samples" / "conversations" / "talk_01_body.usdc"
LOOKS = ("red", "blue")


def with_looks(path: Path, prim: str = "/Hero/Skin", name: str = "look") -> Path:
    """Give a file a mesh whose colour is one of two variants', and whose targets are inside."""
    stage = stages.edited(path)
    mesh = UsdGeom.Mesh.Define(stage, prim).GetPrim()
    mesh.CreateRelationship("about").SetTargets([stages.SKELETON])
    variants = mesh.GetVariantSets().AddVariantSet(name)
    for look in LOOKS:
        variants.AddVariant(look)
        variants.SetVariantSelection(look)
        with variants.GetVariantEditContext():
            mesh.CreateAttribute("colour", Sdf.ValueTypeNames.String).Set(look)
            stage.DefinePrim(f"{prim}/{look}", "Scope")
    stage.GetRootLayer().comment = "Made by hand."
    stage.Save()
    return path


def local(folder: Path) -> Path:
    return with_looks(stages.character(folder / "in.usda"))


def sublayered(folder: Path) -> Path:
    asset = with_looks(stages.character(folder / "asset.usda", rate=48.0))
    return stages.sublayering(folder / "in.usda", asset, offset=Sdf.LayerOffset(3.0), rate=24.0)


def referenced(folder: Path) -> Path:
    asset = with_looks(stages.character(folder / "asset.usda", rate=48.0))
    return stages.referencing(folder / "in.usda", asset, offset=Sdf.LayerOffset(2.0))


def payload(folder: Path) -> Path:
    asset = with_looks(stages.character(folder / "asset.usda"))
    return stages.referencing(folder / "in.usda", asset, how="payload")


def instance(folder: Path) -> Path:
    asset = with_looks(stages.character(folder / "asset.usda"))
    return stages.referencing(folder / "in.usda", asset, instanceable=True)


def selected_above(folder: Path) -> Path:
    """The file over the asset has another selection, and opinions of its own in a variant."""
    path = referenced(folder)
    stage = stages.edited(path)
    mesh = stage.GetPrimAtPath("/Hero/Skin")
    look = mesh.GetVariantSets().GetVariantSet("look")
    look.SetVariantSelection("blue")
    with look.GetVariantEditContext():
        mesh.CreateAttribute("shade", Sdf.ValueTypeNames.String).Set("dark")
    stage.Save()
    return path


def through_variants(folder: Path) -> Path:
    """Each variant brings in a file, which refers to another, with classes and other rates."""
    (folder / "sub").mkdir()
    inner = with_looks(stages.character(folder / "sub" / "inner.usda", rate=30.0))
    stage = stages.edited(inner)
    base = stage.CreateClassPrim("/_Base")
    base.CreateAttribute("inherited", Sdf.ValueTypeNames.Int).Set(7)
    stage.GetPrimAtPath("/Hero/Skin").GetInherits().AddInherit("/_Base")
    stage.Save()
    path = stages.character(folder / "in.usda")
    outers = [
        stages.referencing(
            folder / "sub" / f"{look}.usda", inner, offset=Sdf.LayerOffset(5.0 * i), rate=60.0
        )
        for i, look in enumerate(LOOKS)
    ]
    stage = stages.edited(path)
    prop = stage.DefinePrim("/Hero/Prop")
    kind = prop.GetVariantSets().AddVariantSet("kind")
    for look, outer in zip(LOOKS, outers, strict=True):
        kind.AddVariant(look)
        kind.SetVariantSelection(look)
        with kind.GetVariantEditContext():
            prop.GetReferences().AddReference(stages.relative(outer, path))
    stage.Save()
    return path


def leading_out(folder: Path) -> Path:
    """An asset whose animation and shader are outside of what is referenced: they do not come."""
    asset = with_looks(stages.character(folder / "asset.usda"))
    stage = stages.edited(asset)
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, stages.ANIMATION, layer, "/Loose")
    stages.bind(stage.GetPrimAtPath(stages.SKELETON), "/Loose")
    skin = stage.GetPrimAtPath("/Hero/Skin")
    value = skin.CreateAttribute("inputs:x", Sdf.ValueTypeNames.Float)
    value.SetConnections(["/Loose.outputs:x", "/Hero/Skel.outputs:x"])
    stage.Save()
    return stages.referencing(folder / "in.usda", asset)


SOURCES: list[Callable[[Path], Path]] = [
    local, sublayered, referenced, payload, instance, selected_above, through_variants,
    leading_out,
]  # fmt: skip


def composed(stage: Usd.Stage) -> dict[str, Any]:
    """Everything that is on a stage."""
    result: dict[str, Any] = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        result[str(prim.GetPath())] = prim.GetTypeName(), prim.GetAppliedSchemas()
        for attribute in prim.GetAttributes():
            times = attribute.GetTimeSamples()
            values = [str(attribute.Get(t)) for t in times or [Usd.TimeCode.Default()]]
            result[str(attribute.GetPath())] = [round(t, 9) for t in times], values
            result[f"{attribute.GetPath()} connections"] = attribute.GetConnections()
        for relationship in prim.GetRelationships():
            result[str(relationship.GetPath())] = relationship.GetForwardedTargets()
    return result


def selections(stage: Usd.Stage) -> list[tuple[Sdf.Path, str, str]]:
    """All variants that may be selected, those inside instances left out."""
    return [
        (prim.GetPath(), name, variant)
        for prim, name in variant_places(stage)
        if not prim.IsInstanceProxy() and not str(prim.GetPath()).startswith("/Embedded")
        for variant in prim.GetVariantSets().GetVariantSet(name).GetVariantNames()
    ]


def assert_same_in_all_variants(a: Usd.Stage, b: Usd.Stage) -> None:
    assert variant_places(a)
    assert variant_places(b)
    assert composed(a) == composed(b)
    assert selections(a) == selections(b)
    for path, name, variant in selections(a):
        for stage in (a, b):
            stage.SetEditTarget(stage.GetSessionLayer())
            stage.GetPrimAtPath(path).GetVariantSets().SetSelection(name, variant)
        assert composed(a) == composed(b), (path, name, variant)


@pytest.mark.parametrize("rate", [None, 24.0, 60.0])
@pytest.mark.parametrize("how", ["reference", "payload"])
def test_what_a_sublayer_of_another_rate_refers_to_keeps_its_time(
    how: str, rate: float | None, tmp_path: Path
) -> None:
    asset = with_looks(stages.character(tmp_path / "asset.usda", rate=48.0))
    layout = stages.referencing(
        tmp_path / "layout.usda", asset, how=how, rate=30.0, offset=Sdf.LayerOffset(2.0)
    )
    path = stages.sublayering(tmp_path / "in.usda", layout, rate=rate, offset=Sdf.LayerOffset(1.0))
    target = tmp_path / "out.usdc"
    run("convert", path, "-o", target)
    before, after = (Usd.Stage.Open(str(p)) for p in (path, target))
    assert_composes_alike(before, after)
    assert_same_in_all_variants(before, after)


def test_long_chains_of_files_are_no_recursion(tmp_path: Path) -> None:
    path = local(tmp_path)
    for number in range(400):
        path = stages.referencing(tmp_path / f"{number}.usda", path)
    stage = Usd.Stage.Open(str(path))
    depth = sys.getrecursionlimit()
    sys.setrecursionlimit(250)
    try:
        flat, lost = flat_layer(stage)
    finally:
        sys.setrecursionlimit(depth)
    assert not lost
    assert_composes_alike(stage, Usd.Stage.Open(flat))


def test_values_count_for_more_than_variants(tmp_path: Path) -> None:
    """A class that a file between adds to has no equal in one file."""
    asset = with_looks(stages.character(tmp_path / "asset.usda"))
    middle = stages.referencing(tmp_path / "middle.usda", asset)
    for path, value in ((asset, 1), (middle, 2)):
        stage = stages.edited(path)
        base = stage.CreateClassPrim("/_Base")
        base.CreateAttribute("inherited", Sdf.ValueTypeNames.Int).Set(value)
        if path == asset:
            stage.GetPrimAtPath("/Hero/Skin").GetInherits().AddInherit("/_Base")
        stage.Save()
    stage = Usd.Stage.Open(str(stages.referencing(tmp_path / "in.usda", middle)))
    flat, [lost] = flat_layer(stage)
    assert lost.code == "variants"
    assert "/Hero/Skin.inherited would not stay the same" in lost.message
    assert Usd.Stage.Open(flat).GetAttributeAtPath("/Hero/Skin.inherited").Get() == 2
    assert_composes_alike(stage, Usd.Stage.Open(flat))


@pytest.mark.parametrize("source", SOURCES)
def test_every_variant_composes_to_the_same(source: Callable[[Path], Path], tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(source(tmp_path)))
    flat, lost = flat_layer(stage)
    assert not lost
    assert not any(flat.GetCompositionAssetDependencies())
    assert_same_in_all_variants(stage, Usd.Stage.Open(flat))


@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_a_converted_file_stands_alone_with_its_variants(suffix: str, tmp_path: Path) -> None:
    folder = tmp_path / "source"
    folder.mkdir()
    path = selected_above(folder)
    target, control = tmp_path / f"alone.{suffix}", tmp_path / "control"
    result = run("convert", path, "-o", target)
    assert "variant" not in result.output
    shutil.copytree(folder, control)
    shutil.rmtree(folder)
    stage = Usd.Stage.Open(str(target))
    skin = stage.GetPrimAtPath("/Hero/Skin")
    look = skin.GetVariantSets().GetVariantSet("look")
    assert look.GetVariantSelection() == "blue"
    assert_same_in_all_variants(Usd.Stage.Open(str(control / "in.usda")), stage)
    assert not [f for f in check_file(target) if f.severity == "error"]


def test_the_comment_of_a_file_is_kept(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "plain.usda")
    stage = stages.edited(path)
    stage.GetRootLayer().comment = "Made by hand."
    stage.Save()
    for source in (path, local(tmp_path)):
        target = tmp_path / f"{source.stem}_out.usda"
        run("convert", source, "-o", target)
        assert Sdf.Layer.FindOrOpen(str(target)).comment == "Made by hand."


def relocated(folder: Path) -> Path:
    path = referenced(folder)
    layer = Sdf.Layer.FindOrOpen(str(path))
    layer.relocates = [("/Hero/Skin", "/Hero/Fell")]
    layer.Save()
    return path


def clipped(folder: Path) -> Path:
    path = local(folder)
    stage = stages.edited(path)
    clips = Usd.ClipsAPI(stage.GetPrimAtPath("/Hero"))
    clips.SetClipAssetPaths([Sdf.AssetPath("./clip.usda")])
    clips.SetClipPrimPath("/Hero")
    stage.Save()
    return path


def inheriting(folder: Path) -> Path:
    """A class of the asset that the file over it adds to."""
    path = referenced(folder)
    for name in ("asset.usda", "in.usda"):
        stage = stages.edited(folder / name)
        prim = stage.CreateClassPrim("/_Base")
        prim.CreateAttribute(f"of_{name[0]}", Sdf.ValueTypeNames.Int).Set(1)
        if name == "asset.usda":
            stage.GetPrimAtPath("/Hero/Skin").GetInherits().AddInherit("/_Base")
        stage.Save()
    return path


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        (relocated, "relocated"),
        (clipped, "has value clips"),
        (inheriting, "inherits /_Base of the file over it"),
    ],
)
def test_variants_that_cannot_be_kept_are_said(
    source: Callable[[Path], Path], reason: str, tmp_path: Path
) -> None:
    character = placed(find_character(source(tmp_path)), StageEdit())
    target = tmp_path / "out.usda"
    [lost] = write_placed(character, clip_from_character(character), target, edited=False)
    assert lost.code == "variants"
    assert reason in lost.message
    assert "look" in lost.where
    a, b = composed(character.stage), composed(Usd.Stage.Open(str(target)))
    assert a.keys() == b.keys()  # as it is selected, all is there


def test_a_file_that_is_missing_is_no_reason_to_fail(tmp_path: Path) -> None:
    path = local(tmp_path)
    stage = stages.edited(path)
    stage.GetPrimAtPath("/Hero/Skin").GetReferences().AddReference("./nowhere.usda")
    stage.Save()
    target = tmp_path / "out.usda"
    run("convert", path, "-o", target)
    assert [name for _, name in variant_places(Usd.Stage.Open(str(target)))] == ["look"]


def moving(folder: Path) -> Path:
    """A character with two motions in variants of its animation, and a look that has none."""
    path = local(folder)
    stage = stages.edited(path)
    prim = stage.GetPrimAtPath(stages.ANIMATION)
    rotations = UsdSkel.Animation(prim).GetRotationsAttr()
    samples = {t: rotations.Get(t) for t in rotations.GetTimeSamples()}
    prim.RemoveProperty("rotations")
    variants = prim.GetVariantSets().AddVariantSet("take")
    for name in ("one", "two"):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            attribute = UsdSkel.Animation(prim).CreateRotationsAttr()
            for time, values in samples.items():
                attribute.Set(values if name == "one" else values[::-1], time)
    variants.SetVariantSelection("two")
    stage.Save()
    return path


def bound_by_variant(folder: Path) -> Path:
    """A variant of the character says which animation it plays."""
    path = local(folder)
    stage = stages.edited(path)
    hero = stage.GetPrimAtPath("/Hero")
    Sdf.CopySpec(stage.GetRootLayer(), stages.ANIMATION, stage.GetRootLayer(), "/Hero/Other")
    stage.GetPrimAtPath(stages.SKELETON).RemoveProperty("skel:animationSource")
    variants = hero.GetVariantSets().AddVariantSet("take")
    for name, animation in (("one", "/Hero/Other"), ("two", stages.ANIMATION)):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            stages.bind(hero, animation)
    stage.Save()
    return path


@pytest.mark.parametrize("source", [moving, bound_by_variant])
def test_edited_motion_is_the_selected_variants_and_that_is_said(
    source: Callable[[Path], Path], tmp_path: Path
) -> None:
    character = placed(find_character(source(tmp_path)), StageEdit())
    [(path, name, selection)] = motion_variants(character)
    assert (name, selection) == ("take", "two")
    clip = clip_from_character(character)
    target = tmp_path / "out.usda"
    [lost] = write_placed(character, clip, target, edited=True)
    assert lost.code == "variants"
    assert lost.where == str(path)
    assert "variant 'two' of 'take'" in lost.message
    stage = Usd.Stage.Open(str(target))
    names = {name for _, name in variant_places(stage)}
    assert "look" in names
    # No variant is left that shows motion as it was before.
    assert not motion_variants(find_character(target))
    assert ("take" in names) == (source is bound_by_variant)


def test_edits_of_time_and_place_keep_all_motions(tmp_path: Path) -> None:
    path = moving(tmp_path)
    target = tmp_path / "out.usda"
    run("convert", path, "-o", target, "--start", 100, "--up", "Z", "--scale", 2)
    before, after = (Usd.Stage.Open(str(p)) for p in (path, target))
    for take in ("one", "two"):
        values = []
        for stage in (before, after):
            prim = stage.GetPrimAtPath(stages.ANIMATION)
            prim.GetVariantSets().SetSelection("take", take)
            rotations = UsdSkel.Animation(prim).GetRotationsAttr()
            times = rotations.GetTimeSamples()
            values.append([str(rotations.Get(t)) for t in times])
        assert values[0] == values[1]
        assert times == [t + 99 for t in stages.TIMES]
    assert UsdGeom.GetStageUpAxis(after) == "Z"
    size = UsdGeom.XformCache().GetLocalToWorldTransform(after.GetPrimAtPath("/Hero"))
    assert Gf.Transform(size).GetScale() == Gf.Vec3d(2)


@pytest.mark.parametrize("flatten", [False, True])
def test_alternatives_of_fill_are_there_in_one_file(flatten: bool, tmp_path: Path) -> None:
    library, filled, alone = (tmp_path / f"{n}.usdc" for n in ("lib", "filled", "alone"))
    gestures = sorted((REPOSITORY / "samples" / "gestures").glob("*.usdc"))[:6]
    run("library", "build", *gestures, "-o", library)
    options = ["--flatten"] if flatten else []
    run("fill", TALK, "--library", library, "-o", filled, "--alternatives", 3, *options)
    run("convert", filled, "-o", alone)
    stage = Usd.Stage.Open(str(alone))
    assert not any(stage.GetRootLayer().GetCompositionAssetDependencies())
    assert_same_in_all_variants(Usd.Stage.Open(str(filled)), stage)
    character = find_character(alone)  # holds the stage too
    animation = character.animation
    assert animation is not None
    assert animation.GetVariantSets().GetNames() == ["fingers"]
    assert len(animation.GetVariantSets().GetVariantSet("fingers").GetVariantNames()) == 3
    assert not [f for f in check_file(alone) if f.severity == "error"]
    # A file without variants has no use for what was embedded for their sake.
    plain = tmp_path / "plain.usdc"
    run("convert", alone, "-o", plain, "--trim", "1:20")
    layer = Sdf.Layer.FindOrOpen(str(plain))
    assert [p.name for p in layer.rootPrims] == ["Ada"]
