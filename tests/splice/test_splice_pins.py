"""Pins on pairs whose true alignment is known: they hold, and little else changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.clips import frames_of
from builders.known_pairs import known_pairs
from builders.spliced_pairs import VISIBLE_S, sample, spliced
from conftest import REPOSITORY, shared_data

from usdhand import find_hands, read_clip
from usdhand.anatomy import SIDES, Side
from usdhand.splice.markers import Markers
from usdhand.splice.method import splice
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.timing import align
from usdhand.verbs.splice import splice_hands

SAMPLES = REPOSITORY / "samples"


def test_a_pin_moves_the_warp_only_around_it() -> None:
    pair = sample()
    free = spliced(pair).hands["right"].warp
    at = 340
    pins = (Pin(free[at, 0], free[at, 1] + 0.2), Pin(*free[250]), Pin(*free[430]))
    pinned = spliced(pair, SpliceSettings(pins=pins)).hands["right"].warp
    assert abs(pinned[at, 1] - free[at, 1] - 0.2) < 1e-6
    apart = np.abs(pinned[:, 1] - free[:, 1]) * pair.moving("right")
    assert apart[:250].max() < 0.03
    assert apart[431:].max() < 0.03
    loose = (replace(pins[0], tolerance=0.15), *pins[1:])
    held = spliced(pair, SpliceSettings(pins=loose)).hands["right"].warp
    assert 0.05 - 1e-6 <= abs(held[at, 1] - free[at, 1]) <= 0.35
    one_hand = SpliceSettings(pins=(replace(pins[0], side="right"),))
    hands = spliced(pair, one_hand).hands
    assert np.array_equal(hands["left"].warp, spliced(pair).hands["left"].warp)


@pytest.mark.parametrize(
    ("pins", "near"),
    [
        (["300:300", "301:303"], 3.0),
        (["300:300", "301:306"], 3.0),
        (["300:306"], 3.0),
        (["300:300", "310:300"], 3.0),
        (["300:300", "301:361", "302:362"], 1.0),
    ],
)
def test_pins_that_change_the_speed_do_not_swing(pins: list[str], near: float) -> None:
    """Both clips are the same take, all is right but the pins: before them little may move."""
    folder = SAMPLES / "conversations"
    body, hands = read_clip(folder / "talk_01_body.usdc"), read_clip(folder / "talk_01_full.usdc")
    found = splice_hands(body, hands, pins=pins, sides=["right"]).hands["right"]
    off = found.warp[:, 1] * hands.fps - np.arange(len(body))
    assert np.abs(off[[279, 287, 290]]).max() < near
    assert np.abs(off[[99, 399, 499]]).max() < 0.5


def test_true_pins_do_no_harm() -> None:
    pair = sample()
    at = np.linspace(0, len(pair.body) - 1, 10).astype(int)[1:-1]
    pins = tuple(Pin(t / pair.body.fps, pair.truth[t]) for t in at)
    free, pinned = spliced(pair).hands, spliced(pair, SpliceSettings(pins=pins)).hands
    assert set(free) == set(SIDES)
    for side, moving in ((s, pair.moving(s)) for s in free):
        before, after = (np.abs(pair.error(h[side].warp[:, 1])[moving]) for h in (free, pinned))
        assert np.median(after) < np.median(before) + 0.0005
        assert after.max() < max(before.max() + 0.01, 0.05)


@pytest.mark.parametrize("count", [2, 30, 120])
def test_true_pins_around_frames_that_were_held(count: int) -> None:
    """The hand clip shows its frames before 300 twice; pins say so."""
    folder = SAMPLES / "conversations"
    body, full = read_clip(folder / "talk_01_body.usdc"), read_clip(folder / "talk_01_full.usdc")
    at = np.concatenate([np.arange(300), np.arange(300 - count, len(full))])
    longer = frames_of(full, at)
    pins = ["300:300", f"301:{301 + count}"]
    true = np.arange(len(body)) + np.where(np.arange(len(body)) < 300, 0, count)
    found = splice_hands(body, longer, pins=pins).hands
    assert set(found) == set(SIDES)
    for alignment in found.values():
        off = np.abs(alignment.warp[:, 1] * full.fps - true) / full.fps
        assert off.max() < VISIBLE_S


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("body", "hands", "taken_from"), [(3, 6, "right"), (30, 9, None), (5, 33, None)]
)
def test_three_pins_on_another_sign_act_between_them_only(
    body: int, hands: int, taken_from: Side | None
) -> None:
    """The hand clip shows another sign: much is ambiguous, and pins still act locally."""
    files = [files[0] for files in known_pairs(shared_data("studiogalt", "full"))]
    a, b = read_clip(files[body]), read_clip(files[hands])
    found = find_hands(a), find_hands(b)
    free = splice(a, b, *found).hands
    warp = free["right"].warp
    first, at, last = (round(share * len(a)) for share in (0.35, 0.5, 0.65))
    moved = min(warp[at, 1] + 0.15, warp[last, 1] - 0.02)
    pins = (Pin(*warp[first]), Pin(warp[at, 0], moved), Pin(*warp[last]))
    pins = tuple(replace(pin, side="right") for pin in pins)
    pinned = splice(a, b, *found, SpliceSettings(pins=pins)).hands
    assert pinned["left"].taken_from == taken_from
    if taken_from is None:
        assert np.array_equal(pinned["left"].warp, free["left"].warp)
    apart = np.abs(pinned["right"].warp[:, 1] - warp[:, 1])
    assert pinned["right"].warp[at, 1] == pytest.approx(moved, abs=1e-6)
    assert max(apart[first], apart[last]) < 1e-6
    assert max(apart[:first].max(), apart[last:].max()) < 2.5 / a.fps


def test_every_frame_pinned_is_full_control() -> None:
    pair = sample()
    pins = tuple(
        Pin(t, s)
        for t, s in zip(np.arange(len(pair.body)) / pair.body.fps, pair.truth, strict=True)
    )
    end = pair.hands.duration
    pins = tuple(replace(p, hand=min(p.hand, end)) for p in pins)
    found = spliced(pair, SpliceSettings(pins=pins)).hands
    assert set(found) == set(SIDES)
    for alignment in found.values():
        assert np.abs(alignment.warp[:, 1] - [p.hand for p in pins]).max() < 1e-9


def test_counting_every_left_step() -> None:
    """The paper's example: the hand counts to three while the body waves six times.

    Without pins, every count is spread over two waves. Pins let it count every second wave: there
    the count has the timing of the wave, and waits for the other one.
    """
    body, hands = waves(6), waves(3)
    times = np.arange(len(body)) / 60.0
    pins = [Pin(t, s) for k in range(3) for t, s in ((2.0 * k, k), (2.0 * k + 1.0, k + 1.0))][1:]
    free, pinned = (align([(body, hands)], SpliceSettings(), p, times)[0].warp for p in ((), pins))
    for wave in range(6):
        inside = (times > wave + 0.2) & (times < wave + 0.8)
        wanted = times[inside] - (wave + 1) // 2 if wave % 2 == 0 else np.full(36, wave // 2 + 1.0)
        wanted = wanted[: inside.sum()]
        off = np.abs(pinned[inside] - wanted)
        assert off.max() < 0.12, wave
    middle = np.interp(2.5, times, free)
    assert abs(middle - np.interp(2.5, times, pinned)) > 0.1


def waves(count: int) -> Markers:
    """Markers of a hand that rises and comes down again once a second, resting in between."""
    t = np.arange(60 * count + 1) / 60.0
    phase = np.clip((t % 1.0 - 0.2) / 0.6, 0.0, 1.0)
    up = 20.0 * np.sin(np.pi * phase) ** 2
    wrist = np.stack([10.0 * np.sin(2 * np.pi * phase), up, 0.3 * up], axis=1)
    around = np.array([[3.0, 0.0, 0.0], [-3.0, 0.0, 0.0], [0.0, 0.0, -8.0], [0.0, 0.0, 8.0]])
    forearm = np.tile([0.0, 0.0, 1.0], (len(t), 1))
    return Markers(wrist[:, None] + around, wrist, forearm, None, 60.0, "shoulder")


@pytest.mark.parametrize("off", [0.4, -0.3])
def test_a_pin_that_contradicts_the_motion_is_said_and_does_not_reach_far(off: float) -> None:
    pair = sample()
    free = spliced(pair).hands["right"].warp
    moving = pair.moving("right")
    at = int(np.flatnonzero(moving)[moving.sum() // 2])
    pins = (Pin(free[at, 0], free[at, 1] + off, side="right", name="odd"),)
    found = spliced(pair, SpliceSettings(pins=pins))
    [note] = [p for p in found.problems if p.code == "pin-contradicts"]
    assert "odd" in note.message
    assert f"{abs(off):.2f} s" in note.message
    apart = np.abs(found.hands["right"].warp[:, 1] - free[:, 1])
    assert abs(apart[at] - abs(off)) < 1e-6
    assert apart[np.abs(free[:, 0] - free[at, 0]) >= 1.0].max() < 2.0 / pair.body.fps


def test_a_true_pin_is_no_contradiction() -> None:
    pair = sample()
    pin = Pin(340 / pair.body.fps, float(pair.truth[340]))
    found = spliced(pair, SpliceSettings(pins=(pin,)))
    assert not [p for p in found.problems if p.code == "pin-contradicts"]
