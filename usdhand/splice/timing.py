"""Both passes on markers: the timing of one hand, or of both together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.progress import Steps
from usdhand.splice.band import Band, anchors_of, band_along, band_near, pinned_band
from usdhand.splice.confidence import deviation
from usdhand.splice.markers import Markers
from usdhand.splice.phases import path_with_steady_turns, phase_path, rematched
from usdhand.splice.reach import Contradiction, bounded, contradictions, is_local
from usdhand.splice.refine import OWN_STAGES, MarkerPair, differences, evidence, refined
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.trust import trust
from usdhand.splice.warps import monotone, through_pins

# The band of pass 2 is not wider, in seconds, however long the clips.
MOST_BAND_S = 10.0
# Beside a pin, a matched warp may move by its tolerance and this share of the time to the pin.
FREEDOM_SHARE = 0.25
# Rounds of matching signs with the hand clip in the body's time.
ROUNDS = 2
# Of an alignment, for whoever watches: the path of pass 1, its rounds, and pass 2.
STEPS = 1 + ROUNDS + 1
# Hands have one timing if with it neither differs from the body by more than this factor, in mean
# squares, than with its own.
ONE_TIMING = 1.15
# Nor if, from one timing, one of them moves by this many seconds against the other when it is
# refined: 0 to 5 ms where hands are in step, since they are held; 7 to 30 ms where they are 80 ms
# out of it.
MOST_LAG_S = 0.006


@dataclass(frozen=True, eq=False)
class HandTiming:
    """What both passes found for one hand.

    Attributes
    ----------
    warp, phase_warp : (times,) seconds of the hand clip after pass 2 and after pass 1
    cost : of the path of pass 1, summed
    rows, phase_rows, shared_rows : (marker rows,) in frames of the hand's markers: the warp, that
        of pass 1, and what all hands together told
    shared : whether there were several
    other_rows : (marker rows,) the same of what was not taken, None if there was nothing else: what
        the hand tells on its own, or both together
    deviation : (times,) standard deviation of the warp in seconds, None without pass 2
    contradictions : pins that motion speaks against
    """

    warp: Array
    phase_warp: Array
    cost: int
    rows: Array
    phase_rows: Array
    shared_rows: Array
    shared: bool = False
    other_rows: Array | None = None
    deviation: Array | None = None
    contradictions: tuple[Contradiction, ...] = ()


@dataclass(frozen=True, eq=False)
class Guide:
    """A path (rows,) of which it is known that the one to be found is within ``reach`` columns."""

    path: Array
    reach: float


def align(
    pairs: Sequence[MarkerPair],
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps | None = None,
    guide: Guide | None = None,
) -> tuple[HandTiming, ...]:
    """One timing of all hands, refined for each: markers of body and hand clip of every hand.

    It takes `STEPS` steps.

    Parameters
    ----------
    times : seconds of the body at which the timing is wanted
    """
    steps = steps or Steps(STEPS, None)
    body, hand = (_together([p[k] for p in pairs]) for k in (0, 1))
    band = first_band(len(body), len(hand), settings, pins)
    if guide is not None:
        band = band_near(band, guide.path, guide.reach)
    rule = settings.rule(settings.smoothing)
    path = phase_path(body, hand, band, rule, settings.align)
    reach = _reach(len(body), settings) * settings.fps
    if settings.align == "local":
        near = band_along(path.first, path.last, band, reach)
        path = path_with_steady_turns(body, hand, path, near, rule)
    steps.add()
    own_times = np.arange(len(body)) / body.fps
    freedom = _freedom(own_times, pins)
    rule = settings.rule(settings.shared_smoothing)
    first = path.open_ended
    for _ in range(ROUNDS):
        first = through_pins(first / hand.fps, own_times, pins) * hand.fps
        first = rematched(body, hand, first, freedom * body.fps, rule, settings.align)
        steps.add()

    shared, cost = len(pairs) > 1, path.cost // len(pairs)
    phase_warp = _in_time(first, hand, times, pins)
    if settings.tether == 0:
        steps.add()
        return (HandTiming(phase_warp, phase_warp, cost, first, first, first, shared),) * len(pairs)
    tether = settings.tether * hand.fps
    first = through_pins(first / hand.fps, own_times, pins) * hand.fps
    freedom = np.minimum(freedom * hand.fps, reach)
    second = refined(pairs, first, freedom, settings.align, tether)
    rows = [second]
    if shared:
        rows = [refined([p], second, freedom, settings.align, tether, OWN_STAGES) for p in pairs]
    steps.add()
    return tuple(
        HandTiming(_in_time(r, hand, times, pins), phase_warp, cost, r, first, second, shared)
        for r in rows
    )


def align_hands(
    pairs: Sequence[MarkerPair],
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps | None = None,
    guide: Guide | None = None,
) -> tuple[HandTiming, ...]:
    """Timings of all hands: one for all, unless one of them agrees better on its own.

    Pins that only correct the timing without them act near them, unless motion agrees with more.
    It takes `hands_steps`.
    """
    steps = steps or Steps(hands_steps(len(pairs), pins), None)
    free = _suiting(pairs, settings, (), times, steps, guide)
    if not pins:
        return _trusted(pairs, free, settings, times, pins)
    local = [is_local(t.warp, times, pins) for t in free]
    if all(local):
        groups = [pairs] if free[0].shared else [[p] for p in pairs]
        pinned = [t for group in groups for t in align(group, settings, pins, times, steps, guide)]
    else:
        pinned = list(_suiting(pairs, settings, pins, times, steps, guide))
    free = _trusted(pairs, free, settings, times, ())
    pinned = list(_trusted(pairs, pinned, settings, times, pins))
    for k, (pair, own) in enumerate(zip(pairs, free, strict=True)):
        if local[k]:
            warp = bounded(pair, own.warp, pinned[k].warp, times, pins, settings.align)
            odd = contradictions(pair, own.warp, warp, times, pins, settings.align)
            pinned[k] = replace(pinned[k], warp=warp, contradictions=odd)
    return tuple(pinned)


def hands_steps(hands: int, pins: Sequence[Pin]) -> int:
    """Most steps that `align_hands` takes."""
    return STEPS * (hands + (hands > 1)) * (2 if pins else 1)


def _suiting(
    pairs: Sequence[MarkerPair],
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps,
    guide: Guide | None,
) -> tuple[HandTiming, ...]:
    """Timings of all hands, one for all where it suits all."""
    alone = tuple(align([p], settings, pins, times, steps, guide)[0] for p in pairs)
    if len(pairs) == 1:
        return alone
    together = align(pairs, settings, pins, times, steps, guide)
    both = alone, together
    taken, other = both[::-1] if _in_step(pairs, alone, together, settings) else both
    return tuple(replace(t, other_rows=o.rows) for t, o in zip(taken, other, strict=True))


def _trusted(
    pairs: Sequence[MarkerPair],
    found: Sequence[HandTiming],
    settings: SpliceSettings,
    times: Array,
    pins: Sequence[Pin],
) -> tuple[HandTiming, ...]:
    """Timings that are those of pass 1 where pass 2 does not hold."""
    if settings.tether == 0:
        return tuple(found)
    groups = [range(len(pairs))] if found[0].shared else [[k] for k in range(len(pairs))]
    result = []
    for group in groups:
        own = np.arange(len(found[0].rows)) / settings.fps
        freedom = np.minimum(_freedom(own, pins), _reach(len(own), settings)) * settings.fps
        first = [found[k].phase_rows for k in group]
        weight = trust([pairs[k] for k in group], first, freedom, settings.align)
        for k in group:
            t = found[k]
            rows = monotone(t.phase_rows + weight * (t.rows - t.phase_rows))
            warp = _in_time(rows, pairs[k][1], times, pins)
            spread = deviation(pairs[k], rows, t.phase_rows, t.other_rows, settings.align)
            spread = np.minimum(np.interp(times, own, spread), _freedom(times, pins))
            result.append(replace(t, rows=rows, warp=warp, deviation=spread))
    return tuple(result)


def _in_step(
    pairs: Sequence[MarkerPair],
    alone: Sequence[HandTiming],
    together: Sequence[HandTiming],
    settings: SpliceSettings,
) -> bool:
    """Whether one timing suits all hands."""
    worse, lags = [], []
    for pair, one, own in zip(pairs, together, alone, strict=True):
        with_one, with_own = (differences(*pair, t.rows, settings.align) for t in (one, own))
        worse.append(float(np.mean(with_one / with_own)))
        weight = evidence(*pair, one.shared_rows, settings.align).information
        moved = np.sum(weight * (one.rows - one.shared_rows)) / max(np.sum(weight), 1e-9)
        lags.append(moved / pair[1].fps)
    return bool(max(worse) < ONE_TIMING and max(lags) - min(lags) < MOST_LAG_S)


def first_band(rows: int, columns: int, settings: SpliceSettings, pins: Sequence[Pin]) -> Band:
    """Where the path of pass 1 may go."""
    width = max(settings.band[0] * rows, settings.least_band * settings.fps)
    return pinned_band(anchors_of(pins, rows, columns, settings.fps), width)


def check_trunks(pairs: Sequence[MarkerPair], settings: SpliceSettings) -> None:
    """Refuse to align by trunks that are not there.

    Raises
    ------
    UsageError
        if a clip has no trunk.
    """
    if settings.align == "trunk" and any(m.facing is None for pair in pairs for m in pair):
        raise UsageError("A clip has no trunk to align by: use --align local.")


def _in_time(rows: Array, hand: Markers, times: Array, pins: Sequence[Pin]) -> Array:
    """Seconds of the hand clip (times,) of a warp in its marker frames, through pins."""
    own, end = np.arange(len(rows)) / hand.fps, (len(hand) - 1) / hand.fps
    seconds = np.clip(np.interp(times, own, rows / hand.fps), 0.0, end)
    return through_pins(seconds, times, pins)


def _together(hands: Sequence[Markers]) -> Markers:
    """Markers of several hands as if they were those of one."""
    if len(hands) == 1:
        return hands[0]
    return replace(hands[0], positions=np.concatenate([m.positions for m in hands], axis=1))


def _reach(rows: int, settings: SpliceSettings) -> float:
    """Seconds by which pass 2 may move a warp."""
    most = min(settings.band[1] * rows / settings.fps, MOST_BAND_S)
    return max(most, settings.least_band) / 2


def _freedom(times: Array, pins: Sequence[Pin]) -> Array:
    """Seconds (times,) by which a warp that goes through all pins may still move.

    Where a pin demands a jump, the hand clip as shown around it moves as no hand does, so that
    matching it again would tell nothing.
    """
    freedom = np.full(len(times), np.inf)
    for pin in pins:
        away = np.maximum(np.abs(times - pin.body) - 0.75 * times[1], 0.0)
        np.minimum(freedom, pin.tolerance + FREEDOM_SHARE * away, out=freedom)
    return freedom
