"""The best few channels: as good as trying every set, whatever the measure."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.motion.rotations import Array
from usdhand.reduce import subset
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.subset import Measure, Subsets

seeds = st.integers(0, 2**32 - 1)


def curves(seed: int, channels: int = 12, frames: int = 200) -> Array:
    random = np.random.default_rng(seed)
    rank = random.integers(2, channels + 1)
    mixed = random.normal(size=(frames, rank)) @ random.normal(size=(rank, channels))
    own = random.normal(size=(frames, channels)) * random.uniform(0.05, 1.0)
    return mixed * random.uniform(0.3, 8.0, channels) + own


def singles(covariance: Array, measure: Measure | None = None) -> Subsets:
    groups = tuple((i,) for i in range(len(covariance)))
    return Subsets(covariance, measure or Measure("deg"), groups)


def missed(values: Array, free: tuple[int, ...]) -> Array:
    """What is left of centred curves when all are regressed on some: the slow way."""
    centred = values - values.mean(axis=0)
    told = np.linalg.lstsq(centred[:, list(free)], centred, rcond=None)[0]
    return centred - centred[:, list(free)] @ told


def tips(seed: int, channels: int) -> Measure:
    """Three tips, each moved by a third of the channels."""
    random = np.random.default_rng(seed)
    forms = np.zeros((3, channels, channels))
    for tip, own in enumerate(np.array_split(np.arange(channels), 3)):
        jacobian = random.normal(size=(3, len(own)))
        forms[tip][np.ix_(own, own)] = jacobian.T @ jacobian
    return Measure("mm", forms)


@pytest.mark.parametrize("exhaustive", [True, False], ids=["all tried", "searched"])
@pytest.mark.parametrize("name", ["deg", "mm"])
def test_brute_force_finds_nothing_better(
    monkeypatch: pytest.MonkeyPatch, exhaustive: bool, name: str
) -> None:
    """On random problems of 12 channels; the search alone, which larger ones need, as well."""
    if not exhaustive:
        monkeypatch.setattr(subset, "MOST_TRIED", 0)
    for seed in range(12):
        covariance = Moments.of(curves(seed)).covariance
        measure = tips(seed, 12) if name == "mm" else Measure("deg")
        search = singles(covariance, measure)
        for count in (1, 3, 5, 8):
            every = (frozenset(c) for c in combinations(range(12), count))
            least = min(measure.parts(search.residual(c)).sum() for c in every)
            found = measure.parts(search.residual(search.best(count))).sum()
            assert np.sqrt(found / least) < (1.0 + 1e-6 if exhaustive else 1.02)


@given(seeds, st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_residuals_are_those_of_least_squares(seed: int, count: int) -> None:
    values = curves(seed)
    free = tuple(range(0, 12, 12 // count))[:count]
    search = singles(Moments.of(values).covariance)
    rest = missed(values, free)
    scale = np.abs(search.covariance).max()
    assert_allclose(search.residual(frozenset(free)), rest.T @ rest / len(rest), atol=1e-6 * scale)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_scores_foresee_what_adding_and_removing_does(seed: int) -> None:
    search = singles(Moments.of(curves(seed)).covariance, tips(seed, 12))
    chosen = frozenset({1, 4, 7})
    adding = search._scores_of_adding(search.residual(chosen), chosen)
    removing = search._scores_of_removing(search._solve(chosen), chosen)
    for group in range(12):
        if group in chosen:
            assert removing[group] == pytest.approx(search.score(chosen - {group}), abs=1e-6)
        else:
            assert adding[group] == pytest.approx(search.score(chosen | {group}), abs=1e-6)


def test_the_path_is_about_as_good_as_the_best_of_each_count() -> None:
    search = singles(Moments.of(curves(5, channels=30)).covariance)
    path = list(search.path())
    assert [len(chosen) for chosen in path] == list(range(31))
    for count in (3, 8, 15):
        assert search.score(path[count]) < search.score(search.best(count)) + np.log(1.1**2)


def test_groups_are_free_together_and_kept_ones_in_any_case() -> None:
    covariance = Moments.of(curves(3)).covariance
    pairs = tuple((i, i + 6) for i in range(6))
    search = Subsets(covariance, Measure("deg"), pairs, keep=frozenset({2}))
    for count in range(1, 7):
        chosen = search.best(count)
        assert 2 in chosen
        assert len(search.channels(chosen)) == 2 * count
        every = (frozenset({2, *c}) for c in combinations([0, 1, 3, 4, 5], count - 1))
        assert search.score(chosen) <= min(map(search.score, every)) + 1e-9


def test_dear_groups_are_taken_only_where_they_are_worth_it() -> None:
    """Two channels that tell each other: the dear one only if it tells more by the price."""
    random = np.random.default_rng(0)
    common = random.normal(size=(500, 1))
    values = common + np.array([0.3, 0.29]) * random.normal(size=(500, 2))
    covariance = Moments.of(values).covariance
    [first] = singles(covariance).best(1)
    price = np.ones(2)
    price[first] = 1.5
    groups = ((0,), (1,))
    [second] = Subsets(covariance, Measure("deg"), groups, price=price).best(1)
    assert second != first
    price[first] = 1.0 + 1e-6
    [third] = Subsets(covariance, Measure("deg"), groups, price=price).best(1)
    assert third == first


def test_equal_channels_and_still_ones_do_no_harm() -> None:
    values = curves(1, channels=6)
    values = np.concatenate([values, values, np.full((len(values), 2), 3.0)], axis=1)
    search = singles(Moments.of(values).covariance)
    chosen = search.best(6)
    assert {i % 6 for i in chosen} == set(range(6))
    assert not chosen & {12, 13}
    assert np.diag(search.residual(chosen)).max() < 1e-6 * np.diag(search.covariance).max()
    assert search.best(14) == frozenset(range(14))


@given(seeds, st.lists(st.integers(2, 40), min_size=1, max_size=5))
@settings(max_examples=25, deadline=None)
def test_moments_of_parts_are_those_of_the_whole(seed: int, lengths: list[int]) -> None:
    random = np.random.default_rng(seed)
    parts = [random.normal(size=(n, 4)) * 30 + random.normal(size=4) * 100 for n in lengths]
    found, whole = pooled(map(Moments.of, parts)), Moments.of(np.concatenate(parts))
    assert found.frames == whole.frames
    for name in ("mean", "covariance", "low", "high"):
        assert_allclose(getattr(found, name), getattr(whole, name), atol=1e-8)
    centre = random.normal(size=4)
    away = np.concatenate(parts) - centre
    assert_allclose(found.about(centre), away.T @ away / len(away), atol=1e-7)
    assert_allclose(whole.turned(np.ones(4)).mean, whole.mean - 360.0)
