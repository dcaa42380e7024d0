"""convert between formats, and every verb on files that are not USD."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import frames_of
from conftest import REPOSITORY, shared_data

from usdhand import find_hands, read_character, read_clip
from usdhand.formats.files import animation_names
from usdhand.formats.usd.check import check_file
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

SAMPLES = REPOSITORY / "samples"
TALK = SAMPLES / "conversations" / "talk_01_full.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
NEAR_CM, NEAR_DEG = 0.01, 0.01  # 0.1 mm and a hundredth of a degree

OTHERS = ("bvh", "glb", "gltf")


def by_name(clip: Clip) -> dict[str, int]:
    names = clip.skeleton.originals or clip.skeleton.names
    return {name: j for j, name in enumerate(names)}


def assert_same_motion(a: Clip, b: Clip, time: bool = True) -> None:
    """The joints of ``a`` are where they were, and turned from the bind pose as they were."""
    assert len(a) == len(b)
    assert a.fps == pytest.approx(b.fps, rel=1e-6)
    if time:
        assert a.start == pytest.approx(b.start, abs=1e-6)
    index = by_name(b)
    there = [index[name] for name in by_name(a)]
    poses = forward_kinematics(a), forward_kinematics(b)
    assert np.abs(poses[0].positions - poses[1].positions[:, there]).max() < NEAR_CM
    turned = [
        rot.multiply(p.rotations, rot.conjugate(rot.from_matrix(c.skeleton.bind_rotations)))
        for p, c in zip(poses, (a, b), strict=True)
    ]
    assert rot.angle_between(turned[0], turned[1][:, there]).max() < NEAR_DEG


@pytest.mark.parametrize("suffix", OTHERS)
def test_round_trips_from_usd(tmp_path: Path, suffix: str) -> None:
    other, back = tmp_path / f"talk.{suffix}", tmp_path / "back.usda"
    run("convert", TALK, "-o", other, "--trim", "100:220")
    run("convert", other, "-o", back)
    a, b = read_clip(TALK), read_clip(back)
    a = replace(frames_of(a, slice(99, 220)), origin=replace(a.origin, first_time_code=100.0))
    assert_same_motion(a, b, time=suffix != "bvh")
    assert not [f for f in check_file(back) if f.severity == "error"]
    # Fingers mean the same, since the bind pose survives.
    theirs, own = find_hands(a).encode(a), find_hands(b).encode(b)
    difference = theirs.values - own.select(theirs.names).values
    assert np.abs((difference + 180.0) % 360.0 - 180.0).max() < 0.05


@pytest.mark.real_data
@pytest.mark.parametrize("suffix", ["bvh", "glb"])
@pytest.mark.parametrize("folder", ["full", "mini"])
def test_round_trips_of_real_takes(tmp_path: Path, folder: str, suffix: str) -> None:
    take = sorted(shared_data("studiogalt", folder).glob("*.usdc"))[3]
    other, back = tmp_path / f"take.{suffix}", tmp_path / "back.usdc"
    run("convert", take, "-o", other)
    run("convert", other, "-o", back)
    assert_same_motion(read_clip(take), read_clip(back), time=suffix != "bvh")


def test_names_that_usd_does_not_take_come_back(tmp_path: Path) -> None:
    bvh = tmp_path / "a.bvh"
    run("convert", TALK, "-o", bvh, "--trim", "1:5")
    bvh.write_text(bvh.read_text().replace("LeftHandIndex", "mixamorig:Left-Hand.Index"))
    usd, back = tmp_path / "a.usda", tmp_path / "b.bvh"
    run("convert", bvh, "-o", usd)
    clip = read_clip(usd)
    assert any(name.startswith("mixamorig_Left_Hand_Index") for name in clip.skeleton.names)
    run("convert", usd, "-o", back)
    assert "mixamorig:Left-Hand.Index1" in back.read_text()


def files_of_other_formats() -> list[str]:
    return [
        "bvh/animated-drawings/jesse_dance.bvh",
        "bvh/animated-drawings/jumping_jacks.bvh",
        "bvh/animated-drawings/wave_hello.bvh",
        "bvh/performs/Idle.bvh",
        "fbx/ozz/crossarms.fbx",
        "fbx/ozz/walk.fbx",
        "gltf/webxr-generic-hand/left.glb",
        "gltf/webxr-generic-hand/right.glb",
    ]


@pytest.mark.real_data
@pytest.mark.parametrize("name", files_of_other_formats())
def test_real_files_become_characters(tmp_path: Path, name: str) -> None:
    source = shared_data(*name.split("/"))
    if source.suffix == ".fbx":
        pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
    target = tmp_path / "out.usdc"
    data = json.loads(run("convert", source, "-o", target, "--json", "-q").output)
    [file] = data["files"]
    a = (read_clip if file["animated"] else read_character)(source)
    b = (read_clip if file["animated"] else read_character)(target)
    assert_same_motion(a, b)
    found = [f for f in check_file(target) if f.code != "no-animation"]
    assert not found, found
    if source.suffix == ".bvh":
        assert {"guessed-units", "guessed-up-axis"} <= {p["code"] for p in file["problems"]}


@pytest.mark.real_data
def test_all_takes_of_a_file_are_written(tmp_path: Path) -> None:
    pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
    takes = sorted(shared_data("studiogalt", "fbx").glob("*_7_*Full.fbx"))
    names = animation_names(takes[0])
    assert len(names) > 1
    assert "--animation" in run("convert", takes[0], "-o", tmp_path / "a.usdc", code=2).output
    run("convert", takes[0], "--out-dir", tmp_path / "out")
    assert len(list((tmp_path / "out").iterdir())) == len(names)
    run("convert", takes[0], "-o", tmp_path / "a.usdc", "--animation", names[0])


@pytest.mark.real_data
def test_a_file_of_several_takes_is_inspected_and_can_get_fingers(
    tmp_path: Path, library: Path
) -> None:
    pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
    take = sorted(shared_data("studiogalt", "fbx").glob("*_7_*Full.fbx"))[0]
    names = animation_names(take)
    text = run("inspect", take).output
    assert all(f"'{name}'" in text for name in names)
    refused = run("fill", take, "--library", library, "-o", tmp_path / "a.usda", code=2).output
    assert "usdhand convert FILE --animation NAME" in refused
    result = run("convert", TALK, "--onto", take, "-o", tmp_path / "a.usdc")
    assert f"{len(names)} animations: its body stays at the bind pose" in result.output


def test_what_onto_leaves_out_is_said(tmp_path: Path) -> None:
    right = SAMPLES / "hands" / "talk_01_hands_right.usdc"
    data = json.loads(
        run("convert", right, "--onto", TALK, "-o", tmp_path / "a.usdc", "--json", "-q").output
    )
    lost = {p["code"]: p["message"] for p in data["files"][0]["lost"]}
    assert "has no left hand" in lost["no-common-hand"]
    assert "is cut for the last 16." in lost["other-length"]


def test_odd_bytes_in_names_are_no_traceback(tmp_path: Path) -> None:
    bvh = tmp_path / "take\udcff.bvh"
    run("convert", TALK, "-o", bvh, "--trim", "1:5")
    report = tmp_path / "report.json"
    run("convert", bvh, "-o", tmp_path / "a.usda", "--report", report, "--json")
    assert json.loads(report.read_text())["files"][0]["path"] == str(bvh)


def test_units_and_up_axis_can_be_said(tmp_path: Path) -> None:
    bvh = tmp_path / "a.bvh"
    run("convert", TALK, "-o", bvh, "--trim", "1:5")
    run("convert", bvh, "-o", tmp_path / "m.usda", "--units", "m")
    run("convert", bvh, "-o", tmp_path / "cm.usda", "--units", "1")
    m, cm = read_clip(tmp_path / "m.usda"), read_clip(tmp_path / "cm.usda")
    assert np.allclose(m.translations, 100.0 * cm.translations, rtol=1e-5, atol=1e-4)
    run("convert", bvh, "-o", tmp_path / "z.usda", "--input-up", "Z")
    z = read_clip(tmp_path / "z.usda")
    a, b = forward_kinematics(cm).positions, forward_kinematics(z).positions
    assert np.abs(b - a[..., [0, 2, 1]] * [1, 1, -1]).max() < 1e-3


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("library") / "lib.usdc"
    run("library", "build", *sorted((SAMPLES / "gestures").glob("*.usdc"))[:24], "-o", path)
    return path


@pytest.mark.parametrize("suffix", ["bvh", "glb"])
def test_every_verb_takes_other_formats(tmp_path: Path, library: Path, suffix: str) -> None:
    body, hands, full = (tmp_path / f"{name}.{suffix}" for name in ("body", "hands", "full"))
    for source, target in ((BODY, body), (HANDS, hands), (TALK, full)):
        run("convert", source, "-o", target, *(() if source == HANDS else ("--trim", "1:240")))
    run("inspect", full, body)
    filled = tmp_path / "filled.usda"
    run("fill", body, "--library", library, "-o", filled, "--alternatives", 2)
    spliced = tmp_path / "spliced.usda"
    first = 0 if suffix == "bvh" else 1  # BVH knows no start time
    pins = ["--pin", f"{first}:{first}", "--pin", f"{first + 180}:{first + 402}"]
    run("splice", body, hands, "-o", spliced, *pins)
    rig = tmp_path / "rig.usda"
    run("reduce", full, "-o", rig)
    run("expand", rig, "-o", tmp_path / "expanded.usda")
    run("expand", rig, "--onto", body, "-o", tmp_path / "onto.usda")
    run("compare", full, filled)
    for result in (filled, spliced, rig, tmp_path / "expanded.usda", tmp_path / "onto.usda"):
        assert not [f for f in check_file(result) if f.severity == "error"]
        moved = read_clip(result)
        assert len(moved) == len(read_clip(body))
        # Joints that are no fingers stay to the last digit that float32 has.
        source = read_clip(full if result in (rig, tmp_path / "expanded.usda") else body)
        fingers = {int(j) for f in find_hands(moved).frames.values() for j in f.joints}
        others = [j for j in range(len(moved.skeleton)) if j not in fingers]
        if result.name != "onto.usda":
            assert np.abs(moved.rotations[:, others] - source.rotations[:, others]).max() < 1e-6


@pytest.mark.parametrize("suffix", ["bvh", "glb"])
def test_libraries_take_clips_of_other_formats(tmp_path: Path, suffix: str) -> None:
    clips = tmp_path / "clips"
    clips.mkdir()
    for source in sorted((SAMPLES / "gestures").glob("*.usdc"))[:6]:
        run("convert", source, "-o", clips / f"{source.stem}.{suffix}")
    library = tmp_path / "lib.usda"
    run("library", "build", clips, "-o", library)
    data = json.loads(run("library", "info", library, "--json").output)
    assert data["clips"] == 6
    assert not data["gone"]
    assert not [f for f in check_file(library) if f.severity == "error"]
    run("fill", BODY, "--library", library, "-o", tmp_path / "filled.usda")


def test_check_is_for_usd(tmp_path: Path) -> None:
    bvh = tmp_path / "a.bvh"
    run("convert", TALK, "-o", bvh, "--trim", "1:5")
    assert "not a USD file" in run("check", bvh, code=3).output
