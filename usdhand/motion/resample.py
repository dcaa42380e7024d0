"""Clips at another rate or over another span."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from usdhand.errors import UsageError
from usdhand.motion.clip import Clip
from usdhand.motion.rotations import Array, slerp
from usdhand.motion.timing import quotient, recounted_code

BLOCK = 256


def interpolate(values: Array, frames: Array) -> Array:
    """Values (frames, ...) at fractional frame numbers, linearly, clamped to the ends."""

    def between(low: Array, high: Array, t: Array) -> Array:
        return low * (1.0 - t[..., None]) + high * t[..., None]

    return _sampled(values, frames, between)


def interpolate_rotations(rotations: Array, frames: Array) -> Array:
    """Quaternions (frames, ..., 4) at fractional frame numbers, spherically, clamped."""
    return _sampled(rotations, frames, slerp)


def at_frames(clip: Clip, frames: Array) -> Clip:
    """Return the clip at fractional frame numbers (n,), its ends held.

    They need not be even, so that its own frame rate and times say nothing of them.
    """
    return replace(
        clip,
        rotations=interpolate_rotations(clip.rotations, frames),
        translations=interpolate(clip.translations, frames),
        scales=interpolate(clip.scales, frames),
    )


def resample(clip: Clip, fps: float) -> Clip:
    """Return the clip at another frame rate, over the same time span.

    Raises
    ------
    UsageError
        if ``fps`` is not a positive number.
    """
    if not np.isfinite(fps) or fps <= 0:
        raise UsageError(
            f"Cannot resample {clip.name} to {fps} frames a second: give a number above 0."
        )
    count = int(np.floor(clip.duration * fps + 1e-6)) + 1
    frames = np.asarray(np.arange(count) * (clip.fps / fps), float)
    step = quotient(clip.origin.time_codes_per_second, fps)
    scales = clip.scales
    constant = scales.strides[0] == 0
    return replace(
        clip,
        rotations=interpolate_rotations(clip.rotations, frames),
        translations=interpolate(clip.translations, frames),
        scales=np.broadcast_to(scales[0], (count, *scales.shape[1:]))
        if constant
        else interpolate(scales, frames),
        fps=float(fps),
        origin=replace(clip.origin, time_codes_per_frame=step),
    )


def resample_like(body: Clip, other: Clip) -> Clip:
    """Return a body at the frames of another clip, from its first frame on, its ends held."""
    seconds = np.arange(len(other)) / other.fps
    frames = np.clip(seconds * body.fps, 0, len(body) - 1)
    per_second, theirs = body.origin.time_codes_per_second, other.origin
    origin = replace(
        body.origin,
        first_time_code=recounted_code(
            theirs.first_time_code, theirs.time_codes_per_second, per_second
        ),
        time_codes_per_frame=quotient(per_second, other.fps),
    )
    return replace(at_frames(body, frames), fps=other.fps, origin=origin)


def _sampled(
    values: Array, frames: Array, between: Callable[[Array, Array, Array], Array]
) -> Array:
    """``between`` of the neighbours of each frame; block by block, to need little memory."""
    frames = np.clip(np.asarray(frames, dtype=np.float64), 0.0, len(values) - 1)
    low = np.floor(frames).astype(np.intp)
    high = np.minimum(low + 1, len(values) - 1)
    t = (frames - low).reshape(-1, *([1] * (values.ndim - 2)))
    result = np.empty((len(frames), *values.shape[1:]))
    for start in range(0, len(frames), BLOCK):
        rows = slice(start, start + BLOCK)
        result[rows] = between(values[low[rows]], values[high[rows]], t[rows])
    return result
