"""Skeletons whose joints get the names of a convention, in the wrong places."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from itertools import pairwise

from builders.rigs import Joint, from_points

from usdhand.anatomy.hand import FINGERS, SIDES, Side
from usdhand.motion.skeleton import Skeleton

Rename = Callable[[Joint], Joint]
OTHER: dict[Side | None, Side | None] = {"left": "right", "right": "left", None: None}


def renamed(
    skeleton: Skeleton,
    truth: Mapping[Joint, int],
    names: Mapping[Joint, str],
    change: Rename,
    prefix: str = "",
) -> Skeleton:
    """The skeleton whose joints bear a convention's names, each that of another joint."""
    roles = {joint: key for key, joint in truth.items()}
    paths: dict[int, str] = {}
    used: set[str] = set()
    for j in skeleton.order:
        name = names.get(change(roles[j])) if j in roles else None
        name = f"x{j}" if name is None or name in used else prefix + name
        used.add(name)
        above = f"{paths[p]}/" if (p := int(skeleton.parents[j])) >= 0 else ""
        paths[j] = above + name
    return from_points([paths[j] for j in range(len(skeleton))], skeleton.bind_positions)


def roles(table: Mapping[str, str]) -> Rename:
    """Other roles on the same side."""
    return lambda joint: (joint[0], table.get(joint[1], joint[1]))


def permuted(seed: int, *sides: Side) -> Rename:
    """The fingers of these sides in another order."""
    chance, order = random.Random(seed), list(FINGERS)
    while order == list(FINGERS):
        chance.shuffle(order)
    fingers = dict(zip(FINGERS, order, strict=True))

    def change(joint: Joint) -> Joint:
        side, role = joint
        digit = next((f for f in FINGERS if role.startswith(f)), None)
        if side in sides and digit is not None:
            return side, fingers[digit] + role.removeprefix(digit)
        return joint

    return change


def _shifted() -> dict[str, str]:
    line = ("Metacarpal", "MCP", "PIP", "DIP", "Tip", "Beyond")
    return {f + a: f + b for f in FINGERS for a, b in pairwise(line)}


def _thumb_as_little_finger() -> dict[str, str]:
    thumb = ("ThumbCMC", "ThumbMCP", "ThumbIP", "ThumbTip")
    little = ("PinkyMCP", "PinkyPIP", "PinkyDIP", "PinkyTip")
    pairs = dict(zip(thumb, little, strict=True))
    return pairs | {b: a for a, b in pairs.items()}


MISLEADING: dict[str, Rename] = {
    "names in their places": roles({}),
    "fingers permuted": permuted(1, *SIDES),
    "fingers permuted otherwise": permuted(2, *SIDES),
    "fingers of one hand permuted": permuted(3, "left"),
    "phalanges shifted": roles(_shifted()),
    "thumb and little finger exchanged": roles(_thumb_as_little_finger()),
    "sides exchanged": lambda joint: (OTHER[joint[0]], joint[1]),
    "arm joints named one lower": roles(
        {"clavicle": "shoulder", "shoulder": "elbow", "elbow": "wrist", "wrist": "Beyond"}
    ),
    "arm joints named one higher": roles(
        {"clavicle": "Beyond", "shoulder": "clavicle", "elbow": "shoulder"}
    ),
    "trunk exchanged": roles({"chest": "hips", "hips": "chest", "neck": "head", "head": "neck"}),
}
