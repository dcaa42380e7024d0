"""Hands found without names: by the joints' hierarchy and their places in the bind pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.hand import FINGERS, HandMap, Side, digit_joints
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.transforms import unit
from usdhand.rigs.body import Chain, heights_of


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


def hand_size(points: Array, hand: FoundHand) -> float:
    """Mean distance from the wrist to the fingers' first joints, cm."""
    roots = points[[hand.joints[d + "MCP"] for d in FINGERS if d + "MCP" in hand.joints]]
    return float(np.linalg.norm(roots - points[hand.wrist], axis=1).mean())


def find_hands(skeleton: Skeleton, points: Array) -> tuple[list[FoundHand], list[str]]:
    """Return the parts of a skeleton that have the shape of a hand, and why others have not."""
    hands: dict[int, FoundHand] = {}
    reasons: dict[int, str] = {}
    for root, chains in _branches(skeleton, points).items():
        above = skeleton.ancestors(root)
        if any(joint in hands for joint in above):
            continue
        found = _read_hand(skeleton, points, root, chains)
        if isinstance(found, str):
            reasons[root] = f"below {skeleton.names[root]}: {found}"
        else:
            hands[root] = found
            reasons = {joint: why for joint, why in reasons.items() if joint not in above}
    return list(hands.values()), list(reasons.values())


def _branches(skeleton: Skeleton, points: Array) -> dict[int, list[Chain]]:
    """Joints with three to five unbranched chains below them, the highest first.

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
        if is_branch and 3 <= len(digits) <= 5 and len(digits) == len(chains[joint]):
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
        joint = skeleton.common_ancestor([c[0] for c in chains if c is not left_out])
        if joint is not None and joint != root:
            return joint
    return None


# Digit -> (joint before the first one or None, up to three joints, tip or None)
_Digits = dict[str, tuple[int | None, Chain, int | None]]


def _digits(points: Array, wrist: int, chains: Sequence[Chain]) -> tuple[_Digits, str]:
    """Name the chains of a hand: the thumb, then the fingers in order; or say what is odd.

    The palm decides, which is the same in every pose: knuckles in a row at one distance from the
    wrist, and the thumb's first joint much nearer, at the index finger's end of the row.
    """
    thumb = _thumb_of(points, wrist, chains)
    if thumb is None:
        return {}, "no digit stands out as the thumb"
    fingers = [c for i, c in enumerate(chains) if i != thumb]
    split = [_split_finger(points, wrist, c) for c in fingers]
    if any(len(line) < 2 for _, line, _ in split):
        return {}, "a chain has too few or too many joints for a finger"
    has_tips = any(tip is not None for _, _, tip in split)
    carpal, thumb_line, thumb_tip = _split_thumb(chains[thumb], has_tips)
    if len(thumb_line) < 3:
        return {}, "the thumb has fewer than three joints"
    roots = points[[line[0] for _, line, _ in split]]
    lengths = np.array([_length(points, line) for _, line, _ in split])
    palm = float(np.linalg.norm(roots - points[wrist], axis=1).mean())
    if lengths.max() > 3 * lengths.min() or not 0.6 < palm / max(lengths.mean(), 1e-9) < 6:
        return {}, "the chains' lengths are not those of fingers"
    middle = roots.mean(axis=0)
    _, spread, axes = np.linalg.svd(roots - middle)
    if len(roots) > 2 and spread[1] > 0.6 * spread[0]:
        return {}, "the chains start on a ring, not in a row"
    along = unit(middle - points[wrist])
    across = axes[0] - along * (axes[0] @ along)  # knuckles of the index finger lie farther out
    places = (roots - middle) @ across
    side = float((points[thumb_line[0]] - middle) @ across)
    if abs(side) < 0.1 * np.ptp(places):
        return {}, "the thumb starts at neither end of the row of fingers"
    order = np.argsort(-places * np.sign(side))
    if reason := _odd_row(np.abs(np.diff(places[order])), lengths[order] / lengths.max()):
        return {}, reason
    named: _Digits = {"Thumb": (carpal, thumb_line, thumb_tip)}
    named |= {digit: split[i] for digit, i in zip(FINGERS, order, strict=False)}
    return named, ""


def _thumb_of(points: Array, wrist: int, chains: Sequence[Chain]) -> int | None:
    """Chain of the thumb: counted from the ends, its first joint is far nearer to the wrist.

    Of real hands, over the median of all digits: thumbs 0.25 to 0.48, fingers 0.92 to 1.18.
    """
    count = min(4, *map(len, chains))  # three joints and a tip: the metacarpals stay out of it
    starts = np.linalg.norm(points[[c[-count] for c in chains]] - points[wrist], axis=1)
    near = starts / max(float(np.median(starts)), 1e-9)
    thumb, *fingers = np.argsort(near)
    alone = near[thumb] < 0.65 and near[fingers[0]] > 0.75 and near[fingers[-1]] < 1.35
    return int(thumb) if alone else None


def _odd_row(gaps: Array, lengths: Array) -> str:
    """Say why fingers in this order, thumb first, cannot be named by it; nothing if they can.

    ``gaps`` lie between their first joints, ``lengths`` are relative to the longest finger. Of
    three fingers one is missing: it is the little one where gaps and lengths are even.
    """
    if lengths[0] < 0.85 * lengths[-1]:
        return "the fingers get longer away from the thumb"
    if len(lengths) < 3:
        return "two fingers and a thumb: it is unknown which fingers they are"
    uneven = gaps.max() > 1.5 * gaps.min()
    if len(lengths) == 3 and (uneven or lengths[2] < 0.85 or lengths[0] > 1.02 * lengths[1]):
        return "of three fingers: it is unknown which one is missing"
    return ""


def _length(points: Array, line: Chain) -> float:
    """Length of a line of joints."""
    return float(np.linalg.norm(np.diff(points[list(line)], axis=0), axis=1).sum())


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
