"""Time in files: exact time codes, usual frame rates, and the frames behind the times of keys."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Literal

import numpy as np

from usdhand.motion.rotations import Array

SLOWEST_FPS, FASTEST_FPS = 0.1, 10_000.0  # that a file may mean
DEFAULT_FPS = 30.0  # where nothing tells the rate
MOST_FRAMES = 1_000_000  # more is a mistake in the times: 4.6 hours at 60 frames a second

_FILM_AND_VIDEO = (24, 25, 30, 24_000 / 1001, 30_000 / 1001, 48, 50, 60, 60_000 / 1001)
_FINER = (72, 90, 100, 120, 120_000 / 1001, 144, 240)
_OTHERS = (10, 12, 15, 20, 75, 80, 96, 125, 150, 180, 200, 250, 300, 360, 480, 500, 1000)
# In order of preference where keys lie on the frames of several of them: coarse before fine.
GRID_FPS = tuple(float(rate) for rate in (*_FILM_AND_VIDEO, *_FINER))
USUAL_FPS = (*GRID_FPS, *map(float, _OTHERS))

SPARSE = 12.0 * 0.999  # frames a second: sparser keys are keys of curves, not frames
DENSE = 1000.0  # frames a second: denser keys, in a file that does not say its rate, are none
UNEVEN, UNEVEN_CODES = 0.05, 1e-3  # frames: how far seconds and time codes may lie off steady ones
UNSEEN = 1e-6  # frames: a key this near to a frame is the frame's
SAME_CODE = 1e-9  # time codes: two keys this near are one
DRIFT = 2e-4  # relative: a rate this near to a usual one is that one, badly rounded
MILLISECONDS = 6e-4  # seconds: times rounded to milliseconds
FLOAT32 = 1.2e-7  # relative: times rounded to single precision
FASTEST_TIME_CODES = 240.0  # a second; above, time codes are ticks rather than frames
HALF_KNOWN = 0.7  # frames: times rounded more coarsely tell no frame
BY_CHANCE = 0.01  # how likely any times with gaps may lie on a grid
EXACT = 2e-5  # seconds: times as a rate makes them, summed up with rounding

_LARGEST_DENOMINATOR = 1_000_000
_LARGEST_WHOLE = 2**53  # up to which floats hold every whole number


# --- exact numbers -------------------------------------------------------------------------------


def exact(value: float) -> Fraction:
    """Return the simplest fraction that this float can stand for: 29.97 is 2997/100.

    Arithmetic with these does not round, so that time codes stay what they are when they are
    counted at another rate and back.
    """
    simple = Fraction(value).limit_denominator(_LARGEST_DENOMINATOR)
    return simple if float(simple) == value else Fraction(value)


def quotient(a: float, b: float) -> float:
    """``a / b`` of the numbers that two floats stand for."""
    return float(exact(a) / exact(b))


def recounted_code(time_code: float, old: float, new: float) -> float:
    """Return what is a time code at ``old`` time codes a second at ``new`` ones a second."""
    return float(exact(time_code) * exact(new) / exact(old))


def time_codes(frames: Array | float, first: float, step: float) -> Array:
    """Time codes of frame numbers (n,), each the float nearest to the exact one.

    Parameters
    ----------
    first, step : time code of frame 0, and distance of two frames
    """
    if abs(first) < _LARGEST_WHOLE and abs(step) < _LARGEST_WHOLE:
        start, by = exact(first), exact(step)
        whole = math.lcm(start.denominator, by.denominator)
        if whole >= _LARGEST_WHOLE:
            return np.asarray(first + frames * step)
        a, b = int(start * whole), int(by * whole)
        largest = abs(a) + float(np.max(np.abs(frames), initial=0.0)) * abs(b)
        if largest < _LARGEST_WHOLE:
            return np.asarray((a + frames * b) / whole)
    return np.asarray(first + frames * step)


# --- frame rates ---------------------------------------------------------------------------------


def rate_of_frame_time(written: str) -> tuple[float, bool]:
    """Frames a second of a frame time, as it is written: ``0.0333`` is 30, not 30.03.

    The rate is that of the usual ones whose frame time, rounded or cut off to the digits written,
    is this; whole ones are preferred to those of NTSC video, and near ones to far ones.

    Returns
    -------
    fps
    guessed : whether it is off by more than rounding that nobody sees
    """
    exponent = Decimal(written).as_tuple().exponent
    digit = 10.0**exponent if isinstance(exponent, int) else 0.0
    seconds = float(written)

    def off(fps: float) -> float:
        return abs(1.0 / fps - seconds)

    nearest = min(USUAL_FPS, key=off)
    if off(nearest) < 1e-9 * seconds:
        return nearest, False
    # The other tolerance is what a float32 leaves of a frame time.
    within = min(max(digit, 2e-7 * seconds), 0.2 * seconds) * (1 + 1e-9)
    meant = [fps for fps in USUAL_FPS if off(fps) < within]
    whole = [fps for fps in meant if fps == int(fps)] or meant
    if not whole:
        return 1.0 / seconds, False
    fps = min(whole, key=off)
    return fps, abs(fps * seconds - 1.0) >= 1e-6


@dataclass(frozen=True)
class Clock:
    """How a file counts time.

    Attributes
    ----------
    per_second : units of its time in a second
    frame_rate : frames a second that it says; None if it does not, and times are then in single
        precision or rounded
    """

    per_second: float = 1.0
    frame_rate: float | None = None

    @property
    def uneven(self) -> float:
        """How far keys may lie off a steady sequence, in frames."""
        return UNEVEN if self.frame_rate is None else UNEVEN_CODES


# What lies behind key times: one key; frames, the nearest of which both have keys; the same with
# badly rounded times; frames of which none has a neighbour with a key; or no frames at all, so that
# curves are read between keys.
Rhythm = Literal["one key", "steady", "rounded", "sparse", "uneven"]


@dataclass(frozen=True, eq=False)
class Timing:
    """Frames of a clip over the keys of its animation.

    Attributes
    ----------
    keys : distinct key times, in the file's units
    step : time from frame to frame that brings keys onto whole frames
    fps : frames a second that are meant
    count : of frames
    """

    keys: Array
    step: float
    fps: float
    count: int
    rhythm: Rhythm

    @property
    def start(self) -> float:
        """Time of the first frame."""
        return float(self.keys[0])

    @property
    def times(self) -> Array:
        """(count,) times of the frames, those of the keys where a frame has one."""
        steady = time_codes(np.arange(self.count, dtype=np.float64), self.start, self.step)
        if self.rhythm == "uneven":
            return steady
        if len(self.keys) == self.count:
            return self.keys
        frames = np.round((self.keys - self.start) / self.step).astype(np.intp)
        steady[frames] = self.keys
        return steady

    @property
    def all_times(self) -> Array:
        """Times of the frames, and of the keys that lie between or after them."""
        own, keys = self.times, self.keys
        after = np.searchsorted(own, keys)
        around = own[np.clip(after - 1, 0, None)], own[np.clip(after, None, len(own) - 1)]
        away = np.minimum(*(np.abs(keys - times) for times in around))
        return np.sort(np.concatenate([own, keys[away > UNSEEN * self.step]]))

    def frames(self, times: Array) -> Array:
        """Frame numbers of key times; those meant to lie on a frame do so exactly."""
        found: Array = (times - self.start) / self.step
        whole = np.round(found)
        near = 1e-3 if self.rhythm == "uneven" else 2 * UNEVEN
        return np.where(np.abs(found - whole) <= near, whole, found)


@np.errstate(over="ignore", invalid="ignore")  # of times that cannot be meant
def find_timing(curves: Sequence[Array], clock: Clock | None = None) -> Timing:
    """Find the steady frames behind the key times (n,) of all curves.

    One key alone says nothing about when a curve moves: such curves count only where there are no
    others. ``count`` is not limited, see `MOST_FRAMES`.
    """
    clock = clock or Clock()
    moving = [times for times in curves if len(times) > 1]
    keys = _distinct(moving or list(curves[:1]), clock)
    if len(keys) == 1:
        fps = clock.frame_rate or DEFAULT_FPS
        return Timing(keys, quotient(clock.per_second, fps), fps, 1, "one key")
    if clock.frame_rate is not None:
        return _over_codes(keys, clock, clock.frame_rate)
    rounding = EXACT + FLOAT32 * float(np.abs(keys).max())
    return _steady(keys, clock, rounding) or _on_grid(keys, rounding) or _over_seconds(keys)


def _distinct(curves: list[Array], clock: Clock) -> Array:
    times = np.unique(np.concatenate(curves))
    if clock.frame_rate is not None:
        near = np.diff(times) <= SAME_CODE
    else:
        # Two keys at nearly one time make a jump, they are no frames; many such keys are ticks.
        near = np.diff(times) <= np.maximum(1e-4, 2 * FLOAT32 * np.abs(times[1:]))
        if (near[1:] & near[:-1]).any():
            return times
    return np.asarray(times[np.concatenate([[True], ~near])])


def _steady(keys: Array, clock: Clock, rounding: float = 0.0) -> Timing | None:
    """One key a frame, at any rate."""
    steps, span = len(keys) - 1, float(keys[-1] - keys[0])
    step = span / steps
    densest = DENSE if clock.frame_rate is None else np.inf
    if not SPARSE <= clock.per_second / step <= densest:
        return None
    if _residual(keys, step) > clock.uneven * step:
        return None
    if clock.frame_rate is not None:
        step = _simplest(keys, step)
        return Timing(keys, step, quotient(clock.per_second, step), len(keys), "steady")
    rate = steps / span
    fps = min((*GRID_FPS, round(2 * rate) / 2), key=lambda usual: abs(usual - rate))
    off = abs(steps / fps - span)
    if off > max(DRIFT * span, MILLISECONDS):
        fps = rate
    rounded = off > rounding and fps != rate
    return Timing(keys, step, fps, len(keys), "rounded" if rounded else "steady")


def _simplest(keys: Array, step: float) -> float:
    """Return the simple number next to a step if it gives these very keys, else the step."""
    first, simple = float(keys[0]), float(Fraction(step).limit_denominator(10_000))
    frames = np.round((keys - first) / step)
    return simple if np.array_equal(time_codes(frames, first, simple), keys) else step


def _over_codes(keys: Array, clock: Clock, frame_rate: float) -> Timing:
    """Frames of the rate that the file says, unless its time codes are no frames.

    Seconds, milliseconds and other ticks have the rate that the times themselves tell.
    """
    steady = _steady(keys, clock)
    if SPARSE <= clock.per_second <= FASTEST_TIME_CODES:
        return steady or _over_frames(keys, clock.per_second, frame_rate)
    if steady and min(abs(fps / steady.fps - 1.0) for fps in USUAL_FPS) < 1e-6:
        return steady
    typical = clock.per_second / float(np.median(np.diff(keys)))
    found = _over_rounded(keys, clock.per_second, frame_rate) or steady
    if found or typical < SPARSE or frame_rate >= SPARSE:
        return found or _over_frames(keys, clock.per_second, frame_rate)
    fps = _about(typical)
    return _resampled(keys, quotient(clock.per_second, fps), fps, 1e-3)


def _over_frames(keys: Array, per_second: float, frame_rate: float) -> Timing:
    """Frames of the stated rate, or a finer one on whose frames all keys lie."""
    step, shortest = quotient(per_second, frame_rate), float(np.diff(keys).min())
    if step / 20 <= shortest < step and _residual(keys, shortest) < UNEVEN_CODES * shortest:
        step = _simplest(keys, shortest)
    return _resampled(keys, step, quotient(per_second, step), 1e-6)


def _over_rounded(keys: Array, per_second: float, frame_rate: float) -> Timing | None:
    """Frames of a usual rate whose times, rounded or cut off, are these keys, gaps allowed."""
    seconds = (keys - keys[0]) / per_second
    largest = EXACT + FLOAT32 * float(np.abs(keys).max()) / per_second
    unit = max(_last_digit(keys) / per_second, largest) * (1 + 1e-6)
    every = np.arange(len(keys), dtype=np.float64)
    rates = [fps for fps in (frame_rate, *USUAL_FPS) if fps >= SPARSE and fps * unit < HALF_KNOWN]

    def off(fps: float, frames: Array) -> float:
        return float(np.ptp(seconds - frames / fps))

    exact_rates = [fps for fps in rates if off(fps, every) <= unit]
    if exact_rates:
        whole = [fps for fps in exact_rates if fps == int(fps)] or exact_rates
        fps = min(whole, key=lambda fps: (fps != frame_rate, off(fps, every)))
        return Timing(keys, quotient(per_second, fps), fps, len(keys), "rounded")
    for fps in rates:
        frames = np.round(seconds * fps)
        chance = (fps * unit) ** (len(keys) - 1)
        neighbours = bool((np.diff(frames) == 1).any())
        tells = chance < BY_CHANCE and (neighbours or fps == frame_rate)
        if tells and (np.diff(frames) > 0).all() and off(fps, frames) <= unit:
            rhythm: Rhythm = "rounded" if neighbours else "sparse"
            step = quotient(per_second, fps)
            return Timing(keys, step, fps, int(frames[-1]) + 1, rhythm)
    return None


def _last_digit(keys: Array) -> float:
    """Return the place of the last decimal that any key has: .01 for 0.03 and 0.1; 0 for none."""
    for digits in range(6):
        if np.abs(keys - np.round(keys, digits)).max() <= SAME_CODE:
            return float(10.0**-digits)
    return 0.0


def _on_grid(keys: Array, rounding: float) -> Timing | None:
    """Keys with gaps, all on the frames of a usual rate."""
    shortest, span = float(np.diff(keys).min()), float(keys[-1] - keys[0])
    for tolerance in (rounding, MILLISECONDS):
        for fps in GRID_FPS:
            # A grid so fine that any time lies on it tells nothing.
            if tolerance > UNEVEN / fps or shortest < 0.9 / fps:
                continue
            if _residual(keys, 1.0 / fps) <= tolerance:
                every = shortest < 1.5 / fps and tolerance == rounding
                count = round(span * fps) + 1
                return Timing(keys, 1.0 / fps, fps, count, "steady" if every else "sparse")
    return None


def _over_seconds(keys: Array) -> Timing:
    """Frames of a usual rate that is about as fine as the keys are."""
    typical = 1.0 / float(np.median(np.diff(keys)))
    fps = _about(typical)
    return _resampled(keys, 1.0 / fps, fps, 1e-3)


def _about(typical: float) -> float:
    return min((24.0, 30.0, 60.0, 120.0), key=lambda rate: abs(np.log(rate / max(typical, 30.0))))


def _resampled(keys: Array, step: float, fps: float, slack: float) -> Timing:
    frames = min(float((keys[-1] - keys[0]) / step), 1e18)
    return Timing(keys, step, fps, int(np.floor(frames + slack)) + 1, "uneven")


def _residual(keys: Array, step: float) -> float:
    """Largest distance of keys from steady times."""
    frames = (keys - keys[0]) / step
    return float(np.abs(frames - np.round(frames)).max() * step)
