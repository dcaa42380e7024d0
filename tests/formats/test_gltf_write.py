"""glTF files written: they come back the same, other programs see bones, times survive."""

from __future__ import annotations

import json
import os
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.blender import blender_python
from builders.clips import frames_of, joints_of
from builders.real_takes import USD_TAKES
from conftest import REPOSITORY, shared_data

import usdhand
from usdhand.errors import InputError
from usdhand.formats.gltf.read import read_clip
from usdhand.formats.gltf.write import write_clip
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot

CLOSE_CM, CLOSE_DEG = 1e-2, 1e-2  # 0.1 mm, a hundredth of a degree
SAMPLES = ("gestures/ok_02", "gestures_ben/wipe_01", "conversations/talk_01_full")


def sample(name: str = SAMPLES[0]) -> Clip:
    return usdhand.read_clip(REPOSITORY / "samples" / f"{name}.usdc")


def content(path: Path) -> dict:
    data = path.read_bytes()
    if path.suffix == ".gltf":
        return json.loads(data)
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size])


def assert_comes_back(clip: Clip, path: Path) -> Clip:
    assert write_clip(clip, path) == ()
    again = read_clip(path)
    assert_same(clip, again)
    names = [again.skeleton.names.index(name) for name in clip.skeleton.names]
    assert again.skeleton.rest[names] == pytest.approx(clip.skeleton.rest, abs=1e-3)
    return again


def assert_same(clip: Clip, again: Clip) -> None:
    """The same motion, and the same bind pose: it is what hands are measured against."""
    assert not again.problems
    names = [again.skeleton.names.index(name) for name in clip.skeleton.names]
    assert len(names) == len(again.skeleton)
    assert len(again) == len(clip)
    assert again.fps == clip.fps
    assert again.times == pytest.approx(clip.times, abs=1e-5)
    a, b = forward_kinematics(clip), forward_kinematics(again, names)
    assert np.abs(a.positions - b.positions).max() < CLOSE_CM
    assert rot.angle_between(a.rotations, b.rotations).max() < CLOSE_DEG
    assert again.skeleton.bind_positions[names] == pytest.approx(
        clip.skeleton.bind_positions, abs=CLOSE_CM
    )
    turned = rot.from_matrix(again.skeleton.bind_rotations[names])
    bound = rot.from_matrix(clip.skeleton.bind_rotations)
    assert rot.angle_between(turned, bound).max() < CLOSE_DEG


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", SAMPLES)
def test_samples_come_back(name: str, suffix: str, tmp_path: Path) -> None:
    clip = sample(name)
    path = tmp_path / f"take{suffix}"
    again = assert_comes_back(clip, path)
    assert again.skeleton.joints == clip.skeleton.joints
    # And once more from glTF: nothing creeps.
    assert_comes_back(again, tmp_path / f"again{suffix}")


@pytest.mark.real_data
@pytest.mark.parametrize("take", USD_TAKES)
def test_real_takes_come_back(take: str, tmp_path: Path) -> None:
    assert_comes_back(usdhand.read_clip(shared_data(*take.split("/"))), tmp_path / "take.glb")


def test_what_stands_still_is_written_once(tmp_path: Path) -> None:
    clip = sample()
    still = [clip.skeleton.find(n) for n in ("LeftFoot", "RightFoot")]
    rotations = clip.rotations.copy()
    rotations[:, still] = rotations[0, still]
    write_clip(clip.with_rotations(rotations), tmp_path / "take.glb")
    document = content(tmp_path / "take.glb")
    [animation] = document["animations"]
    counts = {
        (document["nodes"][channel["target"]["node"]]["name"], channel["target"]["path"]): document[
            "accessors"
        ][animation["samplers"][channel["sampler"]]["output"]]["count"]
        for channel in animation["channels"]
    }
    assert counts["LeftFoot", "rotation"] == 1
    assert counts["Hips", "rotation"] == len(clip)
    assert not any(path == "scale" for _, path in counts)
    assert ("LeftFoot", "translation") not in counts, "it is where its rest pose has it"


def test_a_clip_that_never_moves_keeps_its_length(tmp_path: Path) -> None:
    clip = sample()
    assert_comes_back(frames_of(clip, np.zeros(40, int)), tmp_path / "take.glb")


def test_scales_come_back(tmp_path: Path) -> None:
    clip = sample()
    scales = np.array(clip.scales)
    hand = clip.skeleton.find("LeftHand")
    scales[:, hand] = np.linspace(1.0, 2.0, len(clip))[:, None] * [1.0, 1.1, 1.0]
    write_clip(replace(clip, scales=scales), tmp_path / "take.glb")
    again = read_clip(tmp_path / "take.glb")
    assert again.scales == pytest.approx(scales, abs=1e-6)
    positions = forward_kinematics(replace(clip, scales=scales)).positions
    assert forward_kinematics(again).positions == pytest.approx(positions, abs=CLOSE_CM)


def test_original_names_are_written(tmp_path: Path) -> None:
    clip = sample()
    originals = tuple(f"mixamorig:{name}" for name in clip.skeleton.names)
    skeleton = replace(clip.skeleton, originals=originals)
    write_clip(replace(clip, skeleton=skeleton), tmp_path / "take.glb")
    assert read_clip(tmp_path / "take.glb").skeleton.names == originals


def test_several_roots_and_parents_after_children(tmp_path: Path) -> None:
    clip = sample()
    order = np.arange(len(clip.skeleton))[::-1]
    parents = clip.skeleton.parents[order]
    parents = np.where(parents < 0, -1, len(order) - 1 - parents)
    skeleton = Skeleton(
        tuple(clip.skeleton.joints[j] for j in order),
        parents,
        clip.skeleton.bind[order],
        clip.skeleton.rest[order],
    )
    assert_comes_back(joints_of(clip, order, skeleton), tmp_path / "take.glb")


# -- times --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fps", [24.0, 30.0, 120.0, 30000 / 1001])
@pytest.mark.parametrize("first", [0.0, 1.0, 1001.0, 86400.0])
def test_times_survive(fps: float, first: float, tmp_path: Path) -> None:
    clip = sample()
    origin = replace(
        clip.origin, first_time_code=first, time_codes_per_second=fps, time_codes_per_frame=1.0
    )
    clip = replace(clip, fps=fps, origin=origin)
    assert write_clip(clip, tmp_path / "take.glb") == ()
    again = read_clip(tmp_path / "take.glb")
    assert again.fps == pytest.approx(fps, rel=1e-9)
    assert again.origin.first_time_code == first
    assert len(again) == len(clip)
    assert rot.angle_between(again.rotations, clip.rotations).max() < CLOSE_DEG


@pytest.mark.parametrize(("seconds", "reason"), [(-1.0, "be negative"), (86400.0, "that late")])
def test_times_that_cannot_be_kept_are_moved(seconds: float, reason: str, tmp_path: Path) -> None:
    clip = sample()
    origin = replace(clip.origin, first_time_code=seconds * 30.0)
    [problem] = write_clip(replace(clip, origin=origin), tmp_path / "take.glb")
    assert problem.code == "start-time"
    assert reason in problem.message
    again = read_clip(tmp_path / "take.glb")
    assert (again.start, again.fps, len(again)) == (0.0, 30.0, len(clip))


def test_no_numbers_are_refused(tmp_path: Path) -> None:
    clip = sample()
    rotations = clip.rotations.copy()
    rotations[3, 4] = np.nan
    with pytest.raises(InputError, match="not numbers"):
        write_clip(clip.with_rotations(rotations), tmp_path / "take.glb")
    assert not (tmp_path / "take.glb").exists()


# -- other programs -----------------------------------------------------------------------------


def test_another_library_reads_it(tmp_path: Path) -> None:
    from oracles.gltf import Oracle

    clip = sample()
    for suffix in (".glb", ".gltf"):
        path = tmp_path / f"take{suffix}"
        write_clip(clip, path)
        oracle = Oracle(path)
        node = {oracle.name(i): i for i in range(len(oracle.gltf.nodes))}
        [skin] = oracle.gltf.skins
        assert [oracle.name(i) for i in skin.joints] == list(clip.skeleton.names)
        pose = forward_kinematics(clip)
        for frame in (0, 17, len(clip) - 1):
            for joint in ("LeftHandIndex3", "RightHandThumb2", "Head"):
                world = oracle.world(node[joint], 0, clip.times[frame])
                ours = pose.positions[frame, clip.skeleton.find(joint)]
                assert 100 * world[:3, 3] == pytest.approx(ours, abs=CLOSE_CM)


Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # Blender is Z up


def assert_same_in_blender(clip: Clip, path: Path, tmp_path: Path) -> None:
    """Blender makes an armature of all joints that moves as the clip does."""
    index = np.unique(np.linspace(0, len(clip) - 1, 8).astype(int))
    frames = [str(clip.times[i] * round(clip.fps)) for i in index]
    script = REPOSITORY / "tests" / "blender" / "gltf_dump.py"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    target = tmp_path / "blender.npz"
    done = subprocess.run(
        [blender_python(), str(script), str(path), str(target), str(round(clip.fps)), *frames],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = np.load(target)
    names = list(found["names"])
    assert not len(found["empties"])
    assert sorted(names) == sorted(clip.skeleton.names)
    joints = [clip.skeleton.names.index(name) for name in names]
    above = [clip.skeleton.parents[j] for j in joints]
    assert list(found["parents"]) == [clip.skeleton.names[p] if p >= 0 else "" for p in above]
    pose = forward_kinematics(clip, joints)
    places = found["posed"][:, :, :3, 3] @ Y_UP.T * 100.0
    assert np.abs(places - pose.positions[index]).max() < CLOSE_CM
    bind = clip.skeleton.bind_rotations[joints]
    ours = rot.to_matrix(pose.rotations[index]) @ np.swapaxes(bind, -1, -2)
    turned, rest = found["posed"][..., :3, :3], found["rest"][..., :3, :3]
    theirs = Y_UP @ turned @ np.swapaxes(rest, -1, -2) @ Y_UP.T
    angle = rot.angle_between(rot.from_matrix(ours), rot.from_matrix(theirs))
    assert angle.max() < 0.02
    assert np.ptp(theirs, axis=0).max() > 0.05, "nothing moves in Blender"
    assert_same(clip, read_clip(tmp_path / "blender.glb"))


@pytest.mark.blender
@pytest.mark.parametrize(("name", "suffix"), [(SAMPLES[0], ".glb"), (SAMPLES[1], ".gltf")])
def test_blender_makes_an_armature(name: str, suffix: str, tmp_path: Path) -> None:
    clip = sample(name)
    write_clip(clip, tmp_path / f"take{suffix}")
    assert_same_in_blender(clip, tmp_path / f"take{suffix}", tmp_path)


@pytest.mark.blender
@pytest.mark.real_data
@pytest.mark.parametrize("take", USD_TAKES)
def test_blender_shows_real_takes(take: str, tmp_path: Path) -> None:
    clip = usdhand.read_clip(shared_data(*take.split("/")))
    write_clip(clip, tmp_path / "take.glb")
    assert_same_in_blender(clip, tmp_path / "take.glb", tmp_path)
