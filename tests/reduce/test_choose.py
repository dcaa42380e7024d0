"""Rigs of the best channels: for a number, for an error, with what people want kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.moving_hands import hand_map, moved, random_turns, skeleton
from numpy.testing import assert_allclose

from usdhand.anatomy.channels import Channels, Hands, is_flexion
from usdhand.anatomy.hand import SIDES, CharacterMap
from usdhand.errors import UsageError
from usdhand.motion import Clip
from usdhand.reduce.curve import Loss, error_curve
from usdhand.reduce.errors import pca_rms
from usdhand.reduce.evidence import MOST_FOLDS, Takes, gather, tip_forms
from usdhand.reduce.limits import MARGIN_DEG, Limits, anatomical_range
from usdhand.reduce.method import apply_rig, fit_to
from usdhand.reduce.moments import Moments
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.settings import Criteria, ReduceSettings, Target

RIG, INDEX = skeleton(axes=2)
Taken = tuple[Clip, Hands, Channels]


def take(seed: int, frames: int = 60, sides: tuple[str, ...] = SIDES) -> Taken:
    """Two hands whose channels are mixtures of six sources, the same in all takes, and noise."""
    clip = replace(moved(RIG, INDEX, random_turns(frames, seed)), name=f"take{seed}", fps=30.0)
    maps = {side: hand_map(INDEX, side) for side in sides}  # type: ignore[arg-type]
    hands = Hands.of(clip, CharacterMap(maps, "test"))  # type: ignore[arg-type]
    names = hands.all_names
    mixing = np.random.default_rng(0).normal(size=(6, 90))[:, : len(names)] * 6.0
    random = np.random.default_rng(seed)
    steps = np.cumsum(random.normal(size=(frames, 6)), axis=0)
    values = (steps - steps.mean(axis=0)) / 3.0 @ mixing + 0.5 * random.normal(
        size=(frames, len(names))
    )
    clip = hands.decode(Channels(names, np.clip(values, -80.0, 80.0)), clip)
    return clip, hands, hands.encode(clip)


TAKES = [take(seed) for seed in range(5)]


def fitted(target: Target, takes: list[Taken] = TAKES, **choice: object) -> ReducedRig:
    own = Criteria(**choice)  # type: ignore[arg-type]
    return fit_to(gather(takes), target, "least-squares", None, own)


@pytest.mark.parametrize("count", [0, 1, 6, 15, 49, 50, 60])
def test_a_count_is_met(count: int) -> None:
    rig = fitted(Target(free_channels=count))
    assert len(rig.free) == min(count, 50)
    assert rig.measure == "deg"


def test_errors_of_relations_are_those_of_the_motion() -> None:
    """Limits may only make them smaller: what was fitted lies within them."""
    rig = fitted(Target(free_channels=8), TAKES[:1])
    reduction = apply_rig(rig, *TAKES[0])
    told = {r.name: r for r in rig.relations}
    wanted = [told[n].rms_error for n in reduction.errors.names]
    assert (reduction.errors.rms <= np.array(wanted) + 1e-6).all()
    assert_allclose(reduction.errors.rms, wanted, rtol=0.05, atol=1e-6)
    curves = TAKES[0][2].select(rig.names).values
    assert pca_rms(curves, 8) <= reduction.errors.rms_deg < 1.5 * pca_rms(curves, 8) + 0.05
    for name, curve in zip(rig.names, curves.T, strict=True):
        assert told[name].std == pytest.approx(curve.std(), abs=1e-6)
        limits = told[name].limits
        assert limits is None or limits.soft_low <= curve.min() <= curve.max() <= limits.soft_high
    assert all(r.left_out_error is None for r in rig.relations)


def test_errors_on_takes_left_out_foresee_those_of_others() -> None:
    rig = fitted(Target(free_channels=8))
    foreseen = np.array([r.left_out_error or 0.0 for r in rig.relations])
    others = [apply_rig(rig, *take(seed)).errors.rms ** 2 for seed in range(20, 26)]
    fitted_to = np.array([r.rms_error for r in rig.relations])
    on_fitted, on_left_out, on_others = (
        float(np.sqrt(np.mean(squares)))
        for squares in (fitted_to**2, foreseen**2, np.mean(others, axis=0))
    )
    assert on_fitted < on_left_out < 1.5 * on_others
    assert abs(on_left_out - on_others) < abs(on_fitted - on_others)


@pytest.mark.parametrize("measure", ["deg", "mm"])
def test_a_largest_error_is_met_with_few_channels(measure: str) -> None:
    most = 3.0
    rig = fitted(Target(max_error=most), TAKES[:2], measure=measure)
    evidence = gather(TAKES[:2])
    reductions = [apply_rig(rig, *t) for t in TAKES[:2]]
    if measure == "deg":
        squares = np.mean([r.errors.rms**2 for r in reductions], axis=0)
        assert np.sqrt(squares.max()) <= most
    fewer = fitted(Target(free_channels=len(rig.free) - 1), TAKES[:2], measure=measure)
    assert 0 < len(rig.free) < 40
    assert evidence.measure(measure).name == measure
    assert len(fewer.free) == len(rig.free) - 1
    assert len(fitted(Target(max_error=1.0), TAKES[:2], measure=measure).free) > len(rig.free)


def test_what_is_kept_stays_free() -> None:
    rig = fitted(Target(free_channels=9), keep=("riThumb*", "lePinkyDIPy"))
    thumb = [n for n in rig.names if n.startswith("riThumb")]
    assert {*thumb, "lePinkyDIPy"} <= set(rig.free)
    assert len(rig.free) == 9
    with pytest.raises(UsageError, match="no channel 'riToe'"):
        fitted(Target(free_channels=9), keep=("riToe",))
    with pytest.raises(UsageError, match="more than the 3"):
        fitted(Target(free_channels=3), keep=("riThumb*",))


def test_flexions_are_preferred() -> None:
    plain, flexed = (fitted(Target(free_channels=10), prefer=p) for p in (None, "flexion"))
    assert sum(map(is_flexion, flexed.free)) > sum(map(is_flexion, plain.free))


def test_both_hands_have_the_same_channels() -> None:
    for count in (8, 9):
        rig = fitted(Target(free_channels=count), symmetric=True)
        left, right = ([n[2:] for n in rig.free if n[:2] == side] for side in ("le", "ri"))
        assert left == right
        assert len(left) == 4
    with pytest.raises(UsageError, match="both hands"):
        fitted(Target(free_channels=4), [take(0, sides=("left",))], symmetric=True)


def test_millimetres_lower_the_fingertips_error() -> None:
    by_deg, by_mm = (
        apply_rig(fitted(Target(free_channels=5), TAKES[:1], measure=m), *TAKES[0]).errors
        for m in ("deg", "mm")
    )
    assert by_mm.fingertip_mean < by_deg.fingertip_mean
    assert by_deg.rms_deg < by_mm.rms_deg


def test_tip_forms_foresee_how_far_fingertips_go() -> None:
    clip, hands, source = TAKES[0]
    forms = tip_forms(clip, hands, source)
    random = np.random.default_rng(0)
    step = 0.2 * random.normal(size=50)
    columns = [source.names.index(n) for n in hands.model_names]
    values = source.values.copy()
    values[:, columns] += step
    moved_tips = hands.fingertips(clip, Channels(source.names, values))
    found = 10.0 * np.linalg.norm(moved_tips - hands.fingertips(clip, source), axis=-1)
    wanted = np.einsum("i,tij,j->t", step, forms, step)
    assert_allclose(np.mean(found**2, axis=0), wanted, rtol=0.05)


def test_takes_are_gathered_one_at_a_time_into_few_folds() -> None:
    """No take is held after the next has come: memory does not grow with their number."""
    import weakref

    alive: list[weakref.ref[Channels]] = []

    def coming() -> object:
        for seed in range(2 * MOST_FOLDS):
            clip, hands, source = take(seed, frames=12)
            copy = Channels(source.names, source.values.copy())
            assert sum(ref() is not None for ref in alive) <= 1
            alive.append(weakref.ref(copy))
            yield clip, hands, copy

    evidence = gather(coming())  # type: ignore[arg-type]
    assert len(evidence.folds) == MOST_FOLDS
    curves = np.concatenate(
        [take(s, frames=12)[2].select(evidence.names).values for s in range(2 * MOST_FOLDS)]
    )
    assert_allclose(evidence.moments.covariance, np.cov(curves.T, bias=True), atol=1e-6)
    assert len(evidence.sources) == 2 * MOST_FOLDS


@pytest.mark.parametrize("controllers", [None, 2])
def test_moving_one_hand_leaves_the_other(controllers: int | None) -> None:
    """Of takes in which hands move apart: no channel follows one of the other hand."""
    apart = []
    for seed in range(4):
        clip, hands, source = take(seed)
        other = take(seed + 50)[2].select([n for n in source.names if n.startswith("ri")])
        apart.append((clip, hands, source.replaced(other)))
    rig = fit_to(gather(apart), Target(free_channels=12), "least-squares", controllers)
    assert {name[:2] for name in rig.free} == {"le", "ri"}
    for relation in rig.relations:
        assert {name[:2] for name in relation.controllers} <= {relation.name[:2]}


def test_takes_count_by_time_whatever_their_rates() -> None:
    """A take with every frame four times, at four times the rate, is the same motion."""
    clip, hands, source = TAKES[1]
    often = np.repeat(np.arange(len(clip)), 4)
    fast = replace(
        clip,
        rotations=clip.rotations[often],
        translations=clip.translations[often],
        scales=clip.scales[often],
        fps=4.0 * clip.fps,
    )
    same = Channels(source.names, source.values[often])
    one = gather([TAKES[0], TAKES[1], TAKES[2]])
    other = gather([TAKES[0], (fast, hands, same), TAKES[2]])
    assert_allclose(other.moments.covariance, one.moments.covariance, rtol=1e-6, atol=1e-9)
    assert_allclose(other.moments.mean, one.moments.mean, atol=1e-9)
    assert list(other.held.values()) == pytest.approx(list(one.held.values()))
    asked = Target(free_channels=9)
    assert fit_to(other, asked, "least-squares").free == fit_to(one, asked, "least-squares").free


def test_whole_turns_between_takes_are_taken_off() -> None:
    clip, hands, source = TAKES[0]
    values = source.values.copy()
    values[:, source.names.index("riThumbCMCy")] += 360.0
    turned = (clip, hands, Channels(source.names, values))
    one, two = gather([TAKES[1], TAKES[0]]), gather([TAKES[1], turned])
    assert_allclose(two.moments.covariance, one.moments.covariance, atol=1e-6)
    rig = fitted(Target(free_channels=15), keep=("riThumbCMCy",))
    plain, other = apply_rig(rig, *TAKES[0]), apply_rig(rig, *turned)
    assert_allclose(other.errors.rms, plain.errors.rms, atol=1e-6)


def test_the_curve_falls_and_lies_above_pca() -> None:
    evidence = gather(TAKES)
    curve = error_curve(evidence)
    points = {p.channels: p for p in curve.points}
    assert {0, 5, 10, 15, 20, 50} <= set(points)
    for point in curve.points:
        assert point.fitted.deg >= point.pca.deg - 0.05
        assert point.left_out is not None
    fitted_deg = [p.fitted.deg for p in curve.points]
    assert np.diff(fitted_deg).max() < 0.1
    assert points[0].fitted.deg == pytest.approx(np.sqrt(np.mean(evidence.moments.std**2)))
    assert points[50].fitted.deg == pytest.approx(0.0, abs=1e-6)
    assert 3 <= curve.suggested <= 12  # six sources
    one = error_curve(gather(TAKES[:1]))
    assert all(p.left_out is None for p in one.points)
    assert set(curve.presets) == {1, 2, 3, 4}


def test_errors_of_the_curve_are_those_of_rigs() -> None:
    """By the channels of the path, which may be a little worse than the best of one count."""
    evidence = gather(TAKES[:1])
    point = next(p for p in error_curve(evidence).points if p.channels == 8)
    errors = apply_rig(fitted(Target(free_channels=8), TAKES[:1]), *TAKES[0]).errors
    assert errors.rms_deg == pytest.approx(point.fitted.deg, rel=0.15)
    curves = TAKES[0][2].select(evidence.names).values
    assert point.pca.deg == pytest.approx(pca_rms(curves, 8), rel=1e-6)


def test_the_paper_s_rules_take_no_wishes() -> None:
    for wish in ({"measure": "mm"}, {"keep": ("riThumbIPz",)}, {"symmetric": True}):
        for rules in ({"preset": 4}, {"range_deg": 2.0}, {"free_channels": 9, "fit": "paper"}):
            with pytest.raises(UsageError, match="--keep"):
                _ = ReduceSettings(**wish, **rules).target  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="not possible"):
        fitted(Target(free_channels=-1))


@pytest.mark.parametrize("channel", ["riIndexPIPy", "leThumbCMCz", "rePinkyMCPx"])
def test_limits_are_soft_and_hold(channel: str) -> None:
    limits = Limits.of(channel, -4.0, 40.0)
    least, most = anatomical_range(channel)
    assert limits.low == min(least, -4.0 - MARGIN_DEG)
    assert limits.high == max(most, 40.0 + MARGIN_DEG)
    values = np.linspace(-500.0, 500.0, 20001)
    found = limits.soften(values)
    inside = (values >= limits.soft_low) & (values <= limits.soft_high)
    assert_allclose(found[inside], values[inside])
    assert found.min() > limits.low
    assert found.max() < limits.high
    slopes = np.diff(found) / np.diff(values)
    assert slopes.min() > 0.0
    assert slopes.max() <= 1.0 + 1e-9
    assert np.abs(np.diff(slopes)).max() < 0.05  # without a corner


def test_limits_of_dependent_channels_hold_where_free_ones_go_far() -> None:
    rig = fitted(Target(free_channels=6))
    far = Channels(rig.free, np.full((3, 6), 1000.0))
    values = rig.evaluate(far)
    for relation in rig.relations:
        [value] = set(values.select([relation.name]).values[:, 0].tolist())
        if relation.kind == "linear":
            assert relation.limits is not None
            assert relation.limits.low <= value <= relation.limits.high
        elif relation.kind == "free":
            assert value == 1000.0


def test_how_much_of_a_channel_is_told() -> None:
    assert Relation("a", "linear", rms_error=3.0, std=6.0).told == pytest.approx(0.75)
    assert Relation("a", "constant", rms_error=6.0, std=6.0).told == 0.0
    assert Relation("a", "free", std=6.0).told is None
    assert Relation("a", "linear", rms_error=3.0).told is None


def test_losses_are_roots_of_means() -> None:
    evidence = replace(gather(TAKES[:1]), tips=np.stack([np.eye(50), 3.0 * np.eye(50)]))
    assert isinstance(evidence, Takes)
    loss = Loss.of(4.0 * np.eye(50), evidence)
    assert loss.deg == pytest.approx(2.0)
    assert loss.mm == pytest.approx(np.sqrt(4.0 * 50 * 2.0))
    assert Moments.of(np.zeros((2, 3))).std.tolist() == [0.0, 0.0, 0.0]
