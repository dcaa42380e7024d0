"""Warps as curves: hand clip frames or seconds, one a body frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.splice.band import Pin

# Weight of a value that a warp goes through exactly.
EXACT = 1e9


def stiff(values: Array, weights: Array, stiffness: float) -> Array:
    """Curve (n,) near values where they have weight, and bent as little as possible elsewhere.

    Minimises the sum of weights * (curve - values)^2 + stiffness * (second difference)^2.
    """
    from scipy.linalg import solveh_banded

    n = len(values)
    middle, beside = np.full(n, 6.0), np.full(n, -4.0)
    middle[[0, -1]], middle[[1, -2]] = 1.0, 5.0
    beside[[1, -1]] = -2.0
    if n == 3:  # both neighbours of the only inner frame are ends
        middle[1] = 4.0
    bands = stiffness * np.stack([np.ones(n), beside, middle])
    bands[2] += weights
    return np.asarray(solveh_banded(bands, weights * values))


def monotone(warp: Array) -> Array:
    """Warp that never runs backward, by the mean of the bounds from either side."""
    return np.asarray((np.maximum.accumulate(warp) + np.minimum.accumulate(warp[::-1])[::-1]) / 2)


def through_pins(warp: Array, times: Array, pins: Sequence[Pin]) -> Array:
    """Warp moved so that it goes through every pin within its tolerance, and exactly where 0.

    What is missing at the pins is spread linearly over the time between them; nothing passes a pin
    before its time.
    """
    if not pins:
        return warp
    at = np.array([p.body for p in pins])
    wanted = np.array([p.hand for p in pins])
    slack = np.array([p.tolerance for p in pins])
    off = wanted - np.interp(at, times, warp)
    missing = np.sign(off) * np.maximum(np.abs(off) - slack, 0.0)
    ends = (times[0] - 1e-9, times[-1] + 1e-9)
    knots, values = np.array([ends[0], *at, ends[1]]), np.array([0.0, *missing, 0.0])
    lowest = np.maximum.accumulate([-np.inf, *(wanted - slack)])
    highest = np.minimum.accumulate([np.inf, *(wanted + slack)[::-1]])[::-1]
    least = lowest[np.searchsorted(at, times, "right")]
    most = highest[np.searchsorted(at, times, "left")]
    moved = np.clip(warp + np.interp(times, knots, values), least, most)
    return np.asarray(np.maximum.accumulate(moved))
