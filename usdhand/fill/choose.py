"""Which candidates may be chosen, what they cost, and the choices along the cheapest paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from usdhand.anatomy import SIDES
from usdhand.anatomy.channels import model_channels
from usdhand.fill.candidates import Candidate
from usdhand.fill.path import SegmentPath, alternative_paths, transition_cost
from usdhand.fill.settings import FillSettings
from usdhand.motion.rotations import Array

COMPARED_FRAMES = 8  # of a segment are enough to tell how alike candidates' fingers are


@dataclass(frozen=True, eq=False)
class Layer:
    """Candidates of a segment that may be on the path: their order in the pool, and costs."""

    order: tuple[int, ...]
    costs: Array


@dataclass(frozen=True, eq=False)
class Graph:
    """The paper's graph: a layer a body segment, edges (n_l, n_l+1) between layers, unscaled."""

    layers: tuple[Layer, ...]
    edges: tuple[Array, ...]


def graph(
    found: Sequence[Sequence[Candidate]],
    curves: Sequence[Array],
    names: Sequence[str],
    fps: float,
    settings: FillSettings,
) -> Graph:
    """Costs of all candidates and of all transitions between them.

    Parameters
    ----------
    found : the candidates of each body segment, nearest first
    curves : a segment each, (candidates, frames, channels) fingers in degrees at ``fps``
    names : of the channels
    """
    layers = tuple(_layer(*both, settings) for both in zip(found, curves, strict=True))
    modelled = _modelled(names)
    open_ends = [
        own[list(layer.order)][:, :, modelled] for own, layer in zip(curves, layers, strict=True)
    ]
    weights = (settings.angle_weight, settings.velocity_weight)
    edges = tuple(
        transition_cost(
            a[:, -1], fps * (a[:, -1] - a[:, -2]), b[:, 0], fps * (b[:, 1] - b[:, 0]), weights
        )
        for a, b in pairwise(open_ends)
    )
    usual = float(np.mean([edge.mean() for edge in edges])) if edges else 0.0
    repeated = (
        _same_segment(before, after, a, b)
        for (before, after), (a, b) in zip(pairwise(found), pairwise(layers), strict=True)
    )
    loops = settings.repeat_weight * usual
    return Graph(layers, tuple(e + loops * r for e, r in zip(edges, repeated, strict=True)))


def _same_segment(
    before: Sequence[Candidate], after: Sequence[Candidate], a: Layer, b: Layer
) -> Array:
    """One where two candidates are the same piece of the library: played twice, it would loop."""
    first = np.array([before[i].segment for i in a.order])
    second = np.array([after[i].segment for i in b.order])
    same: Array = (first[:, None] == second[None]).astype(np.float64)
    return same


def choose(graph: Graph, settings: FillSettings) -> list[SegmentPath]:
    """The cheapest path and its alternatives, cheapest first."""
    nodes = [layer.costs for layer in graph.layers]
    node, edge = settings.segment_weight, settings.transition_weight
    if settings.scaled:
        node /= float(np.mean(np.concatenate(nodes))) or 1.0
        if graph.edges:
            edge /= float(np.mean(np.concatenate([e.ravel() for e in graph.edges]))) or 1.0
    return alternative_paths(
        [n * node for n in nodes], [e * edge for e in graph.edges], settings.alternatives
    )


def _layer(candidates: Sequence[Candidate], curves: Array, settings: FillSettings) -> Layer:
    """The ``k`` candidates that may be chosen.

    Without a pool, they are the nearest and cost what the paper says. With one, a candidate costs
    the mean squared difference of its fingers from those of all neighbours, weighted by how near
    they are: what a candidate is expected to be wrong by, if the truth is like one of them.
    """
    costs = np.array([c.cost for c in candidates])
    if settings.pool and len(candidates) > 1:
        scale = settings.sharpness * float(np.median(costs[: settings.k])) or 1.0
        weights = np.exp(-(costs - costs[0]) / scale)
        sampled = curves[:, :: max(1, curves.shape[1] // COMPARED_FRAMES)]
        costs = _mean_squares(sampled.reshape(len(candidates), -1)) @ (weights / weights.sum())
    order = np.argsort(costs, kind="stable")[: settings.k]
    return Layer(tuple(int(i) for i in order), costs[order])


def _mean_squares(rows: Array) -> Array:
    """Mean squared difference (n, n) of all pairs of rows."""
    rows = rows - rows.mean(axis=0)  # small numbers, so that nothing cancels
    squares = (rows**2).sum(axis=1)
    both = squares[:, None] + squares - 2.0 * rows @ rows.T
    return np.asarray(np.maximum(both, 0.0) / rows.shape[1])


def _modelled(names: Sequence[str]) -> list[int]:
    """Columns of the paper's 25 channels a hand."""
    joints = tuple(dict.fromkeys(n[2:-1] for n in names))
    wanted = {c for side in SIDES for c in model_channels(side, joints)}
    return [i for i, n in enumerate(names) if n in wanted]
