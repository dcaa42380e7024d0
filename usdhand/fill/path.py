"""The smoothest way through the candidates: Joerg, Hodgins & Safonova 2012, section 3.4.

A layered graph: a layer a segment of the input, a node a candidate. On such a graph, dynamic
programming finds the path of least cost that Dijkstra's algorithm finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array

# Alternatives differ in at least this share of their segments.
DISTINCT_SHARE = 0.25
PENALTY_STRENGTHS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, 1e4)


@dataclass(frozen=True)
class SegmentPath:
    """One candidate a layer, and what the choice costs."""

    nodes: tuple[int, ...]
    cost: float


def transition_cost(
    last: Array,
    last_velocity: Array,
    first: Array,
    first_velocity: Array,
    weights: tuple[float, float],
) -> Array:
    """Cost (a, b) of going from each of ``a`` candidates to each of ``b`` (equation 2).

    Parameters
    ----------
    last, first : (a, m) and (b, m) finger channels at the end and the beginning, degrees
    last_velocity, first_velocity : the same, degrees / s
    weights : of the angles and of the velocities
    """
    angles = last[:, None] - first[None]
    velocities = last_velocity[:, None] - first_velocity[None]
    squares = weights[0] * angles**2 + weights[1] * velocities**2
    return np.asarray(squares.mean(axis=2))


def best_path(nodes: Sequence[Array], edges: Sequence[Array]) -> SegmentPath:
    """The cheapest path; ties fall to the lower node, earlier layers first.

    Parameters
    ----------
    nodes : a layer each, (n_l,) cost of each node
    edges : between layers l and l + 1, (n_l, n_l+1) cost of each edge
    """
    if not nodes:
        return SegmentPath((), 0.0)
    to_go = _costs_to_go(nodes, edges)
    chosen = [int(np.argmin(to_go[0]))]
    for edge, rest in zip(edges, to_go[1:], strict=True):
        chosen.append(int(np.argmin(edge[chosen[-1]] + rest)))
    return SegmentPath(tuple(chosen), path_cost(chosen, nodes, edges))


def alternative_paths(
    nodes: Sequence[Array], edges: Sequence[Array], count: int
) -> list[SegmentPath]:
    """The best path and others that differ, cheapest first.

    The next cheapest paths of a long graph differ in a single node, which nobody would see. So a
    path must differ from every earlier one in a quarter of its layers: nodes that were taken are
    made dearer until it does. Costs returned are the true ones.
    """
    found = [best_path(nodes, edges)]
    if not nodes:
        return found
    typical = float(np.mean([n.mean() for n in nodes]))
    for _ in range(count - 1):
        penalty = [np.zeros(len(n)) for n in nodes]
        for path in found:
            for layer, node in enumerate(path.nodes):
                penalty[layer][node] += 1.0
        for strength in PENALTY_STRENGTHS:
            dearer = [n + strength * typical * p for n, p in zip(nodes, penalty, strict=True)]
            path = best_path(dearer, edges)
            if all(_difference(path, other) >= DISTINCT_SHARE for other in found):
                found.append(SegmentPath(path.nodes, path_cost(path.nodes, nodes, edges)))
                break
        else:
            break
    return sorted(found, key=lambda p: (p.cost, p.nodes))


def path_cost(choice: Sequence[int], nodes: Sequence[Array], edges: Sequence[Array]) -> float:
    """Cost of a path through the graph."""
    cost = sum(float(n[i]) for n, i in zip(nodes, choice, strict=True))
    steps = zip(edges, choice[:-1], choice[1:], strict=True)
    return cost + sum(float(e[i, j]) for e, i, j in steps)


def _difference(a: SegmentPath, b: SegmentPath) -> float:
    """Share of layers in which two paths differ."""
    return sum(i != j for i, j in zip(a.nodes, b.nodes, strict=True)) / max(len(a.nodes), 1)


def _costs_to_go(nodes: Sequence[Array], edges: Sequence[Array]) -> list[NDArray[np.float64]]:
    """Least cost from each node, its own included, to the end."""
    costs = [np.asarray(nodes[-1], dtype=np.float64)]
    for own, edge in zip(reversed(nodes[:-1]), reversed(edges), strict=True):
        costs.append(own + (edge + costs[-1][None]).min(axis=1))
    return costs[::-1]
