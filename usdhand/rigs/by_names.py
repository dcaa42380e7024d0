"""Hands found by the names of joints: the convention that fits best decides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from usdhand.anatomy.hand import ARM_JOINTS, BODY_JOINTS, HAND_JOINTS, SIDES, CharacterMap
from usdhand.errors import HandNotFoundError
from usdhand.rigs.choose_joints import choose_hand, nearest_above
from usdhand.rigs.convention_match import ConventionMatch, convention_matches, exact_roles
from usdhand.rigs.conventions import Conventions
from usdhand.rigs.joint_names import ADVICE, Candidates, NamedJoints
from usdhand.rigs.unsided import unsided_hands


def match_names(rig: NamedJoints, conventions: Conventions) -> CharacterMap | None:
    """Map the hands by the convention that fits best; None if none gives a whole hand.

    Raises
    ------
    HandNotFoundError
        if names could mean several joints, and nothing tells which.
    """
    matches = [m for c in conventions.conventions for m in convention_matches(rig, c)]
    matches.sort(key=lambda m: m.rank, reverse=True)  # stable: then the order in the file
    for match in matches:
        if found := _character(rig, match, matches):
            return found
    return None


def named_body(rig: NamedJoints, found: CharacterMap, conventions: Conventions) -> CharacterMap:
    """Put the arm and body joints with names of the best convention over what was found.

    For names that are a file's own statement and need no hand to be believed: its aliases.
    """
    convention = max(conventions.conventions, key=lambda c: len(exact_roles(rig, c.body_keys)))
    wrists = [h.wrist for h in found.hands.values()]
    body: dict[str, Any] = _body(rig, exact_roles(rig, convention.body_keys), wrists)
    hands = {}
    for side, hand in found.hands.items():
        roles = exact_roles(rig, convention.hand_keys.get(side, {}))
        arms: dict[str, Any] = {r: roles[r][0] for r in ARM_JOINTS[:3] if r in roles}
        hands[side] = replace(hand, **arms)
    return replace(found, hands=hands, **body)


def _character(
    rig: NamedJoints, match: ConventionMatch, matches: Sequence[ConventionMatch]
) -> CharacterMap | None:
    """Hands and body of one match; None if it has no whole hand."""
    notes: list[str] = []
    if None in match.hands:
        same = [m for m in matches if m.convention is match.convention]
        hands = unsided_hands(rig, same, notes)
    else:
        _refuse_twins(rig, match, matches)
        hands = {}
        for side in SIDES:
            roles = match.hands.get(side)
            if roles and (hand := choose_hand(rig, side, roles, notes)):
                hands[side] = hand
    if not hands:
        return None
    if len(hands) == 1:
        notes.append(f"only a {next(iter(hands))} hand was found")
    if any(m.rank[:-1] == match.rank[:-1] and m.rank[-1] < match.rank[-1] for m in matches):
        name = match.convention.name
        notes.append(f"names are read as those of {name}, by the position of the thumb")
    body: dict[str, Any] = _body(rig, match.body, [h.wrist for h in hands.values()])
    pronation = match.convention.pronation
    return CharacterMap(
        hands, match.convention.name, **body, notes=tuple(notes), pronation=pronation
    )


def _refuse_twins(
    rig: NamedJoints, match: ConventionMatch, matches: Sequence[ConventionMatch]
) -> None:
    """Refuse two complete sets of hands with different prefixes and nothing to prefer one."""
    for other in matches:
        if other is match or other.convention is not match.convention:
            continue
        # The first seven places say how complete a match is and whose prefix it has; a plain set
        # wins over prefixed copies of it (FK and IK copies of the deforming joints).
        if other.rank[:7] != match.rank[:7] or not match.prefix + match.suffix:
            continue
        side = next(iter(match.hands))
        role = next(r for r in HAND_JOINTS if r in match.hands[side])
        if role in other.hands.get(side, {}) and other.hands[side] != match.hands[side]:
            paths = [rig.path(m.hands[side][role][0]) for m in (match, other)]
            raise HandNotFoundError(
                f"two sets of joints are named as hands ({match.convention.name}), e.g. "
                f"{paths[0]} and {paths[1]}; {ADVICE}"
            )


def _body(rig: NamedJoints, roles: Candidates, wrists: Sequence[int]) -> dict[str, int]:
    return {r: nearest_above(rig, roles[r], *wrists) for r in BODY_JOINTS if roles.get(r)}
