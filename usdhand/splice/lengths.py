"""Whether two clips can be of one performance by their lengths, and which pins would help."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

from usdhand.anatomy import Side
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.problems import Problem, counted
from usdhand.splice.locate import Place
from usdhand.splice.settings import Pin

# Parts whose lengths differ by more than this factor are worth a warning; clips that begin or end
# together, and differ by more than that one, are not of one performance.
UNLIKELY_FACTOR, MOST_FACTOR = 2.0, 3.3
# Beside a pin, parts of less seconds than this are where a clip has not begun yet, or has ended.
LEAST_PART_S = 1.0
# Tolerance of the pins that are recommended, in seconds.
ADVISED_TOLERANCE_S = 0.3
# Tolerance of pins that motion tells.
FOUND_TOLERANCE_S = 0.15


def check_frames(body: Clip, hand_clip: Clip) -> None:
    """Refuse clips that are too short to move.

    Raises
    ------
    InputError
        if a clip has less than three frames.
    """
    for name, clip in (("body", body), ("hand", hand_clip)):
        if len(clip) < 3:
            raise InputError(
                f"The {name} clip, {clip.name}, has only {counted(len(clip), 'frame')}."
            )


def length_notes(
    body: Clip,
    hand_clip: Clip,
    pins: Mapping[Side, Sequence[Pin]],
    advice: Callable[[], str],
) -> list[Problem]:
    """Notes on the lengths of the clips between their ends and pins.

    Raises
    ------
    UsageError
        if lengths are too different where no pin says that they should be.
    """
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


def pin_advice(body: Clip, hand_clip: Clip, place: Place | None) -> str:
    """Which pins would say what the clips share."""
    if place is None or not place.shared:
        return (
            "Nothing in the longer clip resembles the shorter one: are they of the same "
            "performance? Then pin the moments at which the shorter one begins and ends (--pin)."
        )
    tolerance = round(ADVISED_TOLERANCE_S * hand_clip.origin.time_codes_per_second)
    options = " ".join(f"--pin {text}:{tolerance}" for text in _pin_texts(body, hand_clip, place))
    several = "" if place.clear else ", but other parts as much"
    return f"{_sentence(_shared_parts(place))}{several}: if that is right, give {options}"


def pins_of(body: Clip, hand_clip: Clip, place: Place) -> tuple[Pin, ...]:
    """Pins at both ends of what clips share."""
    tolerance = max(FOUND_TOLERANCE_S, place.within)
    moments = zip(place.body, place.hand, _pin_texts(body, hand_clip, place), strict=True)
    return tuple(Pin(ours, theirs, tolerance, name=text) for ours, theirs, text in moments)


def part_note(body: Clip, hand_clip: Clip, place: Place) -> Problem:
    """Note on clips of which only parts were found to belong together."""
    options = " ".join(f"--pin {text}" for text in _pin_texts(body, hand_clip, place))
    return Problem(
        "found-part",
        f"{_shared_parts(place)}, as the motion tells; if that is wrong, pin where they begin and "
        f"end together, as in {options}",
    )


def _shared_parts(place: Place) -> str:
    (b0, b1), (h0, h1) = place.body, place.hand
    return f"{h0:.1f} to {h1:.1f} s of the hand clip show {b0:.1f} to {b1:.1f} s of the body"


def _pin_texts(body: Clip, hand_clip: Clip, place: Place) -> list[str]:
    return [
        f"{_time_code(body, ours):g}:{_time_code(hand_clip, theirs):g}"
        for ours, theirs in zip(place.body, place.hand, strict=True)
    ]


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
