"""Frames of a recording that repeat the one before: a hand was hidden from the cameras."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

# A wrist whose bend changes by less than this a frame, as a vector of length 1, is a copy.
SAME_BEND = 2e-6
# Copies are a dropout, not a rest, if there are as many and the wrist then jumps by more than so
# many times its usual change: a rest ends slowly.
LEAST_COPIES, JUMP_FACTOR = 3, 3.0
# So are all copies in a recording with noise of this share of its usual change, where they begin
# and end with as much: nothing that is measured repeats itself.
NOISY_SHARE = 0.2

Range = tuple[int, int]  # first and last frame


def frozen_ranges(bend: Array, wrist: Array) -> tuple[Range, ...]:
    """Frames that a recording invents, with the true ones at both ends of each range.

    Places in the world do not show it, since the trunk moves on; how the wrist bends does.

    Parameters
    ----------
    bend : (frames, 3) unit direction of the forearm in the axes of the palm
    wrist : (frames, 3) place of the wrist
    """
    change = np.abs(np.diff(bend, axis=0)).max(axis=1)
    still = change < SAME_BEND
    if still.all() or not still.any():
        return ()
    usual = float(np.median(change[~still]))
    way = np.linalg.norm(np.diff(wrist, axis=0), axis=1)
    jumps = (change > JUMP_FACTOR * usual) | (way > JUMP_FACTOR * np.median(way[~still]))
    moves = change > NOISY_SHARE * usual
    noisy = _noise_of_motion(bend, still) > NOISY_SHARE * usual
    borders = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    found = []
    for first, last in borders.reshape(-1, 2):  # frames first to last are the same
        inside = first > 0 and last < len(change) and last - first >= LEAST_COPIES
        if inside and (jumps[last] or (noisy and moves[first - 1] and moves[last])):
            found.append((int(first), int(last) + 1))
    return tuple(found)


def _noise_of_motion(curve: Array, still: NDArray[np.bool_]) -> float:
    """Standard deviation of the noise of a curve (frames, n) where it moves."""
    if len(curve) < 4:
        return 0.0
    moves = ~(still[:-2] | still[1:-1] | still[2:])
    third = np.abs(np.diff(curve, 3, axis=0))[moves]
    return float(np.median(third) / 0.6745 / np.sqrt(20.0)) if len(third) else 0.0


def bridged(values: Array, ranges: Sequence[Range]) -> Array:
    """Values (frames, ...) that go evenly from the first to the last frame of every range."""
    result = values.copy()
    for first, last in ranges:
        share = np.linspace(0.0, 1.0, last - first + 1).reshape(-1, *[1] * (values.ndim - 1))
        result[first : last + 1] = values[first] + share * (values[last] - values[first])
    return result


def bridged_rotations(values: Array, ranges: Sequence[Range]) -> Array:
    """Rotations (frames, 4), likewise."""
    result = values.copy()
    for first, last in ranges:
        share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
        result[first : last + 1] = rot.slerp(values[first], values[last], share[:, 0])
    return result


def bridged_smoothly(curves: Array, ranges: Sequence[Range]) -> Array:
    """Curves (frames, n) with cubics over the ranges in which they rest too, then jump.

    The cubics begin and end as fast as the frames beside a range move, where that is in the
    direction in which they have to go.
    """
    result = curves.copy()
    for first, last in ranges:
        if last - first < 2 or np.ptp(curves[first:last], axis=0).max() > 1e-3:
            continue
        step = curves[last] - curves[first]
        even = step / (last - first)
        before = curves[first] - curves[max(first - 1, 0)]
        after = curves[min(last + 1, len(curves) - 1)] - curves[last]
        # Slopes of up to three times the even one make a cubic that never goes back.
        before, after = (
            np.where(even >= 0, np.clip(v, 0, 3 * even), np.clip(v, 3 * even, 0))
            for v in (before, after)
        )
        t = np.linspace(0.0, 1.0, last - first + 1)[:, None]
        run = float(last - first)
        result[first : last + 1] = (
            curves[first]
            + step * (3 * t**2 - 2 * t**3)
            + run * before * (t - 2 * t**2 + t**3)
            + run * after * (t**3 - t**2)
        )
    return result
