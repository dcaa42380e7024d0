"""The warp of one segment to the length of another: type III c of Rabiner and Juang."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdhand.errors import InputError, UsageError
from usdhand.search.segments import PackedSegments


def can_warp(query_frames: int, candidate_frames: int) -> bool:
    """True if a candidate of that many frames can be warped to the query at all.

    Always so within a factor of 1.5; never beyond twice, or much under half, the query's length.
    """
    n, m = query_frames, candidate_frames
    return n > 0 and n // 2 <= m - 1 <= 2 * (n - 1)


def warp(query: ArrayLike, candidate: ArrayLike) -> tuple[NDArray[np.intp], float]:
    """Warp a candidate to a query at the least cost.

    Every query frame takes one candidate frame, the ends meet, and the candidate frame advances
    by 1 or 2 a query frame, or by 0 after it has advanced: never at the first step, never twice
    in a row. Of paths of equal cost, one that advances is preferred to one that stays, and a step
    of 1 to a step of 2.

    Parameters
    ----------
    query : (n, D) weighted features, any unit
    candidate : (m, D) likewise

    Returns
    -------
    path : (n,) candidate frame of each query frame
    cost : mean over the query's frames of the squared distance of the features, float64

    Raises
    ------
    InputError
        if a feature is not finite.
    UsageError
        if the shapes do not agree or the lengths are too different, see `can_warp`.

    Notes
    -----
    Step pattern ``typeIIIc`` of the R and Python packages dtw, with the query as reference of the
    slope: Rabiner and Juang, Fundamentals of Speech Recognition (1993), table 4.5.

    Examples
    --------
    >>> path, cost = warp([[0], [1], [1], [3]], [[0], [1], [2], [3]])
    >>> path.tolist(), cost
    ([0, 1, 1, 3], 0.0)
    """
    from usdhand.search.tiles import warp_path

    rows, columns = _matrix(query), _matrix(candidate)
    if rows.shape[1] != columns.shape[1]:
        raise UsageError(f"{rows.shape[1]} features cannot be compared with {columns.shape[1]}")
    _check_lengths(len(rows), len(columns))
    path = np.empty(len(rows), np.int64)
    cost = warp_path(rows, columns, path) / len(rows)
    return path, cost


def warp_many(
    queries: PackedSegments, candidates: PackedSegments, pairs: ArrayLike
) -> list[NDArray[np.intp]]:
    """Paths of `warp` for many pairs at once.

    Parameters
    ----------
    pairs : (pairs, 2) number of the query and of the candidate among the segments packed

    Raises
    ------
    UsageError
        if the lengths of a pair are too different, see `can_warp`.
    """
    from usdhand.search.tiles import warp_paths

    numbers = np.asarray(pairs, dtype=np.intp).reshape(-1, 2)
    spans = [
        np.stack([packed.offsets[own], packed.offsets[own + 1]], axis=1).astype(np.int64)
        for packed, own in zip((queries, candidates), numbers.T, strict=True)
    ]
    lengths = [np.diff(span, axis=1)[:, 0] for span in spans]
    for n, m in set(zip(lengths[0].tolist(), lengths[1].tolist(), strict=True)):
        _check_lengths(n, m)
    ends = np.cumsum(lengths[0])
    paths = np.empty(int(ends[-1]) if len(ends) else 0, np.int64)
    warp_paths(queries.features, spans[0], candidates.features, spans[1], paths, ends - lengths[0])
    return np.split(paths, ends[:-1]) if len(ends) else []


def _check_lengths(query_frames: int, candidate_frames: int) -> None:
    if not can_warp(query_frames, candidate_frames):
        raise UsageError(f"{candidate_frames} frames cannot be warped to {query_frames}")


def _matrix(features: ArrayLike) -> NDArray[np.float64]:
    matrix = np.ascontiguousarray(features, dtype=np.float64)
    if matrix.ndim != 2:
        raise UsageError(f"features have shape {matrix.shape}, not (frames, features)")
    if not np.isfinite(matrix).all():
        raise InputError("features are not all finite numbers")
    return matrix
