"""Skeletons, forward kinematics and resampling, against slow and obvious versions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import stages
from builders.cost import at_most
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from usdhand.errors import UsageError
from usdhand.motion import Clip, Skeleton, forward_kinematics, parents_from_paths, resample
from usdhand.motion import rotations as rot
from usdhand.motion.clip import Origin
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.problems import Problem


def clip_of(joints: tuple[str, ...] = stages.JOINTS, frames: int = 9, scale: float = 0.0) -> Clip:
    random = np.random.default_rng(4)
    count = len(joints)
    identity = np.tile(np.eye(4), (count, 1, 1))
    skeleton = Skeleton(joints, parents_from_paths(joints), identity, identity)
    return Clip(
        skeleton,
        rot.normalize(stages.waves(range(frames), count).astype(float)),
        random.uniform(-10, 10, (frames, count, 3)),
        1.0 + scale * random.uniform(-1, 1, (frames, count, 3)),
        fps=30.0,
        origin=Origin(time_codes_per_second=30.0, first_time_code=1.0),
    )


def slow_worlds(clip: Clip) -> np.ndarray:
    """World matrices by plain multiplication, joint by joint."""
    worlds = np.zeros((len(clip), len(clip.skeleton), 4, 4))
    for frame in range(len(clip)):
        for joint in clip.skeleton.order:
            local = np.eye(4)
            matrix = Rotation.from_quat(clip.rotations[frame, joint]).as_matrix()
            local[:3, :3] = matrix @ np.diag(clip.scales[frame, joint])
            local[:3, 3] = clip.translations[frame, joint]
            parent = clip.skeleton.parents[joint]
            above = worlds[frame, parent] if parent >= 0 else np.eye(4)
            worlds[frame, joint] = above @ local
    return worlds


ORDERS = [
    stages.JOINTS,
    stages.JOINTS[::-1],
    ("A", "A/B", "C", "C/D", "A/B/E"),
    ("A", "A/x/B", "A/x/B/y/z/C"),
]


@pytest.mark.parametrize("scale", [0.0, 0.3])
@pytest.mark.parametrize("joints", ORDERS)
def test_forward_kinematics(joints: tuple[str, ...], scale: float) -> None:
    clip = clip_of(joints, scale=scale)
    worlds = slow_worlds(clip)
    pose = forward_kinematics(clip)
    assert np.allclose(pose.positions, worlds[..., :3, 3])
    if not scale:
        assert np.allclose(rot.to_matrix(pose.rotations), worlds[..., :3, :3])


@pytest.mark.parametrize("scale", [0.0, 0.3])
def test_some_joints_only(scale: float) -> None:
    clip = clip_of(scale=scale)
    wanted = (7, 2)
    everything, some = forward_kinematics(clip), forward_kinematics(clip, wanted)
    assert some.joints == wanted
    for joint in wanted:
        assert np.array_equal(some.position(joint), everything.position(joint))
        assert np.array_equal(some.rotation(joint), everything.rotation(joint))


def test_relative_to_a_base() -> None:
    clip, base = clip_of(), 5
    worlds = slow_worlds(clip)
    relative = np.linalg.inv(worlds[:, base])[:, None] @ worlds[:, 6:]
    pose = forward_kinematics(clip, range(6, len(clip.skeleton)), base=base)
    assert np.allclose(pose.positions, relative[..., :3, 3])
    assert np.allclose(rot.to_matrix(pose.rotations), relative[..., :3, :3])


def test_scales_above_a_base_do_not_count() -> None:
    clip, base = clip_of(), 5
    scales = clip.scales.copy()
    scales[:, 1] = 2.0
    bigger = replace(clip, scales=scales)
    one, other = (forward_kinematics(c, [8], base=base).positions for c in (clip, bigger))
    assert np.allclose(one, other)


def test_scaled_joints() -> None:
    clip = clip_of()
    assert scaled_joints(clip) == frozenset()
    scales = clip.scales.copy()
    scales[3, 4, 1] = 1.1
    assert scaled_joints(replace(clip, scales=scales)) == {4}
    constant = np.broadcast_to(scales[3], scales.shape)
    assert scaled_joints(replace(clip, scales=constant)) == {4}


# -- skeletons ----------------------------------------------------------------------------------


def test_parents_of_names_that_usd_cannot_parse() -> None:
    joints = ["a:b", "a:b/c d", "a:b/c d/e-f", "1", "a:b/x/y"]
    assert parents_from_paths(joints).tolist() == [-1, 0, 1, -1, 0]


@given(st.permutations(range(len(stages.JOINTS))))
def test_order_puts_parents_first(order: list[int]) -> None:
    skeleton = clip_of(tuple(stages.JOINTS[i] for i in order)).skeleton
    place = {joint: i for i, joint in enumerate(skeleton.order)}
    assert len(place) == len(skeleton)
    assert all(place[int(p)] < place[j] for j, p in enumerate(skeleton.parents) if p >= 0)


def skeleton_of(parents: list[int]) -> Skeleton:
    still = np.tile(np.eye(4), (len(parents), 1, 1))
    names = tuple(f"j{i}" for i in range(len(parents)))
    return Skeleton(names, np.array(parents, dtype=np.intp), still, still)


@given(st.data(), st.integers(1, 40))
def test_what_is_above_and_below(data: st.DataObject, count: int) -> None:
    """Against the definitions, in any order of joints and with any number of roots."""
    above = [data.draw(st.integers(-1, i - 1)) for i in range(count)]
    place = data.draw(st.permutations(range(count)))
    parents = [0] * count
    for joint, parent in enumerate(above):
        parents[place[joint]] = -1 if parent < 0 else place[parent]
    skeleton = skeleton_of(parents)
    lines = [skeleton.ancestors(j) for j in range(count)]
    assert list(skeleton.order) == sorted(range(count), key=lambda j: len(lines[j]))
    for joint in range(count):
        below = skeleton.descendants(joint)
        assert sorted(below) == [j for j in range(count) if joint in lines[j]]
        assert all(parents[j] == joint or parents[j] in below[:i] for i, j in enumerate(below))
    some = data.draw(st.lists(st.integers(0, count - 1)))
    wanted = {*some, *(a for j in some for a in lines[j])}
    assert skeleton.with_ancestors(some) == tuple(j for j in skeleton.order if j in wanted)


def test_a_rope_is_ordered_in_a_pass() -> None:
    rope = skeleton_of([*range(-1, 19_999)])
    with at_most(2.0):
        assert rope.order == tuple(range(20_000))
        assert rope.descendants(0) == tuple(range(1, 20_000))
        assert rope.with_ancestors(range(20_000)) == rope.order


def test_finding_joints() -> None:
    skeleton = clip_of(("A", "A/Hand", "A/B", "A/B/Hand", "A/B/Tip")).skeleton
    assert skeleton.find("A/B/Hand") == 3
    assert skeleton.find("Tip") == 4
    assert skeleton.find("Hand") is None
    assert skeleton.find("Foot") is None
    assert skeleton.children[0] == (1, 2)
    assert skeleton.ancestors(4) == (2, 0)
    assert skeleton.common_ancestor([3, 4]) == 2
    assert skeleton.common_ancestor([1, 4]) == 0
    assert skeleton.with_ancestors([3]) == (0, 2, 3)


def test_roots_of_their_own_share_no_ancestor() -> None:
    assert clip_of(("A", "B", "B/C")).skeleton.common_ancestor([0, 2]) is None


def test_bind_rotations_leave_out_scale_and_mirroring() -> None:
    turn = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[0, :3, :3] = turn * 2.5
    bind[1, :3, :3] = turn @ np.diag([1, 1, -1])
    skeleton = replace(clip_of(("A", "A/B")).skeleton, bind=bind)
    assert np.allclose(skeleton.bind_rotations[0], turn)
    assert np.allclose(np.linalg.det(skeleton.bind_rotations), 1.0)


# -- time ---------------------------------------------------------------------------------------


def test_times_of_a_clip() -> None:
    clip = replace(clip_of(frames=4), origin=Origin(None, "", "", 60.0, 10.0, 2.0))
    assert clip.time_codes.tolist() == [10.0, 12.0, 14.0, 16.0]
    assert np.allclose(clip.times, clip.time_codes / 60.0)
    assert clip.duration == pytest.approx(0.1)


@pytest.mark.parametrize("fps", [15.0, 24.0, 30.0, 60.0, 29.97])
def test_resample(fps: float) -> None:
    clip = clip_of(frames=31)
    found = resample(clip, fps)
    assert found.fps == fps
    assert clip.duration - 1.0 / fps < found.duration <= clip.duration + 1e-6
    assert np.allclose(found.times, clip.start + np.arange(len(found)) / fps)
    for joint in (0, 7):
        slerp = Slerp(clip.times, Rotation.from_quat(clip.rotations[:, joint]))
        expected = slerp(np.clip(found.times, None, clip.times[-1])).as_quat()
        assert rot.angle_between(found.rotations[:, joint], expected).max() < 1e-6
        for axis in range(3):
            values = np.interp(found.times, clip.times, clip.translations[:, joint, axis])
            assert np.allclose(found.translations[:, joint, axis], values)


def test_resample_keeps_constant_scales_as_one_row() -> None:
    clip = clip_of()
    scales = np.broadcast_to(clip.scales[0], clip.scales.shape)
    found = resample(replace(clip, scales=scales), 60.0)
    assert found.scales.shape == (len(found), len(clip.skeleton), 3)
    assert found.scales.strides[0] == 0


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_no_such_rate(fps: float) -> None:
    with pytest.raises(UsageError, match="frames a second"):
        resample(clip_of(), fps)


@settings(max_examples=30)
@given(st.lists(st.floats(-5.0, 900.0), min_size=1, max_size=20))
def test_interpolation_holds_the_ends(frames: list[float]) -> None:
    count = 600
    values = np.random.default_rng(1).normal(size=(count, 2))
    expected = [np.interp(frames, np.arange(count), values[:, k]) for k in range(2)]
    assert np.allclose(interpolate(values, np.array(frames)).T, expected)


def test_interpolated_rotations_take_the_shorter_way() -> None:
    q = rot.from_axis_angle(np.array([1.0, 0, 0]), np.array([0.1, 0.5]))
    halfway = interpolate_rotations(np.stack([q[0], -q[1]])[:, None], np.array([0.5]))
    assert rot.angle_between(halfway[0, 0], rot.from_axis_angle(np.array([1.0, 0, 0]), 0.3)) < 1e-6


def test_a_problem_as_a_sentence() -> None:
    assert str(Problem("code", "it is odd", "/A")) == "it is odd (/A)"
    assert str(Problem("code", "it is odd")) == "it is odd"
