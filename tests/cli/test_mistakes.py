"""What people give by mistake, and what the verbs say to it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import edit
from builders.made import BEN, OK, SAMPLES, Run
from pxr import Sdf, Usd, UsdSkel, Vt


def bad_clip(name: str, folder: Path) -> Path:
    """A file of the kind that people have instead of a good one."""
    path = folder / f"{name}.usda"
    animation, skeleton = "/Ada/Animation", "/Ada/Skeleton"

    def rotations(stage: Usd.Stage) -> Usd.Attribute:
        return UsdSkel.Animation(stage.GetPrimAtPath(animation)).GetRotationsAttr()

    def one_value(change: Callable[[np.ndarray], None]) -> Callable[[Usd.Stage], None]:
        def edit_stage(stage: Usd.Stage) -> None:
            values = np.array(rotations(stage).Get(5.0))
            change(values)
            rotations(stage).Set(Vt.QuatfArray.FromNumpy(values), 5.0)

        return edit_stage

    if name == "missing":
        return folder / "nowhere.usdc"
    if name == "text":
        path.write_text("this is no usd file\n")
        return path
    if name == "suffix":
        return Path(shutil.copy(OK, folder / "clip.mov"))
    if name == "truncated":
        path = folder / "truncated.usdc"
        path.write_bytes(BEN.read_bytes()[:20000])
        return path
    changes: dict[str, Callable[[Usd.Stage], None]] = {
        "no-skeleton": lambda s: s.RemovePrim("/Ada"),
        "no-animation": lambda s: s.RemovePrim(animation),
        "zero-frames": lambda s: s.GetPrimAtPath(animation).RemoveProperty("rotations"),
        "one-frame": lambda s: _keep_one_frame(rotations(s)),
        "nan": one_value(lambda v: v[3].fill(np.nan)),
        "zero-quaternion": one_value(lambda v: v[3].fill(0.0)),
        "length": lambda s: rotations(s).Set(Vt.QuatfArray(3), 5.0),
        "no-hands": lambda s: _rename_hands(s.GetPrimAtPath(skeleton), s.GetPrimAtPath(animation)),
    }
    return edit(OK, path, changes[name])


def _keep_one_frame(attribute: Usd.Attribute) -> None:
    value = attribute.Get(5.0)
    attribute.Clear()
    attribute.Set(value, 5.0)


def _rename_hands(skeleton: Usd.Prim, animation: Usd.Prim) -> None:
    """Cut everything below the forearms off."""
    joints = [j for j in skeleton.GetAttribute("joints").Get() if "ForeArm/" not in j]
    index = [i for i, j in enumerate(skeleton.GetAttribute("joints").Get()) if j in joints]
    for name in ("bindTransforms", "restTransforms"):
        values = skeleton.GetAttribute(name).Get()
        skeleton.GetAttribute(name).Set(Vt.Matrix4dArray([values[i] for i in index]))
    skeleton.GetAttribute("joints").Set(Vt.TokenArray(joints))
    del animation


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("missing", 3, "no such file"),
        ("text", 3, "cannot read this file"),
        ("suffix", 3, ".mov"),
        ("truncated", 3, "cannot read this file"),
        ("no-skeleton", 3, "no UsdSkel skeleton"),
        ("no-animation", 3, "no animation is bound"),
        ("zero-frames", 3, "no rotations"),
        ("one-frame", 3, "one frame"),
        ("nan", 3, "not-a-number"),
        ("zero-quaternion", 3, "zero-length"),
        ("length", 3, "3 elements"),
        ("no-hands", 4, "hand"),
    ],
)
def test_bad_input_is_refused_in_one_message(
    run: Run, tmp_path: Path, name: str, code: int, words: str
) -> None:
    clip = bad_clip(name, tmp_path)
    before = set(tmp_path.iterdir())
    result = run("reduce", clip, "-o", tmp_path / "out.usda", code=code)
    assert words in result.output
    assert result.output.count("Error:") == 1
    if name not in ("no-hands",):
        assert clip.name in result.output
    assert set(tmp_path.iterdir()) == before


def test_frames_and_joints_of_bad_values_are_named(run: Run, tmp_path: Path) -> None:
    result = run("reduce", bad_clip("nan", tmp_path), "-o", tmp_path / "o.usda", code=3)
    assert "time code 5" in result.output
    assert "joint '" in result.output


def test_one_hand_works_and_says_so(run: Run, tmp_path: Path) -> None:
    clip = SAMPLES / "hands" / "talk_01_hands_right.usdc"
    report = json.loads(run("reduce", clip, "-o", tmp_path / "r.usda", "--json").stdout)
    assert report["total_channels"] == 25
    assert "only a right hand" in run("inspect", clip).output
    assert run("reduce", clip, "-o", tmp_path / "s.usda", "--side", "left", code=4)


def test_two_candidates_for_a_finger_are_refused(run: Run, tmp_path: Path) -> None:
    def duplicate(stage: Usd.Stage) -> None:
        skeleton = stage.GetPrimAtPath("/Ada/Skeleton")
        joints = list(skeleton.GetAttribute("joints").Get())
        hand = next(j for j in joints if j.endswith("/LeftHand"))
        twin = next(j for j in joints if j.endswith("LeftHandIndex1"))
        joints.append(f"{hand}/Extra/LeftHandIndex1")
        for name in ("bindTransforms", "restTransforms"):
            values = list(skeleton.GetAttribute(name).Get())
            values.append(values[joints.index(twin)])
            skeleton.GetAttribute(name).Set(Vt.Matrix4dArray(values))
        skeleton.GetAttribute("joints").Set(Vt.TokenArray(joints))

    clip = edit(OK, tmp_path / "twins.usda", duplicate)
    result = run("reduce", clip, "-o", tmp_path / "out.usda", code=4)
    assert result.output.count("LeftHandIndex1") >= 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("missing-controller", "is not in the rig"),
        ("circle", "cycle"),
        ("version", "version"),
        ("kind", "unknown kind"),
        ("no-rig", "no hand rig"),
    ],
)
def test_broken_rigs_are_refused(
    run: Run, rig: Path, tmp_path: Path, change: str, words: str
) -> None:
    layer = Sdf.Layer.FindOrOpen(str(rig))
    broken = Sdf.Layer.CreateAnonymous(".usda")
    broken.TransferContent(layer)
    prim = broken.GetPrimAtPath("/Ada/HandRig")
    linear = [a for a in prim.attributes if a.name.endswith(":controller")]
    names = [a.name.split(":")[2] for a in linear]
    if change == "missing-controller":
        linear[0].default = "leThumbCMCq"
    elif change == "circle":
        linear[0].default, linear[1].default = names[1], names[0]
    elif change == "version":
        prim.attributes["usdhand:version"].default = 99
    elif change == "kind":
        prim.attributes[f"usdhand:channel:{names[0]}:kind"].default = "magic"
    else:
        del broken.GetPrimAtPath("/Ada").nameChildren["HandRig"]
    path = tmp_path / "broken.usda"
    broken.Export(str(path))
    before = set(tmp_path.iterdir())
    for result in (
        run("expand", path, "-o", tmp_path / "out.usda", code=3),
        run("reduce", OK, "--rig", path, "-o", tmp_path / "out.usda", code=3),
    ):
        assert words in result.output
        assert "broken.usda" in result.output
    assert set(tmp_path.iterdir()) == before


def test_outputs_are_protected(run: Run, tmp_path: Path) -> None:
    clip = tmp_path / "clip.usdc"
    shutil.copy(OK, clip)
    for reference in ("ada.usdc",):
        (tmp_path / "characters").mkdir(exist_ok=True)
        shutil.copy(SAMPLES / "characters" / reference, tmp_path / "characters")
    folder = tmp_path / "gestures"
    folder.mkdir()
    clip = folder / "ok.usdc"
    shutil.copy(OK, clip)
    content = clip.read_bytes()
    character = tmp_path / "characters" / "ada.usdc"
    taken = tmp_path / "taken.usda"
    taken.write_text("keep me")

    assert "exists" in run("reduce", clip, "-o", taken, code=2).output
    assert taken.read_text() == "keep me"
    assert "input" in run("reduce", clip, "-o", clip, "--force", code=2).output
    assert "input" in run("reduce", clip, "-o", character, "--force", code=2).output
    assert "no such folder" in run("reduce", clip, "-o", tmp_path / "a/b.usda", code=2).output
    assert ".txt" in run("reduce", clip, "-o", tmp_path / "a.txt", code=2).output
    assert clip.read_bytes() == content
    run("reduce", clip, "-o", taken, "--force")
    assert taken.read_text().startswith("#usda")


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder nobody can write to")
def test_a_read_only_folder_is_said(run: Run) -> None:
    assert "cannot write" in run("reduce", OK, "-o", "/proc/self/rig.usda", code=2).output


@pytest.mark.parametrize(
    "arguments",
    [
        ("--preset", "5"),
        ("--preset", "4", "--range", "3"),
        ("--preset", "4", "--target-dofs", "3"),
        ("--target-dofs", "-1"),
        ("--rmsd", "3"),
        ("--controllers", "3"),
        ("--rig", "x.usda", "--preset", "2"),
    ],
)
def test_contradicting_settings_are_usage_errors(
    run: Run, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    run("reduce", OK, "-o", tmp_path / "o.usda", *arguments, code=2)


def test_a_missing_wildcard_and_an_empty_folder(run: Run, tmp_path: Path) -> None:
    assert "No file matches" in run("inspect", tmp_path / "*.usd", code=2).output
    assert "holds no" in run("inspect", tmp_path, code=2).output
