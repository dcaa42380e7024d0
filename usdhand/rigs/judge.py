"""What names propose, judged by hierarchy and bind pose: geometry wins, and says so."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from usdhand.anatomy.hand import (
    ARM_JOINTS,
    BODY_JOINTS,
    DIGITS,
    FINGERS,
    HAND_JOINTS,
    CharacterMap,
    HandMap,
    Side,
    digit_joints,
)
from usdhand.rigs.body import arm_joints, body_of
from usdhand.rigs.by_shape import FoundHand, find_hands, hand_size
from usdhand.rigs.joint_names import NamedJoints
from usdhand.rigs.sides import judged_sides

MOST = 0.6  # of the digits' joints are in the shape that is theirs
LIMB = 2.0  # an upper arm and a forearm differ in length by less than this factor
FAR_WRIST = 0.5  # lengths of the palm: a wrist this far from the shape's is another joint

# Roles that a person or the file itself has named, which geometry does not overrule.
Fixed = Mapping[str, Collection[str]]


def judged_hands(rig: NamedJoints, found: CharacterMap, by_user: Collection[str]) -> CharacterMap:
    """Wrists, digits and sides whose names the bind pose contradicts, put right.

    Where a part of the skeleton has the shape of a hand, its shape says where the wrist is, which
    digit is the thumb, in which order the fingers stand, and where each digit starts: phalanges
    that are counted from 0, or metacarpals that are counted as 1, shift a digit along its chain.

    Parameters
    ----------
    by_user : sides whose joints a person has named, which are not exchanged
    """
    shapes = find_hands(rig.skeleton, rig.points)[0]
    hands, contradictions, evidence = dict(found.hands), list[str](), list[str]()
    for side, hand in found.hands.items():
        shape = _shape_of(rig, hand, shapes)
        if shape is None:
            evidence.append(f"{side} hand by names; no part of the skeleton shows its shape")
            continue
        before = len(contradictions)
        if shape.wrist != hand.wrist:
            contradictions.append(
                f"{side} wrist by the shape of the hand: {rig.path(shape.wrist)}, by its name "
                f"{rig.path(hand.wrist)}"
            )
            hand = replace(hand, wrist=shape.wrist)
        shape, moved = _in_order(hand, shape)
        if moved:
            digit = next(iter(moved))
            contradictions.append(
                f"{side} digits by their order across the palm: {digit} is "
                f"{rig.path(shape.joints[digit + digit_joints(digit)[0]])}, which is named "
                f"{moved[digit]}"
            )
            hand = replace(hand, joints={}, metacarpals={}, tips={})
        hands[side] = _judged_hand(rig, side, hand, shape, contradictions)
        agreed = "in agreement with" if len(contradictions) == before else "put right by"
        evidence.append(f"{side} hand by names, {agreed} the shape of the hand")
    found = replace(found, hands=hands, evidence=(*found.evidence, *evidence))
    found = found.corrected(*contradictions)
    return found if by_user else judged_sides(rig, found)


def _shape_of(rig: NamedJoints, hand: HandMap, shapes: Sequence[FoundHand]) -> FoundHand | None:
    """The shape of a hand that these digits have, unless only its wrist is another one nearby."""
    digits = set(hand.joints.values())
    for shape in shapes:
        if len(digits & _joints_of(shape)) < MOST * len(digits):
            continue
        apart = float(np.linalg.norm(rig.points[shape.wrist] - rig.points[hand.wrist]))
        same = shape.wrist == hand.wrist or apart > FAR_WRIST * hand_size(rig.points, shape)
        return shape if same else None
    return None


def _joints_of(shape: FoundHand) -> set[int]:
    return {*shape.joints.values(), *shape.metacarpals.values(), *shape.tips.values()}


def _in_order(hand: HandMap, shape: FoundHand) -> tuple[FoundHand, dict[str, str]]:
    """The shape with the digits' names, put in order, and digits that are named otherwise.

    Which of three fingers are there only the names can say.
    """
    named: dict[str, str] = {}  # digit of the shape -> digit by name
    for digit in DIGITS:
        chain = set(_chain(shape, digit))
        shared = Counter({own: len(chain & set(_chain(hand, own))) for own in hand.digits})
        if chain and shared and shared.most_common(1)[0][1]:
            named[digit] = shared.most_common(1)[0][0]
    fingers = [d for d in FINGERS if d in named]
    owners = [named[d] for d in fingers]
    if "Thumb" not in owners and named.get("Thumb", "Thumb") == "Thumb" and _rising(owners):
        return _labelled(shape, {"Thumb": "Thumb"} | named), {}
    present = sorted(set(named.values()) - {"Thumb"}, key=FINGERS.index)
    rest = present if len(present) == len(fingers) else FINGERS
    label = {"Thumb": "Thumb"} | dict(zip(fingers, rest, strict=False))
    moved = {label[d]: named[d] for d in named if label[d] != named[d]}
    return _labelled(shape, label), moved


def _rising(digits: Sequence[str]) -> bool:
    places = [FINGERS.index(d) for d in digits]
    return all(a < b for a, b in pairwise(places))


def _chain(hand: HandMap | FoundHand, digit: str) -> list[int]:
    """All joints of a digit from the metacarpal to the tip."""
    line = [hand.joints[r] for j in digit_joints(digit) if (r := digit + j) in hand.joints]
    inner, tip = hand.metacarpals.get(digit), hand.tips.get(digit)
    return [j for j in (inner, *line, tip) if j is not None]


def _labelled(shape: FoundHand, label: Mapping[str, str]) -> FoundHand:
    """The shape with other names for its digits; one without a name is left out."""
    return FoundHand(
        shape.wrist,
        {
            new + joint: shape.joints[digit + joint]
            for digit, new in label.items()
            for joint in digit_joints(digit)
            if digit + joint in shape.joints
        },
        {new: shape.metacarpals[d] for d, new in label.items() if d in shape.metacarpals},
        {new: shape.tips[d] for d, new in label.items() if d in shape.tips},
    )


def _judged_hand(
    rig: NamedJoints, side: Side, hand: HandMap, shape: FoundHand, contradictions: list[str]
) -> HandMap:
    """A hand whose digits start where the shape says; without any digits, those of the shape."""
    if not hand.joints:
        return replace(hand, joints=shape.joints, metacarpals=shape.metacarpals, tips=shape.tips)
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
        contradictions.append(
            f"{side} {role} by the lengths of the hand: {is_now}, by its name {was}"
        )
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
    notes, contradictions = list(found.notes), list[str]()
    body = body_of(rig.skeleton, rig.points, wrists).joints
    new = _judged(rig, found, body, BODY_JOINTS, fixed.get("body", ()), "", notes, contradictions)
    found = replace(found, **new)
    hands = {}
    for side, hand in found.hands.items():
        on_neck = found.neck in rig.skeleton.ancestors(hand.wrist)
        trunk = found.neck if on_neck else found.chest
        if trunk is None:
            arm = _limb(rig, hand)
        else:
            arm = arm_joints(rig.skeleton, rig.points, hand.wrist, trunk)
        roles = ARM_JOINTS[:3]
        hands[side] = replace(
            hand,
            **_judged(
                rig, hand, arm, roles, fixed.get(side, ()), f"{side} ", notes, contradictions
            ),
        )
    return replace(found, hands=hands, notes=tuple(notes)).corrected(*contradictions)


def _limb(rig: NamedJoints, hand: HandMap) -> dict[str, int]:
    """Arm joints of a hand without a trunk, where those of the names make no arm."""
    line = rig.skeleton.ancestors(hand.wrist)  # from the elbow up
    shown = dict(zip(("elbow", "shoulder", "clavicle"), line, strict=False))
    shoulder, elbow = hand.shoulder, hand.elbow
    if (shoulder is None and elbow is None) or len(line) > len(shown):
        return {}
    if elbow not in line or elbow is None:
        return shown
    if shoulder is None:
        return {}
    if shoulder not in rig.skeleton.ancestors(elbow):
        return shown
    upper, fore = np.linalg.norm(np.diff(rig.points[[shoulder, elbow, hand.wrist]], axis=0), axis=1)
    return {} if max(upper, fore) < LIMB * min(upper, fore) else shown


def _judged(
    rig: NamedJoints,
    named: CharacterMap | HandMap,
    shown: Mapping[str, int],
    roles: Collection[str],
    fixed: Collection[str],
    whose: str,
    notes: list[str],
    contradictions: list[str],
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
            contradictions.append(
                f"{whose}{role} by hierarchy: {is_now}, by its name {rig.path(own)}"
            )
    return new
