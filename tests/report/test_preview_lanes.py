"""Lanes of the page of preview: what they say and show, and what they leave out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.preview_pages import (
    GESTURES,
    SAMPLES,
    Results,
    joined,
    page_data,
    shared_results,
    unpacked,
)
from builders.shared_work import SharedWork
from conftest import shared_data
from pxr import Usd

import usdhand
from usdhand.formats.usd.shown import read_shown
from usdhand.motion import forward_kinematics
from usdhand.motion import rotations as rot

OK = GESTURES / "ok_01.usdc"


@pytest.fixture(scope="module")
def results(shared_work: SharedWork) -> Results:
    return shared_results(shared_work)


def test_alternatives_are_lanes_and_the_body_is_stored_once(
    results: Results, tmp_path: Path
) -> None:
    run("preview", results.filled, "-o", tmp_path / "fill.html")
    data = page_data(tmp_path / "fill.html")
    first, second = data["lanes"]
    assert [first["alternative"], second["alternative"]] == ["choice_1", "choice_2"]
    assert [first["shown"], second["shown"]] == [True, False]
    joint = first["joints"].index
    assert first["rotations"][joint("Hips")] == second["rotations"][joint("Hips")]
    fingers = [n for n in first["joints"] if "HandIndex" in n or "HandMiddle" in n]
    assert any(first["rotations"][joint(n)] != second["rotations"][joint(n)] for n in fingers)
    stage = Usd.Stage.Open(str(results.filled))
    variants = [p.GetVariantSet("fingers") for p in stage.Traverse() if p.HasVariantSets()]
    assert variants[0].GetVariantSelection() == "choice_1"


def test_a_lane_says_what_the_clip_says(tmp_path: Path) -> None:
    run("preview", OK, "-o", tmp_path / "ok.html")
    data = page_data(tmp_path / "ok.html")
    [lane] = data["lanes"]
    clip = usdhand.read_clip(OK)
    assert lane["frames"] == len(clip)
    assert lane["duration"] == pytest.approx(clip.duration)
    assert lane["name"] == "ok_01"
    tables = unpacked(data)
    hands = usdhand.find_hands(clip)
    channels = hands.encode(clip)
    for side in ("left", "right"):
        curves = lane["hands"][side]["channels"]
        assert len(curves) == 25
        for name, i in curves.items():
            expected = channels.select([name]).values
            assert np.abs(tables[i] - expected).max() < 0.01
    parts = [bone["part"] for bone in lane["bones"]]
    assert min(parts.count("left"), parts.count("right")) >= 19
    radius = {part: np.mean([b["radius"] for b in lane["bones"] if b["part"] == part])
              for part in ("body", "left")}  # fmt: skip
    assert radius["left"] < 0.5 * radius["body"]


def test_cameras_know_the_front(tmp_path: Path) -> None:
    """Ada looks along +Z of a Y-up stage, Ben along -Y of one that is Z up: +Z for us."""
    run("preview", OK, SAMPLES / "gestures_ben" / "ok_01.usdc", "-o", tmp_path / "a.html")
    for lane in page_data(tmp_path / "a.html")["lanes"]:
        assert abs(lane["view"]["yaw"]) < 0.2, lane["name"]


def test_characters_without_motion_or_hands_are_shown_all_the_same(tmp_path: Path) -> None:
    run("preview", SAMPLES / "characters" / "ben.usdc", "-o", tmp_path / "still.html")
    [lane] = page_data(tmp_path / "still.html")["lanes"]
    assert lane["frames"] == 1
    takes = read_shown(SAMPLES / "characters" / "ada_hand_right.usdc")
    assert len(takes[0].clip) == 1


@pytest.mark.real_data
def test_digits_that_hang_off_nothing_have_curves(tmp_path: Path) -> None:
    """Wrist and fingers of this hand are all roots."""
    file = shared_data("gltf", "webxr-generic-hand", "left.glb")
    run("preview", file, "-o", tmp_path / "hand.html")
    [lane] = page_data(tmp_path / "hand.html")["lanes"]
    assert len(lane["hands"]["left"]["channels"]) == 25
    clip = usdhand.read_character(file)
    hands = usdhand.find_hands(clip)
    again = hands.decode(hands.encode(clip), clip)
    assert rot.angle_between(again.rotations, clip.rotations).max() < 1e-6


@pytest.mark.real_data
@pytest.mark.parametrize("side", ["left", "right"])
def test_digits_of_flat_rigs_have_bones(tmp_path: Path, side: str) -> None:
    """Wrist, metacarpals, joints and tips, none of which hangs off another."""
    file = shared_data("gltf", "webxr-generic-hand", f"{side}.glb")
    run("preview", file, "-o", tmp_path / "hand.html")
    [lane] = page_data(tmp_path / "hand.html")["lanes"]
    bones = {(lane["joints"][b["joint"]], lane["joints"][b["child"]]) for b in lane["bones"]}
    assert len(bones) == len(lane["bones"]) == 24
    index = [f"index_finger_{x}" for x in ("metacarpal", "phalanx_proximal",
             "phalanx_intermediate", "phalanx_distal", "tip")]  # fmt: skip
    assert set(zip(["wrist", *index], index, strict=False)) <= bones
    assert ("wrist", "thumb_metacarpal") in bones
    clip = usdhand.read_character(file)
    at = forward_kinematics(clip).positions[0]
    for bone in lane["bones"]:
        assert bone["part"] == side
        assert bone["loose"]
        length = np.linalg.norm(at[bone["child"]] - at[bone["joint"]])
        assert np.linalg.norm(bone["to"]) == pytest.approx(length, abs=1e-3)


@pytest.mark.real_data
def test_thumbs_beside_the_wrist_belong_to_the_hand(tmp_path: Path) -> None:
    """From the wrist to the tip, though they hang off the forearm."""
    take = shared_data("studiogalt", "full", "SG_ASL_7_2023_1_29.usdc")
    run("preview", take, "-o", tmp_path / "real.html", "--max-points", "0", "--max-frames", "2")
    [lane] = page_data(tmp_path / "real.html")["lanes"]
    parts = {lane["joints"][b["child"]]: b for b in lane["bones"]}
    for side, letter in (("left", "L"), ("right", "R")):
        chain = [f"Thumb{i}_{letter}" for i in (1, 2, 3)] + [f"Thumb3_{letter}_end"]
        assert [parts[name]["part"] for name in chain] == [side] * 4
        assert [parts[name]["loose"] for name in chain] == [True, False, False, False]
        assert lane["joints"][parts[chain[0]]["joint"]] == f"Hand_{letter}"
        assert parts[f"Forearm_{letter}"]["part"] == parts[f"Hand_{letter}"]["part"] == "body"


@pytest.mark.real_data
def test_real_takes_have_bones_of_the_body_only(tmp_path: Path) -> None:
    take = sorted(shared_data("studiogalt", "full").glob("*.usdc"))[0]
    run("preview", take, "-o", tmp_path / "real.html")
    [lane] = page_data(tmp_path / "real.html")["lanes"]
    drawn = {lane["joints"][b["child"]] for b in lane["bones"]}
    assert not drawn & {"Head_Target", "Head_Target_end", "EyeController", "Locator", "Hip_Root"}
    assert all(np.linalg.norm(b["to"]) < 60 for b in lane["bones"])
    assert set(lane["hands"]) == {"left", "right"}


def test_long_clips_are_decimated_with_a_word(tmp_path: Path) -> None:
    page = tmp_path / "long.html"
    done = run("preview", OK, "-o", page, "--max-frames", "10")
    [lane] = page_data(page)["lanes"]
    clip = usdhand.read_clip(OK)
    every = -(-len(clip) // 10)
    assert every > 3
    words = f"the page has every {every}th of {len(clip)} frames"
    assert words in done.output
    assert any(note.startswith("long clip") and words in note for note in lane["notes"])
    assert done.output.count("ok_01: ") == done.output.count("long clip") == 1
    assert lane["fps"] == pytest.approx(clip.fps / every)
    tables = unpacked(page_data(page))
    moving = [tables[i] for i in lane["rotations"] if len(tables[i]) > 1]
    assert {len(t) for t in moving} == {-(-len(clip) // every)}


def test_joined_clips_of_the_measured_page_are_one_motion(tmp_path: Path) -> None:
    clip = joined([OK, GESTURES / "ok_02.usdc"], tmp_path / "two.usdc", 3.0)
    assert len(usdhand.read_clip(tmp_path / "two.usdc")) == len(clip) == 181
