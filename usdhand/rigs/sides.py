"""Which hand is the left one: told by words in names, by its shape, by feet and thumbs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from usdhand.anatomy.hand import FINGERS, SIDES, CharacterMap, HandMap, Side, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.transforms import unit
from usdhand.rigs.body import body_of
from usdhand.rigs.by_shape import FoundHand
from usdhand.rigs.conventions import named_side
from usdhand.rigs.joint_names import ADVICE, NamedJoints

BY_WORDS = "words in the joint names"
OTHER_SIDE: Mapping[Side, Side] = {"left": "right", "right": "left"}


def sides_of(rig: NamedJoints, found: Sequence[FoundHand]) -> tuple[list[Side], str]:
    """Sides of one or two hands and what told them.

    Raises
    ------
    HandNotFoundError
        if nothing tells left from right, or what tells it disagrees.
    """
    named = [_named_side(rig, hand) for hand in found]
    if None not in named and len(set(named)) == len(named):
        return [s for s in named if s], BY_WORDS
    shapes = [chirality(rig.points, h.wrist, h.joints) for h in found]
    above = [_side_above(rig, hand) for hand in found]
    if len(found) == 1:
        said = {above[0]: "words above it", shapes[0]: "the hand's shape"}
        said.pop(None, None)
        if len(said) != 1:
            why = "shape and names disagree" if said else "neither names nor shape tell"
            raise HandNotFoundError(
                f"a hand was found at {rig.path(found[0].wrist)}, but {why} "
                f"whether it is left or right; {ADVICE}"
            )
        return next(([s], how) for s, how in said.items() if s)
    votes = _votes_for_first_left(rig.skeleton, rig.points, found, shapes)
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


def judged_sides(rig: NamedJoints, found: CharacterMap) -> CharacterMap:
    """Left and right by the feet and by the hands' own shape, where these contradict the names.

    A body that was mirrored has its names on the wrong side, and a left hand is then shaped like a
    right one.
    """
    hands = [found.hands[side] for side in SIDES if side in found.hands]
    shapes = [chirality(rig.points, hand.wrist, hand.joints) for hand in hands]
    if len(hands) == 1:
        agrees = 0.0 if shapes[0] is None else 1.0 if shapes[0] == hands[0].side else -1.0
        votes, sure = {"the hand's shape": agrees}, True
    else:
        votes = _votes_for_first_left(rig.skeleton, rig.points, hands, shapes)
        del votes["the thumbs"]
        sure = votes["the feet"] < 0 or None not in shapes
    witnesses = [who for who, vote in votes.items() if vote < 0]
    if not witnesses or not sure or max(votes.values()) > 0:
        others = [who for who, vote in votes.items() if vote > 0]
        told = ["names", *others] if others else ["names alone"]
        said = f"left and right by {' and '.join(told)}"
        against = f", against {' and '.join(witnesses)}" if witnesses else ""
        return replace(found, evidence=(*found.evidence, said + against))
    found = replace(
        found,
        hands={OTHER_SIDE[h.side]: replace(h, side=OTHER_SIDE[h.side]) for h in reversed(hands)},
    )
    return found.corrected(
        f"left and right by {' and '.join(witnesses)}, against the names: "
        + " and ".join(f"{OTHER_SIDE[h.side]} is {rig.path(h.wrist)}" for h in hands)
    )


def _named_side(rig: NamedJoints, hand: FoundHand) -> Side | None:
    """Side of the file's own name for the wrist or arm, else of most of the hand's own names."""
    if any(rig.skeleton.aliases):
        for joint in (hand.wrist, *rig.skeleton.ancestors(hand.wrist)):
            if side := named_side(rig.skeleton.aliases[joint]):
                return side
    sides = [named_side(rig.skeleton.names[j]) for j in (hand.wrist, *hand.joints.values())]
    said = {side for side in sides if side}
    return said.pop() if len(said) == 1 and 2 * sides.count(None) < len(sides) else None


def _side_above(rig: NamedJoints, hand: FoundHand) -> Side | None:
    """Side that names at the wrist and above it speak of; None if any, or a finger's, disagrees."""

    def said(joints: Iterable[int]) -> set[Side]:
        return {side for j in joints if (side := named_side(rig.skeleton.names[j]))}

    above = said((hand.wrist, *rig.skeleton.ancestors(hand.wrist)))
    return above.pop() if len(above) == 1 and said(hand.joints.values()) <= above else None


def chirality(points: Array, wrist: int, joints: Mapping[str, int]) -> Side | None:
    """Side of one hand from its own shape, None for a hand too flat to tell or at odds with itself.

    Fingers bend toward the palm, the thumb stands on the palm's side of the hand, and the knuckles
    arch away from it. On a left hand, ``wrist to fingers`` x ``little to index finger`` points out
    of the palm.
    """
    roots = np.array([points[joints[d + "MCP"]] for d in FINGERS if d + "MCP" in joints])
    if len(roots) < 2:
        return None
    along = roots.mean(axis=0) - points[wrist]
    width = roots[0] - roots[-1]
    palm, across = float(np.linalg.norm(along)), unit(width)
    normal = unit(np.cross(along, width))
    bends = [0.0]
    for digit in FINGERS:
        line = [joints[digit + j] for j in digit_joints(digit) if digit + j in joints]
        if len(line) == 3:
            first, second = (unit(b) for b in np.diff(points[line], axis=0))
            bends.append(-float(np.cross(first, second) @ across))  # however the MCP is bent
    curl = sum(bends) / max(len(bends) - 1, 1)
    ends = [points[joints[j]] - points[wrist] for j in ("ThumbMCP", "ThumbIP") if j in joints]
    stand = float(ends[0] @ normal) / max(palm, 1e-9) if ends else 0.0
    arch = -float((roots.mean(axis=0) - roots[[0, -1]].mean(axis=0)) @ normal)
    # Sines of some degrees, below that modelling noise decides. Fingers straight or bent a little
    # backward are usual: without the thumb only a clear bend counts. The arch is small: it only
    # speaks against the others, as where a thumb is bound behind the hand.
    cues = [stand] if abs(stand) > 0.1 else []
    cues += [curl] if abs(curl) > (0.06 if cues else 0.22) else []
    if not cues:
        return None
    cues += [arch] if abs(arch) > 0.007 * np.linalg.norm(width) else []
    if min(cues) < 0 < max(cues):
        return None
    return "left" if cues[0] > 0 else "right"


def _votes_for_first_left(
    skeleton: Skeleton,
    points: Array,
    hands: Sequence[FoundHand | HandMap],
    shapes: Sequence[Side | None],
) -> dict[str, float]:
    """Votes on two hands: positive where the first is the left one, zero where nothing is known.

    A character looks where its toes point, and a hand's shape is its own. Thumbs count least: they
    show what is in front in usual bind poses only.
    """
    first, second = hands
    body = body_of(skeleton, points, [first.wrist, second.wrist])
    away = points[first.wrist] - points[second.wrist]

    def vote(facing: Array | None) -> float:
        if facing is None:
            return 0.0
        lateral = float(away @ np.cross(body.up, facing))
        return float(np.sign(lateral)) if abs(lateral) > 0.3 * np.linalg.norm(away) else 0.0

    shape = float((shapes[0] == "left") + (shapes[1] == "right"))
    shape -= float((shapes[0] == "right") + (shapes[1] == "left"))
    return {
        "the feet": 1.5 * vote(body.facing),
        "the thumbs": vote(_thumbs_ahead(points, hands, unit(away), body.up)),
        "the hands' shape": 1.5 * float(np.sign(shape)),
    }


def _thumbs_ahead(
    points: Array, hands: Sequence[FoundHand | HandMap], away: Array, up: Array
) -> Array | None:
    """Level direction of both thumbs, None unless the hands mirror each other as in a bind pose.

    There the fingers point outward or down and the palms down or to the body, so that the thumbs
    point forward, if not to the sides. ``away`` leads from the second hand to the first.
    """
    if not all("ThumbIP" in hand.joints for hand in hands):
        return None
    thumbs, outward = [], []
    for hand, way in zip(hands, (away, -away), strict=True):
        roots = [points[hand.joints[d + "MCP"]] for d in FINGERS if d + "MCP" in hand.joints]
        along = unit(np.mean(roots, axis=0) - points[hand.wrist])
        offset = points[hand.joints["ThumbIP"]] - points[hand.wrist]
        thumbs.append(unit(offset - along * (offset @ along)))
        outward.append(float(along @ way))
    one, other = thumbs
    alike = np.linalg.norm(one - 2 * (one @ away) * away - other) < 0.5
    ahead = one + other - up * ((one + other) @ up)
    return ahead if alike and min(outward) > -0.3 and np.linalg.norm(ahead) > 0.5 else None
