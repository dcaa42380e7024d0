"""Plots of reduce show what the numbers say."""

from __future__ import annotations

import numpy as np
import pytest
from builders.panels import lines
from conftest import REPOSITORY

import usdhand
from usdhand.motion import Clip
from usdhand.reduce.curve import error_curve
from usdhand.reduce.errors import pca_rms
from usdhand.reduce.fit import Statistics, fit_relations
from usdhand.reduce.method import Reduction
from usdhand.reduce.search import errors_by_count, thresholds_for_count
from usdhand.reduce.settings import ReduceSettings
from usdhand.report.plots import reducing, rigs, style

SAMPLES = REPOSITORY / "samples"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
FULL = SAMPLES / "conversations" / "talk_01_full.usdc"
OK = SAMPLES / "gestures" / "ok_01.usdc"


@pytest.fixture(scope="module")
def talk() -> Clip:
    return usdhand.read_clip(FULL)


@pytest.fixture(scope="module")
def reduction(talk: Clip) -> Reduction:
    return usdhand.reduce_hands([talk])[0]


def test_followers_lie_where_their_channels_are(reduction: Reduction) -> None:
    figure = reducing.followers([reduction])
    names = {r.name: r for r in reduction.rig.relations}
    own = dict(zip(reduction.source.names, reduction.source.values.T, strict=True))
    titles = [panel.get_title(loc="left") for panel in figure.axes]
    assert len(titles) == reducing.MOST_FOLLOWERS
    shown = []
    for panel in figure.axes:
        dependent, controller = (
            text.removesuffix(", deg") for text in (panel.get_ylabel(), panel.get_xlabel())
        )
        relation = names[dependent]
        assert relation.controllers == (controller,)
        _, dots, line = panel.get_lines()
        at = style.sampled(len(own[dependent]), reducing.SCATTER_POINTS)
        expected = np.stack([own[controller][at], own[dependent][at]], axis=1)
        assert np.array_equal(dots.get_xydata(), expected)
        ends = line.get_xydata()
        assert ends[:, 1] == pytest.approx(relation.offset + relation.slopes[0] * ends[:, 0])
        shown.append(relation.rms_error)
    assert shown == sorted(shown)
    assert f"{shown[-1]:.1f} deg" in titles[-1]


def test_several_controllers_are_drawn_against_the_first(talk: Clip) -> None:
    [found] = usdhand.reduce_hands(
        [talk], ReduceSettings(free_channels=12, fit="least-squares", controllers=3)
    )
    figure = reducing.followers([found])
    shown = {p.get_ylabel().split(",")[0] for p in figure.axes}
    several = (r for r in found.rig.relations if len(r.controllers) == 3)
    relation = next(r for r in several if r.name in shown)
    own = dict(zip(found.source.names, found.source.values.T, strict=True))
    panels = [p for p in figure.axes if p.get_ylabel().startswith(f"{relation.name}, ")]
    for panel in panels:
        assert "less part of" in panel.get_ylabel()
        x, y = panel.get_lines()[1].get_xydata().T
        residual = y - relation.offset - relation.slopes[0] * x
        at = style.sampled(len(talk), reducing.SCATTER_POINTS)
        reduced = found.reduced.select([relation.name]).values[at, 0]
        assert residual == pytest.approx(own[relation.name][at] - reduced, abs=1e-9)
    assert panels


def test_histograms_count_channels_and_pairs(reduction: Reduction) -> None:
    figure = reducing.histograms([reduction])
    curves = reduction.source.select(reduction.rig.names).values
    counts = [sum(bar.get_height() for bar in panel.patches) for panel in figure.axes]
    assert counts == [50, 1225, 1225]  # as in the paper
    constant = sum(r.kind == "constant" for r in reduction.rig.relations)
    labels = [panel.get_legend().get_texts()[0].get_text() for panel in figure.axes]
    assert labels[0] == f"below 5 deg: {constant} channels"
    standard = (curves - curves.mean(axis=0)) / curves.std(axis=0)
    pairs = np.triu_indices(50, k=1)
    close = [
        int(
            (
                np.sqrt(np.mean((standard.T[pairs[0]] - s * standard.T[pairs[1]]) ** 2, 1)) < 0.5
            ).sum()
        )
        for s in (1, -1)
    ]
    assert labels[1:] == [f"below 0.5: {n} pairs" for n in close]
    assert sum(b.get_height() for b in figure.axes[1].patches[:5]) == close[0]


def test_a_rig_of_other_clips_says_what_it_does(reduction: Reduction) -> None:
    """Channels that do not move here, and those that the rig holds since they did not there."""
    [found] = usdhand.reduce_hands([usdhand.read_clip(OK)], rig=reduction.rig)
    constant = sum(r.kind == "constant" for r in found.rig.relations)
    ranges = np.ptp(found.source.select(found.rig.names).values, axis=0)
    still = int((ranges < found.rig.range_threshold).sum())
    assert constant != still
    legend = reducing.histograms([found]).axes[0].get_legend().get_texts()[0].get_text()
    assert legend == f"below 5 deg: {still} channels\nthis rig holds {constant} constant"


def test_curves_are_the_original_and_the_reduced_ones(reduction: Reduction) -> None:
    figure = reducing.curves([reduction])
    worst = np.argsort(-reduction.errors.rms)[: reducing.MOST_CURVES]
    for panel, channel in zip(figure.axes, worst, strict=True):
        name = reduction.errors.names[channel]
        title = panel.get_title(loc="left")
        assert title.startswith(f"{name} ")
        assert f"{reduction.errors.rms[channel]:.1f} deg" in title
        before, after = panel.get_lines()
        assert np.array_equal(before.get_ydata(), reduction.source.select([name]).values[:, 0])
        assert np.array_equal(after.get_ydata(), reduction.reduced.select([name]).values[:, 0])
        assert before.get_xdata()[-1] == pytest.approx(reduction.clip.duration)


def test_error_against_number_of_channels(reduction: Reduction) -> None:
    figure = reducing.errors([reduction])
    own = reduction.source.select(reduction.rig.names).values
    statistics = Statistics.of(own)
    drawn = lines(figure.axes[0])
    for fit, label in (("paper", "the paper's fit"), ("least-squares", "least squares")):
        curve = dict(drawn[f"one controller, {label}"])
        for count in (0, 7, 20, 41):
            limits = thresholds_for_count(statistics, count, fit)
            fitted = fit_relations(reduction.rig.names, statistics, limits, fit)
            best = np.array([relation.rms_error for relation in fitted])
            assert curve[count] == pytest.approx(np.sqrt(np.mean(best**2)), rel=1e-9)
    bound = dict(drawn["PCA: the smallest error of any linear model"])
    assert bound[20] == pytest.approx(pca_rms(own, 20))
    [point] = next(xy for label, xy in drawn.items() if label.startswith("this rig"))
    assert point.tolist() == pytest.approx([len(reduction.rig.free), reduction.errors.rms_deg])


def test_errors_of_the_best_channels_are_those_of_the_curve(reduction: Reduction) -> None:
    assert reduction.evidence is not None
    curve = error_curve(reduction.evidence)
    degrees, millimetres = reducing.errors([reduction]).axes
    for panel, unit in ((degrees, "deg"), (millimetres, "mm")):
        drawn = lines(panel)
        best = dict(drawn["best channels"])
        assert best == {p.channels: p.fitted.by(unit) for p in curve.points}
        assert "best channels, on takes left out" not in drawn  # one take
        [preset] = drawn["presets 1 to 4"]
        assert tuple(preset) == (curve.presets[1][0], curve.presets[1][1].by(unit))
        assert f"suggested number: {curve.suggested}" in drawn


def test_hands_are_drawn_with_every_channel(reduction: Reduction) -> None:
    figure = rigs.hands(reduction.rig)
    [panel] = figure.axes
    marks = [
        line for line in panel.get_lines() if line.get_marker() in "oD" and len(line.get_xdata())
    ]
    assert len(marks) == 50
    places = {tuple(np.round(line.get_xydata()[0], 3)) for line in marks}
    assert len(places) == 50
    free = [m for m in marks if m.get_color() == rigs.COLOURS["free"]]
    assert len(free) == len(reduction.rig.free)
    linear = sum(r.kind == "linear" for r in reduction.rig.relations)
    assert (
        sum(text.arrow_patch is not None for text in panel.texts if hasattr(text, "arrow_patch"))
        == linear
    )


def test_counts_that_no_thresholds_leave_have_no_error() -> None:
    t = np.linspace(0.0, 1.0, 50)
    same = np.stack([t, t, t, np.sin(9 * t)], axis=1)  # three curves are free together or not
    errors = errors_by_count(Statistics.of(30.0 * same))
    assert np.isfinite(errors).tolist() == [True, True, True, False, True]
    assert errors[2] == pytest.approx(0.0, abs=1e-6)


def test_several_clips_are_one_motion() -> None:
    found = usdhand.reduce_hands(
        [usdhand.read_clip(SAMPLES / "gestures" / f"ok_0{i}.usdc") for i in (1, 2)]
    )
    figure = reducing.errors(found)
    [point] = next(xy for label, xy in lines(figure.axes[0]).items() if "this rig" in label)
    together = np.concatenate(
        [
            (r.reduced.select(r.rig.names).values - r.source.select(r.rig.names).values)
            for r in found
        ]
    )
    assert point[1] == pytest.approx(np.sqrt(np.mean(together**2)))
    assert all("\nin ok_0" in p.get_title(loc="left") for p in reducing.curves(found).axes)


def test_nothing_to_show_is_no_plot(talk: Clip) -> None:
    [free] = usdhand.reduce_hands([talk], ReduceSettings(range_deg=0.0))
    assert set(reducing.figures([free])) == {"reduce_histograms", "reduce_errors"}
    [still] = usdhand.reduce_hands([usdhand.read_clip(BODY)], ReduceSettings(preset=1))
    assert set(reducing.figures([still])) == {"reduce_histograms", "reduce_errors"}
