"""Long and still clips are spliced, or refused at once and in words."""

from __future__ import annotations

import numpy as np
import pytest
from builders.long_clips import followed_by, long_clip, still_clip

from usdhand import find_hands
from usdhand.errors import InputError
from usdhand.motion import Clip
from usdhand.motion.resample import interpolate
from usdhand.progress import Steps
from usdhand.splice.long import align_long, is_long, long_steps
from usdhand.splice.markers import Markers
from usdhand.splice.method import Spliced, splice
from usdhand.splice.phases import smoothed
from usdhand.splice.settings import Pin, SpliceSettings

HOUR = 3600.0
NARROW = SpliceSettings(band=(0.01, 0.005))


def spliced(body: Clip, hands: Clip, settings: SpliceSettings | None = None) -> Spliced:
    return splice(body, hands, find_hands(body), find_hands(hands), settings)


def moving(frames: int, fastest: float) -> np.ndarray:
    """Seconds of a hand's motion, at a speed that wanders."""
    noise = np.random.default_rng(5).normal(size=frames)
    speed = 2.0 ** np.clip(40.0 * smoothed(noise, 120.0), -fastest, fastest)
    return np.asarray(np.cumsum(speed) / 60.0)


def wandering_hand(seconds: np.ndarray) -> Markers:
    """Markers of a hand of which no two minutes are alike."""
    random = np.random.default_rng(3)
    count = int(seconds[-1] * 10) + 2
    curve = 400.0 * smoothed(random.normal(size=(count, 4)), 3.0)
    at = interpolate(smoothed(curve, 1.0), seconds * 10.0)
    bend = at[:, 3:] / 100.0
    forearm = np.concatenate([np.sin(bend), 0 * bend, np.cos(bend)], axis=1)
    around = np.array([[4.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [0.0, 0.0, -18.0], [0.0, 0.0, 13.0]])
    wrist = 0.2 * at[:, :3]
    return Markers(wrist[:, None] + around, wrist, forearm, None, 60.0, "shoulder")


def test_half_an_hour_is_aligned_from_coarse_to_fine() -> None:
    """In parts that go over into each other; a pin in the middle holds."""
    frames = round(HOUR / 2 * 60)
    shows = moving(frames, 0.5)
    body, hand = wandering_hand(shows), wandering_hand(np.arange(round(shows[-1] * 60)) / 60.0)
    settings, times = SpliceSettings(), np.arange(frames) / 60.0
    assert is_long(body, hand, settings, ())
    pin = Pin(900.0, float(shows[900 * 60]))
    steps: list[tuple[int, int]] = []
    most = Steps(
        long_steps(1, body, hand, settings, (pin,)), lambda done, total: steps.append((done, total))
    )
    [found] = align_long([(body, hand)], settings, (pin,), times, most)
    off = np.abs(found.warp - shows)
    assert np.median(off) < 0.01
    assert np.quantile(off[600:-600], 0.999) < 0.1
    assert np.interp(pin.body, times, found.warp) == pytest.approx(pin.hand, abs=0.005)
    assert (np.diff(found.warp) >= 0).all()
    assert found.deviation is not None
    assert max(done for done, _ in steps) <= steps[0][1]


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
