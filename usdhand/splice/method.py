"""Splice: a hand clip retimed onto a body clip (Majkowska, Zordan & Faloutsos 2006)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from usdhand.anatomy import SIDES, Hands, Side
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError, InputError, UsageError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.problems import Problem
from usdhand.progress import Progress, Steps
from usdhand.splice.band import (
    Band,
    anchors_of,
    band_along,
    checked_pins,
    pinned_band,
)
from usdhand.splice.finger_notes import held_pose_notes, still_finger_notes
from usdhand.splice.lengths import length_notes, pin_advice
from usdhand.splice.markers import Markers, hand_markers
from usdhand.splice.merge import with_fingers, with_wrist
from usdhand.splice.phases import path_with_steady_turns, phase_path, rematched, smoothed
from usdhand.splice.quality import Phase, phase_qualities
from usdhand.splice.refine import refined
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.warps import through_pins

# A hand whose wrist stays within this of its mean, in lengths of the palm, does not move; and one
# that goes less than this share as far as the other one tells less about timing than that.
STILL_RANGE, LEAST_RANGE_SHARE = 0.1, 0.1
# The band of pass 2 is not wider, in seconds, however long the clips.
MOST_BAND_S = 10.0
# Beside a pin, a matched warp may move by its tolerance and this share of the time to the pin.
FREEDOM_SHARE = 0.25
# Rounds of matching signs with the hand clip in the body's time.
ROUNDS = 2
# Of a hand's alignment, for whoever watches: the path of pass 1, its rounds, and pass 2.
STEPS = 1 + ROUNDS + 1


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
    taken_from : the other side, where this hand hardly moves and follows it
    channels : finger channels that were taken
    """

    warp: Array
    phase_warp: Array
    pins: tuple[Pin, ...]
    cost: float
    phases: tuple[Phase, ...]
    origins: tuple[str, str]
    taken_from: Side | None = None
    channels: tuple[str, ...] = ()

    @property
    def pass_lag(self) -> float:
        """Median seconds by which pass 2 moved the warp of pass 1."""
        return float(np.median(np.abs(self.warp[:, 1] - self.phase_warp)))


@displayed(
    lambda spliced: {
        "name": spliced.clip.name,
        "frames": len(spliced.clip),
        "hands": tuple(spliced.hands),
        "problems": len(spliced.problems),
    }
)
@dataclass(frozen=True, eq=False)
class Spliced:
    """The body with the hand clip's fingers, the alignment of each hand, problems, and settings."""

    clip: Clip
    hands: Mapping[Side, Alignment]
    problems: tuple[Problem, ...] = ()
    settings: SpliceSettings = field(default_factory=SpliceSettings)


def splice(
    body: Clip,
    hand_clip: Clip,
    body_hands: Hands,
    hand_hands: Hands,
    settings: SpliceSettings | None = None,
    progress: Progress | None = None,
) -> Spliced:
    """Give a body clip the fingers of a hand clip of the same performance.

    Hands that both clips have are aligned each on its own.

    Parameters
    ----------
    progress : gets how many rounds of alignment are done, those of each hand, and how many there
        are; False stops

    Raises
    ------
    HandNotFoundError
        if the clips have no hand, or no finger joint of one, in common.
    InputError
        if no hand moves, so that there is nothing to align, and pins do not give the timing; if the
        body's fingers move and none of the hand clip's do.
    UsageError
        if pins contradict each other, or the clips' lengths are too different.
    CancelledError
        if ``progress`` returned False.
    """
    settings = settings or SpliceSettings()
    sides = [s for s in SIDES if s in body_hands.frames and s in hand_hands.frames]
    if not sides:
        there = (" and ".join(h.frames) for h in (body_hands, hand_hands))
        raise HandNotFoundError(
            "The clips have no hand in common: the body has {}, the hand clip {}.".format(*there)
        )
    for side in sides:
        fingers = [set(h.frames[side].names) for h in (body_hands, hand_hands)]
        if not fingers[0] & fingers[1]:
            ours, theirs = (", ".join(sorted(names)) for names in fingers)
            raise HandNotFoundError(
                f"The {side} hands have no finger joint in common: the body has {ours}; the hand "
                f"clip {theirs}."
            )
    pins = {s: checked_pins(settings.pins, s, body.duration, hand_clip.duration) for s in sides}
    for pin in settings.pins:
        if pin.side is not None and pin.side not in sides:
            raise UsageError(f"Pin {pin} is for the {pin.side} hand, which is not spliced.")
    problems = length_notes(
        body,
        hand_clip,
        pins,
        settings.band[0],
        settings.fps,
        lambda: pin_advice(body, hand_clip, body_hands, hand_hands, sides),
    )
    found, more = _aligned_hands(body, hand_clip, body_hands, hand_hands, settings, pins, progress)
    problems += more + still_finger_notes(body, hand_clip, body_hands, hand_hands, sides)
    clip, hands = body, {}
    for side, alignment in found.items():
        warp = alignment.warp[:, 1]
        exact = _exact_frames(alignment)
        if settings.wrist == "hands":
            clip = with_wrist(clip, hand_clip, body_hands, hand_hands, side, warp, exact)
        frames, other = body_hands.frames[side], hand_hands.frames[side]
        clip, names = with_fingers(clip, hand_clip, frames, other, warp, exact)
        hands[side] = replace(alignment, channels=names)
    problems += held_pose_notes(body, hand_clip, {s: a.warp[:, 1] for s, a in hands.items()})
    return Spliced(clip, hands, tuple(problems), settings)


def align(
    body: Markers,
    hand: Markers,
    settings: SpliceSettings,
    pins: Sequence[Pin],
    times: Array,
    steps: Steps | None = None,
) -> tuple[Array, Array, int]:
    """Seconds of the hand clip (times,) after pass 2 and after pass 1, and the cost of pass 1.

    It takes `STEPS` steps.
    """
    steps = steps or Steps(STEPS, None)
    band = first_band(len(body), len(hand), settings, pins)
    signs = settings.smoothing, settings.dead_zone
    path = phase_path(body, hand, band, *signs, settings.align, settings.directions)
    reach = min(settings.band[1] * len(body), MOST_BAND_S * settings.fps)
    reach = max(reach, settings.least_band * settings.fps) / 2
    if settings.align == "local":
        near = band_along(path.first, path.last, band, reach)
        path = path_with_steady_turns(body, hand, path, near, *signs, settings.directions)
    steps.add()
    own_times, end = np.arange(len(body)) / body.fps, (len(hand) - 1) / hand.fps
    freedom = _freedom(own_times, pins)
    first = path.open_ended
    for _ in range(ROUNDS):
        first = through_pins(first / hand.fps, own_times, pins) * hand.fps
        signs = settings.shared_smoothing, settings.dead_zone
        first = rematched(
            body, hand, first, freedom * body.fps, *signs, settings.align, settings.directions
        )
        steps.add()

    def in_time(warp: Array) -> Array:
        seconds = np.clip(np.interp(times, own_times, warp / hand.fps), 0.0, end)
        return through_pins(seconds, times, pins)

    if settings.tether == 0:
        steps.add()
        return in_time(first), in_time(first), path.cost
    tether = settings.tether * hand.fps
    first = through_pins(first / hand.fps, own_times, pins) * hand.fps
    second = refined(
        body, hand, first, np.minimum(freedom * hand.fps, reach), settings.align, tether
    )
    steps.add()
    return in_time(second), in_time(first), path.cost


def _exact_frames(alignment: Alignment) -> Array:
    """Which frames of the body an exact pin is on."""
    times = alignment.warp[:, 0]
    at = np.array([p.body for p in alignment.pins if p.tolerance == 0]) / times[1]
    frames = np.rint(at).astype(np.intp)
    exact = np.zeros(len(times), bool)
    exact[frames[np.abs(at - frames) < 1e-3]] = True
    return exact


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


def first_band(rows: int, columns: int, settings: SpliceSettings, pins: Sequence[Pin]) -> Band:
    """Where the path of pass 1 may go."""
    width = max(settings.band[0] * rows, settings.least_band * settings.fps)
    return pinned_band(anchors_of(pins, rows, columns, settings.fps), width)


def _aligned_hands(
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
    steps = Steps(STEPS * (len(pins) - len(still)), progress)
    found = {
        side: _aligned(*markers[side], settings, own, times, steps)
        for side, own in pins.items()
        if side not in still
    }
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
            "--pin where the clips begin, where they end, and between."
        )
    for side in (s for s in still if s not in found):
        [(moving, alignment)] = found.items()
        found[side] = _aligned_like_other_hand(alignment, moving, pins[side], times)
        body_rests, hand_rests = (
            _wrist_range(m, settings.smoothing) < enough for m in markers[side]
        )
        where = "the hand clip" if not body_rests else "both clips" if hand_rests else "the body"
        message = (
            f"the {side} hand hardly moves in {where}: it follows the timing of the {moving} one"
        )
        problems.append(Problem("follows-other-hand", message))
    return {side: found[side] for side in pins}, problems


def _aligned(
    ours: Markers,
    theirs: Markers,
    settings: SpliceSettings,
    pins: tuple[Pin, ...],
    times: Array,
    steps: Steps,
) -> Alignment:
    if settings.align == "trunk" and any(m.facing is None for m in (ours, theirs)):
        raise UsageError("A clip has no trunk to align by: use --align local.")
    second, first, cost = align(ours, theirs, settings, pins, times, steps)
    warp = np.interp(np.arange(len(ours)) / ours.fps, times, second)
    return Alignment(
        np.stack([times, second], axis=1),
        first,
        pins,
        cost / len(ours),
        phase_qualities(ours, theirs, warp, settings.smoothing),
        (ours.origin, theirs.origin),
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
