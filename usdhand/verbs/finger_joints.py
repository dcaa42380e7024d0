"""Finger joints for bodies that have none, from the characters of a library or a chosen one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from usdhand.anatomy import HAND_JOINTS, SIDES, Side
from usdhand.errors import InputError, UsdHandError
from usdhand.fill.library import LibraryClip, MotionLibrary
from usdhand.formats.files import read_character, read_clip
from usdhand.formats.usd.names import legal_skeleton
from usdhand.motion import Clip
from usdhand.problems import listed
from usdhand.requests.fill import FillRequest
from usdhand.requests.shared import sides as sides_of
from usdhand.rigs import Conventions
from usdhand.rigs.fingerless import fingerless_arms
from usdhand.rigs.graft import Grafted, add_finger_joints
from usdhand.rigs.height import body_height
from usdhand.verbs.clips import find_hands
from usdhand.verbs.outcome import Journal

_FINGER = re.compile(r"thumb|index|middle|ring|pinky|little", re.IGNORECASE)

# Characters of a library that are tried, most fitting first, before it is said that none is there.
TRIED = 8


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
    clip: Clip, source: Path, conventions: Conventions | None = None, sides: Sequence[Side] = SIDES
) -> WithFingers:
    """Give a body the finger joints of a character in a file."""
    donor = read_character(source)
    hands = find_hands(donor, conventions)
    return WithFingers(
        add_finger_joints(clip, donor.skeleton, hands, conventions, sides), str(source)
    )


def fingers_from_library(
    clip: Clip,
    library: MotionLibrary,
    folder: Path,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
) -> WithFingers:
    """Give a body the finger joints of the library's character that fits best.

    That is one with most hand joints, and of those the one nearest in height.

    Parameters
    ----------
    folder : of the library, which its clips' paths are relative to

    Raises
    ------
    InputError
        if the files of the library's clips cannot be read.
    """
    reasons: list[str] = []
    for entry in _by_fit(clip, library, conventions)[:TRIED]:
        try:
            donor = read_clip(folder / entry.path, entry.skel or None)
            hands = find_hands(donor, conventions)
        except UsdHandError as error:
            reasons.append(str(error))
            continue
        return WithFingers(
            add_finger_joints(clip, donor.skeleton, hands, conventions, sides), entry.path
        )
    raise InputError(
        "No character of the library can be read to take finger joints from "
        f"({reasons[0] if reasons else 'the library is empty'}). Choose one with --fingers-from."
    )


def _by_fit(
    clip: Clip, library: MotionLibrary, conventions: Conventions | None
) -> list[LibraryClip]:
    """A clip of each character, the most fitting one first."""
    arms = fingerless_arms(clip.skeleton, conventions)
    height = body_height(clip.skeleton, arms.character) if arms else 1.0

    def fit(entry: LibraryClip) -> tuple[int, float, str]:
        joints = sum(len(hand.joints) for hand in entry.hands.values())
        away = abs(float(np.log(entry.height / height)))
        return min(2 * len(HAND_JOINTS), joints), -round(away, 3), entry.name

    def character(entry: LibraryClip) -> tuple[str, float]:
        return entry.skel, round(entry.height, 1)

    first: dict[tuple[str, float], LibraryClip] = {}
    for entry in sorted(library.clips, key=lambda e: e.name):
        first.setdefault(character(entry), entry)
    joints_then_height = sorted(first.values(), key=lambda e: (-fit(e)[0], -fit(e)[1], e.name))
    # Where a character's first clip is gone, its others may be there.
    return joints_then_height + [e for e in library.clips if first[character(e)] is not e]


def add_fingers(
    request: FillRequest,
    clip: Clip,
    library: MotionLibrary,
    conventions: Conventions | None,
    journal: Journal,
) -> WithFingers | None:
    """Add the finger joints that a request asks for, where the body has none; else say so."""
    wanted = sides_of(request.side)
    bare = lacks_fingers(clip, conventions, wanted)
    if not (request.add_fingers or request.fingers_from):
        if bare and len(bare) < len(wanted):
            message = f"the {bare[0]} hand has no finger joints; --add-fingers adds some"
            journal.warn("no-finger-joints", message, request.body)
        return None
    if not bare:
        journal.warn("has-fingers", f"{request.body} has finger joints, so none are added")
        return None
    if request.fingers_from:
        added = fingers_like(clip, request.fingers_from, conventions, bare)
    else:
        folder = request.library.absolute().parent
        added = fingers_from_library(clip, library, folder, conventions, bare)
    for hand, stubs in finger_stubs(clip, conventions, bare).items():
        what = "thumb" if all("thumb" in name.lower() for name in stubs) else "fingers"
        message = f"{hand} hand: {listed(stubs)} stays beside the added {what}"
        journal.warn("finger-stub", message)
    return added
