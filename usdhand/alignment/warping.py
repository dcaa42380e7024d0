"""The warp of one segment to the length of another: type III c of Rabiner and Juang."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdhand.errors import InputError, UsageError


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
    from usdhand.alignment.tiles import warp_moves

    rows, columns = _matrix(query), _matrix(candidate)
    if rows.shape[1] != columns.shape[1]:
        raise UsageError(f"{rows.shape[1]} features cannot be compared with {columns.shape[1]}")
    if not can_warp(len(rows), len(columns)):
        raise UsageError(f"{len(columns)} frames cannot be warped to {len(rows)}")
    moves = np.zeros((len(rows), len(columns)), np.int8)
    cost = warp_moves(rows, columns, moves) / len(rows)
    return _way_back(moves), cost


def _matrix(features: ArrayLike) -> NDArray[np.float64]:
    matrix = np.ascontiguousarray(features, dtype=np.float64)
    if matrix.ndim != 2:
        raise UsageError(f"features have shape {matrix.shape}, not (frames, features)")
    if not np.isfinite(matrix).all():
        raise InputError("features are not all finite numbers")
    return matrix


def _way_back(moves: NDArray[np.int8]) -> NDArray[np.intp]:
    path = np.empty(len(moves), np.intp)
    path[-1] = frame = moves.shape[1] - 1
    stayed = False
    for i in range(len(moves) - 1, 0, -1):
        # before a stay there was a step
        stayed = bool(moves[i, frame] & 4) and not stayed
        if not stayed:
            frame -= int(moves[i, frame] & 3)
        path[i - 1] = frame
    return path
