"""Thresholds for a result that was asked for: a number of free channels, or a largest error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from usdhand.errors import QualityError, UsageError
from usdhand.motion.rotations import Array
from usdhand.reduce.fit import Fit, Statistics, Thresholds, controllers


def thresholds_for_count(statistics: Statistics, count: int, fit: Fit = "paper") -> Thresholds:
    """Thresholds that leave ``count`` channels free with the smallest RMS error.

    Every range threshold that makes a difference is tried, each with the smallest ``rmsd`` that
    leaves no more than ``count``; where ties make ``count`` impossible, fewer stay free.

    Raises
    ------
    UsageError
        if ``count`` is negative.
    """
    if count < 0:
        raise UsageError(f"{count} free channels cannot be had: give 0 or more.")
    if count >= statistics.moving(0.0).sum():
        return Thresholds(0.0, 0.0)

    def preference(thresholds: Thresholds) -> tuple[int, float, float]:
        errors = channel_errors(statistics, thresholds, fit)
        return (-_count(statistics, thresholds), float(np.sum(errors**2)), thresholds.range)

    return min(_options(statistics, count), key=preference)


def thresholds_for_error(statistics: Statistics, most: float, fit: Fit = "paper") -> Thresholds:
    """Thresholds with the fewest free channels where no channel's RMS error exceeds ``most``.

    Raises
    ------
    QualityError
        if ``most`` is not a positive number of degrees.
    """
    if not most > 0:
        raise QualityError(f"An RMS error of at most {most:g} degrees cannot be met: give > 0.")
    total = int(statistics.moving(0.0).sum())
    for count in range(total):
        fitting = [
            t
            for t in _options(statistics, count)
            if channel_errors(statistics, t, fit).max(initial=0.0) <= most
        ]
        if fitting:
            return min(
                fitting,
                key=lambda t: (float(np.sum(channel_errors(statistics, t, fit) ** 2)), t.range),
            )
    return Thresholds(0.0, 0.0)


def channel_errors(statistics: Statistics, thresholds: Thresholds, fit: Fit) -> Array:
    """(n,) RMS error in degrees of every channel, without making a single curve."""
    root = controllers(statistics, thresholds)
    rows = np.arange(len(root))
    r = np.abs(statistics.correlation[rows, root])
    linear = np.sqrt(2.0 * (1.0 - r)) if fit == "paper" else np.sqrt(1.0 - r**2)
    errors = np.where(root >= 0, statistics.std * linear, 0.0)
    return np.where(statistics.moving(thresholds.range), errors, statistics.std)


def _options(statistics: Statistics, count: int) -> Iterator[Thresholds]:
    larger, distance = statistics.larger(), statistics.distance
    for limit in (0.0, *np.unique(statistics.range[statistics.range > 0])):
        limit = float(np.nextafter(limit, np.inf)) if limit else 0.0
        moving = statistics.moving(limit)
        if moving.sum() < count:
            break
        # A channel stops being free once the threshold passes its nearest possible controller.
        reachable = np.where(larger & moving[None, :], distance, np.inf)
        nearest = np.sort(reachable.min(axis=1, initial=np.inf)[moving])
        dependent = int(moving.sum()) - count
        if dependent == 0:
            yield Thresholds(limit, 0.0)
        elif np.isfinite(nearest[dependent - 1]):
            yield Thresholds(limit, float(np.nextafter(nearest[dependent - 1], np.inf)))


def _count(statistics: Statistics, thresholds: Thresholds) -> int:
    moving = statistics.moving(thresholds.range)
    return int((moving & (controllers(statistics, thresholds) < 0)).sum())
