"""What is written as BVH comes back: places, rotations away from the bind pose, the bind pose."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.bvh_files import ARM, plain_positions, written
from builders.real_takes import BVH_TAKES, USD_TAKES
from conftest import REPOSITORY, shared_data
from hypothesis import given, settings
from hypothesis import strategies as st

import usdhand
from usdhand.formats.bvh.euler import zxy_angles
from usdhand.formats.bvh.motion import from_euler
from usdhand.formats.bvh.read import read_character, read_clip
from usdhand.formats.bvh.write import write_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, Skeleton, forward_kinematics, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.problems import Problem
from usdhand.rigs import map_character

NEAR_CM, NEAR_DEG = 0.01, 0.01
SAMPLES = ["gestures/ok_02", "gestures_ben/wipe_01", "conversations/talk_01_full"]
SAMPLES += ["hands/talk_01_hands_a", "hands/talk_01_hands_right"]


def away_from_bind(clip: Clip, joints: list[int]) -> np.ndarray:
    """(frames, joints, 4) world rotations relative to the bind pose: what a retarget uses."""
    bind = rot.from_matrix(clip.skeleton.bind_rotations[joints])
    return rot.multiply(forward_kinematics(clip, joints).rotations, rot.conjugate(bind))


def matched(clip: Clip, other: Clip) -> list[int]:
    """Joints of ``other`` for each of ``clip``, by leaf names; both have the same ones."""
    assert sorted(clip.skeleton.names) == sorted(other.skeleton.names)
    return [other.skeleton.names.index(name) for name in clip.skeleton.names]


def assert_same(clip: Clip, other: Clip) -> None:
    everything = list(range(len(clip.skeleton)))
    theirs = matched(clip, other)
    assert len(clip) == len(other)
    assert other.fps == pytest.approx(clip.fps, rel=1e-7)
    places = forward_kinematics(other, theirs).positions - forward_kinematics(clip).positions
    assert np.abs(places).max() < NEAR_CM
    angle = rot.angle_between(away_from_bind(clip, everything), away_from_bind(other, theirs))
    assert angle.max() < NEAR_DEG
    bind = other.skeleton.bind_positions[theirs] - clip.skeleton.bind_positions
    assert np.abs(bind).max() < NEAR_CM


def there_and_back(clip: Clip, folder: Path, **told: object) -> tuple[Clip, tuple[Problem, ...]]:
    """Write and read; units and axes are guessed unless told."""
    problems = write_clip(clip, folder / "out.bvh", up=str(told.get("up", "Y")))
    return read_clip(folder / "out.bvh", Reading(**told)), problems  # type: ignore[arg-type]


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("name", SAMPLES)
def test_samples_come_back(tmp_path: Path, name: str, up: str) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / f"{name}.usdc")
    back, _ = there_and_back(clip, tmp_path, up=up)
    assert back.origin.cm_per_unit == 1.0
    assert_same(clip, back)
    if up == "Y":  # guessed as well
        assert_same(clip, there_and_back(clip, tmp_path)[0])


@pytest.mark.real_data
@pytest.mark.parametrize("name", USD_TAKES)
def test_real_takes_come_back(tmp_path: Path, name: str) -> None:
    clip = usdhand.read_clip(shared_data(*name.split("/")))
    back, problems = there_and_back(clip, tmp_path)  # units and axes guessed from our own file
    assert (back.origin.cm_per_unit, back.origin.up_axis) == (1.0, "Y")
    assert_same(clip, back)
    if (clip.skeleton.parents < 0).sum() > 1:
        assert "several-roots" in {p.code for p in problems}
        assert back.skeleton.names[0] == "Locator"  # with most joints


@pytest.mark.real_data
@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("name", BVH_TAKES)
def test_real_files_come_back(tmp_path: Path, name: str, up: str) -> None:
    clip = read_clip(shared_data(*name.split("/")))
    back, _ = there_and_back(clip, tmp_path)
    assert_same(clip, back)
    write_clip(clip, tmp_path / "out.bvh", up=up)
    guessed = read_clip(tmp_path / "out.bvh")
    assert guessed.origin.up_axis == up
    assert_same(clip, guessed)


@pytest.mark.real_data
def test_hands_are_found_again(tmp_path: Path) -> None:
    clip = usdhand.read_clip(shared_data(*USD_TAKES[0].split("/")))
    back, _ = there_and_back(clip, tmp_path)

    def names(which: Clip) -> dict[str, dict[str, str]]:
        hands = map_character(which.skeleton).hands
        return {
            side: {role: which.skeleton.names[j] for role, j in {**h.joints, **h.tips}.items()}
            for side, h in hands.items()
        }

    assert names(clip) == names(back)


# --- random skeletons ----------------------------------------------------------------------------


@st.composite
def clips(draw: st.DrawFn) -> Clip:
    """Any tree, any bind pose, any motion; joints named so that none is a body part."""
    seed = draw(st.integers(0, 2**32 - 1))
    random = np.random.default_rng(seed)
    count, frames = draw(st.integers(1, 12)), draw(st.integers(1, 6))
    paths: list[str] = []
    for j in range(count):
        above = int(random.integers(-1, j)) if j else -1
        paths.append(f"j{j}" if above < 0 else f"{paths[above]}/j{j}")
    order = random.permutation(count)
    joints = tuple(paths[j] for j in order)
    parents = parents_from_paths(joints)
    rest = np.tile(np.eye(4), (count, 1, 1))
    rest[:, :3, :3] = rot.to_matrix(rot.normalize(random.normal(size=(count, 4))))
    rest[:, :3, 3] = random.normal(size=(count, 3)) * 20
    bind = rest.copy()
    skeleton = Skeleton(joints, parents, bind, rest)
    for j in skeleton.order:
        if parents[j] >= 0:
            bind[j] = bind[parents[j]] @ rest[j]
    speed = draw(st.sampled_from([0.01, 0.3, 3.0]))
    q = np.cumsum(random.normal(size=(frames, count, 4)) * speed, axis=0)
    t = np.tile(rest[:, :3, 3], (frames, 1, 1))
    moving = random.random(count) < 0.3
    t[:, moving] += random.normal(size=(frames, moving.sum(), 3))
    scales = np.ones_like(t)
    if draw(st.booleans()):
        scales[:, random.random(count) < 0.3] = random.uniform(0.5, 2.0, 3)
    fps = draw(st.sampled_from([24.0, 29.97, 60.0, 240.0]))
    return Clip(skeleton, rot.make_continuous(rot.normalize(q + 1e-3)), t, scales, fps)


@given(clips(), st.sampled_from("YZ"))
@settings(max_examples=60)
def test_any_skeleton_comes_back(
    tmp_path_factory: pytest.TempPathFactory, clip: Clip, up: str
) -> None:
    back, problems = there_and_back(clip, tmp_path_factory.mktemp("out"), up=up, cm_per_unit=1.0)
    assert_same(clip, back)
    scaled = np.abs(clip.scales - 1.0).max() > 1e-3
    assert ("scales" in {p.code for p in problems}) == scaled


# --- the form of the file ------------------------------------------------------------------------


def arm(folder: Path) -> Clip:
    return read_clip(written(folder, ARM), Reading(up="Y", cm_per_unit=1.0))


def test_zero_is_the_bind_pose(tmp_path: Path) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / "gestures" / "ok_02.usdc")
    write_clip(clip, tmp_path / "out.bvh")
    text = (tmp_path / "out.bvh").read_text()
    rows = text[text.index("MOTION") :].splitlines()[3:]
    zero = " ".join("0" for _ in rows[0].split())
    hips = " ".join(f"{v:.6f}" for v in clip.skeleton.bind_positions[0])
    zero = f"{hips} {zero[6:]}"
    path = written(tmp_path, text.replace("\n".join(rows), zero).replace(f": {len(clip)}", ": 1"))
    still = read_character(path, Reading(up="Y", cm_per_unit=1.0))
    theirs = matched(clip, still)
    assert np.abs(still.skeleton.bind_positions[theirs] - clip.skeleton.bind_positions).max() < 1e-4
    assert np.allclose(still.skeleton.bind_rotations, np.eye(3))


def test_ends_are_ends_again(tmp_path: Path) -> None:
    clip = arm(tmp_path)
    write_clip(clip, tmp_path / "out.bvh")
    text = (tmp_path / "out.bvh").read_text()
    assert text.count("End Site") == 1
    assert "Hand_End" not in text
    turning = clip.rotations.copy()
    turning[1, 3] = rot.from_axis_angle(np.array([1.0, 0, 0]), 0.5)
    write_clip(clip.with_rotations(turning), tmp_path / "out.bvh")
    assert "JOINT Hand_End" in (tmp_path / "out.bvh").read_text()


def test_only_joints_that_move_have_positions(tmp_path: Path) -> None:
    clip = arm(tmp_path)
    assert write_clip(clip, tmp_path / "out.bvh") == ()
    assert (tmp_path / "out.bvh").read_text().count("CHANNELS 6") == 1
    moved = clip.translations.copy()
    moved[1, 2] += 0.1
    problems = write_clip(replace(clip, translations=moved), tmp_path / "out.bvh")
    assert (tmp_path / "out.bvh").read_text().count("CHANNELS 6") == 2
    assert [p.code for p in problems] == ["moving-joints"]


def test_scales_are_in_the_positions_and_said(tmp_path: Path) -> None:
    clip = arm(tmp_path)
    scales = np.ones((3, 4, 3))
    scales[:, 1] = np.linspace(1.0, 1.5, 3)[:, None]
    scaled = replace(clip, scales=scales)
    back, problems = there_and_back(scaled, tmp_path, cm_per_unit=1.0)
    assert_same(scaled, back)
    assert "scales" in {p.code for p in problems}


def test_names_are_those_of_the_file_each_once(tmp_path: Path) -> None:
    clip = arm(tmp_path)
    named = replace(clip.skeleton, originals=("rig:Hips", "an arm", "an arm", "{x}"))
    problems = write_clip(replace(clip, skeleton=named), tmp_path / "out.bvh")
    text = (tmp_path / "out.bvh").read_text()
    for line in ("ROOT rig:Hips", "JOINT an_arm", "JOINT an_arm_2"):
        assert f"{line}\n" in text
    assert "renamed-joints" in {p.code for p in problems}


def test_a_plain_reader_reads_what_we_write(tmp_path: Path) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / "gestures" / "big_03.usdc")
    write_clip(clip, tmp_path / "out.bvh")
    back = read_clip(tmp_path / "out.bvh", Reading(up="Y", cm_per_unit=1.0))
    frames = [0, len(clip) // 2, len(clip) - 1]
    plain = plain_positions(tmp_path / "out.bvh", frames)
    ours = forward_kinematics(clip).positions[frames]
    for joint, name in enumerate(clip.skeleton.names):
        distances = np.linalg.norm(plain - ours[:, joint, None], axis=-1).max(axis=0)
        assert distances.min() < NEAR_CM, name
    assert len(back.skeleton) == len(clip.skeleton)


# --- angles --------------------------------------------------------------------------------------


def turns(frames: int, seed: int) -> np.ndarray:
    """A rotation that wanders, about 5 degrees a frame, through all poses."""
    random = np.random.default_rng(seed)
    steps = rot.from_axis_angle(
        rot.normalize(random.normal(size=(frames, 3))), random.uniform(0, 0.1, frames)
    )
    q = np.empty((frames, 4))
    q[0] = rot.normalize(random.normal(size=4))
    for i in range(1, frames):
        q[i] = rot.multiply(q[i - 1], steps[i])
    return q


@pytest.mark.parametrize("seed", range(5))
def test_angles_give_back_the_rotation(seed: int) -> None:
    q = turns(2000, seed)
    back = from_euler((2, 0, 1), np.radians(zxy_angles(q)))
    assert rot.angle_between(q, back).max() < 1e-9


@pytest.mark.parametrize("pitch", [90.0, -90.0, 90.0 - 1e-7, 90.0 + 1e-9])
def test_gimbal_lock_gives_back_the_rotation(pitch: float) -> None:
    angles = np.radians([[30.0, pitch, 10.0], [31.0, pitch, 50.0], [10.0, pitch, -120.0]])
    q = from_euler((2, 0, 1), angles)
    back = from_euler((2, 0, 1), np.radians(zxy_angles(q)))
    assert rot.angle_between(q, back).max() < 1e-9


def test_curves_have_no_jumps() -> None:
    t = np.linspace(0, 1, 400)[:, None]
    angles = np.radians(np.concatenate([40 * t, 20 + 200 * t, 700 * t - 300], axis=1))
    found = zxy_angles(from_euler((2, 0, 1), angles))  # twice past the pole, and around
    assert np.abs(np.diff(found, axis=0)).max() < 2.0
