"""Clips of which either begins earlier or ends later: what they share is found or asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.clips import frames_of
from builders.known_pairs import Pair, known_pair
from builders.moving_markers import moving_hand
from builders.splice_conditions import CONDITIONS, condition_pair, repeated
from conftest import REPOSITORY
from hypothesis import given, settings
from hypothesis import strategies as st

from usdhand import find_hands, read_clip
from usdhand.dtw.places import NEVER, free_ended
from usdhand.errors import UsageError
from usdhand.splice.locate import locate
from usdhand.splice.method import Spliced, splice

SAMPLES = REPOSITORY / "samples"
TALK = SAMPLES / "conversations" / "talk_01_full.usdc"


@given(st.integers(2, 9), st.integers(2, 9), st.integers(0, 2**32 - 1), st.floats(0.05, 2.0))
@settings(max_examples=60, deadline=None)
def test_paths_are_the_cheapest(rows: int, columns: int, seed: int, unlike: float) -> None:
    random = np.random.default_rng(seed)
    a, b = (random.normal(size=(n, 2)).astype(np.float32) for n in (rows, columns))
    rests = [np.where(random.random(n) < 0.3, 0.1 * unlike, NEVER) for n in (rows, columns)]
    alone = [unlike * random.random(n) for n in (rows, columns)]
    starts, costs = free_ended(a, b, *rests, *alone)
    local = np.sum((a[:, None].astype(float) - b[None]) ** 2, axis=-1)
    total = np.full((rows, columns), np.inf)
    for i in range(rows):
        for j in range(columns):
            before = alone[0][:i].sum() + alone[1][:j].sum()
            ways = [before + local[i, j]] if i == 0 or j == 0 else []
            if i > 0 and j > 0:
                ways.append(total[i - 1, j - 1] + local[i, j])
            if i > 1 and j > 0:
                ways.append(total[i - 2, j - 1] + 0.75 * (local[i - 1, j] + local[i, j]))
            if i > 0 and j > 1:
                ways.append(total[i - 1, j - 2] + 0.75 * (local[i, j - 1] + local[i, j]))
            if i > 0:
                ways.append(total[i - 1, j] + rests[0][i])
            if j > 0:
                ways.append(total[i, j - 1] + rests[1][j])
            total[i, j] = min(ways, default=np.inf)
    right = total[:, -1] + [alone[0][i + 1 :].sum() for i in range(rows)]
    below = total[-1] + [alone[1][j + 1 :].sum() for j in range(columns)]
    expected = np.concatenate([right, below])
    reached = expected < NEVER / 2
    assert np.allclose(costs[reached], expected[reached], rtol=1e-4)
    assert (starts[reached] == 0).any(axis=1).all()


def cut(pair: Pair, body: tuple[float, float], hand: tuple[float, float]) -> Pair:
    """Shares of both clips."""
    ours, theirs = (
        frames_of(c, slice(round(part[0] * len(c)), round(part[1] * len(c))))
        for c, part in ((pair.body, body), (pair.hands, hand))
    )
    return replace(pair, body=ours, hands=theirs)


def errors(whole: Pair, pair: Pair, found: Spliced, body: float, hand: float) -> np.ndarray:
    """Seconds, absolute, at moving frames of the body that the hand clip shows.

    ``body`` and ``hand`` are shares at which the clips of the pair begin in the whole.
    """
    times = np.arange(len(whole.body)) / whole.body.fps
    first = round(body * len(whole.body))
    begins = round(hand * len(whole.hands)) / whole.hands.fps
    own = times[first : first + len(pair.body)]
    true = np.interp(own, times, whole.truth) - begins
    there = (true >= 0) & (true <= pair.hands.duration)
    off = []
    for side, alignment in found.hands.items():
        shown = np.interp(alignment.warp[:, 1] + begins, whole.truth, times)
        moving = whole.moving(side)[first : first + len(pair.body)]
        off.append(np.abs(shown - own)[moving & there])
    return np.concatenate(off)


@pytest.mark.parametrize(
    ("body", "hand"),
    [
        ((0.0, 1.0), (0.3, 0.7)),
        ((0.25, 0.75), (0.0, 1.0)),
        ((0.0, 0.7), (0.4, 1.0)),
        ((0.35, 1.0), (0.0, 0.65)),
    ],
    ids=["part of the body", "begins earlier, ends later", "begins later", "begins earlier"],
)
def test_what_clips_share_is_found(body: tuple[float, float], hand: tuple[float, float]) -> None:
    whole = known_pair(TALK, TALK, 3)
    pair = cut(whole, body, hand)
    found = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
    [note] = [p for p in found.problems if p.code == "found-part"]
    assert "--pin" in note.message
    off = errors(whole, pair, found, body[0], hand[0])
    assert np.median(off) < 0.02
    assert np.mean(off > 0.1) < 0.04


def test_before_and_after_a_part_the_hand_clip_runs_as_fast_as_the_body() -> None:
    whole = known_pair(TALK, TALK, 3)
    pair = cut(whole, (0.0, 1.0), (0.3, 0.7))
    found = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
    seconds = np.arange(len(whole.body)) / whole.body.fps
    ends = np.interp(0.7 * whole.hands.duration, whole.truth, seconds)
    for alignment in found.hands.values():
        times, warp = alignment.warp.T
        reached = times[np.argmax(warp >= pair.hands.duration - 1e-6)]
        assert reached == pytest.approx(ends, abs=1.0)
    assert [p.code for p in found.problems].count("held-pose") >= 2


def test_a_part_that_could_be_anywhere_needs_pins() -> None:
    """A gesture three times, and a hand clip that shows it once."""
    take = read_clip(SAMPLES / "gestures" / "ok_01.usdc")
    hands = find_hands(take)
    body = repeated(take, 4)
    with pytest.raises(UsageError, match=r"but other parts as much: if that is right, give --pin"):
        splice(body, take, hands, hands)


@pytest.mark.parametrize("condition", CONDITIONS[:20], ids=lambda c: c.name)
def test_clips_that_begin_and_end_together_are_left_so(condition: object) -> None:
    pair = condition_pair(condition, TALK, 7)  # type: ignore[arg-type]
    found = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
    assert "found-part" not in [p.code for p in found.problems]


def test_second_performances_are_not_cut() -> None:
    for name in ("attention", "ok", "turn", "wipe"):
        ours, theirs = (read_clip(SAMPLES / "gestures" / f"{name}_0{k}.usdc") for k in (1, 2))
        found = splice(ours, theirs, find_hands(ours), find_hands(theirs))
        assert "found-part" not in [p.code for p in found.problems]


def test_markers_too_short_or_long_are_not_searched() -> None:
    few = moving_hand(np.arange(6) / 60.0)
    assert locate([(few, few)]) is None
    many = moving_hand(np.arange(90_000) / 60.0)
    assert locate([(many, many)]) is None
