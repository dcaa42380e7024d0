"""Frames that a recording invents are found, bridged, and said; rests are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from usdhand.motion import rotations as rot
from usdhand.splice.frozen import (
    bridged,
    bridged_rotations,
    bridged_smoothly,
    frozen_ranges,
)


def motion(noise: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Bend (frames, 3) and place of a wrist that moves all the time."""
    t = np.arange(200) / 60.0
    random = np.random.default_rng(seed)
    angle = 0.4 * np.sin(2 * np.pi * 0.7 * t) + random.normal(scale=noise, size=200)
    bend = np.stack([np.sin(angle), 0 * t, np.cos(angle)], axis=1)
    wrist = 15.0 * np.stack([np.sin(3 * t), np.cos(2 * t), t], axis=1)
    return bend, wrist + random.normal(scale=10 * noise, size=(200, 3))


@given(st.integers(0, 1000), st.integers(10, 150), st.integers(4, 25))
def test_copies_in_a_noisy_recording_are_found(seed: int, first: int, count: int) -> None:
    bend, wrist = motion(0.02, seed)
    for curve in (bend, wrist):
        curve[first : first + count + 1] = curve[first]
    found = frozen_ranges(bend, wrist)
    assert found in ((), ((first, first + count + 1),))
    if found == ():  # by chance the noise is as small as what repeats
        change = np.abs(np.diff(bend, axis=0)).max(axis=1)
        usual = np.median(change[change > 0])
        assert min(change[first - 1], change[first + count]) < 0.2 * usual


def test_a_jump_after_copies_is_a_dropout_without_noise_too() -> None:
    bend, wrist = motion(0.0)
    for curve in (bend, wrist):
        curve[60:76] = curve[60]
    assert frozen_ranges(bend, wrist) == ((60, 76),)


def test_a_rest_is_no_dropout() -> None:
    """It begins and ends slowly."""
    bend, wrist = motion(0.0)
    fastest = int(np.argmin(np.abs(bend[20:60, 0] - bend[20:60, 0].max()))) + 20
    held = np.concatenate([np.arange(fastest + 1), np.full(40, fastest), np.arange(fastest, 200)])
    assert frozen_ranges(bend[held], wrist[held] * 0) == ()
    assert frozen_ranges(bend[:1].repeat(90, axis=0), wrist[:90]) == ()


def test_a_stiff_wrist_is_no_dropout() -> None:
    _, wrist = motion(0.02)
    assert frozen_ranges(np.tile([0.0, 0.0, 1.0], (200, 1)), wrist) == ()


@pytest.mark.parametrize("ranges", [((3, 8), (10, 14))])
def test_bridges_are_even(ranges: tuple[tuple[int, int], ...]) -> None:
    values = np.random.default_rng(1).normal(size=(20, 2))
    found = bridged(values, ranges)
    for first, last in ranges:
        assert np.allclose(np.diff(found[first : last + 1], 2, axis=0), 0.0)
        assert np.allclose(found[[first, last]], values[[first, last]])
    outside = np.setdiff1d(np.arange(20), [*range(3, 9), *range(10, 15)])
    assert np.array_equal(found[outside], values[outside])
    turns = rot.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.linspace(0.0, 1.0, 20) ** 2)
    between = bridged_rotations(turns, ranges)
    steps = rot.angle_between(between[3:8], between[4:9])
    assert np.allclose(steps, steps[0])


@given(st.integers(0, 1000))
def test_bridged_fingers_stay_between_their_ends(seed: int) -> None:
    random = np.random.default_rng(seed)
    curves = np.cumsum(random.normal(size=(40, 3)), axis=0)
    curves[10:21] = curves[10]
    found = bridged_smoothly(curves, [(10, 21)])
    low, high = np.sort(curves[[10, 21]], axis=0)
    assert (found[10:22] >= low - 1e-9).all()
    assert (found[10:22] <= high + 1e-9).all()
    assert np.array_equal(found[:11], curves[:11])
    moving = np.cumsum(random.normal(size=(40, 3)), axis=0)
    assert np.array_equal(bridged_smoothly(moving, [(10, 21)]), moving)
