"""Clips without a file go through every function, and their results say the same in world space."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.in_memory import SAMPLES, arrays_of, in_memory, sample, without_fingers
from numpy.testing import assert_allclose

import usdhand
from usdhand.motion import Clip, forward_kinematics

GESTURES = sorted((SAMPLES / "gestures").glob("o*.usdc"))[:6]
WRITTEN = (".usda", ".usdc", ".usdz", ".bvh", ".glb", ".gltf")
CM = 2e-3  # formats round


def made(name: str) -> Clip:
    """A sample in memory, from arrays in metres and Z up, with quaternions as wxyz."""
    return Clip.from_arrays(**arrays_of(sample(name), metres_z_up=True, wxyz=True))


@pytest.fixture(scope="module")
def gesture() -> Clip:
    return made("gestures/ok_01")


@pytest.fixture(scope="module")
def body() -> Clip:
    return made("conversations/talk_01_body")


@pytest.fixture(scope="module")
def fingers() -> Clip:
    return made("hands/talk_01_hands_a")


@pytest.fixture(scope="module")
def library() -> usdhand.MotionLibrary:
    return usdhand.build_library(GESTURES, "library.usdc").library


def places(clip: Clip) -> dict[str, np.ndarray]:
    """World positions (frames, 3) of joints, by name."""
    pose = forward_kinematics(clip)
    return {name: pose.position(j) for j, name in enumerate(clip.skeleton.names)}


def assert_same_world(clip: Clip, other: Clip) -> None:
    ours, theirs = places(clip), places(other)
    assert ours.keys() <= theirs.keys()
    for name, place in ours.items():
        assert_allclose(theirs[name], place, atol=CM, err_msg=name)


def test_hands_are_found_as_in_the_file(gesture: Clip) -> None:
    hands, theirs = usdhand.find_hands(gesture), usdhand.find_hands(sample("gestures/ok_01"))
    assert hands.character == theirs.character
    assert_allclose(
        hands.encode(gesture).values, theirs.encode(sample("gestures/ok_01")).values, atol=1e-3
    )


def test_a_rig_is_written_and_expanded(gesture: Clip, tmp_path: Path) -> None:
    [reduction] = usdhand.reduce_hands([gesture])
    usdhand.write_rig(reduction, tmp_path / "rig.usda")
    assert usdhand.read_rig(tmp_path / "rig.usda").free == reduction.rig.free
    assert_same_world(reduction.motion, usdhand.expand(tmp_path / "rig.usda"))
    assert_same_world(reduction.motion, usdhand.read_clip(tmp_path / "rig.usda"))
    onto = usdhand.expand_onto(tmp_path / "rig.usda", gesture)
    assert_same_world(reduction.motion, onto)


@pytest.mark.parametrize("flatten", [False, True])
def test_filled_bodies_are_written(
    body: Clip, library: usdhand.MotionLibrary, flatten: bool, tmp_path: Path
) -> None:
    settings = usdhand.FillSettings(alternatives=2)
    filled = usdhand.fill_fingers(body, library, settings)
    theirs = usdhand.fill_fingers(sample("conversations/talk_01_body"), library, settings)
    assert_same_world(filled.clips[0], theirs.clips[0])
    output = tmp_path / "filled.usda"
    usdhand.write_filled(filled, output, flatten=flatten)
    assert_same_world(filled.clips[0], usdhand.read_clip(output))
    lanes = usdhand.preview_clips([output]).clips
    assert len(lanes) == 2
    for clip, lane in zip(filled.clips, lanes, strict=True):
        assert_same_world(clip, lane)


def test_a_body_gets_finger_joints_and_is_filled(
    body: Clip, library: usdhand.MotionLibrary, tmp_path: Path
) -> None:
    bare = without_fingers(body)
    with pytest.raises(usdhand.HandNotFoundError, match="has no finger joints"):
        usdhand.fill_fingers(bare, library)
    grafted = usdhand.add_finger_joints(bare, body.skeleton, usdhand.find_hands(body))
    filled = usdhand.fill_fingers(grafted.clip, library)
    usdhand.write_filled(filled, tmp_path / "filled.usda")
    read = usdhand.read_clip(tmp_path / "filled.usda")
    assert len(read.skeleton) == len(body.skeleton)
    assert_same_world(filled.clips[0], read)


@pytest.mark.parametrize("wrist", ["body", "hands"])
def test_spliced_bodies_are_written(body: Clip, fingers: Clip, wrist: str, tmp_path: Path) -> None:
    settings = usdhand.SpliceSettings(wrist=wrist)  # type: ignore[arg-type]
    spliced = usdhand.splice_hands(body, fingers, settings, pins=["0:0", "180:402"])
    theirs = usdhand.splice_hands(
        sample("conversations/talk_01_body"),
        sample("hands/talk_01_hands_a"),
        settings,
        pins=["1:1", "181:403"],
    )
    assert_same_world(spliced.clip, theirs.clip)
    usdhand.write_spliced(spliced, tmp_path / "spliced.usda")
    assert_same_world(spliced.clip, usdhand.read_clip(tmp_path / "spliced.usda"))


def test_it_is_compared_with_its_file(gesture: Clip) -> None:
    found = usdhand.compare(gesture, SAMPLES / "gestures" / "ok_01.usdc")
    assert found.max_deg < 1e-3
    assert found.fingertip_max < 1e-2


def test_its_fingers_go_to_another_character(gesture: Clip) -> None:
    ben = usdhand.read_character(SAMPLES / "characters" / "ben.usdc")
    onto = usdhand.retarget_hands(gesture, ben)
    assert usdhand.compare(gesture, onto).rms_deg < 1e-3
    back = usdhand.retarget_hands(onto, gesture)
    assert usdhand.compare(gesture, back).rms_deg < 1e-3


@pytest.mark.parametrize("suffix", WRITTEN)
def test_it_is_written_in_every_format(gesture: Clip, suffix: str, tmp_path: Path) -> None:
    output = tmp_path / f"clip{suffix}"
    usdhand.write_new(gesture, output)
    read = usdhand.read_clip(output)
    assert (len(read), read.fps) == (len(gesture), pytest.approx(gesture.fps))
    assert_same_world(gesture, read)


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_it_is_written_as_a_clip(gesture: Clip, suffix: str, tmp_path: Path) -> None:
    output = tmp_path / f"clip{suffix}"
    usdhand.write_clip(gesture, output)
    assert_same_world(gesture, usdhand.read_clip(output))
    with pytest.raises(usdhand.OutputError, match="exists"):
        usdhand.write_clip(gesture, output)


def test_it_is_shown_beside_files_and_itself(gesture: Clip) -> None:
    moved = replace(gesture, translations=gesture.translations + 1.0)
    file = SAMPLES / "gestures" / "ok_01.usdc"
    page = usdhand.preview_clips([gesture, file, moved])
    assert [lane["name"] for lane in page.lanes] == ["ok_01 2", "ok_01", "ok_01 3"]
    assert page.clips[0] is gesture
    assert all(lane["hands"] for lane in page.lanes)
    assert page.notes == ()


def test_names_that_usd_does_not_allow(tmp_path: Path) -> None:
    clip = sample("gestures/ok_01")
    joints = [
        "/".join(f"rig:{part}-1" for part in path.split("/")) for path in clip.skeleton.joints
    ]
    renamed = Clip.from_arrays(**arrays_of(clip) | {"joints": joints})
    assert usdhand.find_hands(renamed).character.hands.keys() == {"left", "right"}
    usdhand.write_clip(renamed, tmp_path / "clip.usda")
    read = usdhand.read_clip(tmp_path / "clip.usda")
    assert_allclose(
        forward_kinematics(read).positions, forward_kinematics(renamed).positions, atol=CM
    )
    assert usdhand.compare(renamed, read).rms_deg < 1e-3


def test_a_clip_of_arrays_is_the_same_after_all(gesture: Clip) -> None:
    assert_same_world(gesture, in_memory(gesture))
