"""Splice: a hand clip retimed onto a body clip (Majkowska, Zordan & Faloutsos 2006)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from usdhand.anatomy import SIDES, Hands, Side
from usdhand.anatomy.channels import encode
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.problems import Problem
from usdhand.progress import Progress
from usdhand.splice.alignment import Alignment, aligned_hands
from usdhand.splice.finger_notes import frozen_notes, held_pose_notes, still_finger_notes
from usdhand.splice.merge import fingers_along, with_fingers, with_wrist, wrist_along
from usdhand.splice.pin_notes import contradiction_notes
from usdhand.splice.settings import SpliceSettings


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
    sides = common_sides(body_hands, hand_hands)
    aligned, problems = aligned_hands(
        body, hand_clip, body_hands, hand_hands, sides, settings, progress
    )
    problems += still_finger_notes(body, hand_clip, body_hands, hand_hands, sides)
    clip, hands = body, {}
    for side, alignment in aligned.items():
        warp, exact = alignment.warp[:, 1], exact_frames(alignment)
        if settings.wrist == "hands":
            bends = wrist_along(hand_clip, hand_hands, side, warp, exact)
            clip = with_wrist(clip, body_hands, side, bends)
        frames, other = body_hands.frames[side], hand_hands.frames[side]
        names, frozen = encode(body, frames).names, alignment.frozen[1]
        taken = fingers_along(hand_clip, other, names, warp, exact, frozen)
        clip = with_fingers(clip, frames, taken)
        hands[side] = replace(alignment, channels=taken.names)
    problems += contradiction_notes(body, {s: a.contradictions for s, a in hands.items()})
    problems += frozen_notes(body, hand_clip, {s: a.frozen for s, a in hands.items()})
    problems += held_pose_notes(body, hand_clip, {s: a.warp[:, 1] for s, a in hands.items()})
    return Spliced(clip, hands, tuple(problems), settings)


def common_sides(body_hands: Hands, hand_hands: Hands) -> list[Side]:
    """Sides of the hands that both clips have.

    Raises
    ------
    HandNotFoundError
        if there are none, or no finger joint of one is in both.
    """
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
    return sides


def exact_frames(alignment: Alignment) -> Array:
    """Which frames of the body an exact pin is on."""
    times = alignment.warp[:, 0]
    at = np.array([p.body for p in alignment.pins if p.tolerance == 0]) / times[1]
    frames = np.rint(at).astype(np.intp)
    exact = np.zeros(len(times), bool)
    exact[frames[np.abs(at - frames) < 1e-3]] = True
    return exact
