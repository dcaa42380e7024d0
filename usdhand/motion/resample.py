"""Clips at another rate or over another span."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdhand.errors import UsageError
from usdhand.motion.clip import Clip
from usdhand.motion.rotations import Array, slerp


def interpolate(values: Array, frames: Array) -> Array:
    """Values (frames, ...) at fractional frame numbers, linearly, clamped to the ends."""
    low, t = _split(frames, len(values))
    high = np.minimum(low + 1, len(values) - 1)
    t = t.reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray(values[low] * (1.0 - t) + values[high] * t)


def interpolate_rotations(rotations: Array, frames: Array) -> Array:
    """Quaternions (frames, ..., 4) at fractional frame numbers, spherically, clamped."""
    low, t = _split(frames, len(rotations))
    high = np.minimum(low + 1, len(rotations) - 1)
    t = np.broadcast_to(
        t.reshape(-1, *([1] * (rotations.ndim - 2))), (len(frames), *rotations.shape[1:-1])
    )
    return slerp(rotations[low], rotations[high], t)


def resample(clip: Clip, fps: float) -> Clip:
    """Return the clip at another frame rate, over the same time span.

    Raises
    ------
    UsageError
        if ``fps`` is not a positive number.
    """
    if not np.isfinite(fps) or fps <= 0:
        raise UsageError(
            f"Cannot resample {clip.name} to {fps} frames a second: give a number > 0."
        )
    count = int(np.floor(clip.duration * fps + 1e-6)) + 1
    frames = np.arange(count) * (clip.fps / fps)
    origin = replace(clip.origin, time_codes_per_frame=clip.origin.time_codes_per_second / fps)
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
        origin=origin,
    )


def _split(frames: Array, count: int) -> tuple[np.ndarray, Array]:  # type: ignore[type-arg]
    frames = np.clip(np.asarray(frames, dtype=np.float64), 0.0, count - 1)
    low = np.floor(frames).astype(np.intp)
    return low, frames - low
