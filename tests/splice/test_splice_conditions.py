"""Splice under conditions of studios: rests, pauses and dropouts of one clip, hands out of step."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from builders.splice_conditions import CONDITIONS, ConditionPair, condition_pair
from builders.spliced_pairs import VISIBLE_S
from conftest import REPOSITORY, shared_data

from usdhand.splice.method import Spliced, splice

NAMED = {condition.name: condition for condition in CONDITIONS}


@cache
def sample(name: str) -> tuple[ConditionPair, Spliced]:
    file = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
    return spliced(condition_pair(NAMED[name], file, 7))


def spliced(pair: ConditionPair) -> tuple[ConditionPair, Spliced]:
    return pair, splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)


def errors(pair: ConditionPair, found: Spliced) -> np.ndarray:
    """Seconds, absolute, at moving frames of all hands."""
    return np.abs(
        np.concatenate(
            [pair.error(s, a.warp[:, 1])[pair.moving[s]] for s, a in found.hands.items()]
        )
    )


@pytest.mark.parametrize("name", list(NAMED))
def test_a_sample_under_every_condition(name: str) -> None:
    found = errors(*sample(name))
    assert np.median(found) < 0.025
    assert np.percentile(found, 95) < VISIBLE_S


def test_hands_have_one_timing_only_where_they_are_in_step() -> None:
    _, together = sample("half arms")
    _, apart = sample("hands 80 ms out of step")
    assert all(a.shared for a in together.hands.values())
    assert not any(a.shared for a in apart.hands.values())


def test_dropouts_are_said_and_fingers_do_not_jump() -> None:
    pair, found = sample("half arms, three frozen gaps")
    notes = [p for p in found.problems if p.code == "frozen-frames"]
    assert len(notes) == 2
    assert all("hand clip" in n.message for n in notes)
    for alignment in found.hands.values():
        assert alignment.frozen[0] == ()
        assert 2 <= len(alignment.frozen[1]) <= 3

    def largest(values: np.ndarray) -> float:
        return float(np.abs(np.diff(values, n=2, axis=0)).max())

    ours = pair.body_hands.encode(found.clip)
    true = pair.body_hands.encode(pair.body).select(ours.names)
    assert largest(ours.values) < 1.3 * largest(true.values)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "most"),
    [("half arms, rest at the body's ends", 0.01), ("half arms, pause only in the body", 0.01)],
)
def test_real_takes(name: str, most: float) -> None:
    files = sorted(shared_data("studiogalt", "full").glob("*.usdc"))[2::15]
    found = [errors(*spliced(condition_pair(NAMED[name], f, 40 + k))) for k, f in enumerate(files)]
    assert np.mean(np.concatenate(found) > VISIBLE_S) <= most
