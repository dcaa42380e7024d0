"""The compiled warp of splice against Algorithm 1 of the paper, and its band and pins."""

from __future__ import annotations

import numpy as np
import pytest
from builders.moving_markers import moving_hand
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.splice_2006 import algorithm_1, best_turn, distance_of_signs
from scipy.spatial.transform import Rotation

from usdhand.dtw.phases import (
    REST_COST,
    UNREACHED,
    phase_path,
    sign_costs,
    signs_along,
    turn_angles,
)
from usdhand.errors import UsageError
from usdhand.splice.band import anchors_of, band_along, checked_pins, pinned_band
from usdhand.splice.phases import smoothed
from usdhand.splice.refine import refined
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.timing import align
from usdhand.splice.warps import EXACT, through_pins, whittaker_smoothed

NO_TURN = np.zeros((1, 2, 1), np.float32), np.zeros((2, 1, 1), np.float32)


def words(signs: np.ndarray) -> np.ndarray:
    """Signs (frames, n) as bits (2, frames)."""
    bits = np.uint64(1) << np.arange(signs.shape[1], dtype=np.uint64)
    return np.stack([((signs == s) * bits).sum(axis=1, dtype=np.uint64) for s in (1, -1)])


def cells(first: np.ndarray, last: np.ndarray) -> list[tuple[int, int]]:
    return [
        (i, j) for i, (a, b) in enumerate(zip(first, last, strict=True)) for j in range(a, b + 1)
    ]


@st.composite
def problems(draw):
    n, m = draw(st.integers(8, 30)), draw(st.integers(8, 30))
    count = draw(st.integers(1, 64))  # few signs: many ties
    seed = draw(st.integers(0, 2**32 - 1))
    width = draw(st.sampled_from([4.0, 8.0, 14.0, 40.0]))
    pins = []
    for _ in range(draw(st.integers(0, 3))):
        x = draw(st.integers(1, n - 2))
        if all(abs(x - p[0]) > 1 for p in pins):
            pins.append((x, draw(st.integers(0, m - 1)), draw(st.integers(0, 2))))
    pins.sort()
    pins = [p for k, p in enumerate(pins) if k == 0 or p[1] >= max(q[1] for q in pins[:k])]
    return n, m, count, seed, width, pins


@given(problems())
def test_agrees_with_algorithm_1(problem) -> None:
    n, m, count, seed, width, pins = problem
    random = np.random.default_rng(seed)
    p, q = random.integers(-1, 2, (n, count)), random.integers(-1, 2, (m, count))
    anchors = ((0, 0, 0), *pins, (n - 1, m - 1, 0))
    band = pinned_band(anchors, width)
    first, last, cost = phase_path(words(p), words(q)[None], *NO_TURN, band.low, band.high)
    wanted, path = algorithm_1(lambda i, j: distance_of_signs(p[i], q[j]), n, m, width, pins)
    assert cost == wanted
    assert cells(first, last) == path
    assert cost == sum(distance_of_signs(p[i], q[j]) for i, j in path)
    for x, y, tolerance in pins:  # the path passes, at most one diagonal step beside
        assert last[x] <= y + tolerance
        assert first[x + 1] >= y - tolerance


@given(problems(), st.integers(-1, 40))
def test_a_rest_uses_up_frames_of_its_own_clip(problem, rest_signs: int) -> None:
    n, m, count, seed, width, pins = problem
    random = np.random.default_rng(seed)
    p, q = (random.integers(-1, 2, (k, count)) * (random.random((k, 1)) < 0.6) for k in (n, m))
    band = pinned_band(((0, 0, 0), *pins, (n - 1, m - 1, 0)), width)
    first, last, cost = phase_path(
        words(p), words(q)[None], *NO_TURN, band.low, band.high, rest_signs
    )

    def alone(signs: np.ndarray, match: int) -> int:
        active = int(np.abs(signs).sum())
        return min(match, active + REST_COST) if active <= rest_signs else match

    total = np.full((n + 1, m + 1), 10**9)
    total[0, 0] = 0
    for i in range(n):
        for j in range(band.low[i], band.high[i] + 1):
            match = distance_of_signs(p[i], q[j])
            total[i + 1, j + 1] = min(
                total[i, j] + match,
                total[i, j + 1] + alone(p[i], match),
                total[i + 1, j] + alone(q[j], match),
            )
    assert cost == total[n, m]
    found = 0
    for before, (i, j) in zip([None, *cells(first, last)], cells(first, last), strict=False):
        match = distance_of_signs(p[i], q[j])
        if before and i == before[0]:
            match = alone(q[j], match)
        elif before and j == before[1]:
            match = alone(p[i], match)
        found += match
    assert found == cost


def test_turns_are_the_papers() -> None:
    """Every cell block takes, of the turns there are, the one nearest to equation (7)."""
    random = np.random.default_rng(1)
    angles = turn_angles(64)
    assert np.allclose(np.diff(np.unwrap(angles)), 2 * np.pi / 64, rtol=0.5)
    for _ in range(20):
        p, q = random.normal(size=(2, 20, 2))
        wanted = best_turn(p, q)
        # A column's sign word is the number of its turn; the body's word makes the cost tell it.
        hand = np.zeros((64, 2, 8), np.uint64)
        hand[:, 0, :] = ((np.uint64(1) << np.arange(64, dtype=np.uint64)) - np.uint64(1))[:, None]
        first, _, cost = phase_path(
            np.zeros((2, 1), np.uint64),
            hand,
            (p - p.mean(axis=0)).T[None].astype(np.float32),
            np.repeat(q.T[:, :, None], 2, axis=2).astype(np.float32),
            np.array([0]),
            np.array([0]),
        )
        assert first[0] == 0
        away = np.angle(np.exp(1j * (angles[cost] - wanted)))
        assert abs(away) < np.radians(4.0)


def test_signs_after_a_turn_are_those_of_turned_vectors() -> None:
    vectors = np.random.default_rng(2).normal(size=(50, 1, 3))
    turned = Rotation.from_euler("y", 40, degrees=True).apply(vectors[:, 0])[:, None]
    from usdhand.splice.phases import _about_vertical

    axes = np.eye(3)[None, None]
    plain = np.zeros((1, 2, 50), np.uint64)
    after = np.zeros((1, 2, 50), np.uint64)
    signs_along(
        np.moveaxis(turned, 0, 2).astype(np.float32).copy(), axes.astype(np.float32), 0.1, plain
    )
    back = _about_vertical(axes, -np.radians(40))
    signs_along(
        np.moveaxis(vectors, 0, 2).astype(np.float32).copy(), back.astype(np.float32), 0.1, after
    )
    assert np.array_equal(plain, after)
    assert plain.any()


def test_a_long_path_through_a_narrow_band() -> None:
    n = 20000
    p = np.random.default_rng(3).integers(0, 2**63, (2, n)).astype(np.uint64)
    p[1] &= ~p[0]
    band = pinned_band(((0, 0, 0), (n - 1, n - 1, 0)), 400.0)
    first, last, cost = phase_path(p, p[None], *NO_TURN, band.low, band.high)
    assert cost == 0
    assert (first == np.arange(n)).all()
    assert (last == first).all()


def test_costs_along_a_path_are_those_of_its_cells() -> None:
    random = np.random.default_rng(4)
    p, q = random.integers(-1, 2, (40, 64)), random.integers(-1, 2, (50, 64))
    columns = random.integers(0, 50, 40)
    costs = sign_costs(words(p), words(q), columns)
    assert costs.tolist() == [distance_of_signs(p[i], q[j]) for i, j in enumerate(columns)]


@pytest.mark.parametrize("n", [3, 4, 5, 60])
def test_a_stiff_curve_is_the_least_squares_one(n: int) -> None:
    random = np.random.default_rng(n)
    values, weights = random.normal(size=n), random.uniform(0.1, 1.0, n)
    bend = np.diff(np.eye(n), n=2, axis=0)
    wanted = np.linalg.solve(np.diag(weights) + 7.0 * bend.T @ bend, weights * values)
    assert np.allclose(whittaker_smoothed(values, weights, 7.0), wanted)
    weights[1] = EXACT
    assert abs(whittaker_smoothed(values, weights, 7.0)[1] - values[1]) < 1e-6


def test_a_stiff_curve_bends_freely_at_a_pin_where_the_speed_jumps_and_nowhere_else() -> None:
    rows = np.arange(101.0)
    values, weights = np.maximum(rows - 50.0, 0.0) * 3.0, np.full(101, 0.02)
    weights[50] = EXACT
    assert np.abs(whittaker_smoothed(values, weights, 500.0) - values).max() < 1e-6
    values[51:] += 40.0  # a jump after the pin is nothing to what is before it
    assert np.abs(whittaker_smoothed(values, weights, 500.0) - values)[:50].max() < 1e-6
    values = rows + np.random.default_rng(5).normal(size=101)
    values[50] = 50.0
    bend = np.diff(np.eye(101), n=2, axis=0)
    wanted = np.linalg.solve(np.diag(weights) + 500.0 * bend.T @ bend, weights * values)
    assert np.abs(whittaker_smoothed(values, weights, 500.0) - wanted).max() < 1e-5
    moved = whittaker_smoothed(values - rows, weights, 500.0, rows)
    assert np.abs(moved + rows - wanted).max() < 1e-5


def test_wide_smoothing_is_nearly_gaussian() -> None:
    pulse = np.zeros(801)
    pulse[400] = 1.0
    t = np.arange(-400, 401)
    gauss = np.exp(-((t / 60.0) ** 2) / 2) / (60.0 * np.sqrt(2 * np.pi))
    found = smoothed(pulse, 60.0)
    assert np.abs(found - gauss).max() < 0.08 * gauss.max()
    assert abs(np.sqrt(np.sum(found * t**2)) - 60.0) < 1.0


def test_pass_2_finds_parts_of_a_frame_and_stays_where_it_may_not_move() -> None:
    rows = np.arange(300.0)
    shift = 3.3 * np.sin(np.pi * rows / 299) ** 2
    body, hand = moving_hand((rows + shift) / 60.0), moving_hand(rows / 60.0)
    room = np.full(300, 12.0)
    found = refined([(body, hand)], rows, room, "local", 7.0) - rows
    assert np.abs(found - shift)[10:-10].max() < 0.5
    assert np.abs(found - shift).mean() < 0.1
    room[150] = 0.0
    assert abs(refined([(body, hand)], rows, room, "local", 7.0)[150] - 150.0) < 1e-6
    still = moving_hand(np.zeros(300))
    assert np.abs(refined([(still, still)], rows, room, "local", 7.0) - rows).max() < 1e-6


def test_pins_that_cannot_hold_are_named() -> None:
    def check(*pins: Pin) -> tuple[Pin, ...]:
        return checked_pins(pins, "left", 10.0, 8.0)

    with pytest.raises(UsageError, match=r"late.*body clip"):
        check(Pin(11.0, 1.0, name="late"))
    with pytest.raises(UsageError, match=r"early.*hand clip"):
        check(Pin(1.0, -0.5, name="early"))
    with pytest.raises(UsageError, match="a and b cross"):
        check(Pin(2.0, 5.0, name="a"), Pin(3.0, 4.0, name="b"))
    with pytest.raises(UsageError, match="a and b contradict"):
        check(Pin(2.0, 4.0, name="a"), Pin(2.0, 5.0, name="b"))
    with pytest.raises(UsageError, match="tolerance"):
        check(Pin(2.0, 4.0, -1.0))
    both = check(Pin(3.0, 4.0), Pin(2.0, 2.0, side="right"), Pin(2.0, 3.0, side="left"))
    assert [p.hand for p in both] == [3.0, 4.0]


@given(problems())
def test_every_row_of_a_band_can_be_reached(problem) -> None:
    n, m, _, _, width, pins = problem
    band = pinned_band(((0, 0, 0), *pins, (n - 1, m - 1, 0)), width)
    assert (band.low <= band.high).all()
    assert (np.diff(band.low) >= 0).all()
    assert (np.diff(band.high) >= 0).all()
    assert (band.low[1:] <= band.high[:-1] + 1).all()
    assert band.low[0] == 0
    assert band.high[-1] == m - 1
    anywhere = np.linspace(0, m - 1, n).astype(int)
    assert band_along(anywhere, anywhere, band, 1e9).cells == band.cells


def test_the_way_stays_open_beside_rows_of_many_columns() -> None:
    """Where the body waits, one row of a path can be wider than the band near it."""
    whole = pinned_band(((0, 0, 0), (9, 199, 0)), 200.0)
    first, last = np.array([0, 1, 2, 3, 4, 195, 196, 197, 198, 199]), np.arange(10)
    last[4], last[5:] = 194, first[5:]
    near = band_along(first, last, whole, 5.0)
    p, q = np.zeros((2, 10), np.uint64), np.zeros((1, 2, 200), np.uint64)
    begin, end, cost = phase_path(p, q, *NO_TURN, near.low, near.high)
    assert (near.low <= first).all()
    assert (near.high >= last).all()
    assert cost == 0
    assert (begin[0], end[-1]) == (0, 199)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ([0, 3, 4], [1, 4, 5]),  # columns 2 is left out
        ([0, 2, 1], [2, 3, 5]),
        ([0, 1, 2], [4, 3, 5]),
        ([0, 3, 4], [5, 2, 5]),
        ([-1, 0, 0], [5, 5, 5]),
        ([0, 0, 0], [5, 5, 6]),
        ([0, 0], [5, 5]),
    ],
)
def test_a_band_without_a_way_through_is_refused(low: list[int], high: list[int]) -> None:
    p, q = np.zeros((2, 3), np.uint64), np.zeros((1, 2, 6), np.uint64)
    with pytest.raises(ValueError, match="no path fits"):
        phase_path(p, q, *NO_TURN, np.array(low), np.array(high))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(20, 400), st.integers(20, 400), st.floats(0.01, 1.0))
def test_all_passes_get_through_whatever_the_pins(
    seed: int, rows: int, columns: int, width: float
) -> None:
    """Pins and holds anywhere: no pass runs a band without a way (it would be refused)."""
    random = np.random.default_rng(seed)
    count = int(random.integers(0, 6))
    at = [np.sort(random.integers(0, n, count)) / 60.0 for n in (rows, columns)]
    slack = random.choice([0.0, 0.1, 1.0], count)
    at[1] = np.clip(at[1] + random.uniform(-slack, slack), 0.0, (columns - 1) / 60.0)
    pins = [Pin(b, h, t) for b, h, t in zip(*at, slack, strict=True)]  # tolerant ones may cross
    holding = np.minimum(np.arange(columns), random.integers(1, columns)) / 60.0
    hand = moving_hand(holding)
    body = moving_hand(np.arange(rows) / 60.0)
    pins = checked_pins(one_a_frame(pins), "left", (rows - 1) / 60.0, (columns - 1) / 60.0)
    times = np.arange(rows) / 60.0
    [found] = align([(body, hand)], SpliceSettings(band=(width, 0.01)), pins, times)
    assert found.cost < UNREACHED
    for warp in (found.phase_warp, found.warp):
        assert (np.diff(warp) >= 0).all()
        assert all(abs(np.interp(p.body, times, warp) - p.hand) < p.tolerance + 1e-6 for p in pins)


def test_pins_may_cross_within_their_tolerances() -> None:
    """Both are met by a hand clip that waits; the band of the matching must not close."""
    pins = checked_pins([Pin(1.0, 5.9, 1.0), Pin(6.5, 4.0, 1.0)], "left", 8.0, 8.0)
    rows, times = 481, np.arange(481) / 60.0
    assert anchors_of(pins, rows, rows, 60.0)[1:3] == ((60, 297, 3), (390, 297, 3))
    hand = moving_hand(times)
    [found] = align([(hand, hand)], SpliceSettings(band=(0.01, 0.01)), pins, times)
    for warp in (found.phase_warp, found.warp):
        for pin in pins:
            assert abs(np.interp(pin.body, times, warp) - pin.hand) < pin.tolerance + 1e-6
    with pytest.raises(UsageError, match="cross"):
        checked_pins([Pin(1.0, 6.1, 1.0), Pin(6.5, 4.0, 1.0)], "left", 8.0, 8.0)


def one_a_frame(pins: list[Pin]) -> list[Pin]:
    return list({p.body: p for p in pins}.values())


def test_pins_on_the_first_and_last_frame_move_the_ends() -> None:
    pins = Pin(0.0, 1.0), Pin(5.0, 4.0)
    assert anchors_of(pins, 301, 601, 60.0) == ((0, 60, 0), (300, 240, 0))


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_pins_are_met_whatever_the_warp(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    times = np.arange(200) / 20.0
    warp = np.sort(random.uniform(0.0, 8.0, 200))
    frames = np.sort(random.choice(200, count, replace=False))
    wanted = np.sort(random.uniform(0.0, 8.0, count))
    slack = random.choice([0.0, 0.3], count)
    pins = [Pin(times[f], h, s) for f, h, s in zip(frames, wanted, slack, strict=True)]
    for spread in (0.02, 0.25, np.inf):
        moved = through_pins(warp, times, pins, spread)
        assert (np.diff(moved) >= 0).all()
        off = np.abs(moved[frames] - wanted)
        assert (off <= slack + 1e-9).all()
