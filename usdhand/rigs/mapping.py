"""Which joints of a skeleton are its hands: decided between map file, names and shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from usdhand.anatomy.hand import ARM_JOINTS, BODY_JOINTS, DIGITS, SIDES, CharacterMap
from usdhand.errors import HandNotFoundError
from usdhand.motion.skeleton import Skeleton
from usdhand.problems import counted, listed
from usdhand.rigs.by_map_file import with_explicit
from usdhand.rigs.by_names import match_names, named_body
from usdhand.rigs.by_shape import FoundHand, find_hands, hand_size
from usdhand.rigs.convention_match import is_hand
from usdhand.rigs.conventions import Conventions, load_conventions
from usdhand.rigs.joint_names import ADVICE, NamedJoints
from usdhand.rigs.judge import judged_arms, judged_hands
from usdhand.rigs.sides import BY_WORDS, judged_sides, sides_of


def map_character(skeleton: Skeleton, conventions: Conventions | None = None) -> CharacterMap:
    """Find the hands of a character, and the arm and body joints that go with them.

    Joints that the user named one by one win; then the names that the file gives its joints besides
    their own (`Skeleton.aliases`), the names of known conventions, the hierarchy and the bind pose.

    Parameters
    ----------
    skeleton : the character's joints
    conventions : from `load_conventions`; the packaged ones if None

    Raises
    ------
    HandNotFoundError
        There is no hand, or more than one joint could be the same joint of a hand.
    """
    conventions = load_conventions() if conventions is None else conventions
    rig = NamedJoints(skeleton)
    by_hand = conventions.explicit
    try:
        found = _found(rig, conventions)
    except HandNotFoundError as error:
        if not any(is_hand(by_hand.get(side, {})) for side in SIDES):
            raise
        found = CharacterMap({}, "map file", notes=(f"beyond the map file: {error}",))
    found = with_explicit(rig, found, by_hand) if by_hand else found
    fixed: dict[str, set[str]] = {side: set(by_hand.get(side, ())) for side in (*SIDES, "body")}
    if any(skeleton.aliases):
        fixed = {where: {*ARM_JOINTS, *BODY_JOINTS} for where in fixed}
    return judged_arms(rig, found, fixed)


def _found(rig: NamedJoints, conventions: Conventions) -> CharacterMap:
    """Hands and body as far as names tell, or hands by their shape."""
    aliased = NamedJoints(rig.skeleton, aliased=True) if any(rig.skeleton.aliases) else None
    if aliased and (found := match_names(aliased, conventions)):
        return _with_unnamed_digits(rig, found)
    if found := match_names(rig, conventions):
        found = judged_hands(rig, _with_unnamed_digits(rig, found), conventions.explicit)
    else:
        found = _hands_by_shape(rig, conventions)
    return named_body(aliased, found, conventions) if aliased else found


def _with_unnamed_digits(rig: NamedJoints, found: CharacterMap) -> CharacterMap:
    """Add digits of unknown names where the shape of the hand agrees with all names there are."""
    if all(hand.digits == DIGITS for hand in found.hands.values()):
        return found
    shapes = {shape.wrist: shape for shape in find_hands(rig.skeleton, rig.points)[0]}
    hands, notes = dict(found.hands), list(found.notes)
    for side, hand in found.hands.items():
        shape = shapes.get(hand.wrist)
        if shape is None or not hand.joints.items() <= shape.joints.items():
            continue
        new = hands[side] = replace(
            hand,
            joints=shape.joints,
            metacarpals={**shape.metacarpals, **hand.metacarpals},
            tips={**shape.tips, **hand.tips},
        )
        notes += [f"{side} {d} by shape" for d in new.digits if d not in hand.digits]
    return replace(found, hands=hands, notes=tuple(notes))


def _hands_by_shape(rig: NamedJoints, conventions: Conventions) -> CharacterMap:
    """Hands that hierarchy and bind pose show, or the error that says why there are none."""
    found: Sequence[FoundHand]
    found, reasons = find_hands(rig.skeleton, rig.points)
    if not found:
        shapes = "; ".join(reasons[:3]) or "no joint has three to five chains of joints below it"
        raise HandNotFoundError(
            f"no hand found in {counted(len(rig.names), 'joint')} ({listed(rig.skeleton.names)}): "
            f"no names of the {len(conventions.conventions)} known conventions"
            f"{_nearest_names(rig)}, and no joint chain looks like a hand: {shapes}; {ADVICE}"
        )
    notes = ["joint names are unknown: hands found by hierarchy and bind pose"]
    if len(found) > 1:
        found = _pair(rig, found, notes)
    sides, how = sides_of(rig, found)
    notes.append(f"left and right by {how}")
    hands = {side: hand.with_side(side) for side, hand in zip(sides, found, strict=True)}
    for side, hand in hands.items():
        if hand.missing:
            notes.append(
                f"{side} hand, digits named from the thumb outwards: no {', '.join(hand.missing)}"
            )
    if len(hands) == 1:
        others = f" ({'; '.join(reasons[:3])})" if reasons else ""
        notes.append(f"only a {sides[0]} hand was found{others}")
    evidence = [f"{side} hand by its shape alone" for side in hands]
    named = how == BY_WORDS
    evidence += [] if named else [f"left and right by {how}"]
    found_map = CharacterMap(hands, "geometry", notes=tuple(notes), evidence=tuple(evidence))
    by_file = conventions.explicit or any(rig.skeleton.aliases)
    return judged_sides(rig, found_map) if named and not by_file else found_map


def _pair(rig: NamedJoints, found: Sequence[FoundHand], notes: list[str]) -> Sequence[FoundHand]:
    """Return the two hands of one size; of several such pairs (feet with toes) the highest."""

    def height(pair: Sequence[FoundHand]) -> float:
        return float(sum(rig.points[h.wrist, 1] for h in pair))

    sizes = [hand_size(rig.points, h) for h in found]
    same_size = [
        (found[a], found[b])
        for a, b in combinations(range(len(found)), 2)
        if max(sizes[a], sizes[b]) < 1.3 * min(sizes[a], sizes[b])
    ]
    if not same_size:
        places = ", ".join(rig.path(h.wrist) for h in found)
        message = f"several places look like hands, but differ in size: {places}"
        raise HandNotFoundError(f"{message}; {ADVICE}")
    if len(found) > 2:
        notes.append(f"{len(found)} places look like hands; the two highest of one size are used")
    return max(same_size, key=height)


def _nearest_names(rig: NamedJoints) -> str:
    """Say which finger-like names there are, for the message."""
    words = ("thumb", "index", "finger", "pinky")
    seen = [n for n, k in zip(rig.names, rig.keys, strict=True) if any(w in k for w in words)]
    return f" with two fingers of two joints (seen: {', '.join(seen[:4])})" if seen else ""
