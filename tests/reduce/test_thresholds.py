"""Thresholds for a wanted number of channels or error: exact, and no better ones exist."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.reduce.fit import Statistics, controllers_at, fit_relations
from usdhand.reduce.search import _errors, thresholds_for_count, thresholds_for_error
from usdhand.reduce.settings import Fit, ReduceSettings, Thresholds

FITS: tuple[Fit, ...] = ("paper", "least-squares")
seeds = st.integers(0, 2**32 - 1)
fits = st.sampled_from(FITS)


def curves(seed: int, channels: int, frames: int = 40, ties: bool = False) -> Array:
    random = np.random.default_rng(seed)
    mixed = random.normal(size=(frames, 2)) @ random.normal(size=(2, channels))
    found = mixed + random.uniform(0.05, 1.0, channels) * random.normal(size=(frames, channels))
    found = found * random.uniform(0.3, 8.0, channels)
    if ties:
        found[:, 1] = -found[:, 0]
    return found


def result(statistics: Statistics, thresholds: Thresholds, fit: Fit) -> tuple[int, Array]:
    """Number of free channels and every channel's RMS error."""
    names = [f"c{i}" for i in range(len(statistics.std))]
    relations = fit_relations(names, statistics, thresholds, fit)
    return sum(r.kind == "free" for r in relations), np.array([r.rms_error for r in relations])


def all_results(statistics: Statistics, fit: Fit) -> list[tuple[int, Array]]:
    """What any thresholds can give, by trying one between all that matter."""
    distance = statistics.distance[np.triu_indices(len(statistics.std), k=1)]
    ranges = [0.0, *(statistics.range + 1e-6)]
    rmsds = [0.0, *(distance + 1e-5)]
    return [result(statistics, Thresholds(w, d), fit) for w in ranges for d in rmsds]


@given(seeds, st.integers(2, 6), fits, st.booleans())
@settings(max_examples=60, deadline=None)
def test_a_count_is_met_with_the_least_error(seed: int, n: int, fit: Fit, ties: bool) -> None:
    statistics = Statistics.of(curves(seed, n, ties=ties))
    possible = all_results(statistics, fit)
    for count in range(n + 1):
        free, errors = result(statistics, thresholds_for_count(statistics, count, fit), fit)
        most = max(f for f, _ in possible if f <= count)
        assert free == most
        least = min(float(np.sum(e**2)) for f, e in possible if f == most)
        assert float(np.sum(errors**2)) <= least * (1 + 1e-9) + 1e-12


@given(seeds, st.integers(2, 6), fits, st.floats(0.05, 6.0))
@settings(max_examples=60, deadline=None)
def test_an_error_is_met_with_the_fewest_channels(seed: int, n: int, fit: Fit, most: float) -> None:
    statistics = Statistics.of(curves(seed, n))
    free, errors = result(statistics, thresholds_for_error(statistics, most, fit), fit)
    assert errors.max() <= most * (1 + 1e-9)
    possible = all_results(statistics, fit)
    assume(all(abs(e.max() - most) > 1e-6 for _, e in possible))
    assert free == min(f for f, e in possible if e.max() <= most)


@pytest.mark.parametrize("fit", FITS)
def test_fifty_channels_meet_every_count(fit: Fit) -> None:
    statistics = Statistics.of(curves(7, 50, frames=300))
    for count in (0, 1, 5, 15, 27, 49, 50, 60):
        free, _ = result(statistics, thresholds_for_count(statistics, count, fit), fit)
        assert free == min(count, 50)


def test_more_channels_never_make_more_error() -> None:
    statistics = Statistics.of(curves(3, 20, frames=200))
    totals = [
        np.sum(result(statistics, thresholds_for_count(statistics, c), "paper")[1] ** 2)
        for c in range(21)
    ]
    assert np.diff(totals).max() <= 1e-9
    assert totals[-1] == 0.0


@pytest.mark.parametrize("fit", FITS)
def test_errors_without_curves_are_those_of_the_relations(fit: Fit) -> None:
    for seed in range(20):
        statistics = Statistics.of(curves(seed, 12))
        limits = Thresholds(4.0, 0.7)
        roots = controllers_at(statistics, limits.range, np.array([limits.rmsd]))
        errors = _errors(statistics, limits.range, roots, fit)[0]
        assert_allclose(errors, result(statistics, limits, fit)[1], atol=1e-9)


def test_duplicates_leave_fewer_where_the_count_cannot_be_had() -> None:
    """Of three equal curves none can be free alone with its twins: 1 or all constant."""
    one = curves(1, 1)
    statistics = Statistics.of(np.concatenate([one, one, -one], axis=1))
    free, errors = result(statistics, thresholds_for_count(statistics, 2), "paper")
    assert free == 1
    assert errors.max() < 1e-6


def test_still_curves_need_no_channel() -> None:
    statistics = Statistics.of(np.ones((10, 4)))
    assert result(statistics, thresholds_for_count(statistics, 3), "paper")[0] == 0
    assert result(statistics, thresholds_for_error(statistics, 0.1), "paper")[0] == 0


def test_what_cannot_be_asked_for() -> None:
    statistics = Statistics.of(curves(1, 3))
    with pytest.raises(UsageError, match="-1"):
        thresholds_for_count(statistics, -1)
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(UsageError, match="is not possible"):
            ReduceSettings(max_error=bad)
