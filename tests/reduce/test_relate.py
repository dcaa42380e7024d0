"""Relations of several controllers: least squares, sparse, and such that hold on other takes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.relate import Shape, best_shape, left_out, residual_moments, told_by
from usdhand.reduce.subset import Measure

seeds = st.integers(0, 2**32 - 1)


def take(seed: int, mixing: Array, frames: int = 60, noise: float = 0.3) -> Array:
    random = np.random.default_rng(seed)
    sources = random.normal(size=(frames, len(mixing)))
    return sources @ mixing + noise * random.normal(size=(frames, mixing.shape[1]))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_all_controllers_are_least_squares(seed: int) -> None:
    values = take(seed, np.random.default_rng(seed).normal(size=(3, 9)))
    moments, free = Moments.of(values), [0, 4, 7]
    told = told_by(moments.covariance, free, Shape())
    centred = values - values.mean(axis=0)
    wanted = np.linalg.lstsq(centred[:, free], centred, rcond=None)[0].T
    errors = np.mean((centred - centred @ told.T) ** 2, axis=0)
    least = np.mean((centred - centred[:, free] @ wanted.T) ** 2, axis=0)
    assert_allclose(told[free], np.eye(9)[free])
    assert (errors <= least * 1.03 + 1e-9).all()  # fewer where they are about as good
    assert_allclose(np.diag(residual_moments(told, moments, moments)), errors, atol=1e-9)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_one_controller_is_the_best_one(seed: int) -> None:
    values = take(seed, np.random.default_rng(seed).normal(size=(3, 8)))
    moments, free = Moments.of(values), [1, 2, 5]
    told = told_by(moments.covariance, free, Shape(1))
    correlation = np.corrcoef(values.T)
    for a in set(range(8)) - set(free):
        most = np.abs(correlation[a, free]).max()
        if not told[a].any():  # hardly told by any: 1 % of the error is not worth a controller
            assert 1.0 / (1.0 - most**2) <= 1.01**2 + 1e-6
            continue
        [only] = np.flatnonzero(told[a])
        assert abs(correlation[a, only]) >= most - 1e-9


def test_few_controllers_come_near_the_best_few() -> None:
    """Chosen one after the other, not as pairs: near the best pair on the whole."""
    found = best = 0.0
    for seed in range(10):
        values = take(seed, np.random.default_rng(seed).normal(size=(4, 12)))
        moments, free = Moments.of(values), list(range(6))
        told = told_by(moments.covariance, free, Shape(2))
        errors = np.diag(residual_moments(told, moments, moments))
        centred = values - values.mean(axis=0)
        for a in range(6, 12):
            assert 1 <= np.count_nonzero(told[a]) <= 2
            pairs = (
                np.linalg.lstsq(centred[:, list(c)], centred[:, a], rcond=None)[1][0]
                for c in combinations(free, 2)
            )
            best += min(pairs) / len(values)
            found += errors[a]
    assert best <= found <= 1.2 * best


def test_what_is_left_out_is_told_by_the_others() -> None:
    mixing = np.random.default_rng(1).normal(size=(3, 9))
    takes = [take(seed, mixing) + 5.0 * seed for seed in range(4)]
    free, shape = [0, 3, 6], Shape(2, 0.01)
    square = np.zeros(9)
    for i, shown in enumerate(takes):
        others = np.concatenate([t for j, t in enumerate(takes) if j != i])
        told = told_by(Moments.of(others).covariance, free, shape)
        away = shown - others.mean(axis=0)
        square += np.sum((away - away @ told.T) ** 2, axis=0)
    found = left_out([Moments.of(t) for t in takes], free, shape)
    assert_allclose(np.diag(found), square / sum(map(len, takes)), rtol=1e-9)


def test_short_takes_want_a_ridge_and_few_controllers() -> None:
    """Where all is noise but one controller, the others are left away; one take decides nothing."""
    mixing = np.zeros((8, 12))
    mixing[np.arange(8), np.arange(8)] = 1.0
    mixing[0, 8:] = 2.0
    folds = [Moments.of(take(seed, mixing, frames=12, noise=1.0)) for seed in range(6)]
    measure, free = Measure("deg"), list(range(8))
    shape = best_shape(folds, free, measure, None)
    assert shape.controllers is not None
    assert shape.controllers <= 3
    plain, chosen = (measure.parts(left_out(folds, free, s)).mean() for s in (Shape(), shape))
    assert chosen < 0.95 * plain
    assert best_shape(folds[:1], free, measure, 5) == Shape(5)
    told = told_by(pooled(folds).covariance, free, shape)
    unseen = Moments.of(take(99, mixing, frames=4000, noise=1.0))
    better, worse = (
        np.diag(residual_moments(t, pooled(folds), unseen)).mean()
        for t in (told, told_by(pooled(folds).covariance, free, Shape()))
    )
    assert better < worse


@pytest.mark.parametrize("free", [[], [0], list(range(5))])
def test_none_one_and_all_free(free: list[int]) -> None:
    moments = Moments.of(take(3, np.random.default_rng(0).normal(size=(2, 5))))
    shape = best_shape([moments, moments], free, Measure("deg"), None)
    told = told_by(moments.covariance, free, shape)
    assert_allclose(told[free], np.eye(5)[free])
    assert not told[:, [i for i in range(5) if i not in free]].any()


def test_what_hardly_moved_does_not_throw_others_far_away() -> None:
    """A channel that moves in the last take only, and before in step with a large one by chance."""
    random = np.random.default_rng(0)
    folds = []
    for still in (0.02, 0.02, 0.02, 1.0):
        large = 20.0 * random.normal(size=(200, 3))
        small = 30.0 * still * random.normal(size=(200, 1))
        if still < 1.0:
            small = 0.03 * large[:, :1] + 0.1 * small
        folds.append(Moments.of(np.concatenate([large, small], axis=1)))
    shape = Shape(None, 0.1)
    missed = np.sqrt(np.diag(left_out(folds, [3], shape)))
    assert missed[:3].max() < 30.0  # no more than without a controller, and a little
