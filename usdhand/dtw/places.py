"""Compiled: where two sequences of which either may begin earlier or end later fit. Import late."""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Doubles, Floats, Ints, kernel


@kernel
def free_ended(a: Floats, b: Floats, unlike: float) -> tuple[Ints, Doubles]:
    """Cheapest paths from any frame of the first row or column to any of the last row or column.

    A path steps by one frame of both, or by two of one and one of the other. Each frame of either
    sequence counts: by half the squared difference of the cell that it is matched in, or by
    ``unlike`` where it has no partner. Costs of three rows are kept.

    Parameters
    ----------
    a, b : (rows, n), (columns, n)

    Returns
    -------
    starts : (rows + columns, 2) row and column at which the paths begin that end in the last
        column, row by row, then those that end in the last row, column by column
    costs : (rows + columns,) of these paths and of what has no partner; infinite where none ends
    """
    rows, columns = len(a), len(b)
    costs = np.full((3, columns + 2), np.float64(1e300))  # column j is at j + 2
    froms = np.zeros((3, columns + 2, 2), np.int64)
    local = np.zeros((2, columns))
    starts = np.zeros((rows + columns, 2), np.int64)
    found = np.zeros(rows + columns)
    for i in range(rows):
        now, one, two = i % 3, (i + 2) % 3, (i + 1) % 3
        here, above = local[i % 2], local[(i + 1) % 2]
        for j in range(columns):
            apart = 0.0
            for k in range(a.shape[1]):
                apart += (a[i, k] - b[j, k]) ** 2
            here[j] = apart
        for j in range(columns):
            best = np.float64(1e300)
            if i == 0 or j == 0:
                best = unlike * (i + j) + here[j]
                froms[now, j + 2, 0], froms[now, j + 2, 1] = i, j
            way = costs[one, j + 1] + here[j]
            if way < best:
                best = way
                froms[now, j + 2] = froms[one, j + 1]
            way = costs[two, j + 1] + 0.75 * (above[j] + here[j])
            if way < best:
                best = way
                froms[now, j + 2] = froms[two, j + 1]
            if j > 0:
                way = costs[one, j] + 0.75 * (here[j - 1] + here[j])
                if way < best:
                    best = way
                    froms[now, j + 2] = froms[one, j]
            costs[now, j + 2] = best
        found[i] = costs[now, columns + 1] + unlike * (rows - 1 - i)
        starts[i] = froms[now, columns + 1]
    last = (rows - 1) % 3
    for j in range(columns):
        found[rows + j] = costs[last, j + 2] + unlike * (columns - 1 - j)
        starts[rows + j] = froms[last, j + 2]
    return starts, found
