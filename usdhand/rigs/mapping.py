"""Which joints of a skeleton are its hands: by names, else by hierarchy and geometry, else not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from typing import Any

from usdhand.anatomy.hand import ARM_JOINTS, DIGITS, HAND_JOINTS, SIDES, CharacterMap, HandMap, Side
from usdhand.errors import HandNotFoundError
from usdhand.motion.skeleton import Skeleton
from usdhand.rigs import shape as geometry
from usdhand.rigs.body import arm_joints, body_of
from usdhand.rigs.conventions import (
    METACARPALS,
    TIPS,
    Conventions,
    load_conventions,
    named_side,
)
from usdhand.rigs.naming import ADVICE, NamedJoints, is_hand, match_names, named_body


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
    found = _with_explicit(rig, found, by_hand) if by_hand else found
    return _with_arms_and_body(rig, found)


def _found(rig: NamedJoints, conventions: Conventions) -> CharacterMap:
    """Hands and body as far as names tell, or hands by their shape."""
    aliased = NamedJoints(rig.skeleton, aliased=True) if any(rig.skeleton.aliases) else None
    if aliased and (found := match_names(aliased, conventions)):
        return _with_unnamed_digits(rig, found)
    if found := match_names(rig, conventions):
        found = _with_unnamed_digits(rig, found)
    else:
        found = _by_geometry(rig, conventions)
    return named_body(aliased, found, conventions) if aliased else found


def _with_unnamed_digits(rig: NamedJoints, found: CharacterMap) -> CharacterMap:
    """Add digits of unknown names where the shape of the hand agrees with all names there are."""
    if all(hand.digits == DIGITS for hand in found.hands.values()):
        return found
    shapes = {shape.wrist: shape for shape in geometry.find_hands(rig.skeleton, rig.points)[0]}
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


# --- joints named by the user, arms, body ---------------------------------------------------------


def _with_explicit(
    rig: NamedJoints, found: CharacterMap, tables: Mapping[str, Mapping[str, str]]
) -> CharacterMap:
    """Put the joints of ``[left]``, ``[right]`` and ``[body]`` over what was found."""
    hands = dict(found.hands)
    for side in SIDES:
        if side in tables:
            named = {role: _lookup(rig, side, role, j) for role, j in tables[side].items()}
            hands[side] = _amended(hands.get(side), side, named)
            _check_named(rig, hands[side])
    _check_apart(rig, hands)
    body: dict[str, Any] = {
        r: _lookup(rig, "body", r, j) for r, j in tables.get("body", {}).items()
    }
    notes = (*found.notes, "joints taken from the map file")
    return replace(found, hands=hands, notes=notes, **body)


def _check_named(rig: NamedJoints, hand: HandMap) -> None:
    """Refuse a digit whose joints stand in the wrong order: a map file has them mixed up."""
    for digit in hand.digits:
        chain = [name for name in HAND_JOINTS if name.startswith(digit) and name in hand.joints]
        for above, below in pairwise(chain):
            if hand.joints[below] in rig.skeleton.ancestors(hand.joints[above]):
                raise HandNotFoundError(
                    f"map file, [{hand.side}]: {below} '{rig.path(hand.joints[below])}' is "
                    f"above {above} '{rig.path(hand.joints[above])}'"
                )


def _check_apart(rig: NamedJoints, hands: Mapping[Side, HandMap]) -> None:
    """Refuse a joint that is said to be in both hands."""
    of_side = [{h.wrist, *h.joints.values()} for h in hands.values()]
    shared = set.intersection(*of_side) if len(of_side) == len(SIDES) else set()
    if shared:
        raise HandNotFoundError(f"map file: '{rig.path(min(shared))}' is named for both hands")


def _lookup(rig: NamedJoints, table: str, role: str, name: str) -> int:
    joint = rig.skeleton.find(name)
    if joint is None:
        many = rig.skeleton.names.count(name)
        why = f"is the name of {many} joints: give a path" if many else "is no joint here"
        raise HandNotFoundError(f"map file, [{table}] {role}: '{name}' {why}")
    return joint


def _amended(hand: HandMap | None, side: Side, named: Mapping[str, int]) -> HandMap:
    if hand is None and not (is_hand(named) and "wrist" in named):
        raise HandNotFoundError(
            f"map file, [{side}]: names no whole hand (wrist, and MCP and PIP of two fingers)"
        )
    hand = hand or HandMap(side, named["wrist"], {})
    arm: dict[str, Any] = {r: named[r] for r in ARM_JOINTS if r in named}
    return replace(
        hand,
        joints={**hand.joints, **{r: named[r] for r in HAND_JOINTS if r in named}},
        metacarpals={
            **hand.metacarpals,
            **{d: named[r] for d, r in METACARPALS.items() if r in named},
        },
        tips={**hand.tips, **{d: named[r] for d, r in TIPS.items() if r in named}},
        **arm,
    )


def _with_arms_and_body(rig: NamedJoints, found: CharacterMap) -> CharacterMap:
    """Fill in arm and body joints that names did not give, by hierarchy."""
    wrists = [h.wrist for h in found.hands.values()]
    body = body_of(rig.skeleton, rig.points, wrists).joints
    missing: dict[str, Any] = {r: j for r, j in body.items() if getattr(found, r) is None}
    found = replace(found, **missing)
    notes = [f"{r} by hierarchy: {rig.path(j)}" for r, j in missing.items()]
    hands = {}
    for side, hand in found.hands.items():
        on_neck = found.neck in rig.skeleton.ancestors(hand.wrist)
        trunk = found.neck if on_neck else found.chest
        arm = arm_joints(rig.skeleton, rig.points, hand.wrist, trunk)
        used = {getattr(hand, r) for r in ARM_JOINTS}
        new: dict[str, Any] = {
            r: j for r, j in arm.items() if getattr(hand, r) is None and j not in used
        }
        hands[side] = replace(hand, **new)
        notes += [f"{side} {r} by hierarchy: {rig.path(j)}" for r, j in new.items()]
    return replace(found, hands=hands, notes=(*found.notes, *notes))


# --- geometry ------------------------------------------------------------------------------------


def _by_geometry(rig: NamedJoints, conventions: Conventions) -> CharacterMap:
    found: Sequence[geometry.FoundHand]
    found, reasons = geometry.find_hands(rig.skeleton, rig.points)
    if not found:
        shapes = "; ".join(reasons[:3]) or "no joint has three to five chains of joints below it"
        some = ", ".join(rig.skeleton.names[:3])
        raise HandNotFoundError(
            f"no hand found in {len(rig.names)} joints ({some}, ...): no names "
            f"of the {len(conventions.conventions)} known conventions{_nearest_names(rig)}, and no "
            f"joint chain looks like a hand: {shapes}; {ADVICE}"
        )
    notes = ["joint names are unknown: hands found by hierarchy and bind pose"]
    if len(found) > 1:
        found = _pair(rig, found, notes)
    sides, how = _sides(rig, found)
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
    return CharacterMap(hands, "geometry", notes=tuple(notes))


def _pair(
    rig: NamedJoints, found: Sequence[geometry.FoundHand], notes: list[str]
) -> Sequence[geometry.FoundHand]:
    """Return the two hands of one size; of several such pairs (feet with toes) the highest."""

    def height(pair: Sequence[geometry.FoundHand]) -> float:
        return float(sum(rig.points[h.wrist, 1] for h in pair))

    sizes = [geometry.hand_size(rig.points, h) for h in found]
    alike = [
        (found[a], found[b])
        for a, b in combinations(range(len(found)), 2)
        if max(sizes[a], sizes[b]) < 1.3 * min(sizes[a], sizes[b])
    ]
    if not alike:
        places = ", ".join(rig.path(h.wrist) for h in found)
        raise HandNotFoundError(f"places of different size look like hands: {places}; {ADVICE}")
    if len(found) > 2:
        notes.append(f"{len(found)} places look like hands; the two highest of one size were taken")
    return max(alike, key=height)


def _nearest_names(rig: NamedJoints) -> str:
    """Say which finger-like names there are, for the message."""
    words = ("thumb", "index", "finger", "pinky")
    seen = [n for n, k in zip(rig.names, rig.keys, strict=True) if any(w in k for w in words)]
    return f" with two fingers of two joints (seen: {', '.join(seen[:4])})" if seen else ""


def _sides(rig: NamedJoints, found: Sequence[geometry.FoundHand]) -> tuple[list[Side], str]:
    """Sides of one or two hands and what told them."""
    named = [_named_side(rig, hand) for hand in found]
    if None not in named and len(set(named)) == len(named):
        return [s for s in named if s], "words in the joint names"
    shapes = [geometry.chirality(rig.points, h.wrist, h.joints) for h in found]
    above = [_side_above(rig, hand) for hand in found]
    if len(found) == 1:
        said = {above[0]: "words above it", shapes[0]: "the hand's shape"}
        said.pop(None, None)
        if len(said) != 1:
            why = "shape and names disagree" if said else "neither names nor shape say"
            raise HandNotFoundError(
                f"a hand was found at {rig.path(found[0].wrist)}, but {why} "
                f"whether it is left or right; {ADVICE}"
            )
        return next(([s], how) for s, how in said.items() if s)
    votes = geometry.first_is_left(rig.skeleton, rig.points, found, shapes)
    if set(above) == set(SIDES):
        votes["words above them"] = 1.0 if above[0] == "left" else -1.0
    total = sum(votes.values())
    if abs(total) < 1e-9:
        raise HandNotFoundError(
            f"hands were found at {' and '.join(rig.path(h.wrist) for h in found)}, but nothing "
            f"tells left from right (no toes, flat hands); {ADVICE}"
        )
    how = " and ".join(k for k, v in votes.items() if v * total > 0)
    against = " and ".join(k for k, v in votes.items() if v * total < 0)
    how += f" (against {against})" if against else ""
    return (["left", "right"] if total > 0 else ["right", "left"]), how


def _named_side(rig: NamedJoints, hand: geometry.FoundHand) -> Side | None:
    """Side of the file's own name for the wrist or arm, else of most of the hand's own names."""
    if any(rig.skeleton.aliases):
        for joint in (hand.wrist, *rig.skeleton.ancestors(hand.wrist)):
            if side := named_side(rig.skeleton.aliases[joint]):
                return side
    sides = [named_side(rig.skeleton.names[j]) for j in (hand.wrist, *hand.joints.values())]
    said = {side for side in sides if side}
    return said.pop() if len(said) == 1 and 2 * sides.count(None) < len(sides) else None


def _side_above(rig: NamedJoints, hand: geometry.FoundHand) -> Side | None:
    """Side that names at the wrist and above it speak of; None if any, or a finger's, disagrees."""

    def said(joints: Iterable[int]) -> set[Side]:
        return {side for j in joints if (side := named_side(rig.skeleton.names[j]))}

    above = said((hand.wrist, *rig.skeleton.ancestors(hand.wrist)))
    return above.pop() if len(above) == 1 and said(hand.joints.values()) <= above else None
