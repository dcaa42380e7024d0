"""Two motions compared: known differences, lags, rates and characters are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.clips import frames_of
from builders.cost import at_most
from builders.moving_hands import hand_map, moved, random_turns, skeleton
from builders.rigs import METACARPALS, parents
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.anatomy.channels import Channels, Hands
from usdhand.anatomy.hand import SIDES, CharacterMap
from usdhand.errors import UsageError
from usdhand.evaluate.compare import Comparison, compare_clips, find_lag, rms_jerk
from usdhand.evaluate.compare import _unique_joints as unique_joints
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.resample import resample
from usdhand.motion.rotations import Array

RIG, INDEX = skeleton(axes=2)


def hands_of(clip: Clip, index: dict = INDEX) -> Hands:  # type: ignore[type-arg]
    maps = {side: hand_map(index, side) for side in SIDES}
    return Hands.of(clip, CharacterMap(maps, "test"))


def take(frames: int = 90, seed: int = 4, rig: Skeleton = RIG, index: dict = INDEX) -> Clip:  # type: ignore[type-arg]
    return moved(rig, index, random_turns(frames, seed))


def compared(a: Clip, b: Clip, align: bool = False) -> Comparison:
    return compare_clips(a, b, hands_of(a), hands_of(b), align)


def test_a_motion_equals_itself() -> None:
    same = compared(take(), take())
    assert same.frames == 90
    assert same.rms_deg == same.max_deg == 0.0
    assert same.joint_max.max() < 1e-9
    assert same.fingertip_max == 0.0
    assert same.lag == pytest.approx(0.0, abs=1e-9)
    assert len(same.channels) == 90
    assert len(same.joints) == len(RIG)


def test_a_known_difference_of_one_channel_is_found() -> None:
    a = take()
    hands = hands_of(a)
    channels = hands.encode(a)
    added = np.zeros(channels.values.shape)
    added[:, channels.names.index("riMiddleDIPy")] = np.where(np.arange(90) % 2, 12.0, 4.0)
    b = hands.decode(Channels(channels.names, channels.values + added), a)
    found = compared(a, b)
    rms = dict(zip(found.channels, found.channel_rms, strict=True))
    largest = dict(zip(found.channels, found.channel_max, strict=True))
    assert rms["riMiddleDIPy"] == pytest.approx(np.sqrt((144 + 16) / 2), abs=1e-6)
    assert largest["riMiddleDIPy"] == pytest.approx(12.0, abs=1e-6)
    assert found.max_deg == pytest.approx(12.0, abs=1e-6)
    assert max(v for n, v in rms.items() if n != "riMiddleDIPy") < 1e-6
    joints = dict(zip(found.joints, found.joint_max, strict=True))
    assert joints["rightMiddleDIP"] == pytest.approx(12.0, abs=1e-6)
    assert max(v for n, v in joints.items() if n != "rightMiddleDIP") < 1e-4
    # The last bone turns about the DIP: a chord of its length, one fingertip of ten.
    bone = float(np.linalg.norm(hands.frames["right"].tips[2]))
    assert found.fingertip_max == pytest.approx(
        20 * bone * np.sin(np.radians(6.0)) * np.cos(np.radians(abduction(a))).max(), rel=0.05
    )
    assert found.fingertip_mean < found.fingertip_max / 10


def abduction(clip: Clip) -> Array:
    return hands_of(clip).encode(clip).select(("riMiddleDIPx",)).values


def test_a_difference_is_the_shorter_way_round() -> None:
    a = take(2)
    hands = hands_of(a)
    channels = hands.encode(a)
    values = np.zeros((2, 90))
    left = hands.decode(Channels(channels.names, values + 170.0 * (np.arange(90) == 10)), a)
    right = hands.decode(Channels(channels.names, values - 170.0 * (np.arange(90) == 10)), a)
    assert compared(left, right).max_deg == pytest.approx(20.0, abs=1e-6)


@pytest.mark.parametrize("late", [-7, 0, 12])
def test_whole_frames_of_lag_are_found_and_undone(late: int) -> None:
    whole = take(140)
    a = frames_of(whole, slice(max(late, 0), 100 + late))
    b = frames_of(whole, slice(max(-late, 0), 100))
    found = compared(a, b)
    assert found.lag == pytest.approx(late / 30.0, abs=0.01 / 30.0)
    aligned = compared(a, b, align=True)
    assert aligned.frames >= 85
    assert aligned.rms_deg < 0.05
    if late:
        assert found.rms_deg > 20 * aligned.rms_deg


def smooth(t: Array, seed: int = 0) -> Array:
    random = np.random.default_rng(seed)
    speed, phase, size = random.uniform((0.3, 0, 2), (1.2, 6, 40), (8, 3)).T
    return size * np.sin(2 * np.pi * speed * t[:, None] + phase)


@given(st.floats(-1.5, 1.5), st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_lags_are_found_to_a_tenth_of_a_frame(late: float, seed: int) -> None:
    t = np.arange(240) / 30.0
    lag = find_lag(smooth(t, seed), smooth(t - late, seed) + 5.0, 30.0)
    assert lag == pytest.approx(late, abs=0.1 / 30.0)


def test_a_lag_is_found_in_noise_and_in_clips_of_other_lengths() -> None:
    random = np.random.default_rng(0)
    a = smooth(np.arange(300) / 30.0)
    b = smooth(np.arange(200) / 30.0 - 0.5)
    noisy = [c + random.normal(scale=1.0, size=c.shape) for c in (a, b)]
    assert find_lag(*noisy, 30.0) == pytest.approx(0.5, abs=0.3 / 30.0)


def test_the_lag_has_the_least_variance_of_differences() -> None:
    """The slow way: every shift on its own."""
    random = np.random.default_rng(5)
    a, b = (np.cumsum(random.normal(size=(n, 4)), axis=0) for n in (80, 65))
    most = 32
    costs = []
    for shift in range(-most, most + 1):
        start, end = max(0, -shift), min(80, 65 - shift)
        costs.append((b[start + shift : end + shift] - a[start:end]).var(axis=0).mean())
    best = int(np.argmin(costs)) - most
    lag = find_lag(a, b, 30.0)
    assert lag is not None
    assert abs(lag * 30.0 - best) <= 0.5 + 1e-9


def test_still_or_short_hands_have_no_lag() -> None:
    t = np.arange(100) / 30.0
    assert find_lag(smooth(t) / 1000, smooth(t) / 1000, 30.0) is None
    assert find_lag(smooth(t[:5]), smooth(t[:5]), 30.0) is None


def test_other_frame_rates_are_compared_in_seconds() -> None:
    """Half the frames: what is left is the error of interpolating between them."""
    a = resample(take(60), 120.0)
    b = resample(a, 60.0)
    found = compared(a, b)
    assert found.rms_deg < 0.2
    assert found.lag == pytest.approx(0.0, abs=0.1 / 120.0)
    assert found.frames == len(a) - (len(a) + 1) % 2


def test_other_characters_are_compared_by_channels() -> None:
    """No metacarpals, other axes: the same anatomical motion."""
    above = {}
    for joint, parent in parents().items():
        while parent is not None and parent[1] in METACARPALS:
            parent = parents()[parent]
        if joint[1] not in METACARPALS:
            above[joint] = parent
    rig, index = skeleton(above, axes=31)
    a, b = take(), take(rig=rig, index=index)
    found = compare_clips(a, b, hands_of(a), hands_of(b, index))
    assert found.rms_deg < 1e-6
    assert found.fingertip_max < 1e-6
    assert found.lag == pytest.approx(0.0, abs=1e-6)


def test_joints_are_compared_by_names_that_no_other_has() -> None:
    """Twenty thousand of them in a pass, not one with every other."""
    names = [f"j{i}" for i in range(20_000)] + ["double", "double"]
    still = np.tile(np.eye(4), (len(names), 1, 1))
    parents = np.full(len(names), -1, dtype=np.intp)
    skeleton = Skeleton(tuple(names), parents, still, still)
    with at_most(2.0):
        assert unique_joints(skeleton) == {f"j{i}": i for i in range(20_000)}


def test_hands_with_nothing_in_common_are_refused() -> None:
    a = take(10)
    hands = hands_of(a)
    left, right = (replace(hands, frames={s: hands.frames[s]}) for s in SIDES)
    with pytest.raises(UsageError, match="no hand joint in common"):
        compare_clips(a, a, left, right)


def test_one_hand_is_compared_with_two() -> None:
    a = take(20)
    hands = hands_of(a)
    left = replace(hands, frames={"left": hands.frames["left"]})
    found = compare_clips(a, a, hands, left)
    assert len(found.channels) == 45
    assert found.fingertip_max == 0.0


def test_jerk_is_the_third_derivative() -> None:
    t = np.arange(200) / 50.0
    assert rms_jerk(t[:, None] ** 3, 50.0) == pytest.approx(6.0, rel=1e-6)
    assert rms_jerk(t[:3, None], 50.0) == 0.0
    assert_allclose(rms_jerk(10 * np.sin(4 * t)[:, None], 50.0), 640 / np.sqrt(2), rtol=0.02)


def test_joint_angles_do_not_depend_on_signs_of_quaternions() -> None:
    a = take(10)
    b = a.with_rotations(-a.rotations)
    assert compared(a, b).joint_max.max() < 1e-5
    assert rot.angle_between(a.rotations, b.rotations).max() < 1e-5
