"""Warps as curves: hand clip frames or seconds, one a body frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.splice.settings import Pin

# Seconds to either side of a pin over which a matched warp gives way. Matching knows the pins, so
# that little is missing: a path that jumps to a pin does so in one row.
SPREAD_S = 0.02
# The speed jumps where it changes by more than this share of the sum before and after.
JUMP = 0.25
# Weight of a value that a warp goes through exactly.
EXACT = 1e9


def whittaker_smoothed(
    values: Array, weights: Array, stiffness: float, start: Array | None = None
) -> Array:
    """Curve (n,) near values where they have weight, and bent as little as possible elsewhere.

    Minimises the sum of weights * (curve - values)^2 + stiffness * (second difference)^2 (Whittaker
    1923, "On a New Method of Graduation"). At an
    exact value where the speed of the warp jumps, the curve may bend freely: else what a pin
    demands on one of its sides would swing on the other.

    Parameters
    ----------
    start : the warp that the curve is added to, None if the curve is the warp
    """
    exact = weights[1:-1] >= EXACT  # of frames 1 to n - 2
    if not exact.any():
        return _smoothed_with(values, weights, np.full(len(exact), stiffness))
    curve = _smoothed_with(values, weights, np.where(exact, 0.0, stiffness))
    speed = np.diff(curve if start is None else start + curve)
    jumps = np.abs(np.diff(speed)) > JUMP * np.abs(speed[1:] + speed[:-1])
    return _smoothed_with(values, weights, np.where(exact & jumps, 0.0, stiffness))


def _smoothed_with(values: Array, weights: Array, bend: Array) -> Array:
    """Curve of which bending costs as much at each inner frame."""
    from scipy.linalg import solveh_banded

    bands = _normal_bands(weights, bend)
    return np.asarray(solveh_banded(bands, weights * values))


def deviations(weights: Array, stiffness: float) -> Array:
    """Standard deviations (n,) of a stiff curve whose values have these inverse variances."""
    from usdhand.dtw.banded import inverse_diagonal

    bands = _normal_bands(weights, np.full(len(weights) - 2, stiffness))
    first, second = np.roll(bands[1], -1), np.roll(bands[0], -2)
    return np.asarray(np.sqrt(np.maximum(inverse_diagonal(bands[2], first, second), 0.0)))


def _normal_bands(weights: Array, bend: Array) -> Array:
    """(3, n) normal equations of a stiff curve, as `scipy.linalg.solveh_banded` wants them."""
    bands = np.zeros((3, len(weights)))
    bands[0, 2:] = bend
    bands[1, 1:-1] -= 2.0 * bend
    bands[1, 2:] -= 2.0 * bend
    bands[2] = weights
    bands[2, :-2] += bend
    bands[2, 1:-1] += 4.0 * bend
    bands[2, 2:] += bend
    return bands


def monotone(warp: Array) -> Array:
    """Warp that never runs backward, by the mean of the bounds from either side."""
    return np.asarray((np.maximum.accumulate(warp) + np.minimum.accumulate(warp[::-1])[::-1]) / 2)


def through_pins(warp: Array, times: Array, pins: Sequence[Pin], spread: float = SPREAD_S) -> Array:
    """Warp moved so that it goes through every pin within its tolerance, and exactly where 0.

    What is missing at the pins is spread over some seconds to either side, or the time between
    two; nothing passes a pin before its time.
    """
    if not pins:
        return warp
    at = np.array([p.body for p in pins])
    wanted = np.array([p.hand for p in pins])
    slack = np.array([p.tolerance for p in pins])
    off = wanted - np.interp(at, times, warp)
    missing = np.sign(off) * np.maximum(np.abs(off) - slack, 0.0)
    alone = np.diff(at, prepend=-np.inf, append=np.inf) >= 2.0 * spread
    before = np.maximum(at[alone[:-1]] - spread, times[0] - 1e-9)
    after = np.minimum(at[alone[1:]] + spread, times[-1] + 1e-9)
    knots = np.concatenate([at, before, after])
    values = np.concatenate([missing, np.zeros(len(knots) - len(at))])
    order = np.argsort(knots, kind="stable")
    lowest = np.maximum.accumulate([-np.inf, *(wanted - slack)])
    highest = np.minimum.accumulate([np.inf, *(wanted + slack)[::-1]])[::-1]
    least = lowest[np.searchsorted(at, times, "right")]
    most = highest[np.searchsorted(at, times, "left")]
    moved = np.clip(warp + np.interp(times, knots[order], values[order]), least, most)
    return np.asarray(np.maximum.accumulate(moved))
