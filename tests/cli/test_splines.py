"""Splines in place of time samples: on channels of a rig, and above a skeleton."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from conftest import REPOSITORY
from oracles.usdskel import assert_same_world
from pxr import Gf, Sdf, Usd, UsdGeom

from usdhand import read_clip
from usdhand.formats.usd.rig import find_rig, read_stored_rig

Ts = pytest.importorskip("pxr.Ts")
if not hasattr(Usd.Attribute, "SetSpline"):
    pytest.skip("this OpenUSD has no splines on attributes", allow_module_level=True)

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
CURVES = {
    "held": Ts.InterpHeld,
    "linear": Ts.InterpLinear,
    "bezier": Ts.InterpCurve,
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.usdc"
    run("reduce", OK, "-o", path, "--flatten", "-q")
    return path


def spline(kind: object, *knots: tuple[float, float]) -> object:
    made = Ts.Spline("double")
    for time, value in knots:
        knot = Ts.Knot(typeName="double", time=time, value=value, nextInterp=kind)
        knot.SetPreTanWidth(3.0)
        knot.SetPostTanWidth(3.0)
        knot.SetPostTanSlope(1.5)
        made.SetKnot(knot)
    return made


def over(rig: Path, path: Path) -> tuple[Usd.Stage, Usd.Prim]:
    """A layer over a rig, for edits of it."""
    stage = stages.edited(stages.sublayering(path, rig, rate=30.0, start=None, end=None))
    return stage, find_rig(stage, path)


@pytest.mark.parametrize("kind", CURVES.values(), ids=CURVES)
def test_a_spline_is_read_as_usd_evaluates_it(rig: Path, tmp_path: Path, kind: object) -> None:
    stage, prim = over(rig, tmp_path / "spline.usda")
    stored = read_stored_rig(rig)
    times = stored.clip.time_codes
    name = stored.rig.free[0]
    attribute = prim.GetAttribute(f"usdhand:channel:{name}:value")
    attribute.SetSpline(spline(kind, (times[3], 10.0), (times[-9], 60.0), (times[-5], 20.0)))
    stage.Save()
    expected = [attribute.Get(t) for t in times.tolist()]
    assert np.ptp(expected) > 5.0
    found = read_stored_rig(tmp_path / "spline.usda").free
    assert np.allclose(found.select((name,)).values[:, 0], expected, atol=1e-9)

    # The same curve as samples gives the same hands.
    stage, prim = over(rig, tmp_path / "samples.usda")
    attribute = prim.GetAttribute(f"usdhand:channel:{name}:value")
    for time, value in zip(times.tolist(), expected, strict=True):
        attribute.Set(value, time)
    stage.Save()
    clips = []
    for each in ("spline", "samples"):
        run("expand", tmp_path / f"{each}.usda", "-o", tmp_path / f"{each}_out.usda", "-q")
        clips.append(read_clip(tmp_path / f"{each}_out.usda"))
    assert np.abs(clips[0].rotations - clips[1].rotations).max() < 1e-6


def test_a_spline_below_a_layer_offset(rig: Path, tmp_path: Path) -> None:
    stage, prim = over(rig, tmp_path / "spline.usda")
    times = read_stored_rig(rig).clip.time_codes
    name = read_stored_rig(rig).rig.free[0]
    attribute = prim.GetAttribute(f"usdhand:channel:{name}:value")
    attribute.SetSpline(spline(Ts.InterpLinear, (times[0], 0.0), (times[-1], 60.0)))
    stage.Save()
    stages.sublayering(
        tmp_path / "shot.usda", tmp_path / "spline.usda", rate=30.0, offset=Sdf.LayerOffset(100.0)
    )
    found = read_stored_rig(tmp_path / "shot.usda")
    assert found.clip.time_codes[0] == times[0] + 100.0
    values = found.free.select((name,)).values[:, 0]
    assert np.allclose(values, np.linspace(0.0, 60.0, len(times)), atol=1e-6)


@pytest.mark.parametrize("how", ["spline", "samples"])
def test_a_constant_that_moves_is_no_constant(rig: Path, tmp_path: Path, how: str) -> None:
    stored = read_stored_rig(rig)
    name = next(r.name for r in stored.rig.relations if r.kind == "constant")
    path = tmp_path / "edited.usda"
    stage, prim = over(rig, path)
    attribute = prim.GetAttribute(f"usdhand:channel:{name}:value")
    if how == "spline":
        attribute.SetSpline(spline(Ts.InterpLinear, (1.0, 0.0), (40.0, 30.0)))
    else:
        attribute.Set(0.0, 1.0)
        attribute.Set(30.0, 40.0)
    stage.Save()
    said = run("expand", path, "-o", tmp_path / "out.usda", code=3).output
    advised = re.search(r"set (\S+)\s+to\s+'free'", said)
    assert advised, said
    prim.GetAttribute(advised[1]).Set("free")
    stage.Save()
    run("expand", path, "-o", tmp_path / "out.usda", "-q")
    assert name in read_stored_rig(path).rig.free


def test_splines_above_a_skeleton(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "a.usda")
    stage = stages.edited(path)
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))
    xform.AddTranslateOp().Set(Gf.Vec3d(1.0, 2.0, 3.0))
    turn = xform.AddRotateYOp(UsdGeom.XformOp.PrecisionDouble).GetAttr()
    turn.SetSpline(spline(Ts.InterpCurve, (2.0, 10.0), (7.0, 80.0), (11.0, -20.0)))
    stage.Save()
    clip = read_clip(path)
    assert_same_world(clip)
    run("convert", path, "-o", tmp_path / "b.bvh")
