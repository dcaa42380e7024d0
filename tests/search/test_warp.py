"""The warp of one segment to another, against the oracle and dtw-python."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import warp as oracle

from usdhand.errors import InputError, UsageError
from usdhand.search import can_warp, warp


def pair(seed: int, n: int, m: int, width: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, width)), rng.normal(size=(m, width))


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 10**6), st.integers(1, 14), st.integers(1, 28))
def test_cost_and_path_are_the_oracles(seed: int, n: int, m: int) -> None:
    query, candidate = pair(seed, n, m)
    cost, path = oracle.warp(query, candidate)
    assert np.isfinite(cost) == can_warp(n, m)
    if can_warp(n, m):
        found, found_cost = warp(query, candidate)
        assert found_cost == pytest.approx(cost, rel=1e-12)
        assert found.tolist() == path


@pytest.mark.parametrize(
    ("n", "m"), [(1, 1), (2, 2), (2, 3), (20, 30), (30, 20), (61, 47), (120, 120)]
)
def test_cost_is_that_of_dtw_python(n: int, m: int) -> None:
    dtw = pytest.importorskip("dtw", reason="no dtw-python: pip install 'usdhand[dev]'")
    query, candidate = pair(n * m, n, m, 12)
    local = ((query[:, None] - candidate[None]) ** 2).sum(axis=2)
    theirs = dtw.dtw(local, step_pattern=dtw.typeIIIc)
    path, cost = warp(query, candidate)
    assert cost == pytest.approx(theirs.distance / n, rel=1e-5)
    assert path[theirs.index1].tolist() == theirs.index2.tolist()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(2, 60), st.floats(1 / 1.5, 1.5))
def test_path_keeps_the_rules_and_costs_what_it_says(seed: int, n: int, ratio: float) -> None:
    m = min(max(round(n * ratio), int(np.ceil(n / 1.5))), int(1.5 * n))
    query, candidate = pair(seed, n, m)
    path, cost = warp(query, candidate)
    steps = np.diff(path)
    assert path[0] == 0
    assert path[-1] == m - 1
    assert steps[0] > 0
    assert set(steps) <= {0, 1, 2}
    assert not np.any((steps[1:] == 0) & (steps[:-1] == 0))
    assert cost == pytest.approx(((query - candidate[path]) ** 2).sum() / n)


def test_any_length_within_a_factor_of_one_and_a_half_can_be_warped() -> None:
    assert all(
        can_warp(n, m)
        for n in range(1, 200)
        for m in range(1, 400)
        if n <= 1.5 * m and m <= 1.5 * n
    )


def test_a_slower_copy_costs_nothing() -> None:
    candidate = np.arange(30.0)[:, None]
    query = candidate[np.minimum(np.arange(44) * 2 // 3 + 1, 29) - (np.arange(44) == 0)]
    path, cost = warp(query, candidate)
    assert cost == 0
    assert np.array_equal(candidate[path], query)


def test_what_cannot_be_warped_is_refused() -> None:
    with pytest.raises(UsageError, match="frames"):
        warp(np.zeros((10, 2)), np.zeros((30, 2)))
    with pytest.raises(UsageError, match="features"):
        warp(np.zeros((10, 2)), np.zeros((10, 3)))
    with pytest.raises(UsageError, match="shape"):
        warp(np.zeros(10), np.zeros(10))
    with pytest.raises(InputError, match="finite"):
        warp(np.full((3, 1), np.nan), np.zeros((3, 1)))
