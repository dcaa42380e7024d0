"""Which channels may follow which: those of the same hand, or of both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.relate import ALIKE, FEWEST_FOLDS, RIDGES, Shape, residual_moments, told_by
from usdhand.reduce.subset import Measure, Subsets

# Numbers of free channels by which it is judged.
COUNTS = (6, 12, 24)


def related_channels(names: Sequence[str], folds: Sequence[Moments]) -> Array:
    """(n, n) 1 where a channel may follow another, else 0.

    What hands have in common seldom holds on other takes, and who moves one hand wants the other to
    stay. So channels follow those of their own hand, unless that is clearly worse on folds left
    out. In one take or two they may follow all.
    """
    sides = np.array([name[:2] for name in names])
    same = np.where(sides[:, None] == sides[None, :], 1.0, 0.0)
    both = np.ones_like(same)
    if len(folds) < FEWEST_FOLDS or same.all():
        return both
    apart, together = _errors(folds, same), _errors(folds, both)
    return same if np.mean(np.log(apart) - np.log(together)) <= np.log(ALIKE) else both


def _errors(folds: Sequence[Moments], related: Array) -> Array:
    """(counts,) squared errors of channels chosen, and relations fitted, without each fold."""
    shape = Shape(None, RIDGES[-1])
    total = np.full(len(COUNTS), np.finfo(float).tiny)
    for i, fold in enumerate(folds):
        others = pooled(f for j, f in enumerate(folds) if j != i)
        covariance = related * others.covariance
        search = Subsets(covariance, Measure("deg"), tuple((a,) for a in range(len(covariance))))
        chosen: frozenset[int] = frozenset()
        for k, count in enumerate(COUNTS):
            chosen = search.grown(chosen, min(count, len(covariance)))
            told = told_by(covariance, search.channels(chosen), shape)
            total[k] += fold.seconds * np.trace(residual_moments(told, others, fold))
    return total
