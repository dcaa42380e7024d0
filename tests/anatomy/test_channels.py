"""Rotations to channels and back: nothing is lost, nothing jumps, locks and turns included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.moving_hands import at_bind, frames_of, gesture, hand_map, random_rotations, skeleton
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.anatomy.angles import (
    euler_angles,
    from_euler,
    from_swing_twist,
    inverse,
    product,
    rotate,
    same_signs,
    swing_twist_angles,
)
from usdhand.anatomy.channels import (
    Channels,
    Hands,
    all_channels,
    decode,
    encode,
    is_flexion,
    model_channels,
)
from usdhand.anatomy.fingertips import fingertips
from usdhand.anatomy.hand import HAND_JOINTS, SIDES, CharacterMap, Side
from usdhand.errors import UsageError
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

LEAST_DEG = 1e-4
RIG, INDEX = skeleton(axes=11)
seeds = st.integers(0, 2**32 - 1)
turn_counts = st.floats(-800.0, 800.0)


def angle(a: Array, b: Array) -> Array:
    """Degrees between quaternions (4, frames)."""
    return rot.angle_between(a.T, b.T)


def reference_rotation(angles: Array) -> Array:
    """R_y(flexion) R_x(abduction) R_z(twist) of (3, frames) degrees, one after the other."""
    axes = np.eye(3)
    turns = [rot.from_axis_angle(axes[i], np.radians(angles[i])) for i in range(3)]
    return rot.multiply(rot.multiply(turns[1], turns[0]), turns[2]).T


# --- angles of one joint -------------------------------------------------------------------------


@given(st.tuples(turn_counts, turn_counts, turn_counts))
def test_angles_mean_flexion_then_abduction_then_twist(triple: tuple[float, float, float]) -> None:
    angles = np.array(triple)[:, None]
    assert angle(from_euler(angles), reference_rotation(angles)).max() < LEAST_DEG


@given(st.tuples(*[st.floats(-170.0, 170.0)] * 3))
def test_swing_is_a_rotation_vector_after_the_twist(triple: tuple[float, float, float]) -> None:
    angles = np.array(triple)[:, None]
    vector = np.radians([triple[0], triple[1], 0.0])
    length = np.linalg.norm(vector)
    swing = rot.from_axis_angle(vector / max(length, 1e-12), length)
    twist = rot.from_axis_angle(np.eye(3)[2], np.radians(triple[2]))
    assert angle(from_swing_twist(angles), rot.multiply(swing, twist)[:, None]).max() < LEAST_DEG


@given(seeds, st.integers(1, 30))
@settings(max_examples=50)
def test_any_rotations_come_back(seed: int, frames: int) -> None:
    q = random_rotations(np.random.default_rng(seed), frames).T
    assert angle(from_euler(euler_angles(q)), q).max() < LEAST_DEG
    assert angle(from_swing_twist(swing_twist_angles(q)), q).max() < LEAST_DEG


@given(seeds, st.sampled_from([0.0, 1e-13, 1e-9, 1e-8, 1e-7, 1e-6, 1e-3]), st.sampled_from([-1, 1]))
@settings(max_examples=100)
def test_rotations_come_back_at_and_near_gimbal_lock(seed: int, off: float, sign: int) -> None:
    random = np.random.default_rng(seed)
    angles = random.uniform(-180, 180, (3, 12))
    angles[0] = sign * 90.0 + off * random.choice([-1, 0, 1], 12)
    q = reference_rotation(angles)
    assert angle(from_euler(euler_angles(q)), q).max() < LEAST_DEG


@given(seeds)
@settings(max_examples=50)
def test_rotations_come_back_where_the_bone_has_turned_round(seed: int) -> None:
    """Swings of half a turn: the twist is not known, the rotation is."""
    q = random_rotations(np.random.default_rng(seed), 12)
    q[::2, 2:] = 0.0
    q = rot.normalize(q).T
    assert angle(from_swing_twist(swing_twist_angles(q)), q).max() < LEAST_DEG


@given(seeds, st.floats(0.0, 80.0))
@settings(max_examples=50)
def test_angles_come_back_however_often_they_turn(seed: int, abduction: float) -> None:
    """Flexion and twist over many turns, up to whole turns of the mean."""
    random = np.random.default_rng(seed)
    t = np.arange(200) / 200.0
    speed = random.uniform(-3000, 3000, (2, 1))  # under 15 degrees a frame
    angles = np.stack([abduction * np.sin(9 * t), *(random.uniform(-180, 180, (2, 1)) + speed * t)])
    for put, take in ((from_euler, euler_angles), (from_swing_twist, swing_twist_angles)):
        if take is swing_twist_angles:
            angles[1] = 60 * np.sin(7 * t)
        found = take(put(angles))
        assert_allclose(found - angles, np.tile((found - angles)[:, :1], 200), atol=1e-6)
        assert_allclose((found - angles) / 360.0, np.rint((found - angles) / 360.0), atol=1e-6)
        assert np.abs(found.mean(axis=1)).max() <= 180.0 + 1e-9


def test_a_swing_through_half_a_turn_is_no_jump() -> None:
    """The bone passes exactly through its opposite direction, and near by."""
    t = np.linspace(0, 1, 91)
    for aside in (0.0, 2.0):
        swing = np.stack([100 * t, np.sqrt(3) * 100 * t])  # up to 200 degrees
        angles = np.stack([swing[0] + aside * t, swing[1], 50 * t - 20])
        q = from_swing_twist(angles)
        found = swing_twist_angles(q)
        assert angle(from_swing_twist(found), q).max() < LEAST_DEG
        # Where the twist is not known, it is that of the frame before.
        assert np.sum(np.abs(found - angles).max(axis=0) > 1e-6) <= 1
        assert np.abs(found - angles).max() < 1.0


@pytest.mark.parametrize("through", [[-150, 140], [-20, 120], [60, 200], [80, -260]])
@pytest.mark.parametrize("exactly", [True, False])
@pytest.mark.parametrize("flips", [True, False])
def test_passing_through_gimbal_lock_is_no_jump(
    through: list[float], exactly: bool, flips: bool
) -> None:
    """The curves stay those that made the motion, or their other triple, throughout."""
    abduction = np.linspace(*through, 101)
    if exactly:
        for lock in (-90, 90, -270):
            i = np.argmin(np.abs(abduction - lock))
            if abs(abduction[i] - lock) < 3:
                abduction[i] = lock
    t = np.linspace(0, 1, 101)
    angles = np.stack([abduction, 30 + 40 * t, -20 + 30 * t])
    q = reference_rotation(angles)
    if flips:
        q[:, ::7] *= -1
    found = euler_angles(q)
    assert angle(from_euler(found), q).max() < LEAST_DEG
    assert np.abs(np.diff(found, axis=1)).max() < 2 * np.abs(np.diff(angles, axis=1)).max() + 1e-6


def test_a_joint_that_stays_at_gimbal_lock_does_not_jitter() -> None:
    """Only the sum of flexion and twist is known there: they share it evenly."""
    t = np.linspace(0, 1, 50)
    q = reference_rotation(np.stack([np.full(50, 90.0), 100 * t, -100 * t]))
    found = euler_angles(q)
    assert np.abs(np.diff(found, axis=1)).max() < 5.0
    assert angle(from_euler(found), q).max() < LEAST_DEG


def test_signs_of_quaternions_do_not_matter() -> None:
    q = reference_rotation(
        np.stack([20 * np.sin(np.arange(50.0) / 9), np.arange(50.0) * 5, 0 * np.arange(50.0)])
    )
    flipped = q * np.where(np.random.default_rng(0).random(50) < 0.5, -1, 1)
    assert_allclose(euler_angles(flipped), euler_angles(q), atol=1e-9)
    assert_allclose(swing_twist_angles(flipped), swing_twist_angles(q), atol=1e-9)
    assert (np.sum(np.diff(same_signs(flipped), axis=1) ** 2, axis=0) < 1).all()


@given(seeds)
@settings(max_examples=20)
def test_products_are_those_of_the_motion_package(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b = random_rotations(random, 2, 5)
    v = random.normal(size=(5, 3))
    assert_allclose(product(a.T, b.T).T, rot.multiply(a, b), atol=1e-12)
    assert_allclose(inverse(a.T).T, rot.conjugate(a), atol=1e-12)
    assert_allclose(rotate(a.T, v.T).T, rot.rotate(a, v), atol=1e-12)


# --- a whole hand --------------------------------------------------------------------------------


def shaken(frames: int, seed: int) -> Clip:
    """Every joint of the character in any rotation."""
    q = random_rotations(np.random.default_rng(seed), frames, len(RIG))
    return at_bind(RIG, frames).with_rotations(q)


@given(seeds, st.integers(1, 6), st.sampled_from(SIDES))
@settings(max_examples=30, deadline=None)
def test_a_hand_of_any_rotations_comes_back(seed: int, frames: int, side: Side) -> None:
    clip = shaken(frames, seed)
    f = frames_of(RIG, INDEX, side)
    channels = encode(clip, f)
    assert channels.values.shape == (frames, 45)
    # Decoded onto another pose, so that nothing of the source is left there.
    again = decode(channels, at_bind(RIG, frames), f)
    assert rot.angle_between(again.rotations, clip.rotations)[:, f.joints].max() < LEAST_DEG


@given(seeds, st.sampled_from(SIDES))
@settings(max_examples=30, deadline=None)
def test_angles_of_a_hand_come_back(seed: int, side: Side) -> None:
    f = frames_of(RIG, INDEX, side)
    names = all_channels(side, f.names)
    values = gesture(60, 15, seed)
    clip = decode(Channels(names, values), at_bind(RIG, 60), f)
    assert_allclose(encode(clip, f).values, values, atol=1e-6)


def test_other_joints_are_left_alone() -> None:
    clip = shaken(5, 1)
    f = frames_of(RIG, INDEX, "left")
    channels = encode(clip, f)
    again = decode(Channels(channels.names, channels.values + 10.0), clip, f)
    changed = np.flatnonzero(np.any(again.rotations != clip.rotations, axis=(0, 2)))
    assert set(changed) == {int(j) for j in f.joints}


@pytest.mark.parametrize("side", SIDES)
def test_decoded_quaternions_are_continuous(side: Side) -> None:
    """Also where the channels themselves jump by a turn."""
    f = frames_of(RIG, INDEX, side)
    values = np.tile(np.linspace(0, 60, 40)[:, None], (1, 45))
    names = all_channels(side, f.names)
    turning = [n[2:] not in ("ThumbCMCx", "ThumbCMCz") for n in names]  # a swing is no angle
    values[20:, turning] += 360.0
    q = decode(Channels(names, values), at_bind(RIG, 40), f).rotations
    assert np.sum(q[1:] * q[:-1], axis=-1).min() > 0.9


def test_names_are_the_papers() -> None:
    names = model_channels("right", HAND_JOINTS)
    assert len(names) == 25
    assert len(all_channels("left", HAND_JOINTS)) == 45
    assert {"riRingDIPy", "riThumbCMCx", "riThumbMCPz", "riThumbIPz", "riPinkyMCPx"} <= set(names)
    assert not {"riRingDIPx", "riThumbMCPx", "riThumbIPy"} & set(names)
    assert [n for n in names if is_flexion(n)] == [
        n for n in names if n[-1] == ("z" if "Thumb" in n else "y")
    ]


def both_hands(clip: Clip) -> Hands:
    maps = {side: hand_map(INDEX, side) for side in SIDES}
    return Hands.of(clip, CharacterMap(maps, "test"))


def test_both_hands_together_are_each_alone() -> None:
    clip = shaken(7, 3)
    hands = both_hands(clip)
    values = hands.encode(clip)
    assert values.names == hands.all_names
    assert len(hands.model_names) == 50
    for side in SIDES:
        alone = encode(clip, hands.frames[side])
        assert_allclose(values.select(alone.names).values, alone.values)
    other = at_bind(RIG, 7)
    apart = decode(values, decode(values, other, hands.frames["left"]), hands.frames["right"])
    assert_allclose(hands.decode(values, other).rotations, apart.rotations)


def test_channels_that_do_not_fit_are_refused() -> None:
    clip = at_bind(RIG, 4)
    f = frames_of(RIG, INDEX, "left")
    channels = encode(clip, f)
    with pytest.raises(UsageError, match="3 frames do not match a clip of 4"):
        decode(Channels(channels.names, channels.values[:3]), clip, f)
    with pytest.raises(UsageError, match="leThumbCMCx"):
        decode(Channels(channels.names[1:], channels.values[:, 1:]), clip, f)


def test_replaced_keeps_the_others_and_the_original() -> None:
    channels = Channels(("a", "b", "c"), np.arange(6.0).reshape(2, 3))
    new = channels.replaced(Channels(("c", "a"), np.array([[10.0, 20.0], [11.0, 21.0]])))
    assert_allclose(new.values, [[20, 1, 10], [21, 4, 11]])
    assert_allclose(channels.values, np.arange(6.0).reshape(2, 3))


# --- fingertips ----------------------------------------------------------------------------------


def slow_tips(clip: Clip, side: Side) -> Array:
    """Fingertips by forward kinematics of everything."""
    f = frames_of(RIG, INDEX, side)
    pose = forward_kinematics(clip)
    wrist = INDEX[side, "wrist"]
    palm = rot.multiply(pose.rotation(wrist), f.palm)
    tips = []
    for digit, tip in zip(f.digits, f.tips, strict=True):
        last = f.last_joint(digit)
        place = pose.position(last) + rot.rotate(pose.rotation(last), tip[None])
        tips.append(rot.rotate(rot.conjugate(palm), place - pose.position(wrist)))
    return np.stack(tips, axis=1)


@pytest.mark.parametrize("side", SIDES)
def test_fingertips_are_those_of_forward_kinematics(side: Side) -> None:
    clip = shaken(6, 8)
    f = frames_of(RIG, INDEX, side)
    assert_allclose(fingertips(clip, hand_map(INDEX, side), f), slow_tips(clip, side), atol=1e-9)


def test_fingertips_of_channels_are_those_of_the_decoded_clip() -> None:
    clip, other = shaken(6, 8), shaken(6, 9)
    hands = both_hands(clip)
    channels = hands.encode(other)
    assert_allclose(
        hands.fingertips(clip, channels), hands.fingertips(hands.decode(channels, clip)), atol=1e-9
    )


@pytest.mark.parametrize("joint", ["IndexMCP", "wrist", "elbow"])
def test_fingertips_grow_with_the_joints_above(joint: str) -> None:
    clip = shaken(6, 8)
    scales = clip.scales.copy()
    scales[:, INDEX["left", joint]] = 2.0
    hand, f = hand_map(INDEX, "left"), frames_of(RIG, INDEX, "left")
    plain = fingertips(clip, hand, f)
    large = fingertips(replace(clip, scales=scales), hand, f)
    if joint == "IndexMCP":
        assert_allclose(np.delete(large, 1, axis=1), np.delete(plain, 1, axis=1))
        assert not np.allclose(large[:, 1], plain[:, 1], atol=0.1)
    else:
        assert_allclose(large, 2 * plain, atol=1e-9)
