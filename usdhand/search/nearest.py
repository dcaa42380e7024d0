"""The nearest segments of a library under the warp: exact, the same for any number of threads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdhand.errors import UsageError
from usdhand.search.index import CELL_EDGES, CODES, SearchIndex, in_chunks
from usdhand.search.query import PART_EDGES, STAGES, Query, prepare_query
from usdhand.search.refine import nearest, ranked
from usdhand.search.segments import PackedSegments

# Queries whose bounds are in memory at once: few for a large library, many for a small one, since
# each batch starts its threads anew.
_BATCH = 20
_BUFFER_BYTES = 64e6


@dataclass(frozen=True, eq=False)
class Matches:
    """The nearest candidates of each query, nearest first, ties by id.

    Attributes
    ----------
    ids : (queries, k) int64, -1 where fewer exist
    costs : (queries, k) float64, mean squared feature distance under the warp, infinite where
        fewer exist
    """

    ids: NDArray[np.int64]
    costs: NDArray[np.float64]


def search(
    index: SearchIndex,
    queries: PackedSegments,
    k: int = 5,
    max_ratio: float = 1.5,
    exclude: ArrayLike | None = None,
    threads: int | None = None,
    prune: bool = True,
) -> Matches:
    """Find the k segments of a library that warp to each query at the least cost.

    Parameters
    ----------
    index : the library, or a shard of it: see `merge`
    queries : segments with the library's features
    k : how many
    max_ratio : candidates are at most this many times longer or shorter than the query
    exclude : (any,) groups not allowed, or (queries, any) for each query, filled up with -1
    threads : default all cores; the result does not depend on it
    prune : False to try every candidate without lower bounds; the result does not depend on it

    Raises
    ------
    UsageError
        if the arguments do not fit each other.

    Notes
    -----
    Candidates are tried in the order of a lower bound of their cost: the distance of the query's
    mean over a part of its time to the box of all that the candidate can be warped to there.
    Costs in float32 only rule out what exceeds the k-th best by more than rounding can explain;
    what is left is ranked in float64.

    Examples
    --------
    >>> from usdhand.search import pack, prepare
    >>> library = prepare(pack([[[0.0], [1.0], [2.0]], [[5.0], [5.0], [5.0]]], ids=[10, 11]))
    >>> search(library, pack([[[0.0], [2.0], [2.0]]]), k=1).ids.tolist()
    [[10]]
    """
    excluded = _checked(index, queries, k, max_ratio, exclude)
    asked = np.flatnonzero(~_repeats(queries, excluded))
    ids = np.full((len(asked), k), -1, np.int64)
    costs = np.full((len(asked), k), np.inf)
    answers = np.searchsorted(asked, np.arange(len(queries)), side="right") - 1
    if not len(index) or not len(queries):
        return Matches(ids[answers], costs[answers])
    prepared = [prepare_query(index, queries[number], max_ratio) for number in asked.tolist()]
    most = max(query.last - query.first for query in prepared)
    rows = 1 + len(STAGES) if prune else 1
    size = min(len(prepared), max(_BATCH, int(_BUFFER_BYTES / (4 * rows * max(most, 1)))))
    buffer = np.empty((size, rows, most), np.float32)
    for start in range(0, len(prepared), size):
        batch = prepared[start : start + size]
        forbidden = excluded[asked[start : start + len(batch)]]
        if prune:
            _fill_bounds(index, batch, threads, buffer)
        else:
            _fill_costs(index, batch, forbidden, k, threads, buffer[:, 0])

        def answer(first: int, last: int, start: int = start) -> None:
            for number in range(start + first, start + last):
                query, own = prepared[number], buffer[number - start]
                if prune:
                    found, cost = nearest(index, query, own, excluded[asked[number]], k)
                else:
                    tried = np.flatnonzero(own[0, : query.last - query.first] < np.inf)
                    found, cost = ranked(index, query, tried, own[0, tried], k, query.error)
                ids[number, : len(found)] = found
                costs[number, : len(cost)] = cost

        in_chunks(answer, len(batch), threads)
    return Matches(ids[answers], costs[answers])


def merge(first: Matches, second: Matches, k: int) -> Matches:
    """The k nearest of two shards' results: a search of the shards as of the whole library."""
    ids = np.concatenate([first.ids, second.ids], axis=1)
    costs = np.concatenate([first.costs, second.costs], axis=1)
    order = np.lexsort((ids, costs), axis=1)[:, :k]
    return Matches(np.take_along_axis(ids, order, 1), np.take_along_axis(costs, order, 1))


def _checked(
    index: SearchIndex,
    queries: PackedSegments,
    k: int,
    max_ratio: float,
    exclude: ArrayLike | None,
) -> NDArray[np.int32]:
    """The groups not allowed for each query, after a look at all arguments."""
    if k < 1:
        raise UsageError(f"k is {k}: ask for one segment or more")
    if not max_ratio >= 1:
        raise UsageError(f"a length ratio of {max_ratio} is below 1")
    if len(index) and len(queries) and queries.features.shape[1] != index.features.shape[1]:
        raise UsageError(
            f"queries have {queries.features.shape[1]} features, the library "
            f"{index.features.shape[1]}"
        )
    if exclude is None:
        return np.empty((len(queries), 0), np.int32)
    excluded = np.asarray(exclude, np.int32)
    if excluded.ndim == 1:
        return np.broadcast_to(excluded, (len(queries), len(excluded)))
    if excluded.ndim != 2 or len(excluded) != len(queries):
        raise UsageError(f"exclude has shape {excluded.shape}, not (any,) or ({len(queries)}, any)")
    return excluded


def _repeats(queries: PackedSegments, excluded: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Queries that ask what the one before them asked, as segments of a long hold do.

    To a library that holds the same pose each of them is a search of its own among equal costs.
    """
    repeats = [
        np.array_equal(queries[number], queries[number - 1])
        and np.array_equal(excluded[number], excluded[number - 1])
        for number in range(1, len(queries))
    ]
    return np.array([False, *repeats][: len(queries)], dtype=bool)


def _fill_bounds(
    index: SearchIndex, batch: list[Query], threads: int | None, bounds: NDArray[np.float32]
) -> None:
    """Lower bounds of accumulated costs, and of what is left of them from each stage on.

    ``bounds`` (queries, 1 + stages, candidates of a query) is the output.
    """
    from usdhand.search.boxes import box_bounds

    below = np.stack([query.below for query in batch])
    above = np.stack([query.above for query in batch])
    parts = np.stack([query.parts for query in batch])
    ranges = np.array([(query.first, query.last) for query in batch])
    cuts = np.full(len(PART_EDGES) - 1, -1)
    cuts[[0, *STAGES]] = range(1 + len(STAGES))
    most = int(np.sqrt(65535 / below.shape[-1]))

    def fill(start: int, stop: int) -> None:
        box_bounds(
            index.low,
            index.high,
            CELL_EDGES,
            index.lengths,
            below,
            above,
            parts,
            ranges,
            cuts,
            index.box_unit[0] ** 2,
            most,
            start,
            stop,
            bounds,
        )

    in_chunks(fill, len(index), threads)


def _fill_costs(
    index: SearchIndex,
    batch: list[Query],
    excluded: NDArray[np.int32],
    k: int,
    threads: int | None,
    costs: NDArray[np.float32],
) -> None:
    """Accumulated costs (queries, candidates of a query), infinite for the hopeless."""
    from usdhand.search.scan import scan
    from usdhand.search.tiles import UNREACHED

    step = index.code_step.astype(np.float32)
    middle = CODES / 2 * index.code_step
    excluded = np.sort(excluded, axis=1)
    frames = np.concatenate([query.frames - middle for query in batch])
    squares = np.sum(frames**2, axis=1).astype(np.float32)
    frames = frames.astype(np.float32)
    parts = np.cumsum([0] + [len(query) for query in batch])
    ranges = np.array([(query.first, query.last) for query in batch])
    slacks = np.array([query.slack for query in batch])
    margins = np.array([query.margin for query in batch])
    errors = np.array([query.error for query in batch])
    costs[:] = np.inf
    worst = np.full(len(batch), UNREACHED)

    def fill(start: int, stop: int) -> None:
        scan(
            frames,
            squares,
            parts,
            ranges,
            slacks,
            margins,
            errors,
            excluded,
            k,
            index.codes,
            step,
            index.begins,
            index.lengths,
            index.groups,
            start,
            stop,
            worst,
            costs,
        )

    in_chunks(fill, len(index), threads, chunks=4)
