"""What a person should know about filled fingers."""

from __future__ import annotations

from collections.abc import Iterator

from usdhand.fill.library import MotionLibrary
from usdhand.fill.results import Filled
from usdhand.fill.settings import FillSettings
from usdhand.problems import Problem, counted, listed


def fill_problems(
    filled: Filled, library: MotionLibrary, settings: FillSettings, body: str
) -> list[Problem]:
    """Everything that a person should know, in words; ``body`` names the file."""
    return [
        *_hands(filled, body),
        *_joints(filled, library),
        *_candidates(filled, settings),
        *_stretched(filled),
    ]


def _hands(filled: Filled, body: str) -> Iterator[Problem]:
    if filled.kept:
        which = " and ".join(filled.kept)
        message = f"the {which} fingers move already and are kept; --replace replaces them"
        yield Problem("kept", message, file=body)
    for side in filled.without:
        message = f"the library has no motion of a {side} hand like this one; it stays as it is"
        yield Problem("no-motion", message)
    for side in filled.still:
        message = f"the {side} arm does not move, so its fingers hold one pose"
        yield Problem("still-arm", message, file=body)


def _joints(filled: Filled, library: MotionLibrary) -> Iterator[Problem]:
    """Which joints were not filled, and which clips were not used for the sake of others."""
    for side, names in filled.missing.items():
        some = [
            clip.name
            for clip in library.clips
            if clip.name not in filled.left_out
            and side in clip.hands
            and {*names} & {*clip.hands[side].joints}
        ]
        which = (
            f"only {counted(len(some), 'clip')} of the library ({listed(some)})"
            if some
            else "no clip of the library"
        )
        verb = "has" if len(some) < 2 else "have"
        joints = f"{', '.join(names)} of the {side} hand"
        message = f"{which} {verb} {joints}: they keep the body's values"
        yield Problem("missing-joints", message)
    for side, names in filled.set_aside.items():
        message = (
            f"{side} hand: {counted(len(names), 'clip')} of the library set aside for lack of "
            f"joints that most others have ({listed(names)})"
        )
        yield Problem("set-aside", message)


def _candidates(filled: Filled, settings: FillSettings) -> Iterator[Problem]:
    for part in filled.parts:
        if part.usable < settings.k:
            message = (
                f"the library has only {counted(part.usable, 'segment')} for the "
                f"{' and '.join(part.part)} hand, fewer than the {settings.k} candidates per "
                "segment that were asked for"
            )
            yield Problem("few-segments", message)
    if len(filled.clips) < settings.alternatives:
        ways = "is only 1 way" if len(filled.clips) == 1 else f"are only {len(filled.clips)} ways"
        yield Problem("few-alternatives", f"there {ways} that differ")
    if filled.left_out:
        message = f"not used, since it is the same performance: {', '.join(filled.left_out)}"
        yield Problem("same-motion", message)


def _stretched(filled: Filled) -> Iterator[Problem]:
    for part in filled.parts:
        best = part.alternatives[0].choices
        odd = [s for c in best if round(s := c.candidates[c.chosen].stretch, 6) != 1.0]
        if not odd:
            continue
        for side in part.part:
            message = (
                f"{side} hand: the library has no segment of similar length for {len(odd)} of "
                f"{len(best)} segments; their fingers move up to "
                f"{max(max(x, 1 / x) for x in odd):.1f} times faster or slower"
            )
            yield Problem("stretched", message)
