"""Whether two clips can be of one performance by their lengths, and which pins would help."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

from usdhand.anatomy import Hands, Side
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.problems import Problem, counted
from usdhand.splice.locate import RATE, locate
from usdhand.splice.markers import hand_markers
from usdhand.splice.settings import Pin

# Parts whose lengths differ by more than this factor are worth a warning; clips that begin or end
# together, and differ by more than that one, are not of one performance.
UNLIKELY_FACTOR, MOST_FACTOR = 2.0, 3.3
# Beside a pin, parts of less seconds than this are where a clip has not begun yet, or has ended.
LEAST_PART_S = 1.0
# Beyond this many cells, the way back alone would need a gigabyte.
MOST_CELLS = 4 * 2**30
# Tolerance of the pins that are recommended, in seconds.
ADVISED_TOLERANCE_S = 0.3


def length_notes(
    body: Clip,
    hand_clip: Clip,
    pins: Mapping[Side, Sequence[Pin]],
    band: float,
    fps: float,
    advice: Callable[[], str],
) -> list[Problem]:
    """Notes on the lengths of the clips between their ends and pins.

    Raises
    ------
    InputError
        if a clip has less than three frames.
    UsageError
        if lengths are too different where no pin says that they should be.
    """
    for name, clip in (("body", body), ("hand", hand_clip)):
        if len(clip) < 3:
            raise InputError(
                f"The {name} clip, {clip.name}, has only {counted(len(clip), 'frame')}."
            )
    cells = band * body.duration * hand_clip.duration * fps**2
    if cells > MOST_CELLS:
        raise UsageError(
            f"The body lasts {body.duration:.2f} s, the hand clip {hand_clip.duration:.2f} s: too "
            "long to align at once. Give a narrower --band."
        )
    notes: dict[Problem, None] = {}
    for own in pins.values():
        start, end = Pin(0.0, 0.0), Pin(body.duration, hand_clip.duration)
        for one, other in pairwise([start, *own, end]):
            lasts = other.body - one.body, other.hand - one.hand
            shorter, longer = sorted(lasts)
            where = _part(one if one is not start else None, other if other is not end else None)
            lengths = f"{where}the body lasts {lasts[0]:.2f} s, the hand clip {lasts[1]:.2f} s"
            if own and shorter < LEAST_PART_S:
                continue
            if longer > MOST_FACTOR * shorter and (one is start or other is end):
                raise UsageError(
                    f"{_sentence(lengths)}, more than a factor of {MOST_FACTOR:g} apart. {advice()}"
                )
            if longer > UNLIKELY_FACTOR * shorter:
                note = f"{_sentence(lengths)}, more than a factor of {UNLIKELY_FACTOR:g} apart"
                if one is start or other is end:
                    note += f". {advice()}"
                notes[Problem("unlike-lengths", note)] = None
    return list(notes)


def pin_advice(
    body: Clip, hand_clip: Clip, body_hands: Hands, hand_hands: Hands, sides: Sequence[Side]
) -> str:
    """Which pins would say where the shorter clip begins and ends in the longer one."""
    ours = [hand_markers(body, body_hands, side, 2 * RATE) for side in sides]
    theirs = [hand_markers(hand_clip, hand_hands, side, 2 * RATE) for side in sides]
    whole = body.duration, hand_clip.duration
    body_is_longer = whole[0] > whole[1]
    found = locate(ours, theirs) if body_is_longer else locate(theirs, ours)
    if found is None:
        return (
            "Nothing in the longer clip resembles the shorter one: are they of the same "
            "performance? Then pin the moments at which the shorter one begins and ends (--pin)."
        )
    ends = (0.0, whole[1 if body_is_longer else 0])
    pairs = [(a, b) if body_is_longer else (b, a) for a, b in zip(found, ends, strict=True)]
    tolerance = round(ADVISED_TOLERANCE_S * hand_clip.origin.time_codes_per_second)
    options = " ".join(
        f"--pin {_time_code(body, first):g}:{_time_code(hand_clip, second):g}:{tolerance}"
        for first, second in pairs
    )
    longer, shorter = ("body", "hand clip") if body_is_longer else ("hand clip", "body")
    return (
        f"The {shorter} resembles {found[0]:.1f} s to {found[1]:.1f} s of the {longer}: if that "
        f"is right, give {options}"
    )


def _part(one: Pin | None, other: Pin | None) -> str:
    if one and other:
        return f"between the pins {one} and {other} "
    if one:
        return f"after the pin {one} "
    return f"before the pin {other} " if other else ""


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def _time_code(clip: Clip, seconds: float) -> float:
    """Time code of a clip's frame nearest to seconds from its first frame."""
    return clip.time_code(min(round(seconds * clip.fps), len(clip) - 1))
