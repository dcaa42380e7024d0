"""Thresholds for a result that was asked for: a number of free channels, or a largest error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.reduce.fit import SAME_DEG, SAME_DISTANCE, Statistics, controllers_at
from usdhand.reduce.settings import Fit, Thresholds


def thresholds_for_count(statistics: Statistics, count: int, fit: Fit = "paper") -> Thresholds:
    """Thresholds that leave ``count`` channels free with the smallest RMS error.

    Every pair of thresholds that makes a difference is tried; where ties make ``count``
    impossible, as many stay free as can be without exceeding it.

    Raises
    ------
    UsageError
        if ``count`` is negative.
    """
    if count < 0:
        raise UsageError(f"{count} free channels are not possible: give 0 or more.")
    if count >= statistics.moving(0.0).sum():
        return Thresholds(0.0, 0.0)
    best: tuple[tuple[int, float, float], Thresholds] | None = None
    for limit, rmsds, roots in _threshold_choices(statistics):
        free = _free(statistics, limit, roots)
        allowed = np.flatnonzero((free <= count) & (free >= (-best[0][0] if best else 0)))
        if len(allowed) == 0:
            continue
        squared = np.sum(_errors(statistics, limit, roots[allowed], fit) ** 2, axis=1)
        i = np.lexsort((rmsds[allowed], squared, -free[allowed]))[0]
        key = (-int(free[allowed[i]]), float(squared[i]), limit)
        if best is None or key < best[0]:
            best = key, Thresholds(limit, float(rmsds[allowed[i]]))
    assert best is not None  # the largest range threshold leaves nothing free
    return best[1]


def thresholds_for_error(statistics: Statistics, most: float, fit: Fit = "paper") -> Thresholds:
    """Thresholds with the fewest free channels where no channel's RMS error exceeds ``most``.

    Of several with equally few the one with the smallest RMS error over all channels.
    """
    best: tuple[tuple[int, float, float], Thresholds] | None = None
    for limit, rmsds, roots in _threshold_choices(statistics):
        if statistics.std[~statistics.moving(limit)].max(initial=0.0) > most:
            break  # a larger limit holds still more channels
        errors = _errors(statistics, limit, roots, fit)
        allowed = np.flatnonzero(errors.max(axis=1, initial=0.0) <= most)
        free = _free(statistics, limit, roots)[allowed]
        squared = np.sum(errors[allowed] ** 2, axis=1)
        i = np.lexsort((rmsds[allowed], squared, free))[0]  # no relation at all is always allowed
        key = (int(free[i]), float(squared[i]), limit)
        if best is None or key < best[0]:
            best = key, Thresholds(limit, float(rmsds[allowed[i]]))
    return best[1] if best else Thresholds(0.0, 0.0)


def errors_by_count(statistics: Statistics, fit: Fit = "paper") -> Array:
    """(n + 1,) smallest RMS error in degrees over all channels with 0 to n of them free.

    nan where no thresholds leave exactly as many.
    """
    n = len(statistics.mean)
    squared = np.full(n + 1, np.inf)
    for limit, _, roots in _threshold_choices(statistics):
        errors = np.sum(_errors(statistics, limit, roots, fit) ** 2, axis=1)
        np.minimum.at(squared, _free(statistics, limit, roots), errors)
    return np.sqrt(np.where(np.isfinite(squared), squared, np.nan) / max(n, 1))


def _threshold_choices(statistics: Statistics) -> Iterator[tuple[float, Array, NDArray[np.intp]]]:
    """All that thresholds can do: a range threshold, all rmsds (k,), controllers (k, n) at each."""
    for limit in (0.0, *(_distinct(statistics.range, SAME_DEG) + 2 * SAME_DEG)):
        moving = statistics.moving(limit)
        pairs = np.triu(moving[:, None] & moving[None, :], k=1)
        rmsds = _distinct(statistics.distance[pairs], SAME_DISTANCE) + 2 * SAME_DISTANCE
        rmsds = np.concatenate([[0.0], rmsds])
        yield float(limit), rmsds, controllers_at(statistics, float(limit), rmsds)


def _distinct(values: Array, same: float) -> Array:
    """Values in rising order, one of every run that differs by no more than rounding errors."""
    values = np.sort(values)
    last = np.append(np.diff(values) > same, True)[: len(values)]
    return np.asarray(values[last])


def _errors(statistics: Statistics, limit: float, roots: NDArray[np.intp], fit: Fit) -> Array:
    """(k, n) RMS errors in degrees of all channels under controllers (k, n)."""
    r = np.abs(statistics.correlation[np.arange(roots.shape[1]), roots])
    linear = np.sqrt(2.0 * (1.0 - r)) if fit == "paper" else np.sqrt(1.0 - r**2)
    errors = np.where(roots >= 0, statistics.std * linear, 0.0)
    return np.where(statistics.moving(limit), errors, statistics.std)


def _free(statistics: Statistics, limit: float, roots: NDArray[np.intp]) -> NDArray[np.intp]:
    """(k,) number of free channels under controllers (k, n)."""
    return np.asarray(np.sum(statistics.moving(limit) & (roots < 0), axis=1))
