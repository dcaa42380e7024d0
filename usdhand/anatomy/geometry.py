"""Hands found without names: by the joints' hierarchy and their places in the bind pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.body import Chain, body_of, common_ancestor, heights_of, unit
from usdhand.anatomy.hand import FINGERS, HandMap, Side, digit_joints
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton


@dataclass(frozen=True)
class FoundHand:
    """A hand of unknown side: its wrist and joints as in `HandMap`."""

    wrist: int
    joints: Mapping[str, int]
    metacarpals: Mapping[str, int]
    tips: Mapping[str, int]

    def with_side(self, side: Side) -> HandMap:
        """Return the map of this hand once its side is known."""
        return HandMap(side, self.wrist, self.joints, self.metacarpals, self.tips)


# --- left or right -------------------------------------------------------------------------------


def chirality(points: Array, wrist: int, joints: Mapping[str, int]) -> Side | None:
    """Side of one hand from its own shape, None for a hand too flat to tell.

    Fingers bend toward the palm and the thumb stands on the palm's side of the hand. On a left
    hand, ``wrist to fingers`` x ``little to index finger`` points out of the palm.
    """
    roots = [points[joints[d + "MCP"]] for d in FINGERS if d + "MCP" in joints]
    if len(roots) < 2:
        return None
    along = unit(np.mean(roots, axis=0) - points[wrist])
    normal = unit(np.cross(along, roots[0] - roots[-1]))
    bends, weights = 0.0, 0
    for digit in FINGERS:
        line = [joints[digit + j] for j in digit_joints(digit) if digit + j in joints]
        if len(line) == 3:
            first, second = (unit(b) for b in np.diff(points[line], axis=0))
            bends += float((second - first) @ normal)
            weights += 1
    curl = bends / max(weights, 1)
    ends = [joints[j] for j in ("ThumbIP", "ThumbMCP") if j in joints]
    palm = float(np.linalg.norm(np.mean(roots, axis=0) - points[wrist]))
    stand = float((points[ends[0]] - points[wrist]) @ normal) / max(palm, 1e-9) if ends else 0.0
    # Sines of some degrees: below that modelling noise decides.
    signs = [np.sign(v) for v, least in ((curl, 0.06), (stand, 0.1)) if abs(v) > least]
    if not signs or min(signs) != max(signs):
        return None
    return "left" if signs[0] > 0 else "right"


def thumb_direction(points: Array, wrist: int, joints: Mapping[str, int]) -> Array:
    """Where the thumb stands off the hand, across the fingers (3,); zero without a thumb."""
    roots = np.mean([points[joints[d + "MCP"]] for d in FINGERS if d + "MCP" in joints], axis=0)
    ends = [joints[j] for j in ("ThumbIP", "ThumbMCP") if j in joints]
    if not ends:
        return np.zeros(3)
    along, offset = unit(roots - points[wrist]), points[ends[0]] - points[wrist]
    return unit(offset - along * (offset @ along))


def first_is_left(
    skeleton: Skeleton, points: Array, hands: Sequence[FoundHand], shapes: Sequence[Side | None]
) -> dict[str, float]:
    """Votes on two hands: positive where the first is the left one, zero where nothing is known.

    Feet count most: a character looks where its toes point. Thumbs point to the front in every
    usual bind pose (palms down or toward the body), if not to the sides.
    """
    first, second = hands
    body = body_of(skeleton, points, [first.wrist, second.wrist])
    away = points[first.wrist] - points[second.wrist]

    def vote(facing: Array) -> float:
        lateral = float(away @ np.cross(body.up, facing))
        return float(np.sign(lateral)) if abs(lateral) > 0.3 * np.linalg.norm(away) else 0.0

    thumbs = sum((thumb_direction(points, h.wrist, h.joints) for h in hands), np.zeros(3))
    thumbs = thumbs - body.up * (thumbs @ body.up)
    shape = float((shapes[0] == "left") + (shapes[1] == "right"))
    shape -= float((shapes[0] == "right") + (shapes[1] == "left"))
    return {
        "the feet": 1.5 * vote(body.facing) if body.facing is not None else 0.0,
        "the thumbs": vote(thumbs) if np.linalg.norm(thumbs) > 0.5 else 0.0,
        "the hands' shape": float(np.sign(shape)),
    }


# --- hands ---------------------------------------------------------------------------------------


def hand_size(points: Array, hand: FoundHand) -> float:
    """Mean distance from the wrist to the fingers' first joints, cm."""
    roots = points[[hand.joints[d + "MCP"] for d in FINGERS if d + "MCP" in hand.joints]]
    return float(np.linalg.norm(roots - points[hand.wrist], axis=1).mean())


def find_hands(skeleton: Skeleton, points: Array) -> tuple[list[FoundHand], list[str]]:
    """Return the parts of a skeleton that have the shape of a hand, and why others have not."""
    branches = _branches(skeleton, points)
    hands, reasons = [], []
    for root, chains in branches.items():
        name = skeleton.names[root]
        found = _read_hand(skeleton, points, root, chains)
        if isinstance(found, str):
            reasons.append(f"below {name}: {found}")
        else:
            hands.append(found)
    return hands, reasons


def _branches(skeleton: Skeleton, points: Array) -> dict[int, list[Chain]]:
    """Joints with three to five unbranched chains below them, the highest such joints only.

    Leaves beside a longer branch (twists, attachment points) are no branches of their own.
    """
    heights = heights_of(skeleton)

    def onward(joint: int) -> list[int]:
        children = skeleton.children[joint]
        longer = [c for c in children if heights[c] > 0]
        if longer or len(children) < 2:
            return longer or list(children)
        return [max(children, key=lambda c: float(np.linalg.norm(points[c] - points[joint])))]

    after = [onward(j) for j in range(len(skeleton))]
    kept = {c for a in after for c in a}
    chains: list[list[Chain]] = [[] for _ in range(len(skeleton))]
    for joint in reversed(skeleton.order):
        if not after[joint]:
            chains[joint] = [(joint,)]
        elif len(after[joint]) == 1 and len(chains[after[joint][0]]) == 1:
            chains[joint] = [(joint, *chains[after[joint][0]][0])]
        else:
            chains[joint] = [chain for c in after[joint] for chain in chains[c]]
    found: dict[int, list[Chain]] = {}
    for joint in skeleton.order:
        is_branch = len(after[joint]) > 1 and (skeleton.parents[joint] < 0 or joint in kept)
        digits = [c for c in chains[joint] if len(c) >= 2]
        inside = any(a in found for a in skeleton.ancestors(joint))
        if is_branch and not inside and 3 <= len(digits) <= 5 and len(digits) == len(chains[joint]):
            found[joint] = digits
    return found


def _read_hand(
    skeleton: Skeleton, points: Array, root: int, chains: list[Chain]
) -> FoundHand | str:
    """Give the chains below ``root`` their names, or say why they are no hand."""
    if sum(len(c) >= 3 for c in chains) < 3:
        return "fewer than three chains of three joints"
    # The thumb may hang off the forearm: then the fingers' own joint is the wrist.
    wrist, (order, reason) = root, _digits(points, root, chains)
    far = _thumb_distance(points, wrist, order) > 0.6  # 0.4 from wrists, 0.8 from elbows
    if far and (inner := _shared_by_most(skeleton, root, chains)) is not None:
        wrist, (order, reason) = inner, _digits(points, inner, chains)
    if reason:
        return reason
    joints: dict[str, int] = {}
    metacarpals: dict[str, int] = {}
    tips: dict[str, int] = {}
    for digit, (inner_joint, line, tip) in order.items():
        joints |= {digit + j: c for j, c in zip(digit_joints(digit), line, strict=False)}
        if inner_joint is not None and digit != "Thumb":
            metacarpals[digit] = inner_joint
        if tip is not None:
            tips[digit] = tip
    return FoundHand(wrist, joints, metacarpals, tips)


def _shared_by_most(skeleton: Skeleton, root: int, chains: Sequence[Chain]) -> int | None:
    """Return the joint below ``root`` that carries all chains but one, if there is one."""
    for left_out in chains:
        joint = common_ancestor(skeleton, [c[0] for c in chains if c is not left_out])
        if joint is not None and joint != root:
            return joint
    return None


# Digit -> (joint before the first one or None, up to three joints, tip or None)
_Digits = dict[str, tuple[int | None, Chain, int | None]]


def _digits(points: Array, wrist: int, chains: Sequence[Chain]) -> tuple[_Digits, str]:
    """Name the chains of a hand: the thumb, then the fingers in order; or say what is odd."""
    ways = np.array([unit(points[c[-1]] - points[c[0]]) for c in chains])
    reach = np.array([np.linalg.norm(points[c[-1]] - points[wrist]) for c in chains])
    longest = max(map(len, chains))
    # The thumb points away from the others, ends nearer to the wrist, and has no metacarpal.
    apart = np.array([_angle(w, ways.sum(axis=0) - w) for w in ways])
    likeness = apart / 30 + 2 * (1 - reach / max(reach.max(), 1e-9))
    likeness += [0.5 * (len(c) < longest) for c in chains]
    thumb, second = np.argsort(-likeness)[:2]
    # Thumbs of real rigs came out at 1.4 to 2, the next digit at most at 1.
    if likeness[thumb] < 1.2 or likeness[thumb] - likeness[second] < 0.25:
        return {}, "no digit stands out as the thumb"
    fingers = [c for i, c in enumerate(chains) if i != thumb]
    if max(_angle(w, ways.sum(axis=0) - ways[thumb]) for w in np.delete(ways, thumb, 0)) > 50:
        return {}, "the chains point in different directions, as fingers do not"
    split = [_split_finger(points, wrist, c) for c in fingers]
    if any(len(line) < 2 for _, line, _ in split):
        return {}, "a chain has too few or too many joints for a finger"
    has_tips = any(tip is not None for _, _, tip in split)
    roots = points[[line[0] for _, line, _ in split]]
    lengths = np.array(
        [
            np.linalg.norm(points[c[-1]] - points[s[1][0]])
            for c, s in zip(fingers, split, strict=True)
        ]
    )
    palm = float(np.linalg.norm(roots - points[wrist], axis=1).mean())
    if lengths.max() > 3 * lengths.min() or not 0.3 < palm / max(lengths.mean(), 1e-9) < 4:
        return {}, "the chains' lengths are not those of fingers"
    _, spread, axes = np.linalg.svd(roots - roots.mean(axis=0))
    if len(roots) > 2 and spread[1] > 0.6 * spread[0]:
        return {}, "the chains start on a ring, not in a row"
    across = axes[0] * np.sign(
        (points[list(chains[thumb])].mean(axis=0) - roots.mean(axis=0)) @ axes[0]
    )
    order = np.argsort(-(roots @ across))
    named: _Digits = {"Thumb": _split_thumb(chains[thumb], has_tips)}
    named |= {digit: split[i] for digit, i in zip(FINGERS, order, strict=False)}
    return named, ""


def _split_finger(points: Array, wrist: int, chain: Chain) -> tuple[int | None, Chain, int | None]:
    """Metacarpal, MCP-PIP-DIP and tip of a chain.

    A metacarpal joint lies in the wrist's half of the way to the next joint, an MCP far beyond
    the middle of the way to the PIP, because a palm is twice as long as a proximal phalanx.
    """
    to_first, to_second = (float(np.linalg.norm(points[j] - points[wrist])) for j in chain[:2])
    inner = chain[0] if len(chain) > 3 and to_first < 0.54 * to_second else None
    line = chain if inner is None else chain[1:]
    if len(line) > 4:
        return None, (), None
    return inner, line[:3], line[3] if len(line) == 4 else None


def _split_thumb(chain: Chain, has_tips: bool) -> tuple[int | None, Chain, int | None]:
    """CMC-MCP-IP and tip: the last three joints before the tip; a joint before them is carpal."""
    tip = chain[-1] if has_tips and len(chain) > 3 else None
    line = chain if tip is None else chain[:-1]
    return None, line[-3:], tip


def _thumb_distance(points: Array, wrist: int, digits: _Digits) -> float:
    """Way from the wrist to the thumb, over the mean way to the fingers: small for a true wrist."""
    if not digits:
        return float("inf")
    starts = points[[line[0] for _, line, _ in digits.values()]]
    thumb, *fingers = np.linalg.norm(starts - points[wrist], axis=1)
    return float(thumb / max(np.mean(fingers), 1e-9))


def _angle(a: Array, b: Array) -> float:
    """Angle between two vectors in degrees."""
    return float(np.degrees(np.arccos(np.clip(unit(a) @ unit(b), -1.0, 1.0))))
