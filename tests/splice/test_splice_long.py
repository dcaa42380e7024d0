"""Long and still clips are spliced, or refused at once and in words."""

from __future__ import annotations

import numpy as np
import pytest
from builders.cost import at_most
from builders.long_clips import followed_by, long_clip, still_clip

from usdhand import find_hands
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.splice.method import Spliced, splice
from usdhand.splice.settings import Pin, SpliceSettings

HOUR = 3600.0
NARROW = SpliceSettings(band=(0.01, 0.005))


def spliced(body: Clip, hands: Clip, settings: SpliceSettings | None = None) -> Spliced:
    return splice(body, hands, find_hands(body), find_hands(hands), settings)


def test_an_hour_is_refused_before_any_work() -> None:
    """The way back alone would take gigabytes."""
    clip = long_clip(HOUR)
    hands = find_hands(clip)
    with at_most(1.0), pytest.raises(UsageError, match="narrower --band"):
        splice(clip, clip, hands, hands)


@pytest.mark.parametrize("settings", [None, NARROW], ids=["default", "narrow"])
def test_stillness_has_no_timing(settings: SpliceSettings | None) -> None:
    clip = still_clip(60.0 if settings is None else HOUR)
    with pytest.raises(InputError, match="No hand moves"):
        spliced(clip, clip, settings)


def test_pins_time_an_hour_of_stillness() -> None:
    body, hands = still_clip(HOUR), still_clip(HOUR / 2)
    ends = (Pin(0.0, 0.0), Pin(HOUR, HOUR / 2))
    found = spliced(body, hands, SpliceSettings(band=(0.01, 0.005), pins=ends))
    for alignment in found.hands.values():
        assert np.allclose(alignment.warp[:, 1], alignment.warp[:, 0] / 2)


def test_a_quarter_of_an_hour_is_aligned() -> None:
    """Twice as fast in frames, the same in seconds."""
    found = spliced(long_clip(HOUR / 4), long_clip(HOUR / 4, fps=12.0), NARROW)
    for alignment in found.hands.values():
        off = alignment.warp[:, 1] - alignment.warp[:, 0]
        assert np.quantile(np.abs(off), 0.95) < 0.1


def test_a_long_rest_between_gestures_is_passed() -> None:
    parts = long_clip(20, seed=1), still_clip(300), long_clip(20, seed=2)
    clip = followed_by(*parts)
    found = spliced(clip, clip, SpliceSettings(band=(0.05, 0.02)))
    for alignment in found.hands.values():
        moving = (alignment.warp[:, 0] < 19) | (alignment.warp[:, 0] > 321)
        off = alignment.warp[moving, 1] - alignment.warp[moving, 0]
        assert np.quantile(np.abs(off), 0.95) < 0.1
