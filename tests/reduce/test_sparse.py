"""Channels to leave free where each dependent channel follows only a few of them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from test_subset import curves, singles, tips

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments
from usdhand.reduce.relate import Shape, residual_moments, told_by
from usdhand.reduce.sparse import exchanged_for_few, grown_for_few
from usdhand.reduce.subset import Measure, Subsets

Problem = tuple[Moments, Subsets]


def problem(seed: int, name: str = "deg", channels: int = 12) -> Problem:
    moments = Moments.of(curves(seed, channels))
    measure = tips(seed, channels) if name == "mm" else Measure("deg")
    return moments, singles(moments.covariance, measure)


def error(of: Problem, chosen: frozenset[int], controllers: int) -> float:
    """Square root of all squared parts with so many controllers a channel."""
    moments, search = of
    told = told_by(moments.covariance, search.channels(chosen), Shape(controllers))
    missed: Array = residual_moments(told, moments, moments)
    return float(np.sqrt(search.measure.parts(missed).sum()))


@pytest.mark.parametrize("name", ["deg", "mm"])
@pytest.mark.parametrize("controllers", [1, 2])
def test_brute_force_finds_little_better(name: str, controllers: int) -> None:
    found = []
    for seed in range(10):
        of = problem(seed, name)
        for count in (3, 5, 7):
            every = (frozenset(c) for c in combinations(range(12), count))
            least = min(error(of, c, controllers) for c in every)
            chosen = exchanged_for_few(of[1], of[1].best(count), controllers)
            assert len(chosen) == count
            found.append(error(of, chosen, controllers) / least)
    assert np.mean(found) < 1.02
    assert max(found) < 1.15


def test_sets_for_few_controllers_beat_those_for_all_of_them() -> None:
    """Six digits of five channels, each told by its own sum: one channel a digit is best.

    For all controllers together, which see the digits' common motion, other channels are as good.
    """
    gains = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        digits = random.normal(size=(400, 6))
        rows = [digits[:, i, None] * random.uniform(2.0, 9.0, 5) for i in range(6)]
        mixed = digits @ random.normal(size=(6, 10)) * 4.0
        values = np.concatenate([*rows, mixed], axis=1)
        values = values + random.normal(size=values.shape)
        moments = Moments.of(values)
        of = moments, singles(moments.covariance)
        best = of[1].best(6)
        gains.append(error(of, exchanged_for_few(of[1], best, 1), 1) / error(of, best, 1))
    assert max(gains) <= 1.0 + 1e-9
    assert np.mean(gains) < 0.97


def test_sets_grow_by_what_few_controllers_need() -> None:
    of = problem(4, channels=20)
    chosen: frozenset[int] = frozenset()
    errors = []
    for count in range(1, 21):
        grown = grown_for_few(of[1], chosen, count, 2)
        assert len(grown) == count
        errors.append(error(of, grown, 2))
        chosen = grown
    assert (np.diff(errors) < 1e-9).all()
    assert errors[-1] == pytest.approx(0.0, abs=1e-6)


def test_groups_stay_together_and_kept_ones_stay() -> None:
    moments = Moments.of(curves(3))
    pairs = tuple((i, i + 6) for i in range(6))
    search = Subsets(moments.covariance, Measure("deg"), pairs, keep=frozenset({2}))
    for count in range(1, 6):
        chosen = exchanged_for_few(search, search.best(count), 1)
        assert 2 in chosen
        every = (frozenset({2, *c}) for c in combinations([0, 1, 3, 4, 5], count - 1))
        least = min(error((moments, search), c, 1) for c in every)
        assert error((moments, search), chosen, 1) <= 1.1 * least


def test_equal_channels_and_still_ones_do_no_harm() -> None:
    values = curves(1, channels=6)
    values = np.concatenate([values, values, np.full((len(values), 2), 3.0)], axis=1)
    search = singles(Moments.of(values).covariance)
    chosen = grown_for_few(search, frozenset(), 6, 2)
    assert {i % 6 for i in chosen} == set(range(6))
    assert not chosen & {12, 13}
    assert grown_for_few(search, chosen, 14, 2) == frozenset(range(14))
