"""Which channels to leave free where each dependent channel may follow only a few of them.

A set that tells all channels best together need not hold the best few for each. So single channels
are exchanged while the error of relations of so many controllers falls.
"""

from __future__ import annotations

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.reduce.relate import Shape, controllers_in_order, told_by
from usdhand.reduce.subset import CLEARLY, SAME_SHARE, TINY, Subsets

# Of the channels that are foreseen to be best in place of another, so many are tried.
TRIED = 2


def grown_for_few(
    search: Subsets, chosen: frozenset[int], count: int, controllers: int
) -> frozenset[int]:
    """Groups of a search and others, ``count`` in all, that serve few controllers."""
    while len(chosen) < count:
        foreseen = _foreseen(search, chosen, controllers)
        foreseen[list(chosen)] = np.inf
        chosen = chosen | {int(foreseen.argmin())}
    return exchanged_for_few(search, chosen, controllers)


def exchanged_for_few(search: Subsets, chosen: frozenset[int], controllers: int) -> frozenset[int]:
    """Swap single groups while that lowers the error of relations of few controllers."""
    score = _score(search, chosen, controllers)
    left = sorted(chosen - search.keep)
    while left:
        group = left.pop(0)
        rest = chosen - {group}
        foreseen = _foreseen(search, rest, controllers)
        foreseen[[*rest, group]] = np.inf
        for other in np.argsort(foreseen, kind="stable")[:TRIED].tolist():
            if not np.isfinite(foreseen[other]):
                break
            found = _score(search, rest | {other}, controllers)
            if found < score + CLEARLY:
                chosen, score = rest | {other}, found
                left += sorted(chosen - search.keep - {other} - set(left))
                break
    return chosen


def _score(search: Subsets, chosen: frozenset[int], controllers: int) -> float:
    told = told_by(search.covariance, search.channels(chosen), Shape(controllers))
    missed = np.eye(len(told)) - told
    residual = missed @ search.covariance @ missed.T
    return float(search.scores(search.measure.parts(residual), chosen))


def _foreseen(search: Subsets, chosen: frozenset[int], controllers: int) -> Array:
    """(groups,) about the logarithm of the error with each group more, and its price.

    Each channel keeps its controllers, the last of which gives way to the group where that is
    better. Channels' errors are added up with the weights that they have alone.
    """
    covariance, measure = search.covariance, search.measure
    free = np.array(search.channels(chosen), dtype=np.intp)
    dependent = np.setdiff1d(np.arange(len(covariance)), free)
    order, left = controllers_in_order(covariance, free, dependent, min(controllers, len(free)))
    stay = order[:, : controllers - 1]
    among = covariance[stay[:, :, None], stay[:, None, :]] + TINY * np.eye(stay.shape[1])
    among = among + SAME_SHARE * np.eye(stay.shape[1]) * among
    across = covariance[stay]  # (dependent, controllers, n)
    told = np.swapaxes(np.linalg.solve(among, across), 1, 2)
    own = np.diag(covariance)
    mine = np.take_along_axis(across, dependent[:, None, None], axis=2)
    beside = covariance[dependent] - (told @ mine)[..., 0]
    alone = own - np.einsum("anc,acn->an", told, across)
    gains = beside**2 / (np.maximum(alone, 0.0) + SAME_SHARE * own + TINY)
    gains[alone <= 2 * SAME_SHARE * own] = 0.0
    errors = np.minimum(left[:, stay.shape[1], None] - gains, left[:, -1:])
    weights = np.ones(len(own)) if measure.forms is None else np.einsum("gii->i", measure.forms)
    found = np.empty(len(search.groups))
    for number, group in enumerate(search.groups):
        others = ~np.isin(dependent, group)
        least = errors[others][:, group].min(axis=1)
        found[number] = weights[dependent[others]] @ np.maximum(least, 0.0)
    return np.asarray(np.log(found + TINY) + search.log_price)
