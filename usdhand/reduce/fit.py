"""Which channels barely move and which follow others: Joerg & O'Sullivan 2009, section 4.

Everything follows from means, ranges, standard deviations and correlations, so fitting does not
depend on the number of frames: with correlation r of two curves, the paper's distances of the
standardised curves are ``rmsd1 = sqrt(2 (1 - r))`` and ``rmsd2 = sqrt(2 (1 + r))``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments
from usdhand.reduce.rig import Relation
from usdhand.reduce.settings import Fit, Thresholds

# Two numbers that differ by less are the same: rounding errors must not decide who controls whom.
# Degrees for ranges and (relative) standard deviations; a distance of standardised curves is a
# square root and known less well near zero.
SAME_DEG = 1e-9
SAME_DISTANCE = 1e-7
# A curve whose range is below this is constant whatever the threshold: what float32 leaves of a
# joint that does not move cannot be standardised.
SMALLEST_RANGE_DEG = 1e-6
# A further controller must lower a channel's error by this share, else it only adds clutter.
WORTHWHILE_GAIN = 0.05


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
        return cls.from_moments(Moments.of(curves))

    @classmethod
    def from_moments(cls, moments: Moments) -> Statistics:
        """Statistics of curves whose moments are known."""
        std = moments.std
        scale = np.where(std > 0, std, 1.0)
        correlation = np.clip(moments.covariance / np.outer(scale, scale), -1.0, 1.0)
        return cls(moments.mean, std, moments.high - moments.low, correlation)

    @cached_property
    def distance(self) -> Array:
        """(n, n) the smaller of rmsd1 and rmsd2 of every pair."""
        return np.sqrt(2.0 * (1.0 - np.abs(self.correlation)))

    def moving(self, threshold: float) -> NDArray[np.bool_]:
        """(n,) which curves are not replaced by their mean at this range threshold, degrees."""
        return self.range > max(threshold - SAME_DEG, SMALLEST_RANGE_DEG)

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """(n,) channels by falling standard deviation, equal ones in channel order.

        A channel may control all those behind it.
        """
        falling = np.argsort(-self.std, kind="stable")
        std = self.std[falling]
        step = std[1:] < std[:-1] * (1.0 - SAME_DEG)
        level = np.concatenate([[0], np.cumsum(step)]) if len(std) else np.zeros(0)
        order: NDArray[np.intp] = falling[np.lexsort((falling, level))]
        return order

    def sign(self, a: int, b: int) -> float:
        """1 where rmsd1 of channels a and b is the smaller (or as small), -1 where rmsd2 is."""
        return -1.0 if self.correlation[a, b] < -SAME_DEG else 1.0


def controllers(statistics: Statistics, thresholds: Thresholds) -> NDArray[np.intp]:
    """Controlling channel of each, followed to the root of its chain; -1 for none, (n,).

    Of several controllers within the threshold the one with the largest standard deviation
    counts (section 5.2).
    """
    roots = controllers_at(statistics, thresholds.range, np.array([thresholds.rmsd]))
    return np.asarray(roots[0])


def controllers_at(statistics: Statistics, range_deg: float, rmsds: Array) -> NDArray[np.intp]:
    """Controllers at one range threshold and many ``rmsds`` (k,) at once; (k, n)."""
    moving = statistics.moving(range_deg)
    # In falling order of standard deviation the best controller is the first.
    order = statistics.order[moving[statistics.order]]
    n = len(order)
    distance = np.where(
        np.tri(n, k=-1, dtype=bool), statistics.distance[np.ix_(order, order)], np.inf
    )
    close = distance < rmsds[:, None, None] - SAME_DISTANCE
    root = np.where(close.any(axis=2), close.argmax(axis=2), -1) if n else np.zeros((len(rmsds), 0))
    rows = np.arange(len(rmsds))
    for a in range(n):  # a controller comes before what it controls
        above = np.where(root[:, a] >= 0, root[rows, root[:, a]], -1)
        root[:, a] = np.where(above >= 0, above, root[:, a])
    result = np.full((len(rmsds), len(moving)), -1, dtype=np.intp)
    result[:, order] = np.where(root >= 0, order[root], -1) if n else -1
    return result


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
            return Relation(name, "constant", offset=mean, rms_error=std, std=std)
        if root[a] < 0:
            return Relation(name, "free", std=std)
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
            std=std,
        )

    return tuple(relation(a) for a in range(len(names)))


def _slopes(statistics: Statistics, a: int, chosen: list[int], fit: Fit) -> tuple[Array, float]:
    """Slopes in degrees a degree, and the RMS error in degrees."""
    std, correlation = statistics.std, statistics.correlation
    if fit == "paper":
        b = chosen[0]
        # Standardised, the curves differ by the rmsd of that sign.
        sign = statistics.sign(a, b)
        error = std[a] * np.sqrt(max(0.0, 2.0 * (1.0 - sign * correlation[a, b])))
        return np.array([sign * std[a] / std[b]]), float(error)
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
