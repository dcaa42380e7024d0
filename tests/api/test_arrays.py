"""Clips made of arrays: in whatever order, unit and axes they come, and what is wrong with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from builders.in_memory import arrays_of, in_memory, reordered, sample
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import usdhand
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

READ = replace(sample("gestures/ok_01"), source=None)
FULL = READ.with_rotations(rot.normalize(READ.rotations))  # files round them
# Three joints of a body that stands in metres; the last one bends.
THREE: dict[str, Any] = {
    "joints": ["hips", "chest", "head"],
    "rotations": [[[1, 0, 0, 0]] * 3, [[1, 0, 0, 0], [1, 0, 0, 0], [0.7071, 0.7071, 0, 0]]],
    "quaternions": "wxyz",
    "parents": [-1, 0, 1],
    "bind": [[0, 1.0, 0], [0, 1.4, 0], [0, 1.7, 0]],
    "fps": 30,
    "units": "m",
}


def by_path(clip: Clip) -> dict[str, np.ndarray]:
    """World positions (frames, 3) of all joints."""
    pose = forward_kinematics(clip)
    return {path: pose.position(j) for j, path in enumerate(clip.skeleton.joints)}


def assert_same_motion(a: Clip, b: Clip) -> None:
    places, others = by_path(a), by_path(b)
    assert places.keys() == others.keys()
    for path, place in places.items():
        assert_allclose(place, others[path], atol=1e-8, err_msg=path)
    first = b.skeleton.joints.index(a.skeleton.joints[0])
    turned = forward_kinematics(a).rotations[:, 0], forward_kinematics(b).rotations[:, first]
    assert rot.angle_between(*turned).max() < 1e-6


def test_a_clip_of_its_own_arrays_is_the_same() -> None:
    again = in_memory(FULL)
    assert_same_motion(FULL, again)
    assert again.skeleton.joints == FULL.skeleton.joints
    assert_allclose(again.skeleton.bind, FULL.skeleton.bind)
    assert_allclose(again.skeleton.rest, FULL.skeleton.rest)
    assert (again.fps, again.name, again.origin.path) == (FULL.fps, FULL.name, None)
    assert again.problems == ()


@pytest.mark.parametrize("metres_z_up", [False, True])
@pytest.mark.parametrize("wxyz", [False, True])
def test_units_axes_and_orders_do_not_matter(metres_z_up: bool, wxyz: bool) -> None:
    again = Clip.from_arrays(**arrays_of(FULL, metres_z_up=metres_z_up, wxyz=wxyz))
    assert_same_motion(FULL, again)
    assert_allclose(again.skeleton.bind, FULL.skeleton.bind, atol=1e-9)
    assert again.problems == ()


@given(st.randoms(use_true_random=False), st.booleans())
def test_joints_come_in_any_order(random: Any, z_up: bool) -> None:
    order = list(range(len(FULL.skeleton)))
    random.shuffle(order)
    again = Clip.from_arrays(**reordered(arrays_of(FULL, metres_z_up=z_up), np.array(order)))
    assert (again.skeleton.parents < np.arange(len(order))).all()
    assert_same_motion(FULL, again)


def test_joints_whose_parents_come_first_stay_in_their_order() -> None:
    clip = Clip.from_arrays(**THREE)
    assert clip.skeleton.joints == ("hips", "hips/chest", "hips/chest/head")


@given(st.permutations(range(3)))
def test_names_and_parents_become_paths(order: list[int]) -> None:
    place = {joint: i for i, joint in enumerate(order)}
    arrays = THREE | {
        "joints": [THREE["joints"][j] for j in order],
        "parents": [place.get(THREE["parents"][j], -1) for j in order],
        "rotations": np.array(THREE["rotations"])[:, order],
        "bind": np.array(THREE["bind"])[order],
    }
    assert_same_motion(Clip.from_arrays(**THREE), Clip.from_arrays(**arrays))


def test_a_bind_pose_of_positions_gives_translations_in_centimetres() -> None:
    clip = Clip.from_arrays(**THREE)
    assert_allclose(clip.translations[0], [[0, 100, 0], [0, 40, 0], [0, 30, 0]])
    assert_allclose(clip.skeleton.bind_positions[:, 1], [100, 140, 170])
    assert_allclose(clip.skeleton.bind_rotations, np.broadcast_to(np.eye(3), (3, 3, 3)))
    assert_allclose(clip.scales, 1.0)
    assert_allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0)
    assert clip.duration == pytest.approx(1 / 30)


def test_a_rest_pose_says_the_same_as_the_bind_pose() -> None:
    rest = [[0, 1.0, 0], [0, 0.4, 0], [0, 0.3, 0]]
    arrays = {k: v for k, v in THREE.items() if k != "bind"} | {"rest": rest}
    assert_same_motion(Clip.from_arrays(**THREE), Clip.from_arrays(**arrays))
    assert_allclose(
        Clip.from_arrays(**THREE).skeleton.bind, Clip.from_arrays(**arrays).skeleton.bind
    )


def test_where_translations_are_not_given_joints_are_at_rest() -> None:
    arrays = {k: v for k, v in arrays_of(FULL).items() if k not in ("translations", "scales")}
    clip = Clip.from_arrays(**arrays)
    assert_allclose(clip.translations[5], FULL.skeleton.rest[:, :3, 3])


def test_a_rest_pose_that_is_scaled_scales() -> None:
    rest = np.tile(np.eye(4), (3, 1, 1))
    rest[:, 1, 3] = [1.0, 0.4, 0.3]
    rest[0, :3, :3] *= 2.0
    arrays = {k: v for k, v in THREE.items() if k != "bind"} | {"rest": rest}
    assert_allclose(Clip.from_arrays(**arrays).scales[1], [[2] * 3, [1] * 3, [1] * 3])


def test_two_negative_scales_are_half_a_turn() -> None:
    scales = np.ones((3, 3))
    scales[1] = [-1.0, -1.0, 1.0]
    clip = Clip.from_arrays(**THREE, scales=scales)
    assert_allclose(by_path(clip)["hips/chest/head"][0], [0, 110, 0], atol=1e-9)
    assert (clip.scales > 0).all()


def test_translations_of_one_frame_hold_for_all() -> None:
    moved = Clip.from_arrays(**THREE, translations=[[0, 2.0, 0], [0, 0.4, 0], [0, 0.3, 0]])
    assert_allclose(moved.translations[:, 0, 1], 200.0)


def test_a_unit_is_a_name_or_a_number_of_centimetres() -> None:
    for units in ("m", 100, 100.0, "100"):
        assert_same_motion(Clip.from_arrays(**THREE), Clip.from_arrays(**THREE | {"units": units}))


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_rounded_quaternions_are_brought_to_unit_length(kind: type) -> None:
    arrays = arrays_of(FULL)
    clip = Clip.from_arrays(**arrays | {"rotations": arrays["rotations"].astype(kind)})
    assert_allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0, atol=1e-12)
    assert rot.angle_between(clip.rotations, FULL.rotations).max() < 0.2


def test_signs_of_quaternions_are_made_continuous() -> None:
    arrays = arrays_of(FULL)
    flipped = arrays["rotations"].copy()
    flipped[1::2] *= -1.0
    clip = Clip.from_arrays(**arrays | {"rotations": flipped})
    assert (np.einsum("tji,tji->tj", clip.rotations[1:], clip.rotations[:-1]) > 0).all()
    assert_same_motion(FULL, clip)


def test_the_arrays_stay_as_they_are() -> None:
    arrays = arrays_of(FULL, metres_z_up=True)
    before = {k: np.array(v) for k, v in arrays.items() if isinstance(v, np.ndarray)}
    Clip.from_arrays(**arrays)
    for name, array in before.items():
        assert (arrays[name] == array).all(), name


def test_a_unit_that_makes_no_body_is_told() -> None:
    [problem] = Clip.from_arrays(**arrays_of(FULL) | {"units": "m"}).problems
    assert problem.code == "odd-size"


def test_a_body_that_lies_at_its_bind_pose_is_told() -> None:
    [problem] = Clip.from_arrays(**arrays_of(FULL) | {"up": "Z"}).problems
    assert problem.code == "odd-up-axis"


def test_quaternions_in_the_other_order_are_refused() -> None:
    for wxyz, said in ((False, "wxyz"), (True, "xyzw")):
        with pytest.raises(usdhand.UsageError, match=f"^quaternions: read as {said}"):
            Clip.from_arrays(**arrays_of(FULL, wxyz=wxyz) | {"quaternions": said})


def changed(array: Any, index: Any, value: float) -> Any:
    result = np.array(array, float)
    result[index] = value
    return result


def row_vectors() -> Any:
    """The bind pose in matrices that are made for row vectors."""
    bind = np.tile(np.eye(4), (3, 1, 1))
    bind[:, 3, :3] = THREE["bind"]
    return bind


def flat() -> Any:
    bind = np.tile(np.eye(4), (3, 1, 1))
    bind[2, 0, 0] = 0.0
    return bind


NAN = changed(THREE["bind"], (1, 2), np.nan)
WRONG: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"joints": []}, usdhand.UsageError, "joints: there are none"),
    ({"joints": "hips"}, usdhand.UsageError, "joints: give a list"),
    ({"joints": ["hips", "", "head"]}, usdhand.UsageError, "joints: number 1 has no name"),
    ({"joints": ["hips", 3, "head"]}, usdhand.UsageError, "joints: give a list"),
    (
        {"joints": ["a", "b", "b"], "parents": [-1, 0, 0]},
        usdhand.UsageError,
        "'a/b' is given twice",
    ),
    ({"parents": None}, usdhand.UsageError, "joints: names alone"),
    ({"parents": [-1, 0]}, usdhand.UsageError, r"parents: the shape is \(2,\)"),
    ({"parents": [-1, 0, 7]}, usdhand.UsageError, "parents: 7 is not a possible parent of joint 2"),
    ({"parents": [-1, 1, 0]}, usdhand.UsageError, "parents: 1 is not a possible parent of joint 1"),
    ({"parents": [2**32 - 1, 0, 1]}, usdhand.UsageError, "-1 for a root"),
    ({"parents": [-1, 0.5, 1]}, usdhand.UsageError, "parents: .* joint 1"),
    ({"parents": [-1, 2, 1]}, usdhand.UsageError, "'chest' is its own ancestor"),
    (
        {"joints": ["a", "a/b", "a/b/c"], "parents": [-1, 0, 0]},
        usdhand.UsageError,
        "parents: that of 'a/b/c' is not the one in its path",
    ),
    ({"rotations": [[1, 0, 0, 0]] * 3}, usdhand.UsageError, r"rotations: the shape is \(3, 4\)"),
    ({"rotations": np.zeros((0, 3, 4))}, usdhand.UsageError, "rotations: there are no frames"),
    ({"rotations": "nothing"}, usdhand.UsageError, "rotations: this is not an array of numbers"),
    (
        {"rotations": changed(THREE["rotations"], (1, 2, 0), np.inf)},
        usdhand.InputError,
        "rotations: frame 1, joint 'hips/chest/head': a value is not finite",
    ),
    (
        {"rotations": changed(THREE["rotations"], (1, 1, 0), 0.9)},
        usdhand.InputError,
        "rotations: frame 1, joint 'hips/chest': the quaternion has the length 0.9",
    ),
    ({"quaternions": "wzyx"}, usdhand.UsageError, "quaternions: 'wzyx' is not one of xyzw"),
    ({"fps": 0}, usdhand.UsageError, "fps: 0"),
    ({"fps": np.nan}, usdhand.UsageError, "fps: nan"),
    ({"fps": "fast"}, usdhand.UsageError, "fps: 'fast'"),
    ({"units": "miles"}, usdhand.UsageError, "units: 'miles'"),
    ({"units": -1}, usdhand.UsageError, "units: '-1'"),
    ({"up": "X"}, usdhand.UsageError, "up: 'X' is not one of Y and Z"),
    ({"bind": None}, usdhand.UsageError, "bind: give the bind pose"),
    ({"bind": NAN}, usdhand.InputError, "bind: joint 'hips/chest': a value is not finite"),
    ({"bind": row_vectors()}, usdhand.UsageError, "bind: joint 'hips': .* transpose them"),
    ({"bind": np.zeros((3, 4, 4))}, usdhand.UsageError, "the last row of a matrix"),
    ({"bind": flat()}, usdhand.InputError, "bind: joint 'hips/chest/head': .* no inverse"),
    ({"rest": np.zeros((2, 3))}, usdhand.UsageError, r"rest: the shape is \(2, 3\)"),
    ({"translations": np.zeros((3, 3, 3))}, usdhand.UsageError, "translations: the shape is"),
    (
        {"translations": changed(np.zeros((2, 3, 3)), (1, 0, 2), np.nan)},
        usdhand.InputError,
        "translations: frame 1, joint 'hips': a value is not finite",
    ),
    (
        {"scales": changed(np.ones((2, 3, 3)), (0, 2, 1), 0.0)},
        usdhand.InputError,
        "scales: frame 0, joint 'hips/chest/head': a scale of 0",
    ),
]


@pytest.mark.parametrize(("otherwise", "kind", "words"), WRONG, ids=lambda v: str(v)[:40])
def test_what_is_wrong_names_the_argument(
    otherwise: dict[str, Any], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        Clip.from_arrays(**THREE | otherwise)
