"""Splice says where it is unsure, and pass 2 gives way where it does not hold."""

from __future__ import annotations

import numpy as np
import pytest
from builders.moving_markers import moving_hand
from builders.splice_conditions import CONDITIONS, condition_pair
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st

from usdhand.dtw.banded import inverse_diagonal
from usdhand.report.splice import splice_result, summary
from usdhand.splice.confidence import doubts, wanted_pins
from usdhand.splice.markers import Markers
from usdhand.splice.method import splice
from usdhand.splice.quality import Phase
from usdhand.splice.settings import SpliceSettings
from usdhand.splice.trust import trust
from usdhand.splice.warps import deviations

TALK = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
NAMED = {condition.name: condition for condition in CONDITIONS}


@given(st.integers(3, 40), st.integers(0, 2**32 - 1))
def test_variances_are_those_of_the_inverse(n: int, seed: int) -> None:
    weights = np.random.default_rng(seed).uniform(0.01, 2.0, n)
    bend = np.diff(np.eye(n), n=2, axis=0)
    matrix = np.diag(weights) + 7.0 * bend.T @ bend
    inverse = np.diag(np.linalg.inv(matrix))
    assert np.allclose(deviations(weights, 7.0), np.sqrt(inverse))
    first, second = np.append(np.diag(matrix, 1), 0.0), np.append(np.diag(matrix, 2), [0.0, 0.0])
    assert np.allclose(inverse_diagonal(np.diag(matrix).copy(), first, second), inverse)


def test_doubts_are_where_it_moves_and_what_is_near_is_one() -> None:
    times, spread = np.arange(300) / 60.0, np.full(300, 0.01)
    spread[[30, 40, 100, 200]] = 0.08, 0.1, 0.2, 0.15
    phases = [Phase(0.0, 2.5, 0.9), Phase(2.5, 4.0, None), Phase(4.0, 5.0, 0.8)]
    found = doubts(times, spread, phases)
    assert [(round(d.start * 60), round(d.end * 60)) for d in found] == [(30, 40), (100, 100)]
    assert [d.off for d in found] == pytest.approx([0.2, 0.4])
    wanted = wanted_pins(times, spread, phases)
    assert [round(p.start * 60) for p in wanted] == [100, 40]
    assert doubts(times, np.full(300, 0.01), phases) == ()


def test_doubt_is_of_the_size_of_the_error() -> None:
    """Most frames are off by less than what is said; little more is said than needed."""
    errors, said = [], []
    for name in ("IK, half about the shoulder", "slow noise of 5 mm", "pause only in the body"):
        pair = condition_pair(NAMED[name], TALK, 7)
        found = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
        for side, alignment in found.hands.items():
            assert alignment.deviation is not None
            errors.append(np.abs(pair.error(side, alignment.warp[:, 1]))[pair.moving[side]])
            said.append(alignment.deviation[pair.moving[side]])
    share = np.concatenate(errors) / np.concatenate(said)
    assert np.mean(share < 2.0) > 0.9
    assert np.median(share) > 0.2


def test_what_is_uncertain_is_printed_and_pins_are_proposed_in_order() -> None:
    pair = condition_pair(NAMED["slow noise of 5 mm"], TALK, 7)
    body, hands = pair.body, pair.hands
    noise = np.random.default_rng(1).normal(scale=0.05, size=hands.rotations.shape)
    arms = [
        j
        for h in pair.hand_hands.character.hands.values()
        for j in (h.shoulder, h.elbow, h.wrist)
        if j is not None
    ]
    rotations = hands.rotations.copy()
    half = slice(len(hands) // 3, len(hands) // 2)
    rotations[half][:, arms] += np.cumsum(noise[half][:, arms], axis=0)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    found = splice(body, hands.with_rotations(rotations), pair.body_hands, pair.hand_hands)
    result = splice_result(found)
    wanted = result["pins_wanted"]
    assert wanted
    offs = [p["off"] for p in wanted]
    assert offs == sorted(offs, reverse=True)
    text = summary(result | {"output": None}, verbose=False)
    assert "off by up to" in text
    assert "pins would help most" in text
    for hand in result["hands"].values():
        assert len(hand["deviation"]) == len(body)


def test_pass_2_gives_way_where_kinds_of_evidence_contradict_each_other() -> None:
    rows, freedom = np.arange(400.0), np.full(400, 45.0)
    body = moving_hand((rows + 3.0) / 60.0)
    agreed = trust([(body, moving_hand(rows / 60.0))], [rows], freedom, "local")
    assert agreed.min() > 0.9
    true, other = moving_hand(rows / 60.0), moving_hand((rows + 9.0) / 60.0)
    odd = Markers(
        true.positions, true.wrist, other.forearm, None, 60.0, "shoulder"
    )  # bends say the opposite of paths
    assert trust([(body, odd)], [rows], freedom, "local").max() < 0.5


def test_without_pass_2_nothing_is_said() -> None:
    pair = condition_pair(NAMED["IK, half about the shoulder"], TALK, 7)
    found = splice(
        pair.body, pair.hands, pair.body_hands, pair.hand_hands, SpliceSettings(tether=0.0)
    )
    for alignment in found.hands.values():
        assert alignment.deviation is None
        assert alignment.doubts == alignment.wanted_pins == ()
