"""Which channels barely move and which follow others: Joerg & O'Sullivan 2009, section 4.

Everything follows from means, ranges, standard deviations and correlations, so fitting does not
depend on the number of frames: with correlation r of two curves, the paper's distances of the
standardised curves are ``rmsd1 = sqrt(2 (1 - r))`` and ``rmsd2 = sqrt(2 (1 + r))``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.reduce.rig import Relation

Fit = Literal["paper", "least-squares"]

# A curve whose range is below this is constant whatever the threshold: it cannot be standardised.
SMALLEST_RANGE_DEG = 1e-9


@dataclass(frozen=True)
class Thresholds:
    """What counts as barely moving (``range`` in degrees) and as following (``rmsd``)."""

    range: float
    rmsd: float


# The paper's four steps (section 5). Steps 2 and 4 work on the curves left by steps 1 and 3.
PRESETS: dict[int, Thresholds] = {
    1: Thresholds(1.0, 0.0),
    2: Thresholds(1.0, 0.3),
    3: Thresholds(5.0, 0.0),
    4: Thresholds(5.0, 0.5),
}


@dataclass(frozen=True, eq=False)
class Statistics:
    """What fitting needs to know of curves (frames, n): all (n,), ``correlation`` (n, n)."""

    mean: Array
    std: Array
    range: Array
    correlation: Array

    @classmethod
    def of(cls, curves: Array) -> Statistics:
        """Statistics over the population (``ddof=0``) of curves (frames, n) in degrees."""
        mean = curves.mean(axis=0)
        centred = curves - mean
        std = np.sqrt(np.mean(centred**2, axis=0))
        standard = centred / np.where(std > 0, std, 1.0)
        correlation = np.clip(standard.T @ standard / len(curves), -1.0, 1.0)
        return cls(mean, std, np.ptp(curves, axis=0), correlation)

    @property
    def distance(self) -> Array:
        """(n, n) the smaller of rmsd1 and rmsd2 of every pair."""
        return np.sqrt(2.0 * (1.0 - np.abs(self.correlation)))

    def moving(self, threshold: float) -> NDArray[np.bool_]:
        """(n,) which curves are not replaced by their mean at this range threshold."""
        return (self.range >= threshold) & (self.range > SMALLEST_RANGE_DEG)

    def larger(self) -> NDArray[np.bool_]:
        """(n, n) whether curve b (column) may control a (row).

        The one with the larger standard deviation controls; ties fall to the earlier channel.
        """
        n = len(self.std)
        earlier = np.arange(n)[None, :] < np.arange(n)[:, None]
        return (self.std[None, :] > self.std[:, None]) | (
            (self.std[None, :] == self.std[:, None]) & earlier
        )


def controllers(statistics: Statistics, thresholds: Thresholds) -> NDArray[np.intp]:
    """Controlling channel of each, followed to the root of its chain; -1 for none.

    Of several controllers within the threshold the one with the largest standard deviation
    counts (section 5.2).
    """
    moving = statistics.moving(thresholds.range)
    candidate = statistics.larger() & (statistics.distance < thresholds.rmsd)
    candidate &= moving[:, None] & moving[None, :]
    # Largest standard deviation first, earlier channels first among equals.
    order = np.lexsort((np.arange(len(moving)), -statistics.std))
    first = np.argmax(candidate[:, order], axis=1)
    direct = np.where(candidate.any(axis=1), order[first], -1)
    root = direct.copy()
    for a in order:  # a controller comes before what it controls
        if direct[a] >= 0 and root[direct[a]] >= 0:
            root[a] = root[direct[a]]
    return root


def fit_relations(
    names: Sequence[str],
    statistics: Statistics,
    thresholds: Thresholds,
    fit: Fit = "paper",
    most_controllers: int = 1,
) -> tuple[Relation, ...]:
    """Relations of all channels.

    Parameters
    ----------
    fit : "paper": the slope that keeps the standard deviation (section 4.2);
        "least-squares": the slope with the smallest RMS error
    most_controllers : with least squares, how many free channels a dependent one may follow
    """
    root = controllers(statistics, thresholds)
    moving = statistics.moving(thresholds.range)
    free = np.flatnonzero(moving & (root < 0))

    def relation(a: int) -> Relation:
        name, mean, std = names[a], float(statistics.mean[a]), float(statistics.std[a])
        if not moving[a]:
            return Relation(name, "constant", offset=mean, rms_error=std)
        if root[a] < 0:
            return Relation(name, "free")
        chosen = [int(root[a])]
        if most_controllers > 1:
            chosen = _chosen_controllers(statistics, a, chosen[0], free, most_controllers)
        slopes, error = _slopes(statistics, a, chosen, fit)
        return Relation(
            name,
            "linear",
            offset=mean - float(slopes @ statistics.mean[chosen]),
            controllers=tuple(names[b] for b in chosen),
            slopes=tuple(float(s) for s in slopes),
            rmsd=float(statistics.distance[a, root[a]]),
            rms_error=error,
        )

    return tuple(relation(a) for a in range(len(names)))


def _slopes(statistics: Statistics, a: int, chosen: list[int], fit: Fit) -> tuple[Array, float]:
    """Slopes in degrees a degree, and the RMS error in degrees."""
    std, correlation = statistics.std, statistics.correlation
    if fit == "paper":
        b = chosen[0]
        sign = 1.0 if correlation[a, b] >= 0 else -1.0
        return np.array([sign * std[a] / std[b]]), float(std[a] * statistics.distance[a, b])
    among = correlation[np.ix_(chosen, chosen)]
    beta = np.linalg.lstsq(among, correlation[chosen, a], rcond=None)[0]
    explained = float(beta @ correlation[chosen, a])
    return beta * std[a] / std[chosen], float(std[a] * np.sqrt(max(0.0, 1.0 - explained)))


def _chosen_controllers(
    statistics: Statistics, a: int, first: int, free: NDArray[np.intp], most: int
) -> list[int]:
    """Add, one at a time, the free channel that lowers the error most, while it helps."""
    chosen = [first]
    while len(chosen) < most:
        errors = {
            int(b): _slopes(statistics, a, [*chosen, int(b)], "least-squares")[1]
            for b in free
            if int(b) not in chosen
        }
        if not errors:
            break
        best = min(errors, key=lambda b: (errors[b], b))
        now = _slopes(statistics, a, chosen, "least-squares")[1]
        if errors[best] > now * (1.0 - WORTHWHILE_GAIN):
            break
        chosen.append(best)
    return chosen


# A further controller must lower a channel's error by this share, else it only adds clutter.
WORTHWHILE_GAIN = 0.05
