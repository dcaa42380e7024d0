"""Extents of moved characters are those that UsdSkel computes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from conftest import REPOSITORY
from pxr import Kind, Sdf, Usd, UsdGeom, UsdSkel

from usdhand.formats.usd.extents import author_extents

FULL, BODY = (
    REPOSITORY / "samples" / "conversations" / f"talk_01_{kind}.usdc" for kind in ("full", "body")
)
WRONG = [(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)]


def assert_right(stage: Usd.Stage, path: str) -> None:
    boundable = UsdGeom.Boundable(stage.GetPrimAtPath(path))
    attribute = boundable.GetExtentAttr()
    animation = next(p for p in stage.Traverse() if p.IsA(UsdSkel.Animation))
    times = UsdSkel.Animation(animation).GetRotationsAttr().GetTimeSamples()
    assert len(times) > 1
    for time in times:
        right = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, time)
        assert np.allclose(attribute.Get(time), right, atol=1e-3), time


@pytest.mark.parametrize("skinned", [False, True])
def test_wrong_extents_are_put_right(skinned: bool, tmp_path: Path) -> None:
    path = stages.character(tmp_path / "in.usda")
    stage = stages.edited(path)
    stages.place(stage, "/Hero/Skel", translate=(1.0, 2.0, 3.0))
    paths = ["/Hero", "/Hero/Skel"]
    for each in paths:
        UsdGeom.Boundable(stage.GetPrimAtPath(each)).CreateExtentAttr(WRONG)
    if skinned:
        mesh = UsdGeom.Mesh.Define(stage, "/Hero/Skin")
        mesh.CreatePointsAttr([(0, 0, 0), (30, 0, 0), (0, 50, 0)])
        mesh.CreateExtentAttr([(0, 0, 0), (30, 50, 0)])
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateJointIndicesPrimvar(False, 1).Set([0, 1, 2])
        binding.CreateJointWeightsPrimvar(False, 1).Set([1.0, 1.0, 1.0])
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())
    author_extents(layer, Sdf.Path("/Hero"))
    for each in paths:
        assert_right(Usd.Stage.Open(layer), each)


def test_no_extent_is_made_where_none_is(tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(stages.character(tmp_path / "in.usda"))))
    author_extents(layer, Sdf.Path("/Hero"))
    assert not layer.GetAttributeAtPath("/Hero.extent")


def test_results_have_the_extents_of_their_motion(tmp_path: Path) -> None:
    for options in (("reduce",), ("convert", "--root-motion", "drop")):
        target = tmp_path / f"{options[0]}.usdc"
        run(options[0], FULL, "-o", target, *options[1:])
        assert_right(Usd.Stage.Open(str(target)), "/Ada")


@pytest.mark.parametrize("options", [[], ["--flatten"]])
def test_alternatives_have_the_extents_of_the_one_that_is_selected(
    options: list[str], gestures_library: Path, tmp_path: Path
) -> None:
    target = tmp_path / "filled.usdc"
    run("fill", BODY, "--library", gestures_library, "-o", target, "--alternatives", 3, *options)
    stage = Usd.Stage.Open(str(target))
    stage.SetEditTarget(stage.GetSessionLayer())
    [animation] = [p for p in stage.Traverse() if p.GetName() == "HandMotion"]
    fingers = animation.GetVariantSet("fingers")
    for name in fingers.GetVariantNames():
        fingers.SetVariantSelection(name)
        for path in ("/Ada", "/Ada/Skeleton"):
            boundable = UsdGeom.Boundable(stage.GetPrimAtPath(path))
            for time in (1.0, 120.0, 300.0):
                right = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, time)
                assert np.allclose(boundable.ComputeExtent(time), right, atol=1e-3)


def test_characters_of_a_library_are_below_groups(tmp_path: Path) -> None:
    library = tmp_path / "library.usdc"
    run("library", "build", REPOSITORY / "samples" / "gestures_ben", "-o", library)
    stage = Usd.Stage.Open(str(library))
    models = [p for p in stage.Traverse() if Usd.ModelAPI(p).IsKind(Kind.Tokens.component)]
    assert models
    assert all(model.IsModel() for model in models)
