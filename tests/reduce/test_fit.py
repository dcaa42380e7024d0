"""Relations of channels: the fast fit against the paper's text, ties, slopes, errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from oracles import reduce_2009

from usdhand.anatomy.channels import Channels
from usdhand.errors import InputError
from usdhand.motion.rotations import Array
from usdhand.reduce.errors import pca_rms
from usdhand.reduce.fit import Statistics, fit_relations
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.settings import PRESETS, Thresholds

KINDS = ("own", "duplicate", "mirrored", "shifted", "constant", "mixed", "negligible")


@st.composite
def curve_sets(draw: st.DrawFn) -> Array:
    """Curves (frames, n) that are new, or made of earlier ones in ways that give ties."""
    frames = draw(st.integers(2, 9))
    value = st.integers(-6, 6)  # whole numbers meet thresholds and each other exactly
    columns: list[Array] = []
    for _ in range(draw(st.integers(1, 8))):
        kind = draw(st.sampled_from(KINDS)) if columns else "own"
        own = np.array(draw(st.lists(value, min_size=frames, max_size=frames)), dtype=float)
        other = columns[draw(st.integers(0, len(columns) - 1))] if columns else own
        columns.append(
            {
                "own": own,
                "duplicate": other.copy(),
                "mirrored": -other,
                "shifted": other + 7.3,
                "constant": np.full(frames, own[0]),
                "mixed": other + own / 8.0,
                "negligible": 1e-8 * own,
            }[kind]
        )
    return np.stack(columns, axis=1)


thresholds = st.builds(
    Thresholds,
    st.sampled_from([0.0, 0.5, 1.0, 4.0, 5.0]),
    st.sampled_from([0.0, 0.3, 0.5, 1.0, float(np.sqrt(2)), 1.5, 2.0]),
)


def named(count: int) -> tuple[str, ...]:
    return tuple(f"c{i}" for i in range(count))


def agree(curves: Array, limits: Thresholds) -> None:
    """The fast fit says what the paper's text says."""
    names = named(curves.shape[1])
    slow = reduce_2009.simplify(
        {n: list(map(float, c)) for n, c in zip(names, curves.T, strict=True)},
        limits.range,
        limits.rmsd,
    )
    for relation in fit_relations(names, Statistics.of(curves), limits):
        wanted = slow[relation.name]
        assert relation.kind == wanted.kind, relation.name
        assert relation.controllers == ((wanted.controller,) if wanted.controller else ())
        if relation.kind == "linear":
            assert_allclose(relation.slopes, [wanted.slope], atol=1e-9)
            assert_allclose(relation.rmsd, wanted.rmsd, atol=1e-6)
        assert_allclose(relation.offset, wanted.offset, atol=1e-7)


@given(curve_sets(), thresholds)
@settings(max_examples=600, deadline=None)
def test_the_fit_is_the_papers(curves: Array, limits: Thresholds) -> None:
    agree(curves, limits)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 8.0), st.floats(0.0, 2.0))
@settings(max_examples=100, deadline=None)
def test_the_fit_is_the_papers_on_correlated_curves(seed: int, width: float, rmsd: float) -> None:
    random = np.random.default_rng(seed)
    mixed = random.normal(size=(60, 3)) @ random.normal(size=(3, 12))
    curves = mixed * random.uniform(0.1, 4.0, 12) + 0.3 * random.normal(size=(60, 12)) + 20.0
    agree(curves, Thresholds(width, rmsd))


@pytest.mark.parametrize("copies", [2, 5])
def test_of_equal_curves_the_first_controls(copies: int) -> None:
    """However they are shifted or mirrored: rounding errors of the deviation decide nothing."""
    curve = np.random.default_rng(3).normal(size=200) * 10
    shifts = np.random.default_rng(4).uniform(-500, 500, copies)
    curves = np.stack([(-1) ** i * curve + s for i, s in enumerate(shifts)], axis=1)
    relations = fit_relations(named(copies), Statistics.of(curves), PRESETS[2])
    assert [r.kind for r in relations] == ["free"] + ["linear"] * (copies - 1)
    assert {r.controllers for r in relations[1:]} == {("c0",)}
    assert_allclose([r.slopes[0] for r in relations[1:]], [(-1) ** i for i in range(1, copies)])


def with_distance(rmsd: float, frames: int = 64) -> Array:
    """Two curves whose rmsd1 is exactly this, the first with the larger deviation."""
    basis = np.linalg.qr(np.c_[np.ones(frames), np.random.default_rng(1).normal(size=(frames, 2))])
    a, b = basis.Q[:, 1] * 80.0, basis.Q[:, 2] * 80.0
    r = 1 - rmsd**2 / 2
    return np.stack([2 * a, r * a + np.sqrt(1 - r**2) * b], axis=1)


@pytest.mark.parametrize("limit", [0.1, 0.3, 0.5, 1.0])
def test_a_distance_at_the_threshold_is_not_below_it(limit: float) -> None:
    at = [
        fit_relations(named(2), Statistics.of(with_distance(d)), Thresholds(0.0, limit))[1].kind
        for d in (limit - 1e-6, limit, limit + 1e-6)
    ]
    assert at == ["linear", "free", "free"]


@pytest.mark.parametrize("start", [0.0, 10.1, -33.3])
def test_a_range_at_the_threshold_is_not_below_it(start: float) -> None:
    curves = np.stack([start + np.linspace(0, w, 11) for w in (0.999, 1.0, 1.001)], axis=1)
    curves[:, 1:] *= [1, 1]
    assert list(Statistics.of(curves).moving(1.0)) == [False, True, True]


def test_a_chain_ends_at_its_root() -> None:
    """c follows b, b follows a: c is computed from a though their own distance is too large."""
    basis = np.linalg.qr(np.c_[np.ones(99), np.random.default_rng(0).normal(size=(99, 2))]).Q
    turn = np.radians([0, 25, 50])  # correlation of neighbours 0.906, of the ends 0.643
    curves = (basis[:, 1:2] * np.cos(turn) + basis[:, 2:] * np.sin(turn)) * [90, 80, -70]
    relations = fit_relations(("a", "b", "c"), Statistics.of(curves), PRESETS[4])
    assert [r.controllers for r in relations] == [(), ("a",), ("a",)]
    assert relations[1].rmsd == pytest.approx(np.sqrt(2 - 2 * np.cos(turn[1])))
    assert relations[2].rmsd == pytest.approx(np.sqrt(2 - 2 * np.cos(turn[2])))
    assert relations[2].rmsd > 0.5
    assert relations[2].slopes[0] == pytest.approx(-7 / 9)


def random_curves(seed: int, channels: int = 10, frames: int = 80) -> Array:
    random = np.random.default_rng(seed)
    mixed = random.normal(size=(frames, 3)) @ random.normal(size=(3, channels))
    return mixed * random.uniform(1, 9, channels) + random.normal(size=(frames, channels))


def evaluated(relations: tuple[Relation, ...], curves: Array) -> Array:
    names = named(curves.shape[1])
    return ReducedRig(relations).evaluate(Channels(names, curves)).select(names).values


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("fit", "most"), [("paper", 1), ("least-squares", 1), ("least-squares", 3)]
)
def test_errors_are_those_of_the_curves(seed: int, fit: str, most: int) -> None:
    curves = random_curves(seed)
    relations = fit_relations(
        named(10), Statistics.of(curves), Thresholds(6.0, 0.8), fit, most_controllers=most
    )
    made = evaluated(relations, curves)
    rms = np.sqrt(np.mean((made - curves) ** 2, axis=0))
    assert_allclose([r.rms_error for r in relations], rms, atol=1e-9)
    assert_allclose(made.mean(axis=0), curves.mean(axis=0), atol=1e-9)
    if fit == "paper":
        moving = [r.kind != "constant" for r in relations]
        assert_allclose(made.std(axis=0)[moving], curves.std(axis=0)[moving])


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 1.4))
@settings(max_examples=50, deadline=None)
def test_least_squares_is_never_worse_and_more_controllers_never_either(
    seed: int, rmsd: float
) -> None:
    statistics = Statistics.of(random_curves(seed))
    limits = Thresholds(0.0, rmsd)
    paper = fit_relations(named(10), statistics, limits)
    least = fit_relations(named(10), statistics, limits, "least-squares")
    three = fit_relations(named(10), statistics, limits, "least-squares", most_controllers=3)
    for p, s, m in zip(paper, least, three, strict=True):
        assert p.kind == s.kind == m.kind
        assert m.rms_error <= s.rms_error + 1e-12 <= p.rms_error + 2e-12
        assert len(m.controllers) <= 3
        assert m.controllers[:1] == s.controllers == p.controllers


def test_a_second_controller_finds_a_sum_of_two() -> None:
    a, b, noise = np.linalg.qr(np.random.default_rng(2).normal(size=(300, 4))).Q.T[:3] * 300
    curves = np.stack([3 * a, 2 * b, 1.5 * a + 0.9 * b + 0.01 * noise], axis=1)
    third = fit_relations(
        ("a", "b", "c"), Statistics.of(curves), Thresholds(0, 0.9), "least-squares", 2
    )[2]
    assert third.controllers == ("a", "b")
    assert_allclose(third.slopes, [0.5, 0.45], atol=0.02)


@pytest.mark.parametrize("fit", ["paper", "least-squares"])
def test_pca_of_the_same_size_is_never_worse(fit: str) -> None:
    for seed in range(10):
        curves = random_curves(seed)
        relations = fit_relations(named(10), Statistics.of(curves), Thresholds(0, 0.9), fit)
        free = sum(r.kind == "free" for r in relations)
        error = np.sqrt(np.mean((evaluated(relations, curves) - curves) ** 2))
        assert pca_rms(curves, free) <= error + 1e-12
    assert pca_rms(curves, 10) == pytest.approx(0.0, abs=1e-6)
    assert pca_rms(curves, 0) == pytest.approx(np.sqrt(curves.var(axis=0).mean()))


def test_no_curves_at_all() -> None:
    assert fit_relations((), Statistics.of(np.empty((5, 0))), PRESETS[4]) == ()


def test_a_rig_that_contradicts_itself_is_refused() -> None:
    free = Channels(("a",), np.zeros((4, 1)))
    with pytest.raises(InputError, match="'b' follows 'x'"):
        ReducedRig(
            (Relation("a", "free"), Relation("b", "linear", controllers=("x",), slopes=(1.0,)))
        ).evaluate(free)
