"""Pairs whose true alignment is known, of the samples and of real takes, and their splices."""

from __future__ import annotations

from functools import cache

from builders.known_pairs import Pair, known_pair, known_pairs
from conftest import REPOSITORY, shared_data

from usdhand.splice.method import Spliced, splice
from usdhand.splice.settings import SpliceSettings

VISIBLE_S = 0.1  # Joerg, Hodgins & O'Sullivan 2010


@cache
def sample() -> Pair:
    path = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
    return known_pair(path, path, 3)


@cache
def real(index: int) -> Pair:
    folder = shared_data("studiogalt", "full")
    return known_pair(*known_pairs(folder)[index], 1000 + index)


def spliced(pair: Pair, settings: SpliceSettings | None = None) -> Spliced:
    return splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands, settings)
