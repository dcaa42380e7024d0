"""Long clips, from coarse to fine: time and memory that grow with the length, not its square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.progress import Steps
from usdhand.splice.band import anchors_of, band_near, pinned_band
from usdhand.splice.markers import Markers
from usdhand.splice.phases import phase_path
from usdhand.splice.refine import MarkerPair
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.timing import Guide, HandTiming, align_hands, first_band, hands_steps

# Cells of the first band beyond which a clip is long: eleven minutes with the usual band.
MOST_CELLS = 5e8
# The coarsest path has at most as many rows, of 2^n frames each; every next one half the frames a
# row, down to these, near the one before by as many seconds.
COARSE_ROWS, FINEST_FRAMES, NEAR_S = 20_000, 8, 20.0
# Smoothing of coarse signs in rows.
SMOOTHING_ROWS = 1.5
# Parts are aligned as clips are, with what is around them, and go over into each other.
PART_S, AROUND_S, MIXED_S = 120.0, 15.0, 4.0
# How far the coarse path may be off, and so half the width of the band of a part.
COARSE_OFF_S = 5.0


@dataclass(frozen=True)
class _Part:
    """Rows of the markers of body and hand clip that are aligned together."""

    body: slice
    hand: slice


def align_long(
    pairs: Sequence[MarkerPair],
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps | None = None,
) -> tuple[HandTiming, ...]:
    """Timings of all hands, as `usdhand.splice.timing.align_hands`, of clips of any length.

    A coarse path says which part of the hand clip is shown by every two minutes of the body. These
    are aligned with some seconds around them, so that the ends, which are known only roughly, are
    not used. It takes `long_steps`.
    """
    body, hand = pairs[0]
    steps = steps or Steps(long_steps(len(pairs), body, hand, settings, pins), None)
    if not is_long(body, hand, settings, pins):
        return align_hands(pairs, settings, pins, times, steps)
    coarse = coarse_warp(pairs, settings, pins)
    steps.add()
    found = [
        _aligned_part(pairs, part, coarse, settings, pins, times, steps)
        for part in _parts(body, hand, coarse)
    ]
    return tuple(_joined([f[k] for f in found], pairs[k], times) for k in range(len(pairs)))


def is_long(body: Markers, hand: Markers, settings: SpliceSettings, pins: Sequence[Pin]) -> bool:
    """Whether a path through the whole band would take too much time and memory."""
    return first_band(len(body), len(hand), settings, pins).cells > MOST_CELLS


def long_steps(
    hands: int, body: Markers, hand: Markers, settings: SpliceSettings, pins: Sequence[Pin]
) -> int:
    """Most steps that `align_long` takes."""
    own = hands_steps(hands, pins)
    if not is_long(body, hand, settings, pins):
        return own
    return 1 + own * len(_starts(len(body), body.fps))


def coarse_warp(
    pairs: Sequence[MarkerPair], settings: SpliceSettings, pins: Sequence[Pin]
) -> Array:
    """Frames of the hand clip (rows,), one every `FINEST_FRAMES` of the body."""
    frames = FINEST_FRAMES
    while len(pairs[0][0]) / frames > COARSE_ROWS:
        frames *= 2
    warp: Array | None = None
    while frames >= FINEST_FRAMES:
        body, hand = (_coarse([p[k] for p in pairs], frames) for k in (0, 1))
        anchors = anchors_of(pins, len(body), len(hand), body.fps)
        width = max(settings.band[0] * len(body), settings.least_band * body.fps)
        band = pinned_band(anchors, width)
        if warp is not None:
            before = np.interp(np.arange(len(body)) / 2, np.arange(len(warp)), 2 * warp)
            band = band_near(band, before, NEAR_S * body.fps)
        rule = settings.rule(SMOOTHING_ROWS / body.fps)
        warp = phase_path(body, hand, band, rule, settings.align).open_ended
        frames //= 2
    assert warp is not None
    return (warp + 0.5) * FINEST_FRAMES - 0.5


def _coarse(hands: Sequence[Markers], frames: int) -> Markers:
    """Markers of all hands, means of as many frames."""

    def means(curves: Array) -> Array:
        rows = len(curves) // frames
        return np.asarray(curves[: rows * frames].reshape(rows, frames, -1).mean(axis=1))

    first = hands[0]
    positions = [means(m.positions.reshape(len(m), -1)) for m in hands]
    return replace(
        first,
        positions=np.concatenate([p.reshape(len(p), -1, 3) for p in positions], axis=1),
        wrist=means(first.wrist),
        forearm=means(first.forearm),
        facing=None if first.facing is None else means(first.facing),
        fps=first.fps / frames,
        frozen=(),
    )


def _starts(rows: int, fps: float) -> list[int]:
    """First rows of parts."""
    return list(range(0, max(rows - round(PART_S * fps / 2), 1), round(PART_S * fps)))


def _parts(body: Markers, hand: Markers, coarse: Array) -> list[_Part]:
    """Parts with what is around them."""
    around, own = round(AROUND_S * body.fps), np.arange(len(coarse)) * float(FINEST_FRAMES)
    starts = _starts(len(body), body.fps)
    found = []
    for first, last in zip(starts, [*starts[1:], len(body)], strict=True):
        rows = max(first - around, 0), min(last + around, len(body))
        columns = np.rint(np.interp(rows, own, coarse)).astype(int)
        begin = 0 if rows[0] == 0 else min(max(int(columns[0]), 0), len(hand) - 3)
        end = len(hand) if rows[1] == len(body) else max(min(int(columns[1]), len(hand)), begin + 3)
        found.append(_Part(slice(*rows), slice(begin, end)))
    return found


def _aligned_part(
    pairs: Sequence[MarkerPair],
    part: _Part,
    coarse: Array,
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps,
) -> list[tuple[NDArray[np.intp], HandTiming]]:
    """Which of all times are in a part, and the timing of every hand there."""
    fps = pairs[0][0].fps
    begins = part.body.start / fps, part.hand.start / fps
    lasts = (part.body.stop - part.body.start) / fps, (part.hand.stop - part.hand.start) / fps
    inside = (times >= begins[0] - 1e-9) & (times < begins[0] + lasts[0])
    own = tuple(
        replace(pin, body=pin.body - begins[0], hand=pin.hand - begins[1])
        for pin in pins
        if 0 <= pin.body - begins[0] < lasts[0] and 0 <= pin.hand - begins[1] < lasts[1]
    )
    cut = [(_rows(a, part.body), _rows(b, part.hand)) for a, b in pairs]
    at = np.flatnonzero(inside)
    rows = np.arange(part.body.start, part.body.stop) / FINEST_FRAMES
    path = np.interp(rows, np.arange(len(coarse)), coarse) - part.hand.start
    guide = Guide(path, COARSE_OFF_S * fps)
    timings = align_hands(cut, settings, own, times[at] - begins[0], steps, guide)
    return [
        (
            at,
            replace(
                timing,
                warp=timing.warp + begins[1],
                phase_warp=timing.phase_warp + begins[1],
                contradictions=tuple(
                    replace(c, start=c.start + begins[0], end=c.end + begins[0])
                    for c in timing.contradictions
                ),
            ),
        )
        for timing in timings
    ]


def _rows(markers: Markers, rows: slice) -> Markers:
    begin, end = rows.start / markers.fps, (rows.stop - 1) / markers.fps
    return replace(
        markers,
        positions=markers.positions[rows],
        wrist=markers.wrist[rows],
        forearm=markers.forearm[rows],
        facing=None if markers.facing is None else markers.facing[rows],
        frozen=tuple(
            (max(a, begin) - begin, min(b, end) - begin)
            for a, b in markers.frozen
            if b >= begin and a <= end
        ),
    )


def _joined(
    parts: Sequence[tuple[NDArray[np.intp], HandTiming]], pair: MarkerPair, times: Array
) -> HandTiming:
    """One timing of several, which go over into each other in the middle of what they share."""
    curves = np.zeros((3, len(times)))
    weights = np.zeros(len(times))
    for k, (at, timing) in enumerate(parts):
        ramp = np.ones(len(at))
        seconds = times[at] - times[at[0]]
        if k > 0:
            ramp = np.minimum(ramp, (seconds - AROUND_S) / MIXED_S + 0.5)
        if k < len(parts) - 1:
            ramp = np.minimum(ramp, (seconds[-1] - seconds - AROUND_S) / MIXED_S + 0.5)
        ramp = np.maximum(ramp, 1e-9)
        spread = np.zeros(len(at)) if timing.deviation is None else timing.deviation
        curves[:, at] += ramp * np.stack([timing.warp, timing.phase_warp, spread])
        weights[at] += ramp
    warp, phase_warp, deviation = curves / weights
    body, hand = pair
    rows = np.interp(np.arange(len(body)) / body.fps, times, warp) * hand.fps
    first = parts[0][1]
    told = {c.pin.name or str(c.pin): c for _, t in parts for c in t.contradictions}
    return HandTiming(
        np.maximum.accumulate(warp),
        np.maximum.accumulate(phase_warp),
        sum(timing.cost for _, timing in parts),
        rows,
        rows,
        rows,
        all(timing.shared for _, timing in parts),
        None,
        None if first.deviation is None else deviation,
        tuple(told.values()),
    )
