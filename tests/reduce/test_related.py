"""Channels follow those of their own hand, unless both hands move alike in all takes."""

from __future__ import annotations

import numpy as np
import pytest

from usdhand.motion.rotations import Array
from usdhand.reduce.moments import Moments
from usdhand.reduce.related import related_channels

NAMES = tuple(f"{side}{i}" for side in ("le", "ri") for i in range(12))


def folds(sources: Array, count: int = 4, frames: int = 80) -> list[Moments]:
    """Takes whose channels mix independent sources by (sources, 24) and have noise."""
    random = np.random.default_rng(7)
    return [
        Moments.of(
            random.normal(size=(frames, len(sources))) @ sources
            + 0.3 * random.normal(size=(frames, len(NAMES)))
        )
        for _ in range(count)
    ]


def mixing(own: int, common: int) -> Array:
    """Sources of each hand's own, and of both."""
    random = np.random.default_rng(1)
    rows = np.zeros((2 * own + common, 24))
    rows[:own, :12] = 5.0 * random.normal(size=(own, 12))
    rows[own : 2 * own, 12:] = 5.0 * random.normal(size=(own, 12))
    rows[2 * own :] = 5.0 * random.normal(size=(common, 24))
    return rows


SAME = np.kron(np.eye(2), np.ones((12, 12)))


def test_hands_that_move_apart_follow_their_own() -> None:
    assert (related_channels(NAMES, folds(mixing(own=5, common=0))) == SAME).all()


def test_hands_that_always_move_alike_follow_both() -> None:
    assert (related_channels(NAMES, folds(mixing(own=0, common=6))) == 1.0).all()


def test_what_hands_have_in_common_in_each_take_otherwise_is_not_followed() -> None:
    """In every take alone the hands move alike, each time in another way."""
    parts = [folds(mixing(0, 4) * np.where(np.arange(24) < 12, 1.0, s), 1)[0] for s in (1, -1) * 3]
    assert (related_channels(NAMES, parts) == SAME).all()


@pytest.mark.parametrize("names", [NAMES, tuple(f"le{i}" for i in range(24))])
def test_one_take_or_one_hand_has_no_such_choice(names: tuple[str, ...]) -> None:
    parts = folds(mixing(own=5, common=0))
    assert (related_channels(names, parts[:1]) == 1.0).all()
    if names != NAMES:
        assert (related_channels(names, parts) == 1.0).all()
