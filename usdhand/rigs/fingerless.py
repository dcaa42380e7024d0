"""Arms that end without fingers: found by names, with the names that fingers would have there."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from usdhand.anatomy import SIDES, CharacterMap, Side
from usdhand.anatomy.hand import (
    ARM_JOINTS,
    BODY_JOINTS,
    DIGITS,
    HAND_JOINTS,
    HandMap,
    digit_joints,
)
from usdhand.motion.skeleton import Skeleton, leaf_name
from usdhand.rigs import Conventions, load_conventions
from usdhand.rigs.body import arm_joints, body_of
from usdhand.rigs.convention_match import Lookup
from usdhand.rigs.conventions import Convention, name_key
from usdhand.rigs.joint_names import NamedJoints

# A wrist with more joints below it, thumb aside, has fingers, whatever they are called, unless they
# are one chain. A mitten has up to three: a hand, all fingers in one, an end.
MOST_WITHOUT_FINGERS = 3


@dataclass(frozen=True, eq=False)
class FingerlessArms:
    """Arms of a skeleton that has no fingers there.

    Attributes
    ----------
    character : hands without joints, and the body joints that go with them
    convention : whose names the skeleton has, None where a map file names the wrists
    """

    character: CharacterMap
    convention: Convention | None


@dataclass(frozen=True)
class _ArmMatch:
    """A convention's arms in a rig: side -> role -> joint."""

    convention: Convention
    arms: Mapping[Side, Mapping[str, int]]
    body: Mapping[str, int]
    rank: tuple[int, ...]


def fingerless_arms(
    skeleton: Skeleton, conventions: Conventions | None = None
) -> FingerlessArms | None:
    """Arms without fingers, by the names of their joints; None if there are none.

    Wrists that a map file names win over known conventions.
    """
    conventions = conventions or load_conventions()
    rig = NamedJoints(skeleton)
    found = max(_matches(rig, conventions.conventions), key=lambda m: m.rank, default=None)
    arms: dict[Side, dict[str, int]] = {}
    for side in SIDES:
        own = dict(found.arms.get(side, {})) if found else {}
        named = conventions.explicit.get(side, {})
        own |= {
            r: j for r in ARM_JOINTS if r in named and (j := skeleton.find(named[r])) is not None
        }
        if "wrist" in own and _is_fingerless(rig, own["wrist"]):
            arms[side] = own
    if not arms:
        return None
    wrists = [arm["wrist"] for arm in arms.values()]
    body: dict[str, Any] = dict(found.body) if found else {}
    body |= body_of(skeleton, rig.points, wrists).joints
    hands: dict[Side, HandMap] = {}
    for side, arm in arms.items():
        by_hierarchy = arm_joints(skeleton, rig.points, arm["wrist"], body.get("chest"))
        by_user = conventions.explicit.get(side, {})
        fixed = {role: joint for role, joint in arm.items() if role in by_user}
        whole: dict[str, Any] = arm | by_hierarchy | fixed
        hands[side] = HandMap(side, joints={}, **whole)
    named_by_file = any("wrist" in conventions.explicit.get(side, {}) for side in arms)
    convention = None if named_by_file or found is None else found.convention
    name = convention.name if convention else "map file"
    return FingerlessArms(CharacterMap(hands, name, **body), convention)


def own_digits(skeleton: Skeleton, arms: FingerlessArms, side: Side) -> dict[str, list[str]]:
    """Names of the joints of digits that are whole, by digit: a lone thumb or index chain.

    They are those that the skeleton's naming has; joints called otherwise are no digits.
    """
    if arms.convention is None:
        return {}
    wrist = arms.character.hands[side].wrist
    names = arms.convention.hands.get(side, {})
    before, after = _affixes(leaf_name(skeleton.joints[wrist]), names.get("wrist", ()))
    below: dict[str, str] = {}
    for joint in sorted(skeleton.descendants(wrist)):
        below.setdefault(name_key(skeleton.names[joint]), skeleton.names[joint])
    found: dict[str, list[str]] = {}
    for digit in DIGITS:
        chain = []
        for role in (digit + joint for joint in digit_joints(digit)):
            keys = (name_key(before + name + after) for name in names.get(role, ()))
            chain += [below[key] for key in keys if key in below][:1]
        if len(chain) == len(digit_joints(digit)):
            found[digit] = chain
    return found


def finger_names(
    skeleton: Skeleton,
    arms: FingerlessArms,
    side: Side,
    roles: Sequence[str],
    conventions: Conventions,
) -> dict[str, str]:
    """Leaf names for the joints of a hand, in the skeleton's own manner of naming.

    Where that has no names for fingers, or another joint bears one of them, names are those of the
    first convention that shares none with it. Metacarpals and tips that a convention does not name
    are left out.
    """
    wrist = arms.character.hands[side].wrist
    taken = {name_key(name) for name in skeleton.names}
    needed = [role for role in roles if role in HAND_JOINTS]
    own = [arms.convention] if arms.convention else []
    for convention in (*own, *conventions.conventions):
        names = convention.hands.get(side, {})
        affixes = ("", "")
        if convention is arms.convention:
            affixes = _affixes(leaf_name(skeleton.joints[wrist]), names.get("wrist", ()))
        spelled = {r: affixes[0] + names[r][0] + affixes[1] for r in roles if r in names}
        # USD takes letters, digits and underscores only.
        found = {role: re.sub(r"[^0-9A-Za-z_]", "_", name) for role, name in spelled.items()}
        keys = {name_key(name) for name in found.values()}
        whole = all(role in found for role in needed) and len(keys) == len(found)
        if whole and not keys & taken:
            return found
        if convention is arms.convention:
            taken |= keys
    raise AssertionError("no convention has free names")  # they are some thirty, all different


def _is_fingerless(rig: NamedJoints, wrist: int) -> bool:
    below = [j for j in rig.skeleton.descendants(wrist) if "thumb" not in rig.path(j).lower()]
    ends = [j for j in below if not rig.skeleton.children[j]]
    return len(ends) <= 1 or len(below) <= MOST_WITHOUT_FINGERS


def _matches(rig: NamedJoints, conventions: Sequence[Convention]) -> Iterator[_ArmMatch]:
    for number, convention in enumerate(conventions):
        keys = convention.hand_keys
        as_they_are: Lookup = dict.fromkeys(SIDES, rig.by_key)
        yield from _arm_matches(rig, convention, keys, as_they_are, (0, -number))
        sideless = convention.sideless_keys
        yield from _arm_matches(rig, convention, sideless, rig.by_sideless_key, (-1, -number))


def _arm_matches(
    rig: NamedJoints,
    convention: Convention,
    names_of: Mapping[Side | None, Mapping[str, Sequence[str]]],
    lookup: Lookup,
    last: tuple[int, int],
) -> Iterator[_ArmMatch]:
    """A convention's arms by names as they are, or without the words for their side."""
    affixes = {
        (key[:start], key[start + len(name) :])
        for side in SIDES
        for name in names_of.get(side, {}).get("wrist", ())
        for key in lookup[side]
        if (start := key.rfind(name)) >= 0
    }
    for prefix, suffix in affixes:

        def joint(
            keys: Mapping[str, tuple[int, ...]],
            names: Sequence[str],
            pre: str = prefix,
            post: str = suffix,
        ) -> tuple[int, ...]:
            """The one joint with the first of these names that a joint has."""
            found = (keys[k] for n in names if (k := pre + n + post) in keys)
            return next((joints for joints in found if len(joints) == 1), ())

        arms: dict[Side, dict[str, int]] = {}
        for side in SIDES:
            roles = names_of.get(side, {})
            own = {r: j[0] for r in ARM_JOINTS if (j := joint(lookup[side], roles.get(r, ())))}
            if "wrist" in own:
                above = rig.above[own["wrist"]]
                arms[side] = {r: j for r, j in own.items() if r == "wrist" or j in above}
        if not arms:
            continue
        names = convention.body_keys
        body = {r: j[0] for r in BODY_JOINTS if (j := joint(rig.by_key, names.get(r, ())))}
        matched = sum(map(len, arms.values())) + len(body)
        rank = (len(arms), matched, -len(prefix) - len(suffix), *last)
        yield _ArmMatch(convention, arms, body, rank)


def _affixes(leaf: str, wrists: Sequence[str]) -> tuple[str, str]:
    """What stands before and behind a wrist's name, as it is spelled."""
    for wrist in map(name_key, wrists):
        for start in reversed(range(len(leaf))):
            for end in range(start + 1, len(leaf) + 1):
                if name_key(leaf[start:end]) == wrist and leaf[start].isalnum():
                    return leaf[:start], leaf[end:]
    return "", ""
