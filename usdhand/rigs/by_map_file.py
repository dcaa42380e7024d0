"""Joints that a user named one by one in a map file, put over what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from usdhand.anatomy.hand import ARM_JOINTS, HAND_JOINTS, SIDES, CharacterMap, HandMap, Side
from usdhand.errors import HandNotFoundError
from usdhand.rigs.convention_match import is_hand
from usdhand.rigs.conventions import LONGEST, METACARPALS, TIPS
from usdhand.rigs.joint_names import NamedJoints


def with_explicit(
    rig: NamedJoints, found: CharacterMap, tables: Mapping[str, Mapping[str, str]]
) -> CharacterMap:
    """Put the joints of ``[left]``, ``[right]`` and ``[body]`` over what was found.

    Raises
    ------
    HandNotFoundError
        if a joint is not there, or joints stand in an order that no hand has.
    """
    hands = dict(found.hands)
    for side in SIDES:
        if side in tables:
            named = {role: _lookup(rig, side, role, j) for role, j in tables[side].items()}
            hands[side] = _amended(hands.get(side), side, named)
            _check_once(rig, side, named)
            _check_named(rig, hands[side])
    _check_apart(rig, hands)
    body: dict[str, Any] = {
        r: _lookup(rig, "body", r, j) for r, j in tables.get("body", {}).items()
    }
    notes = (*found.notes, "joints taken from the map file")
    return replace(found, hands=hands, notes=notes, **body)


def _check_once(rig: NamedJoints, side: Side, named: Mapping[str, int]) -> None:
    """Refuse a joint that is said to be two of the same hand."""
    seen: dict[int, str] = {}
    for role, joint in named.items():
        if (other := seen.setdefault(joint, role)) != role:
            raise HandNotFoundError(
                f"map file, [{side}]: '{rig.path(joint)}' is named for both {other} and {role}"
            )


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
        why = f"is the name of {many} joints: give a path" if many else "is not in the skeleton"
        shown = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        raise HandNotFoundError(f"map file, [{table}] {role}: '{shown}' {why}")
    return joint


def _amended(hand: HandMap | None, side: Side, named: Mapping[str, int]) -> HandMap:
    if hand is None and not (is_hand(named) and "wrist" in named):
        raise HandNotFoundError(
            f"map file, [{side}]: names no complete hand (wrist, and MCP and PIP of two fingers)"
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
