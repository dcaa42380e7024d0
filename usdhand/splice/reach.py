"""How far pins reach: what the motion says without them stays where nothing speaks against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.splice.refine import MarkerPair, row_differences
from usdhand.splice.settings import Align, Pin
from usdhand.splice.warps import monotone, through_pins

# A pin that is further than this from the motion's own timing, in seconds, says that clips begin,
# wait or leave something out as motion does not tell: then all of the timing comes from pins.
LOCAL_S = 0.5
# Seconds from a pin at which it moves the timing by no more than `FAR_S`, unless motion agrees.
REACH_S, FAR_S = 0.4, 0.03
# Motion agrees with a pin if hands differ by less than this share of what they do without it.
SUPPORT = 0.95
# A pin contradicts the motion if it is as many seconds from its timing, and hands within a second
# of it then differ by as many times what they do without.
CONTRADICTS_S, CONTRADICTS_FACTOR = 0.1, 1.1
AROUND_S = 1.0


@dataclass(frozen=True)
class Contradiction:
    """A pin that motion speaks against.

    Attributes
    ----------
    off : seconds of the hand clip by which it is from the timing without pins
    start, end : seconds of the body between which it moves the timing by over a frame
    """

    pin: Pin
    off: float
    start: float
    end: float


def offsets(warp: Array, times: Array, pins: Sequence[Pin]) -> Array:
    """(pins,) seconds by which pins are from a timing, less their tolerances."""
    own = np.interp([p.body for p in pins], times, warp)
    off = np.abs(np.array([p.hand for p in pins]) - own)
    return np.asarray(np.maximum(off - [p.tolerance for p in pins], 0.0))


def is_local(warp: Array, times: Array, pins: Sequence[Pin]) -> bool:
    """Whether pins only correct a timing, which is otherwise right."""
    return bool(pins) and bool((offsets(warp, times, pins) <= LOCAL_S).all())


def bounded(
    pair: MarkerPair, free: Array, pinned: Array, times: Array, pins: Sequence[Pin], align: Align
) -> Array:
    """HandTiming through pins (times,) that is the free one away from them, unless motion agrees.

    Where a pin is as the timing without pins was, nothing on its other side has to move.

    Parameters
    ----------
    free, pinned : seconds of the hand clip without pins and with them
    """
    off = offsets(free, times, pins)
    away = np.abs(times[:, None] - [p.body for p in pins])
    most = np.max(off * np.maximum(1.0 - away / REACH_S, 0.0), axis=1) + FAR_S
    beyond = np.abs(pinned - free) > most
    with_pins, without = (_differences(pair, w, times, align) for w in (pinned, free))
    after = np.searchsorted([p.body for p in pins], times)  # pins at both sides of a frame
    wrong = np.concatenate([[False], off > FAR_S, [False]])
    for first, last in _runs(beyond & (wrong[after] | wrong[after + 1])):
        if with_pins[first:last].sum() < SUPPORT * without[first:last].sum():
            most[first:last] = np.inf
    limited = monotone(np.clip(pinned, free - most, free + most))
    return through_pins(limited, times, pins)


def contradictions(
    pair: MarkerPair, free: Array, pinned: Array, times: Array, pins: Sequence[Pin], align: Align
) -> tuple[Contradiction, ...]:
    """Pins that motion speaks against."""
    off = offsets(free, times, pins)
    with_pins, without = (_differences(pair, w, times, align) for w in (pinned, free))
    moved = np.abs(pinned - free) > times[1]
    found = []
    for pin, by in zip(pins, off, strict=True):
        near = np.abs(times - pin.body) < AROUND_S
        worse = with_pins[near].sum() > CONTRADICTS_FACTOR * without[near].sum()
        if by > CONTRADICTS_S and worse:
            at = int(np.argmin(np.abs(times - pin.body)))
            first, last = next(((a, b) for a, b in _runs(moved) if a <= at < b), (at, at + 1))
            found.append(Contradiction(pin, float(by), float(times[first]), float(times[last - 1])))
    return tuple(found)


def _differences(pair: MarkerPair, warp: Array, times: Array, align: Align) -> Array:
    """(times,) how much hands differ along a timing."""
    body, hand = pair
    own = np.arange(len(body)) / body.fps
    rows = np.interp(own, times, warp) * hand.fps
    return np.interp(times, own, row_differences(body, hand, rows, align))


def _runs(marked: Array) -> list[tuple[int, int]]:
    """First frames of runs, and the frames after them."""
    steps = np.diff(np.concatenate([[0], marked.astype(np.int8), [0]]))
    return [
        (int(a), int(b))
        for a, b in zip(*(np.flatnonzero(steps == s) for s in (1, -1)), strict=True)
    ]
