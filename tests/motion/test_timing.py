"""Time codes that stay what they are, and the frames behind the times of keys."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from usdhand.motion import Clip, Origin, Skeleton, resample
from usdhand.motion.editing import counted_in_frames, recounted, starting_at, trim
from usdhand.motion.resample import resample_like
from usdhand.motion.timing import (
    GRID_FPS,
    MOST_FRAMES,
    Clock,
    exact,
    find_timing,
    quotient,
    rate_of_frame_time,
    recounted_code,
    time_codes,
)

NTSC = (24000 / 1001, 30000 / 1001, 60000 / 1001, 23.976, 29.97, 59.94)
RATES = (*NTSC, 12.5, 15.0, 24.0, 25.0, 30.0, 47.952, 48.0, 50.0, 60.0, 100.0, 119.88, 120.0, 240.0)
rates = st.sampled_from(RATES)
whole = st.integers(-100_000, 1_000_000).map(float)


def clip_of(
    frames: int, fps: float, first: float, per_second: float | None = None, step: float = 1.0
) -> Clip:
    eye = np.eye(4)[None]
    skeleton = Skeleton(("Hips",), np.array([-1]), eye, eye)
    q = np.tile([0.0, 0.0, 0.0, 1.0], (frames, 1, 1))
    t = np.zeros((frames, 1, 3))
    origin = Origin(None, "", "", per_second or fps, first, step)
    return Clip(skeleton, q, t, np.ones_like(t), fps, origin=origin)


# --- exact numbers -------------------------------------------------------------------------------


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_exact_numbers_are_the_floats(value: float) -> None:
    assert float(exact(value)) == value


def test_exact_numbers_are_simple() -> None:
    assert exact(29.97) == Fraction(2997, 100)
    assert exact(30000 / 1001) == Fraction(30000, 1001)
    assert exact(0.1 + 0.2) != Fraction(3, 10)  # not what was meant, but what it is
    assert quotient(24.0, 0.4) == 60.0  # 59.99999999999999 otherwise


@given(whole, rates, rates)
def test_a_time_code_comes_back(code: float, old: float, new: float) -> None:
    assert recounted_code(code, old, old) == code
    there = recounted_code(code, old, new)
    assert there == pytest.approx(code * new / old, rel=1e-14)
    back = recounted_code(there, new, old)
    fractions = [Fraction(old).limit_denominator(10_000), Fraction(new).limit_denominator(10_000)]
    if (Fraction(int(code)) * fractions[1] / fractions[0]).denominator <= 1_000_000:
        assert back == code
    assert back == pytest.approx(code, rel=1e-14)


@given(
    st.decimals(-2000, 2000, places=3),
    st.sampled_from(["1", "0.5", "0.4", "0.8", "1.25", "0.001", "5", "0.8008"]),
    st.integers(1, 400),
)
def test_time_codes_are_the_nearest_floats(first: object, step: str, count: int) -> None:
    exactly = [float(Fraction(str(first)) + i * Fraction(step)) for i in range(count)]
    found = time_codes(np.arange(float(count)), float(str(first)), float(step))
    assert found.tolist() == exactly


def test_time_codes_of_any_numbers() -> None:
    frames = np.arange(5.0)
    assert np.isnan(time_codes(frames, np.nan, 1.0)).all()
    for first, step in ((0.1234567890123, np.pi), (1e300, 1e299), (-7e-300, 1e-301)):
        assert np.allclose(time_codes(frames, first, step), first + frames * step, rtol=1e-14)


# --- clips at other rates ------------------------------------------------------------------------


@given(whole, rates, st.integers(1, 100))
def test_whole_time_codes_stay_whole(first: float, fps: float, frames: int) -> None:
    """A file that counts frames, made into one of another format and back."""
    clip, codes = clip_of(frames, fps, first), first + np.arange(frames)
    for found in (
        clip,
        counted_in_frames(clip),
        counted_in_frames(recounted(clip, 2.0 * fps)),
        recounted(counted_in_frames(clip), fps),
        resample_like(clip_of(3, 30.0, 0.0, fps), clip),
        resample(clip, fps),
        starting_at(clip_of(frames, fps, 5.0), first),
        trim(clip_of(frames + 7, fps, first - 7), first, None),
    ):
        assert found.time_codes.tolist() == codes.tolist()
        assert found.fps == fps


@given(whole, rates, st.sampled_from([2, 3, 4, 5, 8]))
def test_subframes_are_counted_in_frames(frame: float, fps: float, each: int) -> None:
    """Files with several time codes a frame, or several frames a time code."""
    codes = np.arange(frame, frame + 9)
    many = clip_of(9, fps, frame * each, fps * each, float(each))
    few = clip_of(9, fps, float(Fraction(int(frame), each)), float(exact(fps) / each), 1 / each)
    for clip in (many, few):
        assert counted_in_frames(clip).time_codes.tolist() == codes.tolist()


@given(whole, st.sampled_from([(24.0, 60.0), (30.0, 24.0), (29.97, 59.94), (24.0, 23.976)]))
def test_resampled_frames_that_meet_the_old_ones_are_theirs(
    first: float, pair: tuple[float, float]
) -> None:
    old, new = pair
    codes = resample(clip_of(2000, old, first), new).time_codes
    for i, code in enumerate(codes):
        assert code == float(exact(first) + i * exact(old) / exact(new))


# --- frame times as text -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "fps"),
    [("0.016667", 60), ("0.01667", 60), ("0.0167", 60), ("0.017", 60), ("0.0166", 60),
     ("0.0333", 30), (".03333", 30), ("0.033333", 30), ("0.033", 30), ("0.03", 30),
     ("0.0333333351", 30), ("3.33333e-2", 30), ("0.008333", 120), ("0.0083", 120),
     ("0.00833333", 120), ("0.041667", 24), ("0.0417", 24), ("0.04", 25), ("0.020000", 50),
     ("0.010000", 100), ("0.1", 10), ("1", 1), ("0.03336667", 30000 / 1001),
     ("0.0333667", 30000 / 1001), ("0.016683", 60000 / 1001), ("0.008342", 120000 / 1001),
     ("0.0234567", 1 / 0.0234567), ("0.03125", 32)],
)  # fmt: skip
def test_frame_rates(time: str, fps: float) -> None:
    assert rate_of_frame_time(time)[0] == pytest.approx(fps, rel=1e-7)


def test_a_rate_that_is_guessed_is_said() -> None:
    assert rate_of_frame_time("0.0333") == (30.0, True)
    assert rate_of_frame_time("0.0333333") == (30.0, False)
    assert rate_of_frame_time("0.0234567") == (1 / 0.0234567, False)


# --- frames behind keys --------------------------------------------------------------------------


@given(st.sampled_from(GRID_FPS), st.integers(20, 400), st.sampled_from([0.0, 1.0, 33.5, 600.0]))
def test_rates_of_rounded_times(fps: float, frames: int, start: float) -> None:
    times = start + np.arange(frames) / fps
    summed = start + np.cumsum(np.full(frames, np.float32(1 / fps)), dtype=np.float32)
    for keys in (times, times.astype(np.float32).astype(float), summed.astype(float)):
        timing = find_timing([keys])
        assert timing.count == frames
        assert timing.fps == pytest.approx(fps, rel=2e-4)
        assert timing.frames(keys).tolist() == list(range(frames))
        assert timing.times.tolist() == keys.tolist()


@pytest.mark.parametrize("fps", [24.0, 25.0, 30.0, 50.0, 60.0])
@pytest.mark.parametrize("frames", [30, 600])
def test_rates_of_milliseconds(fps: float, frames: int) -> None:
    timing = find_timing([np.round(np.arange(frames) / fps, 3)])
    assert (timing.fps, timing.count) == (fps, frames)


@given(
    st.sampled_from([24.0, 25.0, 30.0]),
    st.sets(st.integers(1, 300), min_size=12, max_size=40),
    st.floats(0.0, 100.0),
)
def test_keys_with_gaps_lie_on_frames(fps: float, later: set[int], start: float) -> None:
    frames = np.array(sorted({0, 1, *later}))
    keys = start + frames / fps
    timing = find_timing([keys[::2], keys, keys[1:4]])
    assert timing.rhythm != "uneven"
    assert (timing.frames(keys) * timing.step + timing.start).tolist() == pytest.approx(
        keys.tolist(), abs=2e-4
    )
    assert timing.start + (timing.count - 1) * timing.step == pytest.approx(keys[-1], abs=2e-4)


@pytest.mark.parametrize("clock", [Clock(), Clock(24.0, 24.0), Clock(6000.0, 30.0)])
def test_irregular_keys_are_said_to_be_so(clock: Clock) -> None:
    keys = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.05, 80)) * clock.per_second
    timing = find_timing([keys], clock)
    assert timing.rhythm == "uneven"
    assert timing.fps == (clock.frame_rate or 30.0)
    assert timing.times[0] == keys[0]
    assert keys[-1] - timing.step < timing.times[-1] <= keys[-1] + 1e-6
    assert len(timing.times) == timing.count


@given(rates, whole, st.integers(2, 300))
def test_time_codes_are_frames(rate: float, first: float, frames: int) -> None:
    keys = first + np.arange(frames)
    timing = find_timing([keys], Clock(rate, rate))
    assert (timing.rhythm, timing.step, timing.fps, timing.count) == ("steady", 1.0, rate, frames)
    assert timing.times.tolist() == keys.tolist()


@given(
    st.decimals(0, 2000, places=2), st.sampled_from(["0.4", "0.5", "0.8", "1.2"]),
    st.integers(2, 300),
)  # fmt: skip
def test_steps_between_time_codes_are_simple(first: object, step: str, frames: int) -> None:
    """The sum of the differences would be 0.39999999999999997."""
    keys = np.array([float(Fraction(str(first)) + i * Fraction(step)) for i in range(frames)])
    timing = find_timing([keys], Clock(24.0, 24.0))
    assert timing.step == float(step)
    assert timing.fps == float(24 / Fraction(step))
    assert time_codes(np.arange(float(frames)), timing.start, timing.step).tolist() == keys.tolist()


def test_sparse_time_codes_are_read_at_each() -> None:
    timing = find_timing([np.array([1.0, 10.0, 33.0])], Clock(24.0, 24.0))
    assert (timing.rhythm, timing.step, timing.fps, timing.count) == ("uneven", 1.0, 24.0, 33)
    finer = find_timing([np.array([1.0, 1.25, 33.0])], Clock(24.0, 24.0))
    assert (finer.step, finer.fps, finer.count) == (0.25, 96.0, 129)


def test_ticks_are_no_frames() -> None:
    second = 46186158000.0
    clock = Clock(second, 30.0)
    timing = find_timing([np.arange(9) * second / 30.0], clock)
    assert (timing.rhythm, timing.fps, timing.count) == ("steady", 30.0, 9)
    timing = find_timing([np.array([0.0, 0.31, 1.0]) * second], clock)
    assert (timing.rhythm, timing.fps, timing.count) == ("uneven", 30.0, 31)
    assert find_timing([np.array([second])], clock).fps == 30.0


def test_keys_that_are_one() -> None:
    """Samples of several attributes at times that differ by rounding."""
    keys = 1003.0 + np.arange(9)
    timing = find_timing([keys, np.nextafter(keys, 0.0), keys + 1e-10], Clock(24.0, 24.0))
    assert (timing.rhythm, timing.count) == ("steady", 9)
    thirds = 1003.0 + np.arange(9) / 3  # not rounded to decimals either
    assert find_timing([thirds, thirds[:4]], Clock(24.0, 24.0)).times.tolist() == thirds.tolist()


@pytest.mark.parametrize("clock", [Clock(), Clock(24.0, 24.0)])
@pytest.mark.parametrize("alone", [-1000.0, 0.5, 1e7])
def test_a_key_alone_says_nothing_about_time(clock: Clock, alone: float) -> None:
    step = 1.0 if clock.frame_rate else 1 / 24
    keys = step * np.arange(1, 48)
    for curves in ([np.array([alone]), keys], [keys, np.array([alone]), np.array([-alone])]):
        timing = find_timing(curves, clock)
        assert (timing.count, timing.fps, timing.rhythm) == (47, 24.0, "steady")
        assert timing.start == keys[0]
    single = find_timing([np.array([alone]), np.array([3.0])], clock)
    assert (single.times.tolist(), single.count, single.rhythm) == ([alone], 1, "one key")


def test_too_many_frames_are_counted_but_not_made() -> None:
    for clock in (Clock(), Clock(24.0, 24.0)):
        for last in (1e9, 1e300):
            assert find_timing([np.array([0.0, 0.013, last])], clock).count > MOST_FRAMES
    assert find_timing([np.array([-1e308, 0.0, 1e308])], Clock(24.0, 24.0)).count > MOST_FRAMES


def test_a_clip_knows_the_time_codes_of_its_frames() -> None:
    clip = clip_of(5, 29.97, 1003.0)
    assert [clip.time_code(frame) for frame in (0, 4, 0.5)] == [1003.0, 1007.0, 1003.5]
    later = replace(clip, origin=replace(clip.origin, time_codes_per_frame=0.4))
    assert later.time_code(5) == 1005.0
