"""What names propose, judged by hierarchy and bind pose: geometry wins, and says so."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from usdhand.anatomy.hand import (
    ARM_JOINTS,
    BODY_JOINTS,
    HAND_JOINTS,
    CharacterMap,
    HandMap,
    Side,
    digit_joints,
)
from usdhand.rigs.body import arm_joints, body_of
from usdhand.rigs.by_shape import FoundHand, find_hands
from usdhand.rigs.joint_names import NamedJoints

# Roles that a person or the file itself has named, which geometry does not overrule.
Fixed = Mapping[str, Collection[str]]


def judged_digits(rig: NamedJoints, found: CharacterMap) -> CharacterMap:
    """Digits whose names are counted otherwise than the convention has it, put right.

    Phalanges counted from 0, metacarpals counted as 1 and the like shift a digit along its chain of
    joints; how far the knuckles lie from the wrist and how long the bones are shows it.
    """
    shapes = {shape.wrist: shape for shape in find_hands(rig.skeleton, rig.points)[0]}
    hands, notes = dict(found.hands), list(found.notes)
    for side, hand in found.hands.items():
        shape = shapes.get(hand.wrist)
        if shape is not None:
            hands[side] = _judged_hand(rig, side, hand, shape, notes)
    return replace(found, hands=hands, notes=tuple(notes))


def _judged_hand(
    rig: NamedJoints, side: Side, hand: HandMap, shape: FoundHand, notes: list[str]
) -> HandMap:
    joints, metacarpals, tips = dict(hand.joints), dict(hand.metacarpals), dict(hand.tips)
    for digit in hand.digits:
        roles = [digit + joint for joint in digit_joints(digit)]
        named = {role: joints[role] for role in roles if role in joints}
        formed = {role: shape.joints[role] for role in roles if role in shape.joints}
        if named == formed and digit in shape.metacarpals:
            metacarpals.setdefault(digit, shape.metacarpals[digit])
        if named == formed or not set(named.values()) & set(formed.values()):
            continue
        for role in roles:
            joints.pop(role, None)
        joints |= formed
        for own, theirs in ((metacarpals, shape.metacarpals), (tips, shape.tips)):
            own.pop(digit, None)
            if digit in theirs:
                own[digit] = theirs[digit]
        role = next(role for role in roles if named.get(role) != formed.get(role))
        was = rig.path(named[role]) if role in named else "no joint"
        is_now = rig.path(formed[role]) if role in formed else "no joint"
        notes.append(f"{side} {role} by the lengths of the hand: {is_now}, by its name {was}")
    ordered = {role: joints[role] for role in sorted(joints, key=HAND_JOINTS.index)}
    return replace(hand, joints=ordered, metacarpals=metacarpals, tips=tips)


def judged_arms(rig: NamedJoints, found: CharacterMap, fixed: Fixed) -> CharacterMap:
    """Arm and body joints by hierarchy and bind pose, as far as these show them.

    What names say beyond that stays. So a take gives the same result whatever its joints are
    called.

    Parameters
    ----------
    fixed : "left", "right", "body" -> roles that are not to be changed
    """
    wrists = [h.wrist for h in found.hands.values()]
    notes = list(found.notes)
    body = body_of(rig.skeleton, rig.points, wrists).joints
    new = _judged(rig, found, body, BODY_JOINTS, fixed.get("body", ()), "", notes)
    found = replace(found, **new)
    hands = {}
    for side, hand in found.hands.items():
        on_neck = found.neck in rig.skeleton.ancestors(hand.wrist)
        trunk = found.neck if on_neck else found.chest
        arm = arm_joints(rig.skeleton, rig.points, hand.wrist, trunk)
        roles = ARM_JOINTS[:3]
        hands[side] = replace(
            hand, **_judged(rig, hand, arm, roles, fixed.get(side, ()), f"{side} ", notes)
        )
    return replace(found, hands=hands, notes=tuple(notes))


def _judged(
    rig: NamedJoints,
    named: CharacterMap | HandMap,
    shown: Mapping[str, int],
    roles: Collection[str],
    fixed: Collection[str],
    whose: str,
    notes: list[str],
) -> dict[str, Any]:
    """Roles whose joints change, with a note each."""
    new: dict[str, Any] = {}
    for role in roles:
        own, theirs = getattr(named, role), shown.get(role)
        gone = theirs is None and whose != "" and own in shown.values()  # it is another arm joint
        if role in fixed or own == theirs or (theirs is None and not gone):
            continue
        new[role] = theirs
        if own is None and theirs is not None:
            notes.append(f"{whose}{role} by hierarchy: {rig.path(theirs)}")
        elif own is not None:
            is_now = "no joint" if theirs is None else rig.path(theirs)
            notes.append(f"{whose}{role} by hierarchy: {is_now}, by its name {rig.path(own)}")
    return new
