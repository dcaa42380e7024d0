"""Up axis and scale: whatever the prims of a stage are, each is placed once in the world."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdSkel, Vt

RESET = "!resetXformStack!"


def with_company(path: Path) -> Path:
    """Give a stage a light, a camera that moves, and a mesh, each a root of its own."""
    stage = stages.edited(path)
    UsdLux.SphereLight.Define(stage, "/Light").AddTranslateOp().Set((1.0, 2.0, 3.0))
    camera = UsdGeom.Camera.Define(stage, "/Camera").AddTranslateOp()
    for time in stages.TIMES:
        camera.Set((time, 5.0, 10.0 * time), time)
    UsdGeom.Xform.Define(stage, "/Set/Inner").AddRotateYOp().Set(30.0)
    UsdGeom.Cube.Define(stage, "/Set/Inner/Cube").AddTranslateOp().Set((0.0, 7.0, 0.0))
    stage.Save()
    return path


def plain(folder: Path) -> Path:
    return with_company(stages.character(folder / "in.usda"))


def below(folder: Path, kind: str, order: tuple[str, ...] = ()) -> Path:
    """A character below a root of a kind."""
    asset = stages.character(folder / "asset.usda")
    path = stages.referencing(folder / "in.usda", asset, prim="/World/Hero")
    stage = stages.edited(path)
    stage.GetPrimAtPath("/World").SetSpecifier(Sdf.SpecifierDef)
    stage.GetPrimAtPath("/World").SetTypeName(kind)
    if order:
        hero = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Hero"))
        hero.AddTranslateOp().Set((3.0, 4.0, 5.0))
        hero.GetXformOpOrderAttr().Set(Vt.TokenArray(order))
    stage.Save()
    return with_company(path)


def scope(folder: Path) -> Path:
    return below(folder, "Scope")


def untyped(folder: Path) -> Path:
    return below(folder, "")


def reset(folder: Path) -> Path:
    return below(folder, "Xform", (RESET,))


def reset_and_moved(folder: Path) -> Path:
    return below(folder, "Xform", (RESET, "xformOp:translate"))


def reset_in_instance(folder: Path) -> Path:
    """An instance of a character that is below a Scope, with a mesh that resets its transform."""
    asset = stages.character(folder / "asset.usda")
    stage = stages.edited(asset)
    cube = UsdGeom.Cube.Define(stage, "/Hero/Cube")
    cube.AddTranslateOp().Set((1.0, 0.0, 0.0))
    cube.SetResetXformStack(True)
    stage.Save()
    return with_company(stages.referencing(folder / "in.usda", asset, instanceable=True))


def referring(folder: Path) -> Path:
    """Roots that refer to other roots, whose placement must not be taken twice."""
    path = scope(folder)
    stage = stages.edited(path)
    stage.DefinePrim("/Again", "Xform").GetReferences().AddInternalReference("/World")
    stage.DefinePrim("/Twin").GetReferences().AddInternalReference("/Camera")
    stage.Save()
    return path


SOURCES: list[Callable[[Path], Path]] = [
    plain, scope, untyped, reset, reset_and_moved, reset_in_instance, referring,
]  # fmt: skip


def world(stage: Usd.Stage) -> dict[str, np.ndarray]:
    """World transforms of all joints and other prims, by UsdSkel and UsdGeom."""
    found = {}
    for time in (1.0, 6.5):
        cache = UsdGeom.XformCache(time)
        for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
            if prim.IsA(UsdGeom.Imageable) and not prim.IsA(UsdGeom.Scope):
                matrix = cache.GetLocalToWorldTransform(prim)
                found[f"{prim.GetPath()} {time}"] = np.array(matrix)
            if prim.IsA(UsdSkel.Skeleton):
                query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(prim))
                matrices = np.array(query.ComputeJointWorldTransforms(cache))
                found[f"{prim.GetPath()} joints {time}"] = matrices
    return found


def assert_placed(before: Path, after: Path, turn: float, scale: float) -> None:
    stages = (Usd.Stage.Open(str(path)) for path in (before, after))
    assert_stage_placed(*stages, turn, scale)


def assert_stage_placed(before: Usd.Stage, after: Usd.Stage, turn: float, scale: float) -> None:
    placing = Gf.Matrix4d().SetRotate(Gf.Rotation((1, 0, 0), turn))
    placing *= Gf.Matrix4d().SetScale(scale)
    one, other = world(before), world(after)
    assert one.keys() == other.keys()
    for name, matrices in one.items():
        assert np.allclose(matrices @ np.array(placing), other[name], atol=1e-4), name


@pytest.mark.parametrize("source", SOURCES)
def test_everything_is_placed_once(source: Callable[[Path], Path], tmp_path: Path) -> None:
    path = source(tmp_path)
    skel = ["--skel", "/World/Hero"] if source is referring else []
    turned, scaled, both, back = (tmp_path / f"{name}.usda" for name in ("t", "s", "b", "k"))
    run("convert", path, "-o", turned, "--up", "Z", *skel)
    assert UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(turned))) == "Z"
    assert_placed(path, turned, 90.0, 1.0)
    run("convert", path, "-o", scaled, "--scale", 2, *skel)
    assert_placed(path, scaled, 0.0, 2.0)
    run("convert", turned, "-o", both, "--scale", 2, *skel)
    assert_placed(path, both, 90.0, 2.0)
    run("convert", both, "-o", back, "--up", "Y", "--scale", 0.5, *skel)
    assert_placed(path, back, 0.0, 1.0)


def test_a_placement_under_other_transforms_is_kept(tmp_path: Path) -> None:
    turned, target = tmp_path / "turned.usda", tmp_path / "out.usda"
    run("convert", plain(tmp_path), "-o", turned, "--up", "Z")
    stage = stages.edited(turned)
    hero = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))
    before = list(hero.GetXformOpOrderAttr().Get())
    hero.AddTranslateOp().Set((1.0, 2.0, 3.0))
    hero.GetXformOpOrderAttr().Set(Vt.TokenArray(["xformOp:translate", *before]))
    stage.Save()
    run("convert", turned, "-o", target, "--up", "Y")
    assert_placed(turned, target, -90.0, 1.0)


def test_domes_that_follow_the_up_axis_are_turned_once(tmp_path: Path) -> None:
    path, target = plain(tmp_path), tmp_path / "out.usda"
    stage = stages.edited(path)
    stage.DefinePrim("/Dome", "DomeLight_1").GetAttribute("poleAxis").Set("scene")
    stage.Save()
    run("convert", path, "-o", target, "--up", "Z")
    after = Usd.Stage.Open(str(target))
    assert after.GetAttributeAtPath("/Dome.poleAxis").Get() == "Y"
    assert_placed(path, target, 90.0, 1.0)


def in_variants(
    stage: Usd.Stage, place: str, name: str, changes: dict[str, Callable[[], object]]
) -> None:
    """Give a prim a variant set, with what is authored in each variant; the last is selected."""
    variants = stage.GetPrimAtPath(place).GetVariantSets().AddVariantSet(name)
    for variant, change in changes.items():
        variants.AddVariant(variant)
        variants.SetVariantSelection(variant)
        with variants.GetVariantEditContext():
            change()


def seats(folder: Path) -> Path:
    """Variants with transforms of their own, one of which resets the stack; one has none."""
    path = stages.character(folder / "in.usda")
    stage = stages.edited(path)
    hero = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))

    def lift() -> None:
        hero.AddTranslateOp(opSuffix="lift").Set((0.0, 30.0, 5.0))

    def turn() -> None:
        hero.AddRotateXYZOp().Set((0.0, 90.0, 30.0))
        hero.SetResetXformStack(True)

    in_variants(stage, stages.ROOT, "seat", {"low": lambda: None, "turned": turn, "high": lift})
    stage.Save()
    return with_company(path)


def seats_of_another_file(folder: Path) -> Path:
    (folder / "there").mkdir()
    return stages.referencing(folder / "in.usda", seats(folder / "there"))


def props(folder: Path) -> Path:
    """A Scope whose variants bring other prims, and a light that follows the up axis."""
    path = scope(folder)
    stage = stages.edited(path)
    in_variants(
        stage,
        "/World",
        "prop",
        {
            "ball": lambda: (
                UsdGeom.Sphere.Define(stage, "/World/Ball").AddTranslateOp().Set((1, 2, 3))
            ),
            "box": lambda: UsdGeom.Cube.Define(stage, "/World/Box/Inner"),
            "none": lambda: None,
            "sky": lambda: stage.DefinePrim("/World/Sky", "DomeLight_1"),
        },
    )
    stage.Save()
    return path


@pytest.mark.parametrize("source", [seats, seats_of_another_file, props])
@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_each_variant_is_placed(
    source: Callable[[Path], Path], suffix: str, tmp_path: Path
) -> None:
    path, turned, both = source(tmp_path), *(tmp_path / f"{name}.{suffix}" for name in "tb")
    run("convert", path, "-o", turned, "--up", "Z")
    run("convert", turned, "-o", both, "--scale", 2)
    for target, scale in ((turned, 1.0), (both, 2.0)):
        before, after = (Usd.Stage.Open(str(each)) for each in (path, target))
        for stage in (before, after):
            stage.SetEditTarget(stage.GetSessionLayer())
        [(place, name)] = [
            (str(prim.GetPath()), prim.GetVariantSets().GetNames()[0])
            for prim in before.Traverse()
            if prim.HasVariantSets()
        ]
        for variant in before.GetPrimAtPath(place).GetVariantSet(name).GetVariantNames():
            for stage in (before, after):
                stage.GetPrimAtPath(place).GetVariantSet(name).SetVariantSelection(variant)
            assert_stage_placed(before, after, 90.0, scale)


def test_variants_that_depend_on_each_other_are_refused(tmp_path: Path) -> None:
    path = seats(tmp_path)
    stage = stages.edited(path)
    hero = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))
    in_variants(
        stage,
        stages.ROOT,
        "size",
        {"own": lambda: None, "big": lambda: hero.AddScaleOp(opSuffix="size").Set((2, 2, 2))},
    )
    stage.Save()
    target = tmp_path / "out.usda"
    said = run("convert", path, "-o", target, "--up", "Z", code=2).output
    assert "/Hero cannot be turned or scaled with variant" in said
    assert not target.exists()
    run("convert", path, "-o", target)
