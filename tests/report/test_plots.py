"""Plots of fill, evaluate and splice show what the numbers say."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.clips import frames_of
from builders.panels import lines
from builders.shared_work import SharedWork, few_gestures
from conftest import REPOSITORY

import usdhand
from usdhand.evaluate.agreement import Agreement
from usdhand.evaluate.reconstruction import METHODS, HandError
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.fill.path import best_path
from usdhand.fill.results import Filled
from usdhand.fill.settings import FillSettings
from usdhand.motion import Clip
from usdhand.report.plots import evaluating, filling, splicing, style
from usdhand.report.splice import splice_result
from usdhand.splice.markers import hand_markers
from usdhand.splice.method import Spliced
from usdhand.splice.phases import derivative_signs, facing, steady_turns
from usdhand.splice.settings import SpliceSettings
from usdhand.verbs import fill as fill_api
from usdhand.verbs import splice as splice_api

SAMPLES = REPOSITORY / "samples"
FULL = SAMPLES / "conversations" / "talk_01_full.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
OK = SAMPLES / "gestures" / "ok_01.usdc"
PINS = ("1:1", "181:403")


@pytest.fixture(scope="module")
def library_file(shared_work: SharedWork) -> Path:
    return few_gestures(shared_work)


@pytest.fixture(scope="module")
def library(library_file: Path) -> MotionLibrary:
    return fill_api.read_library(library_file)


@pytest.fixture(scope="module")
def body() -> Clip:
    return frames_of(usdhand.read_clip(BODY), slice(0, 240))


@pytest.fixture(scope="module")
def filled(body: Clip, library: MotionLibrary) -> Filled:
    return fill_api.fill_fingers(body, library, FillSettings(k=3))


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, Clip]:
    return usdhand.read_clip(BODY), usdhand.read_clip(HANDS)


@pytest.fixture(scope="module")
def spliced(clips: tuple[Clip, Clip]) -> Spliced:
    return splice_api.splice_hands(*clips, pins=PINS)


# fill


def test_speed_and_borders(filled: Filled, body: Clip) -> None:
    part = filled.parts[0]
    figure = filling.speed(part, body, usdhand.find_hands(body))
    [panel] = figure.axes
    choices = part.alternatives[0].choices
    borders = sorted({segment[0][0] for segment in panel.collections[0].get_segments()})
    assert borders == pytest.approx([c.start for c in choices] + [choices[-1].end])
    threshold, curve = panel.get_lines()
    assert threshold.get_ydata()[0] == part.space.segmentation.speed
    seconds, speed = curve.get_xydata().T
    assert seconds[-1] == pytest.approx(body.duration, abs=1 / ARM_FPS)
    # Borders lie where the speed crosses the threshold, or where a long part is slowest.
    level = part.space.segmentation.speed
    at = np.rint(np.array(borders[1:-1]) * ARM_FPS).astype(int)
    crossing = (speed[at] > level) != (speed[at - 1] > level)
    slowest = (speed[at] <= speed[at - 1]) & (speed[at] <= speed[at + 1])
    assert (crossing | slowest).mean() > 0.7  # neither, where segments would be too short
    assert crossing.any()


def test_a_long_clip_is_shown_in_rows_of_its_first_minute(library: MotionLibrary) -> None:
    clip = usdhand.read_clip(BODY)
    long = frames_of(clip, np.tile(np.arange(len(clip)), 4))
    part = fill_api.fill_fingers(long, library, sides=("left",)).parts[0]
    figure = filling.speed(part, long, usdhand.find_hands(long))
    assert len(figure.axes) == filling.MOST_ROWS
    assert figure.axes[-1].get_xlim()[1] == pytest.approx(60.0)
    assert "first 60 of 91 s" in figure.get_suptitle()


def test_graph_has_costs_and_the_cheapest_path(filled: Filled, library: MotionLibrary) -> None:
    part = filled.parts[0]
    figure = filling.graph(part, library)
    panel = figure.axes[0]
    choices = part.alternatives[0].choices[: filling.MOST_LAYERS]
    [path] = panel.get_lines()
    assert path.get_ydata().tolist() == [c.chosen for c in choices]
    # All transitions are there with the costs that the path was chosen by.
    drawn = dict(
        zip(
            ((*a, b[1]) for a, b in panel.collections[0].get_segments()),
            panel.collections[0].get_array(),
            strict=True,
        )
    )
    network = part.network
    assert len(drawn) == sum(e.size for e in network.edges[: len(choices) - 1])
    texts = {(t.get_position()): t.get_text() for t in panel.texts}
    for x, (before, after) in enumerate(pairwise(choices)):
        cost = drawn[(x, before.chosen, after.chosen)]
        assert cost == pytest.approx(after.transition_cost)
        assert texts[(x + 0.5, (before.chosen + after.chosen) / 2)] == f"{cost:.3g}"
    for x, choice in enumerate(choices):
        text = texts[(x, choice.chosen)]
        segment = choice.candidates[choice.chosen].segment
        assert library.clips[part.space.clips[segment]].name in text
        assert f"cost {choice.node_cost:.3g}" in text


def test_one_segment_has_room_for_its_caption(body: Clip, library: MotionLibrary) -> None:
    short = frames_of(body, slice(0, 8))
    part = fill_api.fill_fingers(short, library, FillSettings(k=1), sides=("left",)).parts[0]
    assert len(part.alternatives[0].choices) == 1
    figure = filling.graph(part, library)
    with style.look():
        figure.draw_without_rendering()
        whole = figure.bbox
        words = [figure.axes[0].xaxis.label, *figure.axes[0].texts, *figure.texts]
        boxes = [text.get_window_extent() for text in words]
    assert len(boxes) == 3
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 for b in boxes)
    assert all(whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)


def test_the_network_is_what_the_path_was_found_in(filled: Filled) -> None:
    settings = filled.settings
    for part in filled.parts:
        nodes = [layer.costs for layer in part.network.layers]
        mean = [
            np.mean(np.concatenate([np.ravel(x) for x in c])) for c in (nodes, part.network.edges)
        ]
        path = best_path(
            [n * settings.segment_weight / mean[0] for n in nodes],
            [e * settings.transition_weight / mean[1] for e in part.network.edges],
        )
        assert path.nodes == tuple(c.chosen for c in part.alternatives[0].choices)
        assert path.cost == pytest.approx(part.alternatives[0].cost)


# evaluate


def test_evaluation() -> None:
    confusion = np.array([[0.75, 0.25], [0.1, 0.9]])
    agreements = [
        Agreement("near", ("big", "ok"), 0.5, confusion[::-1], 10),
        Agreement("best", ("big", "ok"), 0.8, confusion, 10),
    ]
    errors = [
        HandError(take, side, method, i + frames / 10, 10.0 * i, 0.0, frames)
        for take, frames in (("a", 10), ("b", 30))
        for side in ("left", "right")
        for i, method in enumerate(METHODS, 1)
    ]
    figures = evaluating.figures(agreements, errors)
    assert tuple(figures) == evaluating.NAMES
    bars = figures["evaluate_features"].axes[0].patches
    assert [b.get_width() for b in bars] == pytest.approx([50.0, 80.0])
    [matrix] = figures["evaluate_confusion"].axes
    assert np.array_equal(matrix.images[0].get_array(), 100 * confusion)
    assert [t.get_text() for t in matrix.texts] == ["75", "25", "10", "90"]
    degrees, tips = figures["evaluate_fingers"].axes
    mean = 0.25 * 1.0 + 0.75 * 3.0  # over frames
    assert [b.get_width() for b in degrees.patches[:6]] == pytest.approx(np.arange(1, 7) + mean)
    assert [b.get_width() for b in tips.patches[6:]] == pytest.approx(10.0 * np.arange(1, 7))
    assert len(degrees.get_lines()[0].get_xydata()) == 2 * len(METHODS)
    assert tuple(evaluating.figures([], errors)) == ("evaluate_fingers",)


# splice


def test_path_band_and_pins(spliced: Spliced, clips: tuple[Clip, Clip]) -> None:
    body, hands = clips
    settings = SpliceSettings()
    found = [usdhand.find_hands(clip) for clip in clips]
    markers = [
        hand_markers(clip, h, "left", settings.fps) for clip, h in zip(clips, found, strict=True)
    ]
    alignment = spliced.hands["left"]
    figure = splicing.path("left", alignment, *markers, settings)
    panel = figure.axes[0]
    drawn = lines(panel)
    assert np.isin(drawn["path"], alignment.warp).all()
    low = drawn["band"]
    inside = np.interp(drawn["path"][:, 0], *low.T) <= drawn["path"][:, 1] + 0.05
    assert inside.all()
    assert panel.get_xlim() == pytest.approx((0.0, 6.0), abs=0.05)
    assert panel.get_ylim() == pytest.approx((0.0, hands.duration), abs=0.05)
    [pins] = [c for c in panel.containers if c.get_label() == "pin"]
    assert pins.lines[0].get_xydata().tolist() == [[p.body, p.hand] for p in alignment.pins]
    assert len(splice_result(spliced)["hands"]["left"]["warp"]) == len(body)


def test_cost_grid_is_the_mean_of_the_methods_own_costs(
    spliced: Spliced, clips: tuple[Clip, Clip]
) -> None:
    from usdhand.dtw.phases import sign_costs

    settings, alignment = SpliceSettings(), spliced.hands["left"]
    ours, theirs = (
        hand_markers(clip, usdhand.find_hands(clip), "left", settings.fps) for clip in clips
    )
    shown = splicing.common_part(alignment)
    rows, columns, costs = splicing.cost_grid(ours, theirs, alignment, settings, shown)
    warp = np.interp(np.arange(len(ours)) / ours.fps, *alignment.warp.T) * theirs.fps
    turned = facing(ours, -steady_turns(ours, theirs, warp))
    signs = [
        derivative_signs(m, settings.rule(settings.smoothing), np.zeros(1))
        for m in (turned, theirs)
    ]
    for i, j in ((3, 4), (100, 120), (240, 200)):
        first, last = (np.rint(rows[i : i + 2] * ours.fps + 0.5)).astype(int)
        left, right = (np.rint(columns[j : j + 2] * theirs.fps + 0.5)).astype(int)
        block = [
            sign_costs(signs[0][0][:, r : r + 1], signs[1][0], np.array([c]))[0]
            for r in range(first, last)
            for c in range(left, right)
        ]
        assert costs[i, j] == pytest.approx(np.mean(block))
    along = np.interp((rows[1:] + rows[:-1]) / 2, *alignment.warp.T)
    at = np.clip(np.searchsorted(columns, along) - 1, 0, costs.shape[1] - 1)
    assert costs[np.arange(len(costs)), at].mean() < 0.5 * costs.mean()


def test_hand_curves_meet_after_alignment(spliced: Spliced, clips: tuple[Clip, Clip]) -> None:
    found = [usdhand.find_hands(clip) for clip in clips]
    figures = splicing.figures(spliced, *clips, *found, SpliceSettings())
    assert set(figures) == set(splicing.NAMES)
    axes = figures["splice_curves_left"].axes
    bend_before, bend_after = (lines(panel) for panel in axes[2:4])

    def apart(panel: dict[str, Any]) -> float:
        body, hand = panel["body"], panel["hand clip"]
        return float(np.abs(np.interp(body[:, 0], *hand.T) - body[:, 1]).mean())

    assert apart(bend_after) < 0.25 * apart(bend_before)
    name = axes[4].get_ylabel().partition(",")[0]
    seconds, taken = lines(axes[5])["hand clip"].T
    own = found[0].encode(spliced.clip).select([name]).values[:, 0]
    own_times = np.arange(len(own)) / spliced.clip.fps
    assert taken == pytest.approx(np.interp(seconds, own_times, own))
