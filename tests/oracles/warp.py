"""Slow, obvious search for the nearest segments under the warp, from methods.md section 2."""

from __future__ import annotations

import numpy as np


def warp(query, candidate):
    """Cost and path of the best warp: every way to get to every pair of frames, one at a time.

    ``cheapest[i, j, s]`` is the least cost of a warp that takes candidate frame j at query frame
    i, having advanced (s = 0) or stayed (s = 1) on the way there. It begins at the first frames
    as if it had stayed: the first step of type III c advances.
    """
    query, candidate = np.asarray(query, float), np.asarray(candidate, float)
    n, m = len(query), len(candidate)
    local = ((query[:, None, :] - candidate[None, :, :]) ** 2).sum(axis=2)
    cheapest = np.full((n, m, 2), np.inf)
    came_from = {}
    cheapest[0, 0, 1] = local[0, 0]
    for i in range(1, n):
        for j in range(m):
            ways = [(cheapest[i - 1, j, 0], 1, (i - 1, j, 0))]
            for step in (1, 2):
                if j >= step:
                    for state in (0, 1):
                        before = (i - 1, j - step, state)
                        ways.append((cheapest[before], 0, before))
            for cost, state, before in ways:
                if cost + local[i, j] < cheapest[i, j, state]:
                    cheapest[i, j, state] = cost + local[i, j]
                    came_from[i, j, state] = before
    at = (n - 1, m - 1, int(np.argmin(cheapest[-1, -1])))
    cost = cheapest[at] / n
    path = [at[1]]
    while at in came_from:
        at = came_from[at]
        path.append(at[1])
    return cost, path[::-1]


def search(library, ids, groups, queries, k, max_ratio=1.5, exclude=None):
    """All costs of all candidates of a legal length, sorted by (cost, id): a list a query."""
    answers = []
    for number, query in enumerate(queries):
        found = []
        for segment, name, group in zip(library, ids, groups, strict=True):
            n, m = len(query), len(segment)
            if not n / max_ratio <= m <= n * max_ratio:
                continue
            if exclude is not None and group in exclude[number]:
                continue
            cost = warp(query, segment)[0]
            if np.isfinite(cost):
                found.append((cost, int(name)))
        answers.append(sorted(found)[:k])
    return answers
