"""The steady frame rate behind the key times of an animation, which glTF leaves open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdhand.errors import InputError
from usdhand.motion.rotations import Array

# In order of preference where keys lie on several of them: coarse before fine.
RATES = tuple(
    float(rate)
    for rate in (
        *(24, 25, 30, 24_000 / 1001, 30_000 / 1001, 48, 50, 60, 60_000 / 1001),
        *(72, 90, 100, 120, 120_000 / 1001, 144, 240),
    )
)
SLOWEST, FASTEST = 12.0, 1000.0  # steady keys in between are frames
DEFAULT_FPS = 30.0
MOST_FRAMES = 1_000_000

UNEVEN = 0.05  # frames: how far keys may lie off a steady sequence
DRIFT = 2e-4  # relative: a rate this near to a common one is that one, badly rounded
MILLISECONDS = 6e-4  # seconds: times rounded to milliseconds
FLOAT32 = 1.2e-7  # relative: times rounded to single precision
EXACT = 2e-5  # seconds: times as a rate makes them, summed up with rounding


@dataclass(frozen=True, eq=False)
class Timing:
    """Frames of a clip over the keys of its animation.

    Attributes
    ----------
    start : seconds
    fps : as the clip says it
    rate : frames a second that bring the keys onto whole frames
    count : of frames
    steady : whether all keys lie on frames
    guess : what to tell people about the rate, "" where nothing was guessed
    """

    start: float
    fps: float
    rate: float
    count: int
    steady: bool
    guess: str = ""

    def frames(self, times: Array) -> Array:
        """Frame numbers of key times; those meant to lie on a frame do so exactly."""
        exact: Array = (times - self.start) * self.rate
        whole = np.round(exact)
        return np.where(
            np.abs(exact - whole) <= (2 * UNEVEN if self.steady else 1e-3), whole, exact
        )


def find_timing(where: str, keys: list[Array]) -> Timing:
    """Find the frame rate behind the key times (n,) of all curves, in seconds.

    Raises
    ------
    InputError
        if the keys are spread over more frames than can be meant.
    """
    times = _distinct(keys)
    start, span = float(times[0]), float(times[-1] - times[0])
    rounding = EXACT + FLOAT32 * float(np.abs(times).max())
    timing = _steady(times, rounding) or _on_grid(times, rounding)
    if timing is None:
        fps = _near(times)
        timing = Timing(
            start,
            fps,
            fps,
            int(np.floor(span * fps + 1e-3)) + 1,
            steady=False,
            guess=f"{len(times)} key times lie on no steady frame rate: resampled at {fps:g} "
            "frames a second",
        )
    if timing.count > MOST_FRAMES:
        raise InputError(
            f"{where}: its keys from {start:g} to {times[-1]:g} s would make more than "
            f"{MOST_FRAMES} frames. Check the key times."
        )
    return timing


def _distinct(keys: list[Array]) -> Array:
    times = np.unique(np.concatenate(keys))
    # Two keys at nearly one time make a jump, they are no frames; many such keys are ticks.
    near = np.diff(times) <= np.maximum(1e-4, 2 * FLOAT32 * np.abs(times[1:]))
    if (near[1:] & near[:-1]).any():
        return times
    return np.asarray(times[np.concatenate([[True], ~near])])


def _steady(times: Array, rounding: float) -> Timing | None:
    """One key a frame, at any rate."""
    if len(times) < 2:
        return None
    steps, span = len(times) - 1, float(times[-1] - times[0])
    rate = steps / span
    if not SLOWEST * 0.999 <= rate <= FASTEST or _residual(times, rate) > UNEVEN / rate:
        return None
    fps = min((*RATES, round(2 * rate) / 2), key=lambda common: abs(common - rate))
    off = abs(steps / fps - span)
    if off > max(DRIFT * span, MILLISECONDS):
        fps = rate
    guess = "" if off <= rounding else f"key times are rounded: read as {fps:g} frames a second"
    return Timing(float(times[0]), fps, rate, steps + 1, True, guess if fps != rate else "")


def _on_grid(times: Array, rounding: float) -> Timing | None:
    """Keys with gaps, all on the frames of a common rate."""
    if len(times) == 1:
        guess = f"one key tells no frame rate: {DEFAULT_FPS:g} frames a second are assumed"
        return Timing(float(times[0]), DEFAULT_FPS, DEFAULT_FPS, 1, True, guess)
    shortest, span = float(np.diff(times).min()), float(times[-1] - times[0])
    for tolerance in (rounding, MILLISECONDS):
        for fps in RATES:
            # A grid so fine that any time lies on it tells nothing.
            if tolerance > UNEVEN / fps or shortest < 0.9 / fps:
                continue
            if _residual(times, fps) <= tolerance:
                guess = (
                    f"keys are sparse: read at {fps:g} frames a second, on which all of them lie"
                )
                return Timing(
                    float(times[0]),
                    fps,
                    fps,
                    round(span * fps) + 1,
                    True,
                    "" if shortest < 1.5 / fps and tolerance == rounding else guess,
                )
    return None


def _near(times: Array) -> float:
    """Common rate about as fine as the keys are."""
    typical = 1.0 / float(np.median(np.diff(times)))
    return min((24.0, 30.0, 60.0, 120.0), key=lambda fps: abs(np.log(fps / max(typical, 30.0))))


def _residual(times: Array, rate: float) -> float:
    """Largest distance in seconds of times from the frames of a rate."""
    frames = (times - times[0]) * rate
    return float(np.abs(frames - np.round(frames)).max() / rate)
