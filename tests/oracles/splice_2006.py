"""Majkowska, Zordan & Faloutsos 2006 as printed: Algorithm 1 and the cost of equation (6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

Cell = tuple[int, int]


def algorithm_1(
    distance: Callable[[int, int], float],
    n: int,
    m: int,
    width: float,
    points: Sequence[tuple[int, int, int]] = (),
) -> tuple[float, list[Cell]]:
    """Cost and path of the constrained warp; frames and columns count from 0.

    ``points`` are matching points (x, y, T). W is the width of the whole band, as the paper says in
    words, so that half of it lies on either side (the formula of A is garbled in our copy).
    Of equal predecessors: diagonal, row before, column before.
    """
    gamma = {(-1, -1): 0.0}
    came: dict[Cell, Cell] = {}
    knots = [(0, 0, 0), *points, (n - 1, m - 1, 0)]
    rows = {0: (0, min(math.floor(width / 2 + 1e-9), knots[1][1] + knots[1][2], m - 1))}
    for (x0, y0, t0), (x1, y1, t1) in pairwise(knots):
        for i in range(x0 + 1, x1 + 1):
            x, y = x1 - x0, y1 - y0
            a = width * math.sqrt(x * x + y * y) / (2 * x)
            centre = y / x * (i - x0)
            lower = max(0, y0 - t0, math.ceil(y0 + centre - a - 1e-9))
            upper = min(m - 1, y1 + t1, math.floor(y0 + centre + a + 1e-9))
            rows[i] = (lower, upper)
    for i in range(n):
        for j in range(rows[i][0], rows[i][1] + 1):
            before = [(i - 1, j - 1), (i - 1, j), (i, j - 1)]
            best = min(before, key=lambda cell: gamma.get(cell, math.inf))
            if gamma.get(best, math.inf) < math.inf:
                gamma[i, j] = distance(i, j) + gamma[best]
                came[i, j] = best
    path = [(n - 1, m - 1)]
    while path[-1] != (0, 0):
        path.append(came[path[-1]])
    return gamma[n - 1, m - 1], path[::-1]


def sign(value: float, dead_zone: float) -> int:
    return (value > dead_zone) - (value < -dead_zone)


def distance_of_signs(p: Sequence[int], q: Sequence[int]) -> int:
    """Equation (6) for signs that were taken."""
    return sum((a - b) ** 2 for a, b in zip(p, q, strict=True))


def best_turn(p: Sequence[Sequence[float]], q: Sequence[Sequence[float]]) -> float:
    """Equation (7): radians by which points q (x, z) turn about the vertical onto points p."""
    n = len(p)
    px, pz = sum(a[0] for a in p), sum(a[1] for a in p)
    qx, qz = sum(b[0] for b in q), sum(b[1] for b in q)
    up = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(p, q, strict=True))
    along = sum(a[0] * b[0] + a[1] * b[1] for a, b in zip(p, q, strict=True))
    return math.atan2(up - (px * qz - qx * pz) / n, along - (px * qx + pz * qz) / n)
