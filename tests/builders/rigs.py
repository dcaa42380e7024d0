"""Synthetic characters: a plausible body and two hands whose joints get any names."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES, CharacterMap, Side, digit_joints
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton, parents_from_paths

# A joint is (side, role) for hands and arms, (None, role) for the body.
Joint = tuple[Side | None, str]
Places = dict[Joint, Array]
Parents = dict[Joint, Joint | None]


def places(pose: str = "T", curl: float = 8.0) -> Places:
    """World positions of a character in the T- or A-pose that looks along +Z, cm."""
    found: Places = {
        (None, role): np.array([0.0, y, 0.0])
        for role, y in (("hips", 95), ("spine", 108), ("chest", 130), ("neck", 150), ("head", 160))
    }
    for side in SIDES:
        mirror = np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
        for role, place in (_leg() | _arm(pose, curl)).items():
            found[side, role] = place * mirror
    return found


def _leg() -> dict[str, Array]:
    return {
        "thigh": np.array([9.0, 92.0, 0.0]),
        "shin": np.array([9.5, 50.0, 1.0]),
        "foot": np.array([10.0, 8.0, -2.0]),
        "toe": np.array([10.0, 2.0, 10.0]),
        "toe_end": np.array([10.0, 2.0, 17.0]),
    }


def _arm(pose: str, curl: float) -> dict[str, Array]:
    """Left arm: straight to the side, palm down, thumb in front; lowered for the A-pose."""
    joints = {
        "clavicle": np.array([3.0, 145.0, 0.0]),
        "shoulder": np.array([17.0, 146.0, 0.0]),
        "elbow": np.array([45.0, 146.0, -1.0]),
        "wrist": np.array([71.0, 146.0, 0.0]),
    }
    joints |= {role: joints["wrist"] + place for role, place in _hand(curl).items()}
    if pose == "A":
        c, s = np.cos(np.radians(-50)), np.sin(np.radians(-50))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        pivot = joints["shoulder"]
        joints |= {
            role: pivot + turn @ (place - pivot)
            for role, place in joints.items()
            if role != "clavicle"
        }
    return joints


def _hand(curl: float) -> dict[str, Array]:
    """Left hand from the wrist: x along the fingers, -y out of the palm, z toward the thumb."""
    thumb = {
        "ThumbCarpal": [1.0, -0.3, 1.2],
        "ThumbCMC": [2.4, -0.8, 2.6],
        "ThumbMCP": [5.4, -1.8, 5.4],
        "ThumbIP": [8.2, -2.4, 7.0],
        "ThumbTip": [10.6, -2.9, 8.0],
    }
    joints = {role: np.array(place) for role, place in thumb.items()}
    shape = {"Index": (9.0, 3.0, 0.95), "Middle": (9.3, 1.0, 1.05)}
    shape |= {"Ring": (8.8, -1.0, 0.97), "Pinky": (8.0, -2.8, 0.78)}
    for digit, (reach, across, size) in shape.items():
        joints[digit + "Metacarpal"] = np.array([2.8, 0.0, 0.45 * across])
        place = np.array([reach, 0.0, across])
        joints[digit + "MCP"] = place
        for i, (role, bone) in enumerate((("PIP", 4.3), ("DIP", 2.7), ("Tip", 2.0))):
            bend = np.radians(curl * i)
            way = np.array([np.cos(bend), -np.sin(bend), 0.06 * across])
            place = place + size * bone * way
            joints[digit + role] = place
    return joints


def parents() -> Parents:
    """Who hangs off whom in an ordinary rig with every joint there is."""
    found: Parents = {(None, "hips"): None}
    for above, below in (
        ("hips", "spine"),
        ("spine", "chest"),
        ("chest", "neck"),
        ("neck", "head"),
    ):
        found[None, below] = (None, above)
    for side in SIDES:
        leg = ("thigh", "shin", "foot", "toe", "toe_end")
        found |= {(side, b): (side, a) for a, b in pairwise(leg)}
        found[side, "thigh"] = (None, "hips")
        arm = ("clavicle", "shoulder", "elbow", "wrist")
        found |= {(side, b): (side, a) for a, b in pairwise(arm)}
        found[side, "clavicle"] = (None, "chest")
        for digit in DIGITS:
            inner = "ThumbCarpal" if digit == "Thumb" else digit + "Metacarpal"
            line = ("wrist", inner, *(digit + j for j in digit_joints(digit)), digit + "Tip")
            found |= {(side, b): (side, a) for a, b in pairwise(line)}
    return found


def build(
    name: Callable[[Joint], str | None] | Mapping[Joint, str],
    *,
    pose: str = "T",
    curl: float = 8.0,
    move: Callable[[Parents], None] | None = None,
    extra: Mapping[str, Joint] | None = None,
) -> tuple[Skeleton, dict[Joint, int]]:
    """Skeleton of the joints that get a name, and where each of them is in it.

    A joint without a name is left out; what hangs below it moves up. ``move`` changes the
    hierarchy in place; ``extra`` adds leaf joints: name -> the joint to hang them on.
    """
    at, above = places(pose, curl), parents()
    if move:
        move(above)
    get = name.get if isinstance(name, Mapping) else name
    names = {joint: n for joint in above if (n := get(joint)) is not None}

    def path(joint: Joint) -> str:
        parent = above[joint]
        while parent is not None and parent not in names:
            parent = above[parent]
        return names[joint] if parent is None else f"{path(parent)}/{names[joint]}"

    joints = [(path(joint), at[joint]) for joint in names]
    joints += [(f"{path(on)}/{leaf}", at[on] + 1.0) for leaf, on in (extra or {}).items()]
    skeleton = from_points([j for j, _ in joints], np.array([p for _, p in joints]))
    return skeleton, {joint: i for i, joint in enumerate(names)}


def from_points(joints: list[str], points: Array) -> Skeleton:
    """Skeleton with unturned joints at the given world positions; rest equals bind."""
    above = parents_from_paths(joints)
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    bind[:, :3, 3] = points
    rest = np.array(
        [b if p < 0 else np.linalg.inv(bind[p]) @ b for b, p in zip(bind, above, strict=True)]
    )
    return Skeleton(tuple(joints), above, bind, rest)


HAND: tuple[str, ...] = tuple(d + j for d in DIGITS for j in digit_joints(d))
METACARPALS: tuple[str, ...] = tuple(f + "Metacarpal" for f in FINGERS)
TIPS: tuple[str, ...] = tuple(d + "Tip" for d in DIGITS)

_BODY = ("hips", "chest", "neck", "head")
_ARM = ("clavicle", "shoulder", "elbow", "wrist")


def found_joints(found: CharacterMap) -> dict[Joint, int]:
    """All joints of a map with the names of tests.rigs."""
    joints: dict[Joint, int | None] = {
        (None, role): getattr(found, role) for role in ("hips", "chest", "neck", "head")
    }
    for side, hand in found.hands.items():
        joints |= {
            (side, role): getattr(hand, role) for role in ("clavicle", "shoulder", "elbow", "wrist")
        }
        joints |= {(side, role): joint for role, joint in hand.joints.items()}
        joints |= {(side, d + "Metacarpal"): j for d, j in hand.metacarpals.items()}
        joints |= {(side, d + "Tip"): j for d, j in hand.tips.items()}
    return {key: joint for key, joint in joints.items() if joint is not None}


def nonsense(drop: tuple[str, ...] = ()) -> dict[Joint, str]:
    """Names that say nothing, for every joint but ``drop`` and the carpal bone."""
    kept = (j for j in parents() if j[1] not in (*drop, "ThumbCarpal"))
    return {joint: f"joint{i}" for i, joint in enumerate(kept)}


def same_joints(found: CharacterMap, expected: dict[Joint, int]) -> None:
    """Compare with everything that a map can hold."""
    body = ("spine", "thigh", "shin", "foot", "toe", "toe_end", "ThumbCarpal")
    assert found_joints(found) == {k: j for k, j in expected.items() if k[1] not in body}


def known_rigs() -> dict[str, dict[Joint, str]]:
    """Names of ``rig_names.txt``: rig -> joint -> name; left only where names have no side."""
    text = Path(__file__).with_name("rig_names.txt").read_text("utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return dict(_rig(lines[i : i + 8]) for i in range(0, len(lines), 8))


def _rig(lines: list[str]) -> tuple[str, dict[Joint, str]]:
    name, _, rule = lines[0].partition(" ")
    roles = [_ARM, (*HAND[:3], TIPS[0])]
    roles += [(f + "Metacarpal", f + "MCP", f + "PIP", f + "DIP", f + "Tip") for f in FINGERS]
    named: dict[Joint, str] = {}
    for line, wanted in zip(lines[1:7], roles, strict=True):
        for role, left in zip(wanted, _names(line), strict=False):
            if left == "-":
                continue
            named["left", role] = left
            if rule:
                pattern, _, right = rule.partition(">")
                named["right", role] = re.sub(pattern, right, left)
                assert named["right", role] != left, (name, left)
    named |= {(None, r): n for r, n in zip(_BODY, _names(lines[7]), strict=True) if n != "-"}
    return name, named


def _names(line: str) -> list[str]:
    found = []
    for item in line.strip().split(", "):
        match = re.fullmatch(r"(.*)\{(.*)\}(.*)", item)
        middles = match[2].split(" ") if match else [""]
        found += [f"{match[1]}{m}{match[3]}" for m in middles] if match else [item]
    return found
