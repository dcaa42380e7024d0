"""Compiled: where two sequences of which either may begin earlier or end later fit. Import late."""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Doubles, Floats, Ints, kernel

NEVER = 1e300  # what does not happen costs as much


@kernel
def free_ended(
    a: Floats,
    b: Floats,
    a_waits: Doubles,
    b_waits: Doubles,
    a_alone: Doubles,
    b_alone: Doubles,
) -> tuple[Ints, Doubles]:
    """Cheapest paths from any frame of the first row or column to any of the last row or column.

    A path steps by one frame of both, by two of one and one of the other, or by one that rests.
    Each frame of either sequence counts: by half the squared difference of the cell that it is
    matched in, by what it costs as a rest, or alone, before a path begins or after it ends. Costs
    of three rows are kept.

    Parameters
    ----------
    a, b : (rows, n), (columns, n)
    a_waits, b_waits : (rows,), (columns,) what a frame costs as a rest, `NEVER` where it moves
    a_alone, b_alone : (rows,), (columns,) what a frame costs that has no partner

    Returns
    -------
    starts : (rows + columns, 2) row and column at which the paths begin that end in the last
        column, row by row, then those that end in the last row, column by column
    costs : (rows + columns,) of these paths and of what has no partner; infinite where none ends
    """
    rows, columns = len(a), len(b)
    costs = np.full((3, columns + 2), np.float64(NEVER))  # column j is at j + 2
    froms = np.zeros((3, columns + 2, 2), np.int64)
    local = np.zeros((2, columns))
    starts = np.zeros((rows + columns, 2), np.int64)
    found = np.zeros(rows + columns)
    a_before, b_before = np.zeros(rows + 1), np.zeros(columns + 1)
    for i in range(rows):
        a_before[i + 1] = a_before[i] + a_alone[i]
    for j in range(columns):
        b_before[j + 1] = b_before[j] + b_alone[j]
    for i in range(rows):
        now, one, two = i % 3, (i + 2) % 3, (i + 1) % 3
        here, above = local[i % 2], local[(i + 1) % 2]
        for j in range(columns):
            apart = 0.0
            for k in range(a.shape[1]):
                apart += (a[i, k] - b[j, k]) ** 2
            here[j] = apart
        for j in range(columns):
            best = np.float64(NEVER)
            if i == 0 or j == 0:
                best = a_before[i] + b_before[j] + here[j]
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
                way = costs[now, j + 1] + b_waits[j]
                if way < best:
                    best = way
                    froms[now, j + 2] = froms[now, j + 1]
            way = costs[one, j + 2] + a_waits[i]
            if way < best:
                best = way
                froms[now, j + 2] = froms[one, j + 2]
            costs[now, j + 2] = best
        found[i] = costs[now, columns + 1] + (a_before[rows] - a_before[i + 1])
        starts[i] = froms[now, columns + 1]
    last = (rows - 1) % 3
    for j in range(columns):
        found[rows + j] = costs[last, j + 2] + (b_before[columns] - b_before[j + 1])
        starts[rows + j] = froms[last, j + 2]
    return starts, found
