"""Alignments of the hands of two clips: the timing of hands that move, of pins, and of clocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.display import displayed
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.problems import Problem
from usdhand.progress import Progress, Steps
from usdhand.splice.band import checked_pins
from usdhand.splice.clocks import clock_notes, clock_pins, clock_warp, is_clocked
from usdhand.splice.confidence import Doubt, doubts, wanted_pins
from usdhand.splice.lengths import check_frames, length_notes, part_note, pin_advice, pins_of
from usdhand.splice.locate import RATE, Place, locate
from usdhand.splice.long import align_long, long_steps
from usdhand.splice.markers import Markers, hand_markers
from usdhand.splice.phases import smoothed
from usdhand.splice.quality import Phase, phase_qualities
from usdhand.splice.reach import Contradiction
from usdhand.splice.refine import MarkerPair
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.timing import HandTiming, check_trunks
from usdhand.splice.warps import through_pins

# A hand whose wrist stays within this of its mean, in lengths of the palm, does not move; and one
# that goes less than this share as far as the other one tells less about timing than that.
STILL_RANGE, LEAST_RANGE_SHARE = 0.1, 0.1

Ranges = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Piece:
    """Seconds of the body from ``start`` to ``end`` with the fingers of one of several takes."""

    take: int
    start: float
    end: float


@displayed(
    lambda alignment: {
        "frames": len(alignment.warp),
        "phases": len(alignment.phases),
        "pins": len(alignment.pins),
        "cost": alignment.cost,
        "pass_lag": alignment.pass_lag,
    }
)
@dataclass(frozen=True, eq=False)
class Alignment:
    """One hand's alignment.

    Attributes
    ----------
    warp : (body frames, 2) seconds of the body and of the hand clip, from their first frames
    phase_warp : (body frames,) seconds of the hand clip after pass 1
    pins : that held
    cost : of the path of pass 1, mean over the body's frames
    phases : how well each phase of the motion agrees
    origins : joints that the markers of body and hand clip were measured from
    frozen : first and last seconds of what the recordings of body and hand clip lack
    shared : whether both hands told one timing
    contradictions : pins that motion speaks against
    deviation : (body frames,) standard deviation of the warp in seconds, None if nothing tells it
    taken_from : the other side, where this hand hardly moves and follows it
    channels : finger channels that were taken
    pieces : of several takes, which one is shown when; empty for one
    """

    warp: Array
    phase_warp: Array
    pins: tuple[Pin, ...]
    cost: float
    phases: tuple[Phase, ...]
    origins: tuple[str, str]
    frozen: tuple[Ranges, Ranges] = ((), ())
    shared: bool = False
    contradictions: tuple[Contradiction, ...] = ()
    deviation: Array | None = None
    taken_from: Side | None = None
    channels: tuple[str, ...] = ()
    pieces: tuple[Piece, ...] = ()

    @property
    def pass_lag(self) -> float:
        """Median seconds by which pass 2 moved the warp of pass 1."""
        return float(np.median(np.abs(self.warp[:, 1] - self.phase_warp)))

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Ranges of the body that move, and in which the timing may be off visibly."""
        if self.deviation is None:
            return ()
        return doubts(self.warp[:, 0], self.deviation, self.phases)

    @property
    def wanted_pins(self) -> tuple[Doubt, ...]:
        """Moments of the body at which pins would help most, in this order."""
        if self.deviation is None or self.taken_from is not None:
            return ()
        return wanted_pins(self.warp[:, 0], self.deviation, self.phases)


def aligned_hands(
    body: Clip,
    hand_clip: Clip,
    body_hands: Hands,
    hand_hands: Hands,
    sides: Sequence[Side],
    settings: SpliceSettings,
    progress: Progress | None = None,
) -> tuple[dict[Side, Alignment], list[Problem]]:
    """Alignments of hands that both clips have, and what is odd about them.

    Raises the errors of `usdhand.splice.method.splice`.
    """
    if is_clocked(settings):
        return _by_clocks(body, hand_clip, body_hands, hand_hands, sides, settings)
    pins = {s: checked_pins(settings.pins, s, body.duration, hand_clip.duration) for s in sides}
    for pin in settings.pins:
        if pin.side is not None and pin.side not in sides:
            raise UsageError(f"Pin {pin} is for the {pin.side} hand, which is not spliced.")
    check_frames(body, hand_clip)
    place = _place_of(body, hand_clip, body_hands, hand_hands, sides)
    part = None if settings.pins else place()
    problems: list[Problem] = []
    if part and part.clear and part.partial:
        pins = dict.fromkeys(sides, pins_of(body, hand_clip, part))
        problems.append(part_note(body, hand_clip, part))
    problems += length_notes(
        body,
        hand_clip,
        pins,
        lambda: pin_advice(body, hand_clip, place()),
    )
    aligned, more = _timed_hands(body, hand_clip, body_hands, hand_hands, settings, pins, progress)
    if part and part.clear and part.partial:
        aligned = {s: _going_on(a, part, hand_clip.duration) for s, a in aligned.items()}
    return aligned, [*problems, *more]


def _by_clocks(
    body: Clip,
    hand_clip: Clip,
    body_hands: Hands,
    hand_hands: Hands,
    sides: Sequence[Side],
    settings: SpliceSettings,
) -> tuple[dict[Side, Alignment], list[Problem]]:
    """Alignments by claps or time codes; motion only tells whether it agrees."""
    known = clock_pins(body, hand_clip, settings)
    check_frames(body, hand_clip)
    times = np.arange(len(body)) / body.fps
    warp = clock_warp(times, known, hand_clip.duration)
    found = {}
    moves = True
    for side in sides:
        ours = hand_markers(body, body_hands, side, settings.fps)
        theirs = hand_markers(hand_clip, hand_hands, side, settings.fps)
        own = np.interp(np.arange(len(ours)) / ours.fps, times, warp)
        both = min(_wrist_range(m, settings.smoothing) for m in (ours, theirs)) >= STILL_RANGE
        moves = moves and both
        found[side] = Alignment(
            np.stack([times, warp], axis=1),
            warp,
            settings.claps,
            0.0,
            phase_qualities(ours, theirs, own, settings.smoothing) if both else (),
            (ours.origin, theirs.origin),
            (ours.frozen, theirs.frozen),
        )
    place = _place_of(body, hand_clip, body_hands, hand_hands, sides)() if moves else None
    return found, clock_notes(known, place)


def _place_of(
    body: Clip, hand_clip: Clip, body_hands: Hands, hand_hands: Hands, sides: Sequence[Side]
) -> Callable[[], Place | None]:
    """What tells, as soon as it is asked, which part the clips share."""

    @cache
    def place() -> Place | None:
        pairs = [
            (
                hand_markers(body, body_hands, side, 2 * RATE),
                hand_markers(hand_clip, hand_hands, side, 2 * RATE),
            )
            for side in sides
        ]
        return locate(pairs)

    return place


def _going_on(alignment: Alignment, part: Place, end: float) -> Alignment:
    """What clips do not share of the hand clip comes at the body's speed."""
    times, warp = alignment.warp.T
    first, last = (float(np.interp(t, times, warp)) for t in part.body)
    warp = np.where(times < part.body[0], np.maximum(first - (part.body[0] - times), 0.0), warp)
    warp = np.where(times > part.body[1], np.minimum(last + (times - part.body[1]), end), warp)
    return replace(alignment, warp=np.stack([times, warp], axis=1))


def _timed_hands(
    body: Clip,
    hand_clip: Clip,
    body_hands: Hands,
    hand_hands: Hands,
    settings: SpliceSettings,
    pins: Mapping[Side, tuple[Pin, ...]],
    progress: Progress | None,
) -> tuple[dict[Side, Alignment], list[Problem]]:
    """Alignments of the hands that move; hands that hardly do follow the other one."""
    times = np.arange(len(body)) / body.fps
    markers = {
        side: (
            hand_markers(body, body_hands, side, settings.fps),
            hand_markers(hand_clip, hand_hands, side, settings.fps),
        )
        for side in pins
    }
    reach = {
        s: min(_wrist_range(m, settings.smoothing) for m in both) for s, both in markers.items()
    }
    enough = max(STILL_RANGE, LEAST_RANGE_SHARE * max(reach.values()))
    still = [side for side in pins if reach[side] < enough]
    moving = {side: both for side, both in markers.items() if side not in still}
    found = _timings(moving, pins, settings, times, progress) if moving else {}
    problems: list[Problem] = []
    if not found:
        ends = body.duration, hand_clip.duration
        found = {
            s: _aligned_by_pins(*markers[s], p, times)
            for s, p in pins.items()
            if _pins_fix_both_ends(p, *ends)
        }
        if found:
            message = "no hand moves: the timing is that of the pins, interpolated between them"
            problems.append(Problem("pins-only", message))
    if not found:
        clips = {f"the body {body.name}": 0, f"the hand clip {hand_clip.name}": 1}
        at_rest = [
            name
            for name, k in clips.items()
            if all(
                _wrist_range(both[k], settings.smoothing) < STILL_RANGE for both in markers.values()
            )
        ]
        where = " and ".join(at_rest) or f"both {body.name} and {hand_clip.name}"
        raise InputError(
            f"No hand moves in {where}, so nothing tells which moments belong together. Pins can: "
            "--pin where the clips begin, where they end, and between. For recordings of one "
            "moment, such as gloves without arms: --clap BODY:HAND, frames at which both show the "
            "same clap, or --align timecode."
        )
    for side in (s for s in still if s not in found):
        other, alignment = next(iter(found.items()))
        found[side] = _aligned_like_other_hand(alignment, other, pins[side], times)
        body_rests, hand_rests = (
            _wrist_range(m, settings.smoothing) < enough for m in markers[side]
        )
        where = "the hand clip" if not body_rests else "both clips" if hand_rests else "the body"
        message = (
            f"the {side} hand hardly moves in {where}: it follows the timing of the {other} one"
        )
        problems.append(Problem("follows-other-hand", message))
    return {side: found[side] for side in pins}, problems


def _timings(
    markers: Mapping[Side, MarkerPair],
    pins: Mapping[Side, tuple[Pin, ...]],
    settings: SpliceSettings,
    times: Array,
    progress: Progress | None,
) -> dict[Side, Alignment]:
    """Alignments of hands that move.

    Both hands together say more about when than each alone. A hand has the timing that both
    clips have with its own pins, so that a pin for one hand changes nothing of the other.
    """
    check_trunks(list(markers.values()), settings)
    hands = list(markers)
    runs = dict.fromkeys(pins[s] for s in hands)
    ours, theirs = markers[hands[0]]
    most = [long_steps(len(hands), ours, theirs, settings, own) for own in runs]
    steps = Steps(sum(most), progress)
    found = {
        own: align_long([markers[s] for s in hands], settings, own, times, steps) for own in runs
    }
    steps.add(steps.total - steps.done)  # pins can need less than the most
    return {
        s: _alignment(*markers[s], settings, pins[s], times, found[pins[s]][k])
        for k, s in enumerate(hands)
    }


def _alignment(
    ours: Markers,
    theirs: Markers,
    settings: SpliceSettings,
    pins: tuple[Pin, ...],
    times: Array,
    timing: HandTiming,
) -> Alignment:
    warp = np.interp(np.arange(len(ours)) / ours.fps, times, timing.warp)
    return Alignment(
        np.stack([times, timing.warp], axis=1),
        timing.phase_warp,
        pins,
        timing.cost / len(ours),
        phase_qualities(ours, theirs, warp, settings.smoothing),
        (ours.origin, theirs.origin),
        (ours.frozen, theirs.frozen),
        timing.shared,
        timing.contradictions,
        timing.deviation,
    )


def _pins_fix_both_ends(pins: Sequence[Pin], body: float, hand: float) -> bool:
    """Whether pins say where one of the clips begins and where one ends."""
    if len(pins) < 2:
        return False
    first, last = pins[0], pins[-1]
    begin = min(first.body, first.hand)
    return begin < 1e-3 and min(body - last.body, hand - last.hand) < 1e-3


def _aligned_by_pins(
    ours: Markers, theirs: Markers, pins: tuple[Pin, ...], times: Array
) -> Alignment:
    """Alignment by pins alone, evenly between them."""
    warp = np.interp(times, [p.body for p in pins], [p.hand for p in pins])
    joint = np.stack([times, warp], axis=1)
    return Alignment(joint, warp, pins, 0.0, (), (ours.origin, theirs.origin))


def _wrist_range(markers: Markers, smoothing: float) -> float:
    """How far a wrist goes from its mean, in lengths of the palm."""
    wrist = smoothed(markers.wrist, smoothing * markers.fps)
    far = np.linalg.norm(wrist - wrist.mean(axis=0), axis=-1).max()
    return float(far / max(markers.palm_length, 1e-9))


def _aligned_like_other_hand(
    alignment: Alignment, side: Side, pins: tuple[Pin, ...], times: Array
) -> Alignment:
    warp = through_pins(alignment.warp[:, 1], times, pins, np.inf)
    return replace(
        alignment, warp=np.stack([times, warp], axis=1), pins=pins, phases=(), taken_from=side
    )
