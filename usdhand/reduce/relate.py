"""How dependent channels follow the free ones: ridge regression on a few controllers each.

A model is a matrix ``told`` (n, n) that gives all channels, less their means, from themselves: the
rows of free channels are those of the identity, the others have coefficients at free channels only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.subset import SAME_SHARE, TINY, Measure

# Shares of each controller's variance that are tried as ridge, and numbers of controllers.
RIDGES = (1e-9, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
# Of controllers that moved less, as of one with this share of the mean variance of all channels:
# else slopes on what hardly moved would throw others far away where it moves.
LEAST_SHARE = 0.5
NUMBERS = (1, 2, 3, 4, 6, 9, 14)
# Fewer controllers are taken where they raise the error by no more than this share.
WORTHWHILE = 0.01
# Fewer folds tell too little of what holds on others: one left out leaves hardly any to fit.
FEWEST_FOLDS = 3
# Squared errors on takes left out that differ by less are alike.
ALIKE = 1.02**2


@dataclass(frozen=True)
class Shape:
    """How a model is fitted.

    Attributes
    ----------
    controllers : at most so many a channel; None for all
    ridge : share of each controller's variance
    spared : fewer controllers are taken where that raises a channel's error by at most this share
    """

    controllers: int | None = None
    ridge: float = RIDGES[0]
    spared: float = WORTHWHILE


def told_by(covariance: Array, free: Sequence[int], shape: Shape) -> Array:
    """(n, n) model of all channels, of a covariance (n, n), from the free ones."""
    n, k = len(covariance), len(free)
    told = np.zeros((n, n))
    told[free, free] = 1.0
    dependent = np.setdiff1d(np.arange(n), free)
    if not k or not len(dependent):
        return told
    most = k if shape.controllers is None else min(shape.controllers, k)
    order, left = controllers_in_order(covariance, np.asarray(free), dependent, most)
    enough = left <= left[:, -1:] * (1.0 + shape.spared) ** 2 + TINY
    counts = enough.argmax(axis=1)
    own = np.diag(covariance)
    shares = SAME_SHARE * own + shape.ridge * np.maximum(own, LEAST_SHARE * own.mean())
    ridge = covariance + np.diag(shares + TINY)
    for count in np.unique(counts[counts > 0]):
        rows = np.flatnonzero(counts == count)
        chosen = order[rows, :count]
        among = ridge[chosen[:, :, None], chosen[:, None, :]]
        across = covariance[chosen, dependent[rows, None]]
        slopes = np.linalg.solve(among, across[..., None])[..., 0]
        told[dependent[rows, None], chosen] = slopes
    return told


def residual_moments(told: Array, fitted: Moments, shown: Moments) -> Array:
    """(n, n) second moments of what a model with the means of ``fitted`` misses on ``shown``."""
    missed = np.eye(len(told)) - told
    return np.asarray(missed @ shown.about(fitted.mean) @ missed.T)


def left_out(
    folds: Sequence[Moments], free: Sequence[int], shape: Shape, related: Array | float = 1.0
) -> Array:
    """(n, n) second moments of what models fitted to the other folds miss on each fold.

    Parameters
    ----------
    related : (n, n) 1 where a channel may follow another, else 0
    """
    seconds = sum(fold.seconds for fold in folds)
    total = np.zeros((len(folds[0].mean),) * 2)
    for i, fold in enumerate(folds):
        others = pooled(f for j, f in enumerate(folds) if j != i)
        missed = residual_moments(told_by(related * others.covariance, free, shape), others, fold)
        total += fold.seconds / seconds * missed
    return total


def best_shape(
    folds: Sequence[Moments],
    free: Sequence[int],
    measure: Measure,
    most: int | None,
    related: Array | float = 1.0,
) -> Shape:
    """Ridge, and number of controllers up to ``most``, with the least error on folds left out.

    Of what is about as good, the largest ridge, since takes of one session are more alike than what
    a rig meets later, and the fewest controllers. With too few folds to tell: all controllers, and
    no ridge.
    """
    if len(folds) < FEWEST_FOLDS or not len(free):
        return Shape(most)

    def error(shape: Shape) -> float:
        return float(measure.parts(left_out(folds, free, shape, related)).mean())

    by_ridge = [error(Shape(most, r)) for r in RIDGES]
    ridge = max(r for r, e in zip(RIDGES, by_ridge, strict=True) if e <= min(by_ridge) * ALIKE)
    limit = len(free) if most is None else min(most, len(free))
    tried = [Shape(n, ridge) for n in NUMBERS if n < limit] + [Shape(most, ridge)]
    errors = [error(shape) for shape in tried]
    return next(
        shape
        for shape, e in zip(tried, errors, strict=True)
        if e <= min(errors) * (1.0 + WORTHWHILE) ** 2
    )


def controllers_in_order(
    covariance: Array, free: NDArray[np.intp], dependent: NDArray[np.intp], most: int
) -> tuple[NDArray[np.intp], Array]:
    """Controllers (dependent, most), each the best beside those before it, and variances left.

    Variances (dependent, most + 1) are left of 0, 1, ... controllers. All dependent channels at
    once: each has its own residual covariance of the free channels and itself.
    """
    d, k = len(dependent), len(free)
    rows = np.arange(d)
    index = np.concatenate([np.broadcast_to(free, (d, k)), dependent[:, None]], axis=1)
    residual = covariance[index[:, :, None], index[:, None, :]]
    own = np.diag(covariance)[free]
    order = np.zeros((d, most), dtype=np.intp)
    taken = np.zeros((d, k), dtype=bool)
    left = np.empty((d, most + 1))
    left[:, 0] = residual[:, k, k]
    for step in range(most):
        among = residual[:, np.arange(k), np.arange(k)]
        gain = residual[:, :k, k] ** 2 / (np.maximum(among, 0.0) + SAME_SHARE * own + TINY)
        gain[among <= 2 * SAME_SHARE * own] = -1.0  # told by those that are chosen
        gain[taken] = -2.0
        best = gain.argmax(axis=1)
        taken[rows, best] = True
        order[:, step] = free[best]
        column = residual[rows, :, best]
        pivot = column[rows, best] + SAME_SHARE * own[best] + TINY
        residual = residual - column[:, :, None] * (column / pivot[:, None])[:, None, :]
        left[:, step + 1] = np.maximum(residual[:, k, k], 0.0)
    return order, left
