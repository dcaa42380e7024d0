"""convert from USD to USD: edits of time, size, axes and root motion; broken characters mended."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from builders.clips import joints_of
from conftest import REPOSITORY, shared_data
from oracles.usdskel import assert_same_world
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand import find_hands, read_clip, retarget_hands, write_new
from usdhand.errors import HandNotFoundError
from usdhand.formats.usd.character import character_of, legal_clip
from usdhand.formats.usd.check import check_file
from usdhand.motion import Clip, forward_kinematics, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.rigs import map_character

TALK = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
BEN = REPOSITORY / "samples" / "characters" / "ben.usdc"


def errors(path: Path) -> list[str]:
    return [str(f) for f in check_file(path) if f.severity == "error"]


def meshes(path: Path) -> list[str]:
    stage = Usd.Stage.Open(str(path))
    return [str(prim.GetPath()) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]


def assert_same_motion(a: Clip, b: Clip, *, factor: float = 1.0) -> None:
    """Joints are at the same places, within what float32 holds, and turned the same."""
    pose, other = forward_kinematics(a), forward_kinematics(b)
    assert np.abs(pose.positions * factor - other.positions).max() < 1e-4 * max(factor, 1.0)
    assert rot.angle_between(pose.rotations, other.rotations).max() < 2e-3


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usd", "usdz"])
def test_a_plain_conversion_keeps_samples_to_the_bit(tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"talk.{suffix}"
    run("convert", TALK, "-o", target)
    a, b = read_clip(TALK), read_clip(target)
    assert np.array_equal(a.rotations, b.rotations)
    assert np.array_equal(a.translations, b.translations)
    assert np.array_equal(a.time_codes, b.time_codes)
    assert not errors(target)
    assert len(meshes(target)) == len(meshes(TALK)) > 0
    own = ["./talk.motion.usdc"] if suffix == "usda" else []
    assert list(Sdf.Layer.FindOrOpen(str(target)).subLayerPaths) == own


def test_trim_start_fps_scale_up_and_root_motion_together(tmp_path: Path) -> None:
    target = tmp_path / "edited.usdc"
    run(
        *("convert", TALK, "-o", target, "--trim", "31:211", "--start", 1001, "--fps", 60),
        *("--scale", 2, "--up", "Z", "--root-motion", "drop"),
    )
    a, b = read_clip(TALK), read_clip(target)
    assert b.fps == 60
    assert b.origin.first_time_code == 1001
    assert b.origin.up_axis == "Z"
    assert len(b) == 2 * 180 + 1
    assert_same_world(b)
    assert not errors(target)
    # Every second frame is one of the source's, twice as large and over one spot.
    pose, other = forward_kinematics(a), forward_kinematics(b)
    hips = map_character(a.skeleton).hips
    assert hips is not None
    now, then = other.positions[::2], 2.0 * pose.positions[30:211]
    away = now - then
    assert np.ptp(away, axis=1).max() < 1e-3  # one displacement a frame, for all joints
    assert np.abs(away[:, 0, 1]).max() < 1e-3  # none of it vertical
    assert np.ptp(now[:, hips, [0, 2]], axis=0).max() < 1e-3
    assert rot.angle_between(pose.rotations[30:211], other.rotations[::2]).max() < 2e-3


def test_everything_on_a_stage_moves_with_its_character(tmp_path: Path) -> None:
    source = stages.character(tmp_path / "a.usda")
    stage = stages.edited(source)
    xform = stages.place(stage, translate=(5, 0, 0))
    xform.GetOrderedXformOps()[0].Set(Gf.Vec3d(5, 0, 0), 1)
    xform.GetOrderedXformOps()[0].Set(Gf.Vec3d(65, 0, 0), 12)
    stage.Save()
    target = tmp_path / "b.usda"
    run("convert", source, "-o", target, "--start", 100, "--fps", 48, "--up", "Z")
    a, b = read_clip(source), read_clip(target)
    assert len(b) == 2 * (len(a) - 1) + 1
    assert_same_world(b)
    difference = forward_kinematics(b).positions[::2] - forward_kinematics(a).positions
    assert np.abs(difference).max() < 1e-3


def test_broken_characters_come_out_whole(tmp_path: Path) -> None:
    illegal = tuple(j.replace("LeftHandIndex", "Left Hand:Index") for j in stages.JOINTS)
    source = stages.character(
        tmp_path / "a.usda",
        joints=illegal,
        without=("translations", "scales", "rest", "bind"),
    )
    stage = stages.edited(source)
    mesh = UsdGeom.Mesh.Define(stage, "/Hero/Glove")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateJointsAttr([illegal[0], illegal[8]])
    stage.Save()
    assert errors(source)
    target = tmp_path / "b.usda"
    run("convert", source, "-o", target)
    assert not errors(target)
    a, b = read_clip(source), read_clip(target)
    assert_same_motion(a, b)
    assert b.skeleton.originals == tuple(j.rsplit("/", 1)[-1] for j in illegal)
    stage = Usd.Stage.Open(str(target))
    names = stage.GetPrimAtPath("/Hero/Glove").GetAttribute("skel:joints").Get()
    assert list(names) == [b.skeleton.joints[0], b.skeleton.joints[8]]
    assert_same_world(b)


def test_a_new_character_is_complete_and_shows_the_same(tmp_path: Path) -> None:
    a = read_clip(TALK)
    for up in ("Y", "Z"):
        target = tmp_path / f"new_{up}.usdc"
        write_new(replace(a, origin=replace(a.origin, path=None)), target, up=up)
        b = read_clip(target)
        assert b.origin.up_axis == up
        assert_same_motion(a, b)
        assert_same_world(b)
        assert np.abs(a.skeleton.bind - b.skeleton.bind).max() < 1e-4
        assert np.abs(a.skeleton.rest - b.skeleton.rest).max() < 1e-4
        assert np.array_equal(a.time_codes, b.time_codes)
        assert not check_file(target)
        stage = Usd.Stage.Open(str(target))
        assert stage.GetDefaultPrim().IsA(UsdSkel.Root)


def test_names_become_legal_and_joints_follow_their_parents() -> None:
    a = read_clip(TALK)
    names = ["a b", "a-b", "a.b", "1st", "mixamorig:Hips", "ü x"]
    joints = tuple(f"Root/{name}" for name in names)
    parents = np.array([6] * 6 + [-1])
    skeleton = replace(
        a.skeleton,
        joints=(*joints, "Root"),
        parents=parents,
        bind=a.skeleton.bind[:7],
        rest=a.skeleton.rest[:7],
        aliases=(*"abcdef", "hips"),
    )
    clip = joints_of(a, slice(7), skeleton)
    b = legal_clip(clip)
    assert b.skeleton.joints[0] == "Root"
    assert b.skeleton.joints[1:4] == ("Root/a_b", "Root/a_b_2", "Root/a_b_3")
    assert b.skeleton.originals == ("Root", *names)
    assert b.skeleton.aliases == ("hips", *"abcdef")
    assert np.array_equal(b.skeleton.parents, parents_from_paths(b.skeleton.joints))
    assert np.array_equal(b.rotations[:, 0], clip.rotations[:, 6])
    again = character_of(b)
    topology = UsdSkel.Topology(Vt.TokenArray(list(b.skeleton.joints)))
    assert list(topology.GetParentIndices()) == b.skeleton.parents.tolist()
    assert again.animation is not None


def test_fingers_go_onto_another_character(tmp_path: Path) -> None:
    target = tmp_path / "ben_talks.usdc"
    run("convert", TALK, "--onto", BEN, "-o", target)
    a, b = read_clip(TALK), read_clip(target)
    assert not errors(target)
    assert b.fps == a.fps
    assert len(b) == len(a)
    theirs, own = find_hands(a).encode(a), find_hands(b).encode(b)
    shared = [n for n in theirs.names if n in own.names]
    assert len(shared) == 90
    difference = theirs.select(shared).values - own.select(shared).values
    assert np.abs((difference + 180.0) % 360.0 - 180.0).max() < 0.01
    assert meshes(target) == meshes(BEN) != []  # the character is written, not the hands


def test_hands_that_share_no_side_are_refused() -> None:
    right = read_clip(REPOSITORY / "samples" / "hands" / "talk_01_hands_right.usdc")
    keep = [j for j, name in enumerate(right.skeleton.joints) if "Right" not in name]
    assert len(keep) < len(right.skeleton)
    body = read_clip(TALK)
    left = [j for j, name in enumerate(body.skeleton.joints) if "RightHand" not in name]
    place = {j: i for i, j in enumerate(left)}
    skeleton = replace(
        body.skeleton,
        joints=tuple(body.skeleton.joints[j] for j in left),
        parents=np.array([place.get(int(body.skeleton.parents[j]), -1) for j in left]),
        bind=body.skeleton.bind[left],
        rest=body.skeleton.rest[left],
    )
    with pytest.raises(HandNotFoundError, match="no hand in common"):
        retarget_hands(right, joints_of(body, left, skeleton))


@pytest.mark.real_data
@pytest.mark.parametrize("folder", ["full", "mini"])
def test_real_takes_convert(tmp_path: Path, folder: str) -> None:
    takes = sorted(shared_data("studiogalt", folder).glob("*.usdc"))[:2]
    run("convert", *takes, "--out-dir", tmp_path / "out", "--to", "usda", "--fps", 30)
    for take in takes:
        target = tmp_path / "out" / f"{take.stem}.usda"
        a, b = read_clip(take), read_clip(target)
        assert not errors(target)
        assert_same_world(b)
        assert len(b) == (len(a) + 1) // 2
        difference = forward_kinematics(b).positions - forward_kinematics(a).positions[::2]
        assert np.abs(difference).max() < 1e-3


@pytest.mark.real_data
def test_the_maya_character_takes_fingers(tmp_path: Path) -> None:
    maya = shared_data("maya", "HIK_Export.usda")
    target = tmp_path / "maya.usdc"
    run("convert", TALK, "--onto", maya, "-o", target)
    a, b = read_clip(TALK), read_clip(target)
    theirs, own = find_hands(a).encode(a), find_hands(b).encode(b)
    shared = [n for n in theirs.names if n in own.names]
    assert len(shared) >= 80
    difference = theirs.select(shared).values - own.select(shared).values
    assert np.abs((difference + 180.0) % 360.0 - 180.0).max() < 0.05


def test_the_report_says_what_was_read(tmp_path: Path) -> None:
    result = run("convert", TALK, "-o", tmp_path / "a.usda", "--json", "--fps", 60)
    data = json.loads(result.output)
    assert data["schema"] == "usdhand.convert/1"
    [file] = data["files"]
    assert file["fps"] == 60
    assert file["read"]["fps"] == 30
    assert file["convention"] == "humanik"
    assert data["settings"]["fps"] == 60


def test_several_inputs_go_to_a_folder_and_bad_ones_do_not_stop_it(tmp_path: Path) -> None:
    bad = tmp_path / "bad.usda"
    bad.write_text("#usda 1.0\n(")
    result = run("convert", TALK, bad, "--out-dir", tmp_path / "out", code=3)
    assert "bad.usda" in result.output
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["talk_01_full.usdc"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "either -o OUTPUT or --out-dir"),
        (("-o", "a.xyz"), "cannot write '.xyz'"),
        (("-o", "a.fbx"), "cannot write '.fbx'"),
        (("-o", "a.usda", "--trim", "5000:6000"), "no frame from 5000 to 6000"),
        (("-o", "a.usda", "--trim", "x"), "not FIRST:LAST"),
        (("-o", "a.usda", "--fps", "0"), "give a number above 0"),
        (("-o", "a.usda", "--fps", "1e12"), "would make over"),
        (("-o", "a.usda", "--scale", "-1"), "give a number above 0"),
        (("-o", "a.usda", "--scale", "1e300"), "give a number above 0"),
        (("-o", "a.usda", "--start", "nan"), "give a time code"),
        (("-o", "a.bvh", "--start", "inf"), "give a time code"),
        (("-o", "a.glb", "--up", "Z"), "always Y up"),
        (("-o", "a.usda", "--to", "bvh"), "contradict each other"),
        (("-o", "a.usda", "--onto-skel", "Skel"), "which is not given"),
        (("-o", "a.usda", "--input-up", "Z"), "a USD file states this itself"),
        (("-o", "a.usda", "--units", "parsec"), "one of mm, cm"),
        (("-o", "a.usda", "--units", "m"), "a USD file states this itself"),
        (("-o", "a.usda", "--animation", "Walk"), "a USD file states this itself"),
    ],
)
def test_what_cannot_be_done_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("convert", TALK, *arguments, code=2)
    assert message in " ".join(result.output.split())
    assert not list(tmp_path.iterdir())
