"""Joints before their parents, absolute joint paths, and values of the wrong type."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from oracles.usdskel import joint_worlds
from pxr import Sdf, UsdGeom, UsdSkel, Vt

from usdhand import read_clip
from usdhand.formats.usd.check import check_file
from usdhand.motion import forward_kinematics

AT = np.array(stages.TIMES)
COUNT = len(stages.JOINTS)
ORDER = [1, 0, *range(2, COUNT)]


def disordered(path: Path) -> Path:
    """A skeleton whose second joint is listed first, with a mesh that counts joints so."""
    stages.character(path)
    stage = stages.edited(path)
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(stages.SKELETON))
    skeleton.GetJointsAttr().Set([stages.JOINTS[j] for j in ORDER])
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        attribute.Set(stages.matrices(np.array(attribute.Get())[ORDER]))
    mesh = UsdGeom.Mesh.Define(stage, f"{stages.ROOT}/Skin")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([stages.SKELETON])
    binding.CreateJointIndicesPrimvar(False, 1).Set([0, 1, 2])
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0, 1.0, 1.0])
    stage.Save()
    return path


def test_joints_before_their_parents(tmp_path: Path) -> None:
    right = stages.character(tmp_path / "right.usda")
    source = disordered(tmp_path / "a.usda")
    assert "before their parents" in " ".join(run("inspect", source, code=4).output.split())
    assert "joint-order" in {p.code for p in check_file(source) if p.severity == "error"}
    run("convert", source, "-o", tmp_path / "b.usda")
    found, expected = (joint_worlds(p, stages.SKELETON, AT) for p in (tmp_path / "b.usda", right))
    assert np.abs(found - expected).max() < 1e-4
    assert check_file(tmp_path / "b.usda") == ()

    # The first point of the mesh still belongs to the joint that was listed first.
    stage = stages.edited(tmp_path / "b.usda")
    listed = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Skin")).GetJointsAttr().Get()
    assert list(listed) == [stages.JOINTS[j] for j in ORDER]


def test_absolute_joint_paths(tmp_path: Path) -> None:
    joints = [f"{stages.SKELETON}/{joint}" for joint in stages.JOINTS]
    source = stages.character(tmp_path / "a.usda", joints=joints)
    clip = read_clip(source)
    assert [p.code for p in clip.problems] == ["absolute-joints"]
    said = run("check", source).output
    assert "''" not in said
    run("convert", source, "-o", tmp_path / "b.usda")
    found = read_clip(tmp_path / "b.usda")
    assert found.skeleton.joints == stages.JOINTS
    assert not found.problems
    assert np.abs(found.rotations - clip.rotations).max() < 1e-6
    assert check_file(tmp_path / "b.usda") == ()


WRONG = {
    "rotations": (Sdf.ValueTypeNames.QuatdArray, Vt.QuatdArray, np.float64),
    "translations": (Sdf.ValueTypeNames.Double3Array, Vt.Vec3dArray, np.float64),
    "scales": (Sdf.ValueTypeNames.Float3Array, Vt.Vec3fArray, np.float32),
}


@pytest.mark.parametrize("name", WRONG)
def test_values_of_the_wrong_type_are_told(tmp_path: Path, name: str) -> None:
    right = stages.character(tmp_path / "right.usda")
    source = stages.character(tmp_path / "a.usda", without=[name])
    kind, array, dtype = WRONG[name]
    layer = Sdf.Layer.FindOrOpen(str(source))
    spec = Sdf.AttributeSpec(layer.GetPrimAtPath(stages.ANIMATION), name, kind)
    stage = stages.edited(right)
    good = stage.GetPrimAtPath(stages.ANIMATION).GetAttribute(name)
    for time in good.GetTimeSamples():
        values = np.array(good.Get(time), dtype=dtype)
        layer.SetTimeSample(spec.path, time, array.FromNumpy(values))
    if not good.GetTimeSamples():
        spec.default = array.FromNumpy(np.array(good.Get(), dtype=dtype))
    layer.Save()
    expected = joint_worlds(right, stages.SKELETON, AT)
    clip = read_clip(source)
    assert "wrong-type" in {problem.code for problem in clip.problems}
    positions = forward_kinematics(clip).positions
    assert np.abs(positions - expected[..., :3, 3]).max() < 1e-3
    assert "wrong-type" in {p.code for p in check_file(source) if p.severity == "error"}
    run("convert", source, "-o", tmp_path / "b.usda")
    found = joint_worlds(tmp_path / "b.usda", stages.SKELETON, AT)
    assert np.abs(found - expected).max() < 1e-3
    assert not read_clip(tmp_path / "b.usda").problems
