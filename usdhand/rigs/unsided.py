"""Hands of conventions whose names have no side: the side is told by what is around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from usdhand.anatomy.hand import FINGERS, HandMap, Side
from usdhand.errors import HandNotFoundError
from usdhand.rigs.choose_joints import choose_hand, refuse_ambiguous
from usdhand.rigs.convention_match import ConventionMatch
from usdhand.rigs.conventions import named_side
from usdhand.rigs.joint_names import ADVICE, NamedJoints
from usdhand.rigs.sides import chirality


def unsided_hands(
    rig: NamedJoints, matches: Sequence[ConventionMatch], notes: list[str]
) -> dict[Side, HandMap]:
    """Hands of a convention whose names have no side: from other names around, or the shape."""
    hands: dict[Side, HandMap] = {}
    for match in matches:
        roles = match.hands[None]
        for wrist in roles.get("wrist", ()):
            near = {r: _nearest(rig, js, wrist) for r, js in roles.items()} | {"wrist": (wrist,)}
            hand = choose_hand(rig, "left", near, notes)
            if hand is None or any(hand.wrist == h.wrist for h in hands.values()):
                continue
            knuckles = [hand.joints[f + "MCP"] for f in FINGERS if f + "MCP" in hand.joints]
            side = named_side(rig.path((*knuckles, wrist)[0])) or named_side(rig.path(wrist))
            how = "names"
            if side is None:
                side, how = chirality(rig.points, wrist, hand.joints), "shape"
            if side is None:
                raise HandNotFoundError(
                    f"a hand was found at {rig.path(wrist)} ({match.convention.name}), but neither "
                    f"names nor shape say whether it is left or right; {ADVICE}"
                )
            if side in hands:
                refuse_ambiguous(rig, f"{side} wrist", [hands[side].wrist, wrist])
            hands[side] = replace(hand, side=side)
            notes.append(f"{side} side by {how}: {rig.path(wrist)}")
    return hands


def _nearest(rig: NamedJoints, joints: Sequence[int], wrist: int) -> tuple[int, ...]:
    """Those of ``joints`` that share most ancestors with the wrist."""
    line = rig.above[wrist] | {wrist}
    shared = [len(line & rig.above[j]) for j in joints]
    return tuple(j for j, n in zip(joints, shared, strict=True) if n == max(shared))
