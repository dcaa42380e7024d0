"""Finger joints come to bodies of many conventions under names that every program takes."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from builders.bare_bodies import named_body, with_raw_names
from builders.blender import blender_python
from builders.cli_runner import run
from builders.rigs import known_rigs
from conftest import REPOSITORY
from pxr import Usd, UsdGeom, UsdSkel, Vt

import usdhand
from usdhand.anatomy import SIDES
from usdhand.anatomy.hand import digit_joints
from usdhand.formats.usd.names import legal_name
from usdhand.motion import rotations as rot

BODIES = (
    "humanik", "mixamo", "unreal", "rigify", "unity_humanoid", "unity_spaced", "vroid", "smplx",
    "biped", "auto_rig_pro", "daz_g9", "mgear", "character_creator", "xsens_mvn",
)  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("names") / "l.usdc"
    clips = [REPOSITORY / "samples" / "gestures" / f"{n}_01.usdc" for n in ("ok", "wipe", "turn")]
    run("library", "build", *clips, "-o", path, "-q")
    return path


def filled(
    name: str, library: Path, folder: Path, suffix: str = ".usdc"
) -> tuple[Path, Path, dict]:
    body, out = folder / f"body{suffix}", folder / "out.usdc"
    clip = named_body(known_rigs()[name])
    usd = folder / "made.usdc" if suffix == ".bvh" else body
    usdhand.write_clip(clip, usd)
    if suffix == ".bvh":
        run("convert", usd, "-o", body, "-q")
    else:
        with_raw_names(body, clip.skeleton.joints)
    arguments = ("fill", body, "--library", library, "-o", out, "--add-fingers", "--json")
    return body, out, json.loads(run(*arguments).stdout)


@pytest.mark.parametrize("name", BODIES)
def test_bodies_of_many_conventions_gain_fingers(name: str, library: Path, tmp_path: Path) -> None:
    body, out, report = filled(name, library, tmp_path)
    run("check", out)
    before, after = usdhand.read_clip(body), usdhand.read_clip(out)
    stage = Usd.Stage.Open(str(out))
    [skeleton] = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    tokens = UsdSkel.Skeleton(skeleton).GetJointsAttr().Get()
    topology = UsdSkel.Topology(tokens)
    assert [topology.GetParent(i) for i in range(len(tokens))] == after.skeleton.parents.tolist()
    assert len({str(token).rsplit("/", 1)[-1] for token in tokens}) == len(tokens)
    added = [path for paths in report["added_joints"].values() for path in paths]
    assert [str(token) for token in tokens][len(before.skeleton) :] == added
    # The names read as those of the body's own convention, and nothing needs a warning.
    own, found = usdhand.find_hands(after), json.loads(run("inspect", out, "--json").stdout)
    assert {side: len(f.names) for side, f in own.frames.items()} == {"left": 15, "right": 15}
    assert found["files"][0]["notes"] == []
    assert found["files"][0]["problems"] == []
    assert own.character.convention in (name, "humanik")
    count = len(before.skeleton)
    assert np.abs(after.rotations[:, :count] - before.rotations).max() < 1e-6


@pytest.mark.parametrize("digit", ["Thumb", "Index"])
@pytest.mark.parametrize("name", ["humanik", "mixamo", "unreal", "rigify"])
def test_a_whole_digit_stays_or_is_replaced(
    name: str, digit: str, library: Path, tmp_path: Path
) -> None:
    """No hand has six digits unasked."""
    names, body = known_rigs()[name], tmp_path / "body.usdc"
    usdhand.write_clip(named_body(names, digits=[digit]), body)
    own = {names[side, digit + joint] for side in SIDES for joint in digit_joints(digit)}
    arguments = ("fill", body, "--library", library, "--add-fingers", "--json", "-o")
    kept = run(*arguments, tmp_path / "kept.usdc")
    assert "--replace-fingers adds a new" in kept.stderr
    assert "beside" not in kept.stderr
    added = [p for paths in json.loads(kept.stdout)["added_joints"].values() for p in paths]
    assert not any(digit.lower() in path.rsplit("/", 1)[-1].lower() for path in added)
    clip = usdhand.read_clip(tmp_path / "kept.usdc")
    hands = usdhand.find_hands(clip)
    assert hands.character.convention in (name, "humanik")
    joints = {clip.skeleton.names[j] for f in hands.frames.values() for j in f.joints}
    assert {side: len(f.names) for side, f in hands.frames.items()} == {"left": 15, "right": 15}
    assert {legal_name(joint) for joint in own} <= {legal_name(joint) for joint in joints}
    whole = run(*arguments, tmp_path / "whole.usdc", "--replace-fingers")
    assert "stays beside the added" in whole.stderr
    hands = usdhand.find_hands(usdhand.read_clip(tmp_path / "whole.usdc"))
    assert {side: len(f.names) for side, f in hands.frames.items()} == {"left": 15, "right": 15}


def test_a_whole_digit_that_moves_gets_the_motion(library: Path, tmp_path: Path) -> None:
    names = known_rigs()["humanik"]
    clip = named_body(names, digits=["Index"])
    rotations = clip.rotations.copy()
    joints = [j for j, name in enumerate(clip.skeleton.names) if name.endswith("HandIndex2")]
    bend = rot.from_axis_angle(np.array([0.0, 0.0, 1.0]), 0.5 * np.sin(np.arange(len(clip)) / 5.0))
    for joint in joints:
        rotations[:, joint] = rot.multiply(rotations[:, joint], bend)
    usdhand.write_clip(clip.with_rotations(rotations), tmp_path / "body.usdc")
    out = tmp_path / "out.usdc"
    text = run("fill", tmp_path / "body.usdc", "--library", library, "-o", out, "--add-fingers")
    assert "stays its index and gets the motion" in text.output
    assert len(joints) == 2
    filled = usdhand.read_clip(out)
    for joint in joints:
        assert np.abs(filled.rotations[:, joint] - rotations[:, joint]).max() > 0.01


def test_replacing_fingers_needs_some_to_add(library: Path, tmp_path: Path) -> None:
    body = tmp_path / "body.usdc"
    usdhand.write_clip(named_body(known_rigs()["humanik"]), body)
    text = run(
        "fill", body, "--library", library, "-o", tmp_path / "o.usda", "--replace-fingers", code=2
    ).output
    assert "--replace-fingers is for --add-fingers" in text


@pytest.mark.parametrize("name", ["rigify", "biped"])
def test_bvh_bodies_gain_fingers(name: str, library: Path, tmp_path: Path) -> None:
    _, out, _ = filled(name, library, tmp_path, ".bvh")
    run("check", out)
    assert len(usdhand.find_hands(usdhand.read_clip(out)).frames) == 2


def test_meshes_that_list_joints_follow_their_new_names(library: Path, tmp_path: Path) -> None:
    body = tmp_path / "body.usdc"
    clip = named_body(known_rigs()["biped"])
    usdhand.write_clip(clip, body)
    with_raw_names(body, clip.skeleton.joints)
    stage = Usd.Stage.Open(str(body))
    [skeleton] = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    mesh = UsdGeom.Mesh.Define(stage, skeleton.GetParent().GetPath().AppendChild("Sleeve"))
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    wrists = [j for j in clip.skeleton.joints if j.endswith("Hand")]
    binding.CreateJointsAttr(Vt.TokenArray(wrists))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    stage.GetRootLayer().Save()
    out = tmp_path / "out.usda"
    run("fill", body, "--library", library, "-o", out, "--add-fingers")
    shown = Usd.Stage.Open(str(out))
    listed = UsdSkel.BindingAPI(shown.GetPrimAtPath(mesh.GetPath())).GetJointsAttr().Get()
    tokens = UsdSkel.Skeleton(shown.GetPrimAtPath(skeleton.GetPath())).GetJointsAttr().Get()
    assert len(listed) == len(wrists)
    assert set(listed) <= set(tokens)


@pytest.mark.blender
@pytest.mark.parametrize("name", BODIES)
def test_blender_loads_one_armature_with_fingers(name: str, library: Path, tmp_path: Path) -> None:
    _, out, report = filled(name, library, tmp_path)
    script = tmp_path / "count.py"
    script.write_text(
        "import bpy, json, sys\n"
        "bpy.ops.wm.read_factory_settings(use_empty=True)\n"
        "bpy.ops.wm.usd_import(filepath=sys.argv[1])\n"
        "found = [o for o in bpy.data.objects if o.type == 'ARMATURE']\n"
        "bones = [b for o in found for b in o.data.bones]\n"
        "bones = [[b.name, b.parent.name if b.parent else ''] for b in bones]\n"
        "print('FOUND', json.dumps([len(found), bones]))\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [blender_python(), str(script), str(out)], capture_output=True, text=True, check=False
    )
    [line] = [text for text in done.stdout.splitlines() if text.startswith("FOUND ")]
    armatures, bones = json.loads(line.removeprefix("FOUND "))
    assert armatures == 1
    for paths in report["added_joints"].values():
        for path in paths:
            above, leaf = path.split("/")[-2:]
            assert [leaf, above] in bones
