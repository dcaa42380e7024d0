"""One query against its candidates, in rounds of rising lower bound."""

from __future__ import annotations

from mmap import mmap

import numpy as np
from numpy.typing import NDArray

from usdhand.search.index import SearchIndex
from usdhand.search.query import STAGES, Query

_SEEDS = 32  # candidates of the lowest bounds, that set the first limit
_ROUND = 256  # candidates of the first round; each is twice as large as the one before


def nearest(
    index: SearchIndex,
    query: Query,
    bounds: NDArray[np.float32],
    excluded: NDArray[np.int32],
    k: int,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The k nearest candidates of a query by (cost, id), fewer where there are fewer.

    Parameters
    ----------
    bounds : (1 + stages, candidates of the query or more) lower bounds of the whole accumulated
        cost, then of what is left of it from each stage on; used up
    excluded : groups not allowed

    Returns
    -------
    ids, costs
    """
    from usdhand.search.boxes import lowest
    from usdhand.search.tiles import UNREACHED, warp_some

    here = slice(query.first, query.last)
    begins, lengths = index.begins[here], index.lengths[here]
    bounds = bounds[:, : len(begins)]
    bounds[0, np.isin(index.groups[here], excluded[excluded >= 0])] = UNREACHED
    step = index.code_step.astype(np.float32)

    def warped(positions: NDArray[np.int64], frames: int) -> NDArray[np.float32]:
        return warp_some(query.frames, index.codes, step, begins, lengths, positions, frames)

    tried = np.sort(lowest(bounds[0], max(_SEEDS, 2 * k)))
    costs = warped(tried, len(query))
    worst = kth_smallest(costs, k)
    bounds[0, tried] = UNREACHED
    rest = np.flatnonzero((bounds[0] <= query.limit(worst)) & (bounds[0] < UNREACHED))
    rest = rest[np.argsort(bounds[0, rest], kind="stable")]
    size = _ROUND
    while len(rest) and bounds[0, rest[0]] <= query.limit(worst):
        # in order of length, so that the lanes of a tile are of about the same length
        positions = np.sort(rest[:size])
        rest = rest[size:]
        size *= 2
        for stage, tails in zip(query.parts[list(STAGES)], bounds[1:], strict=True):
            positions = positions[bounds[0, positions] <= query.limit(worst)]
            bounds[0, positions] = warped(positions, stage) + tails[positions]
        positions = positions[bounds[0, positions] <= query.limit(worst)]
        tried = np.concatenate([tried, positions])
        costs = np.concatenate([costs, warped(positions, len(query))])
        worst = kth_smallest(costs, k)
    return ranked(index, query, tried, costs, k)


def kth_smallest(costs: NDArray[np.float32], k: int) -> float:
    """The k-th smallest cost; infinite where there are fewer."""
    return float(np.partition(costs, k - 1)[k - 1]) if len(costs) >= k else np.inf


def ranked(
    index: SearchIndex,
    query: Query,
    tried: NDArray[np.int64],
    approximate: NDArray[np.float32],
    k: int,
    error: float = 0.0,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The best k of the candidates that were tried, by costs in float64.

    Parameters
    ----------
    tried : counted from the first candidate of the query
    approximate : their accumulated costs of coded features
    error : what these can be off by besides what codes lose

    Returns
    -------
    ids, costs
    """
    from usdhand.search.tiles import warp_moves

    near = approximate <= query.limit(kth_smallest(approximate, k), error)
    positions = query.first + tried[near]
    costs = np.empty(len(positions))
    for number, position in enumerate(positions):
        candidate = _frames(index.features, index.begins[position], index.lengths[position])
        moves = np.empty((len(query), len(candidate)), np.int8)
        costs[number] = warp_moves(query.exact, candidate, moves)
    costs /= len(query)
    ids = index.ids[positions]
    order = np.lexsort((ids, costs))[:k]
    return ids[order], costs[order]


def _frames(features: NDArray[np.float32], begin: int, count: int) -> NDArray[np.float32]:
    """Some rows of features, from the file where they are mapped.

    Touching a map takes in megabytes around each row, which would soon be the whole library.
    """
    if isinstance(features, np.memmap) and isinstance(features.base, mmap):
        row = features.dtype.itemsize * features.shape[1]
        return np.fromfile(
            str(features.filename),
            features.dtype,
            count * features.shape[1],
            offset=features.offset + int(begin) * row,
        ).reshape(count, -1)
    return features[begin : begin + count]
