"""Finger joints for bodies that have none, from the characters of a library or a chosen one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from usdhand.anatomy import HAND_JOINTS, SIDES, Side
from usdhand.errors import InputError, UsageError
from usdhand.fill.library import LibraryClip, MotionLibrary
from usdhand.formats.files import read_character
from usdhand.formats.usd.names import legal_skeleton
from usdhand.motion import Clip
from usdhand.problems import listed
from usdhand.requests.fill import FillRequest
from usdhand.requests.shared import sides as sides_of
from usdhand.rigs import Conventions
from usdhand.rigs.fingerless import fingerless_arms, own_digits
from usdhand.rigs.graft import Grafted, graft_hands, hand_shapes
from usdhand.rigs.height import body_height
from usdhand.verbs.clips import find_hands
from usdhand.verbs.outcome import Journal

_FINGER = re.compile(r"thumb|index|middle|ring|pinky|little", re.IGNORECASE)

HAND_ROLES = set(HAND_JOINTS)


@dataclass(frozen=True, eq=False)
class WithFingers:
    """A clip with finger joints added, which ones, and whose they are."""

    grafted: Grafted
    source: str

    @property
    def joints(self) -> dict[Side, list[str]]:
        """Paths of the added joints by hand, as they are written."""
        skeleton = self.grafted.clip.skeleton
        written = dict(zip(skeleton.joints, legal_skeleton(skeleton).joints, strict=True))
        return {side: [written[p] for p in paths] for side, paths in self.grafted.added.items()}


def lacks_fingers(
    clip: Clip, conventions: Conventions | None = None, sides: Sequence[Side] = SIDES
) -> list[Side]:
    """Sides on which a body has an arm and no fingers."""
    arms = fingerless_arms(clip.skeleton, conventions)
    return [side for side in sides if arms is not None and side in arms.character.hands]


def whole_digits(
    clip: Clip, conventions: Conventions | None = None, sides: Sequence[Side] = SIDES
) -> dict[Side, dict[str, list[str]]]:
    """Names of the joints of whole digits that a body without whole hands has."""
    arms = fingerless_arms(clip.skeleton, conventions)
    there = [side for side in sides if arms and side in arms.character.hands]
    found = {side: own_digits(clip.skeleton, arms, side) for side in there if arms}
    return {side: digits for side, digits in found.items() if digits}


def finger_stubs(
    clip: Clip, conventions: Conventions | None = None, sides: Sequence[Side] = SIDES
) -> dict[Side, list[str]]:
    """Names of finger joints that a body without whole fingers has; new ones stand beside them."""
    arms, skeleton = fingerless_arms(clip.skeleton, conventions), clip.skeleton
    found: dict[Side, list[str]] = {}
    for side in sides:
        hand = arms.character.hands.get(side) if arms else None
        below = sorted(skeleton.descendants(hand.wrist)) if hand else []
        stubs = [name for joint in below if _FINGER.search(name := skeleton.names[joint])]
        if stubs:
            found[side] = stubs
    return found


def fingers_like(
    clip: Clip,
    source: Path,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
    *,
    replace: bool = False,
) -> WithFingers:
    """Give a body the finger joints of a character in a file."""
    donor = read_character(source)
    shapes = hand_shapes(donor.skeleton, find_hands(donor, conventions))
    made = graft_hands(clip, shapes, conventions, sides, replace_fingers=replace)
    return WithFingers(made, str(source))


def fingers_from_library(
    clip: Clip,
    library: MotionLibrary,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
    *,
    replace: bool = False,
) -> WithFingers:
    """Give a body the finger joints of the library's character that fits best.

    That is one with most hand joints, and of those the one nearest in height.

    Raises
    ------
    InputError
        if the library has no character's hands.
    """
    donor = _most_fitting(clip, library, conventions)
    if donor is None:
        raise InputError(
            "The library has no character's hands to take finger joints from; someone removed "
            "them. Choose a character with --fingers-from."
        )
    made = graft_hands(clip, donor.shapes, conventions, sides, replace_fingers=replace)
    return WithFingers(made, donor.path)


def _most_fitting(
    clip: Clip, library: MotionLibrary, conventions: Conventions | None
) -> LibraryClip | None:
    arms = fingerless_arms(clip.skeleton, conventions)
    height = body_height(clip.skeleton, arms.character) if arms else 1.0

    def fit(entry: LibraryClip) -> tuple[int, float, str]:
        joints = sum(len(set(shape.roles) & HAND_ROLES) for shape in entry.shapes.values())
        away = abs(float(np.log(entry.height / height)))
        return -joints, round(away, 3), entry.name

    return min((entry for entry in library.clips if entry.shapes), key=fit, default=None)


def add_fingers(
    request: FillRequest,
    clip: Clip,
    library: MotionLibrary,
    conventions: Conventions | None,
    journal: Journal,
) -> WithFingers | None:
    """Add the finger joints that a request asks for, where the body has none; else say so."""
    wanted, replace = sides_of(request.side), request.replace_fingers
    bare = lacks_fingers(clip, conventions, wanted)
    if not (request.add_fingers or request.fingers_from):
        if replace:
            raise UsageError("--replace-fingers is for --add-fingers or --fingers-from.")
        if bare and len(bare) < len(wanted):
            message = f"the {bare[0]} hand has no finger joints; --add-fingers adds some"
            journal.warn("no-finger-joints", message, request.body)
        return None
    if not bare:
        journal.warn("has-fingers", f"{request.body} has finger joints, so none are added")
        return None
    if request.fingers_from:
        added = fingers_like(clip, request.fingers_from, conventions, bare, replace=replace)
    else:
        added = fingers_from_library(clip, library, conventions, bare, replace=replace)
    kept = {} if replace else whole_digits(clip, conventions, bare)
    for hand, digits in kept.items():
        names = [name for chain in digits.values() for name in chain]
        what = " and ".join(digit.lower() for digit in digits)
        message = (
            f"{hand} hand: {listed(names)} stays its {what} and gets the motion; "
            f"--replace-fingers adds a new {what}"
        )
        journal.warn("kept-fingers", message)
    for hand, stubs in finger_stubs(clip, conventions, bare).items():
        own = [name for chain in kept.get(hand, {}).values() for name in chain]
        stubs = [name for name in stubs if not name.startswith(tuple(own))]
        if stubs:
            what = "thumb" if all("thumb" in name.lower() for name in stubs) else "fingers"
            message = f"{hand} hand: {listed(stubs)} stays beside the added {what}"
            journal.warn("finger-stub", message)
    return added
