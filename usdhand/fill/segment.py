"""Motion cut into segments where the wrist comes to rest: Joerg, Hodgins & Safonova 2012, 3.1."""

from __future__ import annotations

from bisect import bisect
from heapq import heapify, heappop, heappush
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
    to their shorter neighbour; longer ones than ``longest`` are cut where the wrist is slowest.
    A clip shorter than ``shortest`` is one segment.
    """
    last = len(speed) - 1
    shortest = max(1, round(settings.shortest * fps))
    longest = max(2 * shortest, int(settings.longest * fps))
    moving = speed > settings.speed
    crossings = np.flatnonzero(moving[1:] != moving[:-1]) + 1
    borders = _without_short(sorted({0, *(int(c) for c in crossings), last}), shortest)
    return [
        part
        for first, end in pairwise(borders)
        for part in pairwise(_cut(speed, first, end, shortest, longest))
    ]


def _without_short(borders: list[int], shortest: int) -> list[int]:
    """Borders of segments that were joined until none is short.

    The shortest segment is joined first, of equal ones the earliest, and to its shorter neighbour,
    of equal ones the earlier.
    """
    ends = dict(pairwise(borders))
    starts = {last: first for first, last in ends.items()}
    queue = [(last - first, first) for first, last in ends.items()]
    heapify(queue)
    while len(ends) > 1:
        length, first = heappop(queue)
        if length >= shortest:
            break
        last = first + length
        if ends.get(first) != last:
            continue  # joined to another one since
        before = first - starts[first] if first in starts else np.inf
        after = ends[last] - last if last in ends else np.inf
        border = first if before <= after else last
        left, right = starts.pop(border), ends.pop(border)
        starts[right], ends[left] = left, right
        heappush(queue, (right - left, left))
    return [*ends, borders[-1]]


def _cut(speed: Array, first: int, last: int, shortest: int, longest: int) -> list[int]:
    """Borders from ``first`` to ``last`` such that no segment between them is too long.

    A segment is cut at the slowest frame, the first of equal ones, that leaves no short part. The
    frames that may cut a part may also cut the whole, so that each is tried only once, the slowest
    first.
    """
    borders = [first, last]
    if last - first <= longest:
        return borders
    inside = speed[first + shortest : last - shortest + 1]
    for frame in (first + shortest + np.argsort(inside, kind="stable")).tolist():
        at = bisect(borders, frame)
        before, after = borders[at - 1], borders[at]
        if after - before > longest and min(frame - before, after - frame) >= shortest:
            borders.insert(at, frame)
    return borders
