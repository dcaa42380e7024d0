"""The parts of fill agree with the paper as slow code."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from oracles import fill_2012 as oracle

from usdhand.fill.assemble import FingerPiece, join, within_limits
from usdhand.fill.path import alternative_paths, best_path, path_cost, transition_cost
from usdhand.fill.segment import segments
from usdhand.fill.settings import Segmentation
from usdhand.motion.rotations import Array

seeds = st.integers(0, 2**32 - 1)


def layered(seed: int, layers: int, most: int) -> tuple[list[Array], list[Array]]:
    """A random graph; whole numbers, so that ties happen."""
    random = np.random.default_rng(seed)
    sizes = random.integers(1, most + 1, layers)
    nodes = [random.integers(0, 9, n).astype(float) for n in sizes]
    edges = [random.integers(0, 9, (a, b)).astype(float) for a, b in itertools.pairwise(sizes)]
    return nodes, edges


@given(seeds, st.integers(1, 90), st.integers(1, 5), st.integers(0, 9), st.booleans())
@settings(max_examples=300)
def test_segments(seed: int, frames: int, shortest: int, more: int, steps: bool) -> None:
    random = np.random.default_rng(seed)
    speed = np.abs(np.cumsum(random.normal(size=frames)))
    if steps:
        speed = np.round(speed)  # equal speeds
    longest = 2 * shortest + more
    cutting = Segmentation(1.5, float(shortest), float(longest))
    found = segments(speed, 1.0, cutting)
    assert found == (oracle.segments(speed, 1.5, shortest, longest) if frames > 1 else [])
    if frames > 1:
        assert found[0][0] == 0
        assert found[-1][1] == frames - 1
        assert all(a[1] == b[0] for a, b in itertools.pairwise(found))
        assert all(b - a <= longest for a, b in found)
        assert len(found) == 1 or all(b - a >= shortest for a, b in found)


@given(seeds)
def test_transition_cost(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, u = random.normal(size=(2, 3, 25))
    b, v = random.normal(size=(2, 4, 25))
    fast = transition_cost(a, u, b, v, (1.0, 0.5))
    slow = [
        [oracle.transition_cost(a[i], u[i], b[j], v[j], (1.0, 0.5)) for j in range(4)]
        for i in range(3)
    ]
    assert_allclose(fast, slow, rtol=1e-12)


@given(seeds, st.integers(1, 6))
def test_best_path_is_the_first_of_all(seed: int, layers: int) -> None:
    nodes, edges = layered(seed, layers, 4)
    path = best_path(nodes, edges)
    assert (path.cost, path.nodes) == oracle.all_paths(nodes, edges)[0]


@given(seeds, st.integers(1, 30))
@settings(max_examples=30)
def test_best_path_is_dijkstras(seed: int, layers: int) -> None:
    networkx = pytest.importorskip("networkx", reason="no networkx: pip install 'usdhand[test]'")
    nodes, edges = layered(seed, layers, 6)
    graph = networkx.DiGraph()
    for i, n in enumerate(nodes[0]):
        graph.add_edge("start", (0, i), weight=n)
    for layer, edge in enumerate(edges):
        for i, j in np.ndindex(*edge.shape):
            graph.add_edge((layer, i), (layer + 1, j), weight=edge[i, j] + nodes[layer + 1][j])
    for i in range(len(nodes[-1])):
        graph.add_edge((layers - 1, i), "end", weight=0.0)
    assert best_path(nodes, edges).cost == networkx.dijkstra_path_length(graph, "start", "end")


@given(seeds, st.integers(1, 9), st.integers(1, 4))
def test_alternatives_are_distinct_and_cost_what_they_say(
    seed: int, layers: int, count: int
) -> None:
    nodes, edges = layered(seed, layers, 5)
    found = alternative_paths(nodes, edges, count)
    assert 1 <= len(found) <= count
    assert found[0] == best_path(nodes, edges)
    assert [p.cost for p in found] == sorted(p.cost for p in found)
    for i, path in enumerate(found):
        assert path.cost == path_cost(path.nodes, nodes, edges)
        for other in found[:i]:
            differ = sum(a != b for a, b in zip(path.nodes, other.nodes, strict=True))
            assert differ >= 0.25 * layers


def test_many_equal_paths_do_not_take_long() -> None:
    nodes, edges = [np.full(5, 0.1)] * 2000, [np.full((5, 5), 0.7)] * 1999
    assert best_path(nodes, edges).nodes == (0,) * 2000


@given(seeds, st.integers(1, 5), st.floats(1.0, 15.0))
def test_joining_by_the_papers_rule(seed: int, count: int, size: float) -> None:
    random = np.random.default_rng(seed)
    curves = [random.normal(size=(int(random.integers(2, 8)), 3)) * size for _ in range(count)]
    pieces, first = [], 0
    for own in curves:
        pieces.append(FingerPiece(first, first + len(own) - 1, own))
        first += len(own) - 1
    assert_allclose(join(pieces, "linear"), oracle.joined(curves), atol=1e-9)


@given(seeds, st.integers(2, 5))
def test_smooth_joining_meets_halfway(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    curves = np.cumsum(random.normal(size=(count, 40, 3)), axis=1)
    pieces = [FingerPiece(39 * i, 39 * (i + 1), own) for i, own in enumerate(curves)]
    result = join(pieces, "smooth")
    assert_allclose(result[[0, -1]], [curves[0, 0], curves[-1, -1]], atol=1e-9)
    for piece, before in zip(pieces[1:], curves[:-1], strict=True):
        assert_allclose(result[piece.first], (before[-1] + piece.curves[0]) / 2, atol=1e-9)
        ahead = result[piece.first + 1] - result[piece.first]
        behind = result[piece.first] - result[piece.first - 1]
        change = np.abs(before[-1] - piece.curves[0]).max()
        assert np.abs(ahead - behind).max() < 0.5 + 0.01 * change


@given(seeds, st.integers(1, 6))
def test_joining_knows_no_direction_of_time(seed: int, count: int) -> None:
    """What plays backwards is joined the same way, so that no hand comes late or early."""
    random = np.random.default_rng(seed)
    curves = [random.normal(size=(int(random.integers(2, 9)), 3)) for _ in range(count)]

    def joined(parts: list[Array]) -> Array:
        pieces, first = [], 0
        for own in parts:
            pieces.append(FingerPiece(first, first + len(own) - 1, own))
            first += len(own) - 1
        return join(pieces)

    assert_allclose(joined([c[::-1] for c in curves[::-1]]), joined(curves)[::-1], atol=1e-9)


@given(seeds, st.integers(2, 200), st.sampled_from([24.0, 30.0, 60.0]))
def test_limits_hold_without_corners(seed: int, frames: int, fps: float) -> None:
    random = np.random.default_rng(seed)
    time = np.arange(frames)[:, None] / fps
    curves = 40 * np.sin(random.uniform(1, 8, 4) * time + random.uniform(0, 6, 4))
    low, high = np.full(4, -30.0), np.full(4, 35.0)
    low[3], high[3] = -100.0, 100.0
    found = within_limits(curves, low, high, fps)
    assert (found >= low).all()
    assert (found <= high).all()
    assert np.array_equal(found[:, 3], curves[:, 3])
    beyond = ((curves < low) | (curves > high))[:, :3]
    reach = 2 * round(0.1 * fps) + 1
    far = [t for t in range(frames) if not beyond[max(0, t - reach) : t + reach + 1].any()]
    assert_allclose(found[far], curves[far], atol=1e-9)


def test_a_limit_bends_no_faster_than_hands_do() -> None:
    """Cut off, a curve has a corner as sharp as the frame rate; eased, it has none."""
    time = np.arange(240)[:, None] / 60.0
    curves = 40 * np.sin(4 * time)
    low, high = np.array([-100.0]), np.array([30.0])

    def sharpest(values: Array) -> float:
        return float(np.abs(np.diff(values, n=2, axis=0)).max() * 60**2)

    eased = within_limits(curves, low, high, 60.0)
    assert sharpest(np.clip(curves, low, high)) > 5000
    assert sharpest(eased) < 2000
    assert eased.max() > 25  # and is not held far below the limit


@given(seeds, st.integers(2, 6))
@settings(max_examples=40)
def test_segment_cost_is_the_best_of_all_warps(seed: int, frames: int) -> None:
    from usdhand.search import warp

    random = np.random.default_rng(seed)
    query = random.normal(size=(frames, 2))
    candidate = random.normal(size=(int(random.integers(frames // 2 + 1, 2 * frames)), 2))
    path, cost = warp(query, candidate)
    assert_allclose(cost, oracle.segment_cost(query, candidate), rtol=1e-12)
    assert tuple(path) in set(oracle.warps(len(query), len(candidate)))
