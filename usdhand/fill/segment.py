"""Motion cut into segments where the wrist comes to rest: Joerg, Hodgins & Safonova 2012, 3.2."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from usdhand.fill.settings import Segmentation
from usdhand.motion.rotations import Array


def wrist_speed(position: Array, fps: float, smoothing: float) -> Array:
    """Speed (frames,) in cm/s of a smoothed path (frames, 3)."""
    if len(position) < 2:
        return np.zeros(len(position))
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(position, smoothing * fps, axis=0, mode="nearest")
    return np.asarray(np.linalg.norm(np.gradient(smooth, axis=0), axis=1) * fps)


def segments(speed: Array, fps: float, settings: Segmentation) -> list[tuple[int, int]]:
    """Frames [first, last] of segments; each begins on the last frame of the one before.

    Borders lie where the speed crosses the threshold. Segments shorter than ``shortest`` are joined
    to their shorter neighbour; longer ones than ``longest`` are split where the wrist is slowest.
    A clip shorter than ``shortest`` is one segment.
    """
    last = len(speed) - 1
    shortest = max(1, round(settings.shortest * fps))
    longest = max(2 * shortest, int(settings.longest * fps))
    moving = speed > settings.speed
    crossings = np.flatnonzero(moving[1:] != moving[:-1]) + 1
    borders = _joined(sorted({0, *(int(c) for c in crossings), last}), shortest)
    return [
        part
        for first, end in pairwise(borders)
        for part in _split(speed, first, end, shortest, longest)
    ]


def _joined(borders: list[int], shortest: int) -> list[int]:
    while len(borders) > 2:
        lengths = np.diff(borders)
        i = int(np.argmin(lengths))
        if lengths[i] >= shortest:
            break
        before = lengths[i - 1] if i > 0 else np.inf
        after = lengths[i + 1] if i + 1 < len(lengths) else np.inf
        del borders[i if before <= after else i + 1]
    return borders


def _split(
    speed: Array, first: int, last: int, shortest: int, longest: int
) -> list[tuple[int, int]]:
    if last - first <= longest:
        return [(first, last)]
    inside = speed[first + shortest : last - shortest + 1]
    cut = first + shortest + int(np.argmin(inside))
    left = _split(speed, first, cut, shortest, longest)
    return left + _split(speed, cut, last, shortest, longest)
