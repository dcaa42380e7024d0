"""Naming conventions laid over the names of a skeleton's joints, and how well each fits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.hand import FINGERS, HAND_JOINTS, Side
from usdhand.rigs.conventions import Convention
from usdhand.rigs.joint_names import Candidates, NamedJoints

# Side -> key -> joints.
Lookup = Mapping[Side | None, Mapping[str, tuple[int, ...]]]


@dataclass(frozen=True)
class ConventionMatch:
    """One convention laid over a rig, with the prefix and suffix that its names have there."""

    convention: Convention
    prefix: str
    suffix: str
    hands: Mapping[Side | None, Candidates]
    body: Candidates
    rank: tuple[int, ...]


def exact_roles(rig: NamedJoints, names: Mapping[str, Sequence[str]]) -> Candidates:
    """Joints with one of the names of each role, and nothing around it."""
    found = {
        role: tuple(j for k in keys for j in rig.by_key.get(k, ())) for role, keys in names.items()
    }
    return {role: joints for role, joints in found.items() if joints}


def convention_matches(rig: NamedJoints, convention: Convention) -> Iterator[ConventionMatch]:
    """Ways to lay a convention over a rig that give a hand, by what stands around its names.

    Names are compared as they are, and without the word for their side, which rigs put anywhere:
    ``HandLeft`` for ``LeftHand``.
    """
    as_they_are: Lookup = dict.fromkeys(convention.hand_keys, rig.by_key)
    yield from _matches(rig, convention, convention.hand_keys, as_they_are, moved=False)
    sideless = convention.sideless_keys
    yield from _matches(rig, convention, sideless, rig.by_sideless_key, moved=True)


def _matches(
    rig: NamedJoints,
    convention: Convention,
    names_of: Mapping[Side | None, Mapping[str, Sequence[str]]],
    lookup: Lookup,
    *,
    moved: bool,
) -> Iterator[ConventionMatch]:
    for prefix, suffix in _affixes(lookup, names_of):

        def joints(
            keys: Mapping[str, tuple[int, ...]],
            names: Sequence[str],
            pre: str = prefix,
            post: str = suffix,
        ) -> tuple[int, ...]:
            return next((f for n in names if (f := keys.get(pre + n + post))), ())

        hands: dict[Side | None, Candidates] = {}
        for side, roles in names_of.items():
            spelled = convention.hands[side]
            found = {
                role: _spelled(rig, js, spelled.get(role, ()))
                for role, names in roles.items()
                if (js := joints(lookup[side], names))
            }
            if is_hand(found):
                hands[side] = found
        if not hands:
            continue
        keys = rig.by_key
        body = {r: js for r, names in convention.body_keys.items() if (js := joints(keys, names))}
        # The arms may hang from any spine joint: keep them all, the hierarchy decides.
        chests = [joints(keys, [n]) for n in convention.body_keys.get("chest", ())]
        body["chest"] = tuple(j for js in chests for j in js)
        rank = _rank(rig, convention, prefix, suffix, hands, body, moved)
        yield ConventionMatch(convention, prefix, suffix, hands, body, rank)


def _spelled(rig: NamedJoints, joints: tuple[int, ...], names: Sequence[str]) -> tuple[int, ...]:
    """Of joints whose names differ in separators only, those with the convention's own spelling.

    Helpers of MakeHuman and others are called like the joint they help, with other separators.
    """
    if len(joints) < 2:
        return joints
    exact = tuple(j for j in joints if rig.names[j].endswith(tuple(names)))
    return exact or joints


def is_hand(roles: Mapping[str, object]) -> bool:
    """Two fingers with two joints each are the least that can be called a hand."""
    return sum(f + "MCP" in roles and f + "PIP" in roles for f in FINGERS) >= 2


def _affixes(
    lookup: Lookup, names_of: Mapping[Side | None, Mapping[str, Sequence[str]]]
) -> list[tuple[str, str]]:
    """Most frequent (prefix, suffix) around the names of finger joints; the plain one first."""
    found: Counter[tuple[str, str]] = Counter()
    for side, roles in names_of.items():
        keys = lookup[side]
        text = "\n".join(keys)
        for anchor in (n for f in FINGERS for j in ("MCP", "PIP") for n in roles.get(f + j, ())):
            if anchor not in text:
                continue
            for key in keys:
                if (start := key.rfind(anchor)) >= 0:
                    found[key[:start], key[start + len(anchor) :]] += 1
    return sorted(found, key=lambda a: (-found[a], len(a[0]) + len(a[1]), a))[:8]


def _rank(
    rig: NamedJoints,
    convention: Convention,
    prefix: str,
    suffix: str,
    hands: Mapping[Side | None, Candidates],
    body: Candidates,
    moved: bool,
) -> tuple[int, ...]:
    """How well a match fits; the larger the better, the first difference decides."""
    required = sum(r in roles for roles in hands.values() for r in ("wrist", *HAND_JOINTS))
    matched = sum(map(len, hands.values())) + sum(map(bool, body.values()))
    in_line = sum(
        any(inner in rig.above[outer] for inner in roles[a] for outer in roles[b])
        for roles in hands.values()
        for f in FINGERS
        for a, b in ((f + "MCP", f + "PIP"), (f + "PIP", f + "DIP"))
        if a in roles and b in roles
    )
    wanted = convention.prefix_keys[::-1]
    own_prefix = 1 + max((i for i, p in enumerate(wanted) if prefix.startswith(p)), default=-1)
    spelled = sum(
        any(n in rig.names[j] for n in convention.hands[side].get(role, ()) for j in joints)
        for side, roles in hands.items()
        for role, joints in roles.items()
    )
    return (
        len(hands),
        convention.own,
        -moved,
        required,
        matched,
        in_line,
        own_prefix,
        -len(prefix) - len(suffix),
        spelled,
        sum(_thumb_starts_well(rig, roles) for roles in hands.values()),
    )


def _thumb_starts_well(rig: NamedJoints, roles: Candidates) -> bool:
    """Whether the first joint of a thumb with joints missing lies where its name says.

    VRM 0 calls the CMC what VRM 1 calls the MCP; of real hands the CMC lies at 0.25 to 0.48 of the
    way from the wrist to the knuckles, the MCP beyond 0.7.
    """
    line = [r for r in ("ThumbCMC", "ThumbMCP", "ThumbIP") if r in roles]
    if len(line) == 3 or not {"wrist", *line[:1]} <= set(roles) or line[:1] == ["ThumbIP"]:
        return False
    joints = [roles[r][0] for r in (*line[:1], *(f + "MCP" for f in FINGERS)) if r in roles]
    thumb, *knuckles = np.linalg.norm(rig.points[joints] - rig.points[roles["wrist"][0]], axis=1)
    return bool((thumb < 0.6 * np.mean(knuckles)) == (line[0] == "ThumbCMC")) if line else False
