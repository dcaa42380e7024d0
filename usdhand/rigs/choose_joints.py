"""One joint for each role of a hand, of those that bear its names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NoReturn

import numpy as np

from usdhand.anatomy.hand import (
    ARM_JOINTS,
    DIGITS,
    FINGERS,
    HAND_JOINTS,
    HandMap,
    Side,
    digit_joints,
)
from usdhand.errors import HandNotFoundError
from usdhand.rigs.conventions import METACARPALS, THUMB_CARPAL, TIPS, name_key
from usdhand.rigs.joint_names import ADVICE, Candidates, NamedJoints


def choose_hand(
    rig: NamedJoints, side: Side, roles: Candidates, notes: list[str]
) -> HandMap | None:
    """Choose one joint for each role of a hand; None if it has no wrist.

    Raises
    ------
    HandNotFoundError
        if more than one joint could be the same joint of the hand.
    """
    wrist = _wrist(rig, side, roles)
    if wrist is None:
        return None
    if "wrist" not in roles:
        notes.append(f"{side} wrist by hierarchy: {rig.path(wrist)}")
    chosen = {}
    for role, joints in roles.items():
        inside = _inside(rig, joints, wrist)
        if len(inside) == 1:
            chosen[role] = inside[0]
        elif role in HAND_JOINTS:
            refuse_ambiguous(rig, f"{side} {role}", inside)
    _settle_thumb(rig, side, chosen, notes)
    _fill_gaps(rig, side, chosen, notes)
    digits = {r: chosen[r] for r in HAND_JOINTS if r in chosen}
    metacarpals = {d: chosen[r] for d, r in METACARPALS.items() if r in chosen}
    tips = {d: tip for d in TIPS if (tip := _tip(rig, d, chosen)) is not None}
    arms = {r: nearest_above(rig, roles[r], wrist) for r in ARM_JOINTS[:3] if r in roles}
    return HandMap(side, wrist, digits, metacarpals, tips, **arms)


def _wrist(rig: NamedJoints, side: Side, roles: Candidates) -> int | None:
    fingers = [j for f in FINGERS for j in roles.get(f + "MCP", ())]
    if "wrist" not in roles:
        meeting = rig.skeleton.common_ancestor(fingers)
        return None if meeting in fingers else meeting
    below = {w: sum(w in rig.above[j] for j in fingers) for w in roles["wrist"]}
    best = [w for w in below if below[w] == max(below.values())]
    if len(best) > 1:
        refuse_ambiguous(rig, f"{side} wrist", best)
    return best[0]


def _inside(rig: NamedJoints, joints: Sequence[int], wrist: int) -> Sequence[int]:
    """Of joints with one name, those below the wrist, else those below its parent, else all."""
    for above in (wrist, int(rig.skeleton.parents[wrist])):
        if inside := [j for j in joints if above in rig.above[j]]:
            return inside
    return joints


def refuse_ambiguous(rig: NamedJoints, what: str, joints: Sequence[int]) -> NoReturn:
    """Raise the error that says which joints could be ``what``.

    Raises
    ------
    HandNotFoundError
        always.
    """
    paths = " and ".join(rig.path(j) for j in joints[:2])
    raise HandNotFoundError(f"{len(joints)} joints could be the {what}: {paths}; {ADVICE}")


def _settle_thumb(rig: NamedJoints, side: Side, chosen: dict[str, int], notes: list[str]) -> None:
    """Take a carpal joint for the CMC if the bone lengths say that the last joint is the tip.

    From the CMC outwards a thumb's bones get shorter; a carpal bone is shorter than the next.
    """
    roles = (THUMB_CARPAL, "ThumbCMC", "ThumbMCP", "ThumbIP")
    line = [chosen[r] for r in roles if r in chosen]
    if len(line) < 4 or "ThumbTip" in chosen or rig.skeleton.children[line[-1]]:
        return
    first, second, third = np.linalg.norm(np.diff(rig.points[line], axis=0), axis=1)
    if first > 1.1 * second > 1.1 * third > 0:
        chosen.update(zip((*roles[1:], "ThumbTip"), line, strict=True))
        notes.append(f"{side} thumb CMC by bone lengths: {rig.path(line[0])}")


def _fill_gaps(rig: NamedJoints, side: Side, chosen: dict[str, int], notes: list[str]) -> None:
    """Take the one joint between the first and the third of a digit whose second has no name."""
    for digit in DIGITS:
        first, second, third = (digit + j for j in digit_joints(digit))
        if first not in chosen or second in chosen or third not in chosen:
            continue
        between = rig.above[chosen[third]] - rig.above[chosen[first]] - {chosen[first]}
        if len(between) == 1 and chosen[first] in rig.above[chosen[third]]:
            chosen[second] = min(between)
            notes.append(f"{side} {second} by hierarchy: {rig.path(chosen[second])}")


_TIP_WORDS = ("end", "tip", "nub", "term")


def _tip(rig: NamedJoints, digit: str, chosen: Mapping[str, int]) -> int | None:
    """Return the named tip, else the only child of the last joint if it is called an end."""
    if TIPS[digit] in chosen:
        return chosen[TIPS[digit]]
    last = chosen.get(digit + digit_joints(digit)[-1])
    children = rig.skeleton.children[last] if last is not None else ()
    ends = [c for c in children if any(w in name_key(rig.skeleton.names[c]) for w in _TIP_WORDS)]
    return ends[0] if len(ends) == 1 and not rig.skeleton.children[ends[0]] else None


def nearest_above(rig: NamedJoints, joints: Sequence[int], *below: int) -> int:
    """Return the lowest of ``joints`` above all of ``below``; the first if none is."""
    above = [j for j in joints if all(j in rig.above[b] for b in below)]
    return max(above, key=lambda j: len(rig.above[j])) if above else joints[0]
