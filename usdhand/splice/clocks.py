"""Timing by clocks: claps that both recordings show, or the time codes of both."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.motion.timecode import clock_text
from usdhand.problems import Problem
from usdhand.splice.locate import Place
from usdhand.splice.settings import Pin, SpliceSettings

# Clocks of two recorders, or a frame rate that was given for another, differ by less than this.
MOST_DRIFT = 0.05
# Motion contradicts a clock if it puts the hand clip as many seconds elsewhere.
CONTRADICTS_S = 0.5


def is_clocked(settings: SpliceSettings) -> bool:
    """Whether claps or time codes give the timing."""
    return bool(settings.claps) or settings.align == "timecode"


def clock_pins(body: Clip, hand_clip: Clip, settings: SpliceSettings) -> tuple[Pin, ...]:
    """Moments at which both clocks are known, in order of time.

    Raises
    ------
    UsageError
        if pins are given too, or claps and time codes; if claps are not the same ones.
    InputError
        if a clip has no time code, or the clips do not overlap.
    """
    if settings.pins:
        raise UsageError("Claps and time codes give all of the timing: give no pins with them.")
    if settings.align != "timecode":
        return _checked_claps(body, hand_clip, settings.claps)
    if settings.claps:
        raise UsageError("Claps and --align timecode both give all of the timing: give one.")
    begins = []
    for kind, clip in (("body", body), ("hand clip", hand_clip)):
        if clip.origin.clock is None:
            raise InputError(
                f"{clip.origin.path or clip.name}: the {kind} carries no time code, so --align "
                "timecode has nothing to align by. USD files carry one as startTimeCode or as "
                "customLayerData 'timecode', FBX files as the start of their take; BVH and glTF "
                "have none. Give a moment that both clips show: --clap BODY:HAND, or --pin."
            )
        begins.append(clip.origin.clock)
    ours, theirs = begins
    if ours > theirs + hand_clip.duration or theirs > ours + body.duration:
        lasts = [
            f"{clock_text(begin)} to {clock_text(begin + clip.duration)}"
            for begin, clip in zip(begins, (body, hand_clip), strict=True)
        ]
        raise InputError(
            f"By their time codes the clips do not overlap: the body lasts from {lasts[0]}, the "
            f"hand clip from {lasts[1]}. If a clock was not set, give --clap BODY:HAND."
        )
    return (Pin(0.0, ours - theirs, name="time code"),)


def _checked_claps(body: Clip, hand_clip: Clip, claps: Sequence[Pin]) -> tuple[Pin, ...]:
    own = tuple(sorted(claps, key=lambda clap: clap.body))
    for clap in own:
        if clap.side is not None:
            raise UsageError(f"Clap {clap}: both hands have one clock; give no side.")
    for one, other in pairwise(own):
        lasts = other.body - one.body, other.hand - one.hand
        if abs(lasts[1] - lasts[0]) > MOST_DRIFT * max(lasts[0], 1e-3):
            raise UsageError(
                f"Between the claps {one} and {other} the body lasts {lasts[0]:.2f} s, the hand "
                f"clip {lasts[1]:.2f} s: these are not the same two claps."
            )
    begins = own[0].body - own[0].hand
    if begins > body.duration or begins + hand_clip.duration < 0:
        raise UsageError(f"By the clap {own[0]} the clips do not overlap.")
    return own


def clock_warp(times: Array, known: Sequence[Pin], end: float) -> Array:
    """Seconds of the hand clip (times,) where both clocks are known at some moments.

    Parameters
    ----------
    end : last second of the hand clip; it holds its first and last pose beyond
    """
    body, hand = np.array([(pin.body, pin.hand) for pin in known]).T
    far = 1.0 + np.ptp(times) + np.abs(body).max()
    speeds = np.diff(hand) / np.diff(body) if len(body) > 1 else np.ones(1)
    body = np.concatenate([[body[0] - far], body, [body[-1] + far]])
    hand = np.concatenate([[hand[0] - far * speeds[0]], hand, [hand[-1] + far * speeds[-1]]])
    return np.asarray(np.clip(np.interp(times, body, hand), 0.0, end))


def clock_notes(known: Sequence[Pin], place: Place | None) -> list[Problem]:
    """What the clocks say, and whether motion says otherwise."""
    offset = known[0].body - known[0].hand
    when = f"{abs(offset):.3f} s {'after' if offset >= 0 else 'before'} the body"
    by = "time codes" if known[0].name == "time code" else "claps"
    notes = [Problem("clock", f"by the {by} the hand clip begins {when}", severity="note")]
    if place is not None and place.clear:
        wanted = clock_warp(np.array(place.body), known, np.inf)
        off = np.array(place.hand) - wanted
        if np.abs(off).min() > CONTRADICTS_S and off[0] * off[1] > 0:
            where = "later" if off.mean() > 0 else "earlier"
            notes.append(
                Problem(
                    "clock-contradicts",
                    f"the motion of the arms says that the body shows moments of the hand clip "
                    f"that are about {abs(off.mean()):.1f} s {where} than the {by} say",
                )
            )
    return notes
