"""Takes that begin, or stay, lying face down: bind pose and height are those of the body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from conftest import REPOSITORY
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from usdhand import Clip, read_clip
from usdhand.motion.transforms import affine
from usdhand.rigs import map_character
from usdhand.rigs.height import body_height

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
QUARTER = Gf.Quatf(0.70710678, 0.70710678, 0.0, 0.0)
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])  # row vectors


def height(clip: Clip) -> float:
    return body_height(clip.skeleton, map_character(clip.skeleton))


def take(path: Path, *, lies: bool, turned: bool, bind: str, rest: bool = True) -> Path:
    """A take whose root joint may be turned, below a prim that may be turned the other way."""
    Usd.Stage.Open(str(OK)).Flatten().Export(str(path))
    clip = read_clip(path)
    stage = Usd.Stage.Open(str(path))
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(clip.origin.skeleton_path))
    animation = UsdSkel.Animation(stage.GetPrimAtPath(clip.origin.animation_path))
    turns = int(lies) + int(turned)
    roots = np.flatnonzero(clip.skeleton.parents < 0).tolist()
    rotations, translations = animation.GetRotationsAttr(), animation.GetTranslationsAttr()
    for attribute in (rotations, translations):
        for time in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]:
            values = list(attribute.Get(time))
            for root in roots:
                for _ in range(turns):
                    old = values[root]
                    values[root] = (
                        QUARTER * old if attribute == rotations else QUARTER.Transform(old)
                    )
            attribute.Set(type(attribute.Get(time))(values), time)
    if turned:
        xform = UsdGeom.Xformable(skeleton.GetPrim().GetParent())
        xform.AddRotateXOp(opSuffix="up").Set(-90.0)
        binds, rests = skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()
        values = np.array(rests.Get())
        values[roots] = values[roots] @ Z_UP
        rests.Set(Vt.Matrix4dArray.FromNumpy(values))
        if bind == "skeleton":
            binds.Set(Vt.Matrix4dArray.FromNumpy(np.array(binds.Get()) @ Z_UP))
    if bind == "none":
        skeleton.GetPrim().RemoveProperty("bindTransforms")
    if not rest:
        skeleton.GetPrim().RemoveProperty("restTransforms")
    stage.Save()
    return path


@pytest.mark.parametrize("lies", [False, True])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("bind", ["skeleton", "world"])
@pytest.mark.parametrize("rest", [True, False])
def test_bind_pose(tmp_path: Path, lies: bool, turned: bool, bind: str, rest: bool) -> None:
    expected = read_clip(OK)
    clip = read_clip(take(tmp_path / "a.usda", lies=lies, turned=turned, bind=bind, rest=rest))
    assert np.abs(clip.skeleton.bind - expected.skeleton.bind).max() < 1e-3
    assert height(clip) == pytest.approx(height(expected), abs=0.01)


def test_height_without_any_pose(tmp_path: Path) -> None:
    """The first frame stands in for it, and lies: the back tells what is up."""
    path = take(tmp_path / "a.usda", lies=True, turned=False, bind="none", rest=False)
    upright = take(tmp_path / "b.usda", lies=False, turned=False, bind="none", rest=False)
    assert height(read_clip(path)) == pytest.approx(height(read_clip(upright)), rel=0.03)


@pytest.mark.parametrize("lies", [False, True])
def test_height_in_bvh(tmp_path: Path, lies: bool) -> None:
    path = take(tmp_path / "a.usda", lies=lies, turned=False, bind="skeleton")
    run("convert", path, "-o", tmp_path / "a.bvh", "-q")
    assert height(read_clip(tmp_path / "a.bvh")) == pytest.approx(height(read_clip(OK)), rel=0.01)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 0, 1), (1, 1, 0.3)])
@pytest.mark.parametrize("degrees", [90.0, -90.0, 180.0])
def test_height_of_a_body_that_lies(axis: tuple[float, float, float], degrees: float) -> None:
    clip = read_clip(OK)
    turn = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Vec3d(*axis), degrees))).T
    skeleton = clip.skeleton
    turned = type(skeleton)(
        skeleton.joints, skeleton.parents, affine(turn, np.zeros(3)) @ skeleton.bind, skeleton.rest
    )
    character = map_character(skeleton)
    expected = body_height(skeleton, character)
    assert body_height(turned, character) == pytest.approx(expected, rel=0.03)
