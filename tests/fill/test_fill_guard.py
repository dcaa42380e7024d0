"""A fill never copies the answer, and never takes fingers that do not move."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import frames_of
from conftest import REPOSITORY, shared_data

import usdhand
from usdhand.anatomy import Side
from usdhand.fill.arm import ArmMotion, arm_motion
from usdhand.fill.duplicates import same_motion
from usdhand.fill.library import MotionLibrary, at_arm_rate, library_clip
from usdhand.fill.settings import Segmentation
from usdhand.motion import Clip

SAMPLES = REPOSITORY / "samples"
TALKS = SAMPLES / "conversations"


def flattened(source: Path, target: Path) -> Path:
    from pxr import Usd

    target.parent.mkdir(parents=True, exist_ok=True)
    Usd.Stage.Open(str(source)).Flatten().Export(str(target))
    return target


def test_the_same_performance_under_another_name_is_left_out(tmp_path: Path) -> None:
    for name in ("ok_01", "wipe_01", "turn_01", "big_02"):
        flattened(SAMPLES / "gestures" / f"{name}.usdc", tmp_path / "clips" / f"{name}.usdc")
    flattened(TALKS / "talk_01_full.usdc", tmp_path / "clips" / "renamed.usdc")
    library, out = tmp_path / "l.usdc", tmp_path / "o.usda"
    run("library", "build", tmp_path / "clips", "-o", library, "-q")
    body = TALKS / "talk_01_body.usdc"
    report = json.loads(run("fill", body, "--library", library, "-o", out, "--json").stdout)
    assert report["left_out"] == ["renamed"]


def test_equal_names_of_other_motion_are_used(tmp_path: Path) -> None:
    for shot, name in (("s0", "ok_01"), ("s1", "wipe_01"), ("s2", "turn_01")):
        flattened(SAMPLES / "gestures" / f"{name}.usdc", tmp_path / shot / "anim.usdc")
    body = flattened(TALKS / "talk_01_body.usdc", tmp_path / "new" / "anim.usdc")
    library, out = tmp_path / "l.usdc", tmp_path / "o.usda"
    clips = [tmp_path / s / "anim.usdc" for s in ("s0", "s1", "s2")]
    run("library", "build", *clips, "-o", library, "-q")
    report = json.loads(run("fill", body, "--library", library, "-o", out, "--json").stdout)
    assert report["left_out"] == []
    assert report["hands"]["right"]["segments"]


def test_no_piece_is_played_twice_in_a_row(gestures_library: Path, tmp_path: Path) -> None:
    given = ("--library", gestures_library, "-o", tmp_path / "o.usda")
    report = json.loads(run("fill", TALKS / "talk_01_body.usdc", *given, "--json").stdout)
    for hand in report["hands"].values():
        pieces = [(s["clip"], s["clip_start"]) for s in hand["segments"]]
        assert sum(a == b for a, b in pairwise(pieces)) <= len(pieces) // 20
        seams = hand["seams"]
        captured = seams["max_acceleration_captured_deg_s2"]
        assert seams["max_acceleration_deg_s2"] < 1.2 * captured


def test_still_fingers_are_no_library(tmp_path: Path) -> None:
    library = tmp_path / "l.usdc"
    built = json.loads(run("library", "build", TALKS, "-o", library, "--json").stdout)
    left = {Path(x["path"]).stem: x["reason"] for x in built["left_out"]}
    assert set(left) == {f"talk_0{i}_body" for i in (1, 2, 3)}
    assert all("do not move" in reason for reason in left.values())


@pytest.mark.parametrize("verb", ["fill", "library"])
def test_a_refused_report_leaves_no_output(tmp_path: Path, verb: str) -> None:
    library = tmp_path / "l.usdc"
    clips = [SAMPLES / "gestures" / f"ok_0{i}.usdc" for i in (1, 2)]
    bad = ("--report", tmp_path / "none" / "r.json")
    if verb == "library":
        run("library", "build", *clips, "-o", library, *bad, code=2)
        assert list(tmp_path.iterdir()) == []
        return
    run("library", "build", *clips, "-o", library, "-q")
    body = TALKS / "talk_01_body.usdc"
    run("fill", body, "--library", library, "-o", tmp_path / "o.usda", *bad, code=2)
    assert [p.name for p in tmp_path.iterdir()] == ["l.usdc"]
    shutil.rmtree(tmp_path)


def test_a_body_without_finger_joints_is_told_so(tmp_path: Path) -> None:
    from pxr import Usd, Vt

    stage = Usd.Stage.Open(Usd.Stage.Open(str(TALKS / "talk_01_body.usdc")).Flatten())
    skeleton = stage.GetPrimAtPath("/Ada/Skeleton")
    joints = list(skeleton.GetAttribute("joints").Get())
    keep = [i for i, j in enumerate(joints) if "Hand/" not in j]
    for name in ("bindTransforms", "restTransforms"):
        values = skeleton.GetAttribute(name).Get()
        skeleton.GetAttribute(name).Set(Vt.Matrix4dArray([values[i] for i in keep]))
    skeleton.GetAttribute("joints").Set(Vt.TokenArray([joints[i] for i in keep]))
    body, library = tmp_path / "body.usdc", tmp_path / "l.usdc"
    stage.GetRootLayer().Export(str(body))
    run("library", "build", SAMPLES / "gestures" / "ok_01.usdc", "-o", library, "-q")
    result = run("fill", body, "--library", library, "-o", tmp_path / "o.usda", code=4)
    assert "no finger joints" in result.output


def test_the_same_performance_on_a_body_of_other_proportions_is_left_out() -> None:
    """Its wrists go elsewhere, its hands turn alike; a take that only stands still does neither."""
    body = usdhand.read_clip(TALKS / "talk_01_body.usdc")
    longer = body.translations.copy()
    names = body.skeleton.names
    longer[:, [i for i, n in enumerate(names) if "Arm" in n or n.endswith("Hand")]] *= 1.4
    twin = usdhand.read_clip(TALKS / "talk_01_full.usdc")
    entry = library_clip(
        twin, usdhand.find_hands(twin), Segmentation(), path="a.usdc", content_hash="1"
    )
    other = usdhand.read_clip(SAMPLES / "gestures" / "ok_01.usdc")
    second = library_clip(
        other, usdhand.find_hands(other), Segmentation(), path="b.usdc", content_hash="2"
    )
    library = MotionLibrary((entry, second))
    hands = usdhand.find_hands(body)

    def arms(clip: Clip) -> dict[Side, ArmMotion]:
        return {s: at_arm_rate(arm_motion(clip, hands, s), clip.fps) for s in hands.frames}

    assert same_motion(library, arms(body), None) == [0]
    assert same_motion(library, arms(replace(body, translations=longer)), None) == [0]
    still = body.with_rotations(np.repeat(body.rotations[:1], len(body), axis=0))
    assert same_motion(library, arms(still), None) == []
    assert same_motion(library, {}, "2") == [1]


@pytest.mark.parametrize("frames", [slice(0, 90), slice(150, 300), slice(30, 61)])
def test_an_excerpt_is_the_same_performance(frames: slice) -> None:
    """A piece of a take is told to be of it, and not of others; and the other way round."""
    whole = [usdhand.read_clip(TALKS / f"talk_0{i}_full.usdc") for i in (1, 2, 3)]
    hands = usdhand.find_hands(whole[0])

    def arms(clip: Clip) -> dict[Side, ArmMotion]:
        return {s: at_arm_rate(arm_motion(clip, hands, s), clip.fps) for s in hands.frames}

    def library(clips: list[Clip]) -> MotionLibrary:
        made = (library_clip(c, hands, Segmentation(), path="", content_hash="") for c in clips)
        return MotionLibrary(tuple(made))

    assert same_motion(library(whole), arms(frames_of(whole[0], frames)), None) == [0]
    assert same_motion(library([frames_of(c, frames) for c in whole]), arms(whole[1]), None) == [1]


@pytest.mark.real_data
def test_the_same_takes_on_two_rigs() -> None:
    """Every take of the smaller rig is told to be one of the larger, and which."""
    folders = [shared_data("studiogalt", name) for name in ("mini", "full")]
    mini, full = (sorted(folder.glob("*.usdc")) for folder in folders)
    names = [*[path.stem for path in mini][::3], "SG_ASL_About_1_2023_2_27"]
    entries = []
    for path in full:
        if path.stem in names or path.stem < "SG_ASL_Abe":
            clip = usdhand.read_clip(path)
            entries.append(
                library_clip(
                    clip, usdhand.find_hands(clip), Segmentation(), path=path.name, content_hash=""
                )
            )
    library = MotionLibrary(tuple(entries))
    for path in mini:
        if path.stem in names:
            clip = usdhand.read_clip(path)
            hands = usdhand.find_hands(clip)
            arms = {s: at_arm_rate(arm_motion(clip, hands, s), clip.fps) for s in hands.frames}
            found = same_motion(library, arms, None)
            assert [library.clips[i].name for i in found] == [path.stem]
