"""Rig files as people leave them: reduced again, damaged, several on one stage."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from builders.cli_runner import edit, run
from conftest import REPOSITORY
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
BEN = REPOSITORY / "samples" / "gestures_ben" / "ok_01.usdc"
RIG = "/Ada/HandRig"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "rig.usdc"
    run("reduce", OK, "-o", path, "--flatten", "-q")
    return path


def test_a_rig_of_a_rig_is_a_rig_of_its_own(tmp_path: Path) -> None:
    first, second, back = (tmp_path / f"{n}.usda" for n in ("first", "second", "back"))
    fit = ("--fit", "least-squares", "--controllers", 3, "--target-dofs", 12)
    run("reduce", OK, "-o", first, *fit, "-q")
    run("reduce", first, "-o", second, "--preset", 4, "-q")
    run("expand", second, "-o", back, "-q")
    assert json.loads(run("compare", second, back, "--json").stdout)["max_deg"] < 1e-3
    assert run("check", second).exit_code == 0
    stage = Usd.Stage.Open(str(second))
    rigs = [p for p in stage.Traverse() if p.GetAttribute("usdhand:version").HasAuthoredValue()]
    [prim] = rigs
    names = {a.GetName() for a in prim.GetAttributes()}
    linear = [n for n in names if n.endswith(":kind") and prim.GetAttribute(n).Get() == "linear"]
    assert linear
    for kind in linear:
        channel = kind.removesuffix(":kind")
        assert f"{channel}:controllers" not in names
        assert f"{channel}:value" not in names


def test_a_rig_with_other_thumb_axes_moves_its_own_character_only(
    rig: Path, tmp_path: Path
) -> None:
    old = tmp_path / "old.usda"
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(rig)))
    layer.GetPrimAtPath(RIG).attributes["usdhand:version"].default = 1
    layer.Export(str(old))
    run("expand", old, "-o", tmp_path / "own.usda", "-q")
    same = run("compare", rig, tmp_path / "own.usda", "--json").stdout
    assert json.loads(same)["max_deg"] < 1e-3
    for wrong in (
        run("expand", old, "--onto", BEN, "-o", tmp_path / "x.usda", code=3),
        run("reduce", OK, "--rig", old, "-o", tmp_path / "x.usda", code=3),
    ):
        assert "thumbs are measured about other axes" in wrong.output
    assert not (tmp_path / "x.usda").exists()


def test_one_hand_after_the_other_leaves_one_rig(tmp_path: Path) -> None:
    left, both = tmp_path / "left.usda", tmp_path / "both.usda"
    run("reduce", OK, "-o", left, "--side", "left", "-q")
    report = json.loads(run("reduce", left, "-o", both, "--side", "right", "--json").stdout)
    assert report["total_channels"] == 25
    expanded = json.loads(run("expand", both, "-o", tmp_path / "x.usda", "--json").stdout)
    assert expanded["free_channels"] == report["free_channels"]


def two_characters(folder: Path) -> Path:
    path = folder / "two.usda"
    stage = Usd.Stage.CreateNew(str(path))
    for name, source in (("One", OK), ("Two", OK)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(str(source))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(30)
    stage.SetFramesPerSecond(30)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(47)
    stage.Save()
    return path


def test_rigs_of_two_characters_are_chosen_by_skeleton(tmp_path: Path) -> None:
    shot, one, both = two_characters(tmp_path), tmp_path / "one.usda", tmp_path / "both.usda"
    assert "--skel" in run("reduce", shot, "-o", one, code=2).output
    first = json.loads(run("reduce", shot, "--skel", "One", "-o", one, "--json").stdout)
    run("reduce", one, "--skel", "Two", "-o", both, "--target-dofs", 3, "-q")
    assert "--skel" in run("expand", both, "-o", tmp_path / "x.usda", code=3).output
    for name, free in (("Two", 3), ("One", first["free_channels"])):
        out = tmp_path / f"x{name}.usda"
        result = json.loads(run("expand", both, "--skel", name, "-o", out, "--json").stdout)
        assert result["free_channels"] == free != 0
    run("expand", both, "--skel", "Three", "-o", tmp_path / "y.usda", code=3)


Change = Callable[[Usd.Prim], object]


def retyped(name: str, type_name: Sdf.ValueTypeName, value: object) -> Change:
    def change(prim: Usd.Prim) -> None:
        prim.RemoveProperty(name)
        prim.CreateAttribute(name, type_name).Set(value)

    return change


def first(prim: Usd.Prim, kind: str) -> str:
    names = [a.GetName() for a in prim.GetAttributes() if a.GetName().endswith(":kind")]
    return next(n for n in names if prim.GetAttribute(n).Get() == kind).removesuffix(":kind")


def of_first(kind: str, name: str, type_name: Sdf.ValueTypeName, value: object) -> Change:
    return lambda prim: retyped(f"{first(prim, kind)}:{name}", type_name, value)(prim)


TYPES = Sdf.ValueTypeNames
FRAMES = "usdhand:right:jointFrames"
DAMAGE: dict[str, Change] = {
    "skeleton": lambda p: p.GetRelationship("usdhand:skeleton").SetTargets(["/Nobody"]),
    "slope text": of_first("linear", "slope", TYPES.String, "steep"),
    "slope nan": of_first("linear", "slope", TYPES.Double, float("nan")),
    "range text": retyped("usdhand:rangeThreshold", TYPES.String, "wide"),
    "curve text": of_first("free", "value", TYPES.String, "up"),
    "curve array": of_first("free", "value", TYPES.DoubleArray, Vt.DoubleArray([1.0, 2.0])),
    "curve huge": of_first("free", "value", TYPES.Double, 1e300),
    "frames nan": lambda p: p.GetAttribute(FRAMES).Set(
        Vt.QuatdArray([Gf.Quatd(float("nan"), 0, 0, 0)] * 15)
    ),
    "frames zero": lambda p: p.GetAttribute(FRAMES).Set(Vt.QuatdArray(15)),
    "frames type": retyped(FRAMES, TYPES.Float3Array, Vt.Vec3fArray(15)),
    "joints": lambda p: p.GetAttribute("usdhand:right:joints").Set(Vt.TokenArray(["x"] * 15)),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damaged_rigs_are_refused_and_found_by_check(rig: Path, tmp_path: Path, name: str) -> None:
    damaged = edit(rig, tmp_path / "damaged.usdc", lambda s: DAMAGE[name](s.GetPrimAtPath(RIG)))
    result = run("expand", damaged, "-o", tmp_path / "out.usda", code=3)
    assert "damaged.usdc" in result.output
    assert [p.name for p in tmp_path.iterdir()] == ["damaged.usdc"]
    checked = json.loads(run("check", damaged, "--json", code=1).stdout)
    codes = {f["code"] for f in checked["files"][0]["findings"] if f["severity"] == "error"}
    assert codes & {"broken-rig", "rig-skeleton"}
