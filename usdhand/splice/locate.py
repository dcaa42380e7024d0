"""Which part of one clip another one shows: either may begin earlier, and either end later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit
from usdhand.splice.markers import Markers
from usdhand.splice.phases import facing, smoothed
from usdhand.splice.refine import MarkerPair

# Frames a second of what is compared, fewer where clips are so long that there would be too many
# cells; with still fewer, no place is looked for.
RATE, MOST_CELLS, LEAST_RATE = 15.0, 2e7, 4.0
# Smoothing in frames; weight of accelerations, in shares of their RMS.
SMOOTHING, ACCELERATIONS = 1.0, 0.5
# Frames have no partner rather than one that differs by more than this share of what two moments
# usually differ by: at first, and when the turn between the clips is known.
UNLIKE, TURNED_UNLIKE = 0.6, 0.2
ROUNDS = 2
# A frame rests if no wrist is faster than this share of its RMS speed, and then has no partner for
# this share of what others cost.
RESTS, REST = 0.2, 0.3
# Before and after what is shared it has none for slightly less, so that nothing ends with a rest.
LEFT_OUT_REST = 0.29
# Clips do not begin or end together if what is left out then would cost as much more, in shares of
# what it costs alone: a pause that was taken for motion does not.
SPARED = 0.6
# A place is clear if clips differ there by less than this share of what is usual, if no other place
# saves as much, in this share, and if they share at least as many seconds.
DISTINCT, SECOND_BEST, LEAST_SHARED_S = 0.25, 0.6, 0.8
# It has at least this share of the motion of one of them: a rest is found in many places.
LEAST_SHARED_MOTION = 0.35
# Nor is it clear if all of it, with its rests, is shown as many times as fast.
MOST_STRETCH = 2.2
# Another place is this many seconds away, at both ends.
ELSEWHERE_S = 0.75
# A clip goes on where a wrist moves faster than this share of its RMS speed for as many seconds.
MOVES, GOES_ON_S = 0.3, 0.7


@dataclass(frozen=True)
class Place:
    """What two clips share.

    Attributes
    ----------
    body, hand : first and last second of it
    shared : whether they resemble each other there
    clear : whether they do there and nowhere else
    partial : whether a clip moves beyond it
    within : seconds to which the ends are known
    """

    body: tuple[float, float]
    hand: tuple[float, float]
    shared: bool
    clear: bool
    partial: bool
    within: float


def locate(pairs: Sequence[MarkerPair]) -> Place | None:
    """Find what body and hand clip share; None if they are too short, or too long to be searched.

    The cheapest path from any beginning to any end, from half to twice as fast at every moment. At
    first over what neither direction nor size changes: how wrists bend and palms tilt, and the
    speeds up and level in shares of their RMS. Then the turn between the clips is known, and what
    has a direction is compared as well.

    Parameters
    ----------
    pairs : markers of body and hand clip, of every hand
    """
    lengths = [(len(m) - 1) / m.fps for m in pairs[0]]
    rate = min(RATE, float(np.sqrt(MOST_CELLS / max(lengths[0] * lengths[1], 1e-9))))
    if rate < LEAST_RATE or min(lengths) * rate < 3:
        return None
    sides = [[_without_spikes(pair[k]) for pair in pairs] for k in (0, 1)]
    ours, theirs = (_together([_turnless(m, rate) for m in s]) for s in sides)
    rests = [_rests(s, rate, len(c)) for s, c in zip(sides, (ours, theirs), strict=True)]
    found = _placed((ours, theirs), rests, UNLIKE, rate)
    for _ in range(ROUNDS):
        turned = [facing(m, np.full(len(m), -_turn(pairs, found, rate))) for m in sides[0]]
        ours = _together([_turned(m, rate, found.rows) for m in turned])
        theirs = _together([_turned(m, rate, found.columns) for m in sides[1]])
        found = _placed((ours, theirs), rests, TURNED_UNLIKE, rate)
    body, hand = (
        (min(first / rate, end), min(last / rate, end))
        for (first, last), end in zip((found.rows, found.columns), lengths, strict=True)
    )
    shortest = min(body[1] - body[0], hand[1] - hand[0])
    motion = [
        [_motion(m, *part) for m in side] for side, part in zip(sides, (body, hand), strict=True)
    ]
    most = max(min(inside / max(inside + beyond, 1e-9) for inside, beyond in own) for own in motion)
    shared = found.differs < DISTINCT and shortest >= LEAST_SHARED_S and most >= LEAST_SHARED_MOTION
    longest = max(body[1] - body[0], hand[1] - hand[0])
    clear = shared and found.second < SECOND_BEST and longest <= MOST_STRETCH * shortest
    partial = found.spared > SPARED and any(
        beyond > GOES_ON_S for own in motion for _, beyond in own
    )
    return Place(body, hand, shared, clear, partial, 1.0 / rate)


@dataclass(frozen=True)
class _Found:
    """First and last rows and columns that have partners.

    ``differs`` as a share of what two moments usually differ by; ``second``: what the best path
    elsewhere saves, as a share of what this one does; ``spared``: what all of both clips would cost
    more, as a share of what is left out.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    differs: float
    second: float
    spared: float


def _placed(
    curves: tuple[Array, Array], rests: Sequence[NDArray[np.bool_]], unlike: float, rate: float
) -> _Found:
    from usdhand.dtw.places import NEVER, free_ended

    a, b = (c.astype(np.float32) for c in curves)
    random = np.random.default_rng(0)
    rows, columns = (random.integers(0, len(c), 4000) for c in (a, b))
    usual = float(np.median(np.sum((a[rows] - b[columns]) ** 2, axis=1)))
    alone = unlike * usual
    waits = [np.where(r, REST * alone, NEVER) for r in rests]
    unmatched = [np.where(r, LEFT_OUT_REST * alone, alone) for r in rests]
    starts, costs = free_ended(a, b, *waits, *unmatched)
    ends = np.concatenate(
        [
            np.stack([np.arange(len(a)), np.full(len(a), len(b) - 1)], axis=1),
            np.stack([np.full(len(b), len(a) - 1), np.arange(len(b))], axis=1),
        ]
    )
    everything = float(unmatched[0].sum() + unmatched[1].sum())
    saved = everything - costs
    best = int(np.argmax(saved))
    start, end = starts[best], ends[best]
    away = ELSEWHERE_S * rate
    elsewhere = (np.abs(_shift(starts) - _shift(start)) > away) & (
        np.abs(_shift(ends) - _shift(end)) > away
    )
    second = float(saved[elsewhere].max()) if elsewhere.any() else 0.0
    parts = [slice(int(start[k]), int(end[k]) + 1) for k in (0, 1)]
    inside = sum(float(u[p].sum()) for u, p in zip(unmatched, parts, strict=True))
    frames = float((end - start).sum() + 2)
    # What all of both clips costs, beside the best place, for what of them that one leaves out.
    whole = [np.full(len(c), 1e6 * alone) for c in (a, b)]
    together = float(free_ended(a, b, *waits, *whole)[1][len(a) - 1])
    left_out = everything - inside
    return _Found(
        (int(start[0]), int(end[0])),
        (int(start[1]), int(end[1])),
        (inside - float(saved[best])) / frames / max(usual, 1e-12),
        second / max(float(saved[best]), 1e-12),
        (together - float(costs[best])) / max(left_out, 1e-12),
    )


def _shift(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.asarray(cells[..., 0] - cells[..., 1])


def _turn(pairs: Sequence[MarkerPair], found: _Found, rate: float) -> float:
    """Radians about the vertical by which the hand clip turns onto the body, equation (7)."""
    rows, columns = (np.linspace(*ends, 200) / rate for ends in (found.rows, found.columns))
    cosine = sine = 0.0
    for body, hand in pairs:
        p = interpolate(body.positions, rows * body.fps)
        q = interpolate(hand.positions, columns * hand.fps)
        p = p - p.mean(axis=1, keepdims=True)
        cosine += float(np.sum(p[..., 0] * q[..., 0] + p[..., 2] * q[..., 2]))
        sine += float(np.sum(p[..., 0] * q[..., 2] - p[..., 2] * q[..., 0]))
    return float(np.arctan2(sine, cosine))


def _together(curves: Sequence[Array]) -> Array:
    return np.concatenate(curves, axis=1)


def _turnless(markers: Markers, rate: float) -> Array:
    """(frames, 7): bend, heights of the palm's axes, speeds up and level in their RMS."""
    smooth = SMOOTHING / rate * markers.fps
    axes, velocity = _axes(markers), smoothed(_wrist(markers), smooth, 1)
    velocity = velocity / _rms(velocity)
    speeds = np.stack([velocity[:, 1], np.hypot(velocity[:, 0], velocity[:, 2])], axis=1)
    posture = np.concatenate([markers.forearm, axes[..., 1]], axis=1)
    return _at_rate(np.concatenate([smoothed(posture, smooth), speeds], axis=1), markers, rate)


def _turned(markers: Markers, rate: float, part: tuple[int, int]) -> Array:
    """(frames, 15): bend, the palm's axes, velocity and acceleration in their RMS in a part."""
    smooth = SMOOTHING / rate * markers.fps
    posture = np.concatenate([markers.forearm, _axes(markers).reshape(len(markers), -1)], axis=1)
    inside = slice(round(part[0] / rate * markers.fps), round(part[1] / rate * markers.fps) + 1)
    velocity, acceleration = (smoothed(_wrist(markers), smooth, order) for order in (1, 2))
    curves = [
        smoothed(posture, smooth),
        velocity / _rms(velocity[inside]),
        ACCELERATIONS * acceleration / _rms(acceleration[inside]),
    ]
    return _at_rate(np.concatenate(curves, axis=1), markers, rate)


def _without_spikes(markers: Markers) -> Markers:
    """Markers without what lasts for a single frame, which would count as the usual speed."""
    from scipy.ndimage import median_filter

    return replace(markers, positions=median_filter(markers.positions, size=(3, 1, 1)))


def _rests(hands: Sequence[Markers], rate: float, count: int) -> NDArray[np.bool_]:
    """(frames,) whether no wrist moves."""
    slow = np.ones(count, bool)
    for m in hands:
        velocity = smoothed(_wrist(m), SMOOTHING / rate * m.fps, 1)
        share = np.linalg.norm(velocity, axis=-1, keepdims=True) / _rms(velocity)
        slow &= _at_rate(share, m, rate)[:, 0] < RESTS
    return slow


def _at_rate(curves: Array, markers: Markers, rate: float) -> Array:
    count = int((len(markers) - 1) / markers.fps * rate + 1e-6) + 1
    return interpolate(curves, np.arange(count, dtype=np.float64) * markers.fps / rate)


def _wrist(markers: Markers) -> Array:
    return np.asarray(markers.positions[:, :2].mean(axis=1))


def _axes(markers: Markers) -> Array:
    """(frames, 2, 3) directions of the palm, towards the thumb and along it."""
    return unit(markers.positions[:, [0, 3]] - _wrist(markers)[:, None])


def _rms(velocity: Array) -> float:
    return max(float(np.sqrt(np.mean(np.sum(velocity**2, axis=-1)))), 1e-9)


def _motion(markers: Markers, first: float, last: float) -> tuple[float, float]:
    """Seconds in which a wrist moves within a part, and beyond it."""
    velocity = smoothed(_wrist(markers), 0.12 * markers.fps, 1)
    moves = np.linalg.norm(velocity, axis=-1) > MOVES * _rms(velocity)
    seconds = np.arange(len(markers)) / markers.fps
    inside = (seconds >= first) & (seconds <= last)
    return float((moves & inside).sum() / markers.fps), float((moves & ~inside).sum() / markers.fps)
