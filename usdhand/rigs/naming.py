"""Hands found by the names of joints: whole conventions laid over a rig, the best fit taken."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from usdhand.anatomy.hand import (
    ARM_JOINTS,
    BODY_JOINTS,
    DIGITS,
    FINGERS,
    HAND_JOINTS,
    SIDES,
    CharacterMap,
    HandMap,
    Side,
    digit_joints,
)
from usdhand.errors import HandNotFoundError
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.rigs.body import joint_points
from usdhand.rigs.conventions import (
    METACARPALS,
    THUMB_CARPAL,
    TIPS,
    Convention,
    Conventions,
    name_key,
    named_side,
)
from usdhand.rigs.shape import chirality

Candidates = Mapping[str, tuple[int, ...]]  # role -> the joints that bear one of its names

ADVICE = "name the joints in a file and pass it with --map FILE"


@dataclass(frozen=True, eq=False)
class NamedJoints:
    """A skeleton with what the search asks again and again.

    ``aliased``: the joints' names are those that the file gives them besides their own.
    """

    skeleton: Skeleton
    aliased: bool = False

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Leaf names, without the running numbers that some exporters append to each joint."""
        if self.aliased:
            return self.skeleton.aliases
        names = self.skeleton.names
        numbers = [m.group() for n in names if (m := re.search(r"[._]\d+$", n))]
        if len(numbers) < 0.8 * len(names) or len(set(numbers)) < len(numbers):
            return names
        return tuple(re.sub(r"[._]\d+$", "", n) for n in names)

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Spelling-free forms of the names."""
        return tuple(map(name_key, self.names))

    @cached_property
    def by_key(self) -> dict[str, tuple[int, ...]]:
        """Joints of each key, in the file's order."""
        found: dict[str, list[int]] = {}
        for joint, key in enumerate(self.keys):
            if key:
                found.setdefault(key, []).append(joint)
        return {key: tuple(joints) for key, joints in found.items()}

    @cached_property
    def above(self) -> tuple[frozenset[int], ...]:
        """Ancestors of each joint."""
        return tuple(frozenset(self.skeleton.ancestors(j)) for j in range(len(self.skeleton)))

    @cached_property
    def points(self) -> Array:
        """World positions (joints, 3) at the bind pose."""
        return joint_points(self.skeleton)

    def path(self, joint: int) -> str:
        """Full path of a joint."""
        return self.skeleton.joints[joint]


@dataclass(frozen=True)
class _Match:
    """One convention laid over a rig, with the prefix and suffix that its names have there."""

    convention: Convention
    prefix: str
    suffix: str
    hands: Mapping[Side | None, Candidates]
    body: Candidates
    rank: tuple[int, ...]


def match_names(rig: NamedJoints, conventions: Conventions) -> CharacterMap | None:
    """Map the hands by the convention that fits best; None if none gives a whole hand."""
    matches = [m for c in conventions.conventions for m in _matches(rig, c)]
    matches.sort(key=lambda m: m.rank, reverse=True)  # stable: then the order in the file
    for match in matches:
        if found := _character(rig, match, matches):
            return found
    return None


def named_body(rig: NamedJoints, found: CharacterMap, conventions: Conventions) -> CharacterMap:
    """Put the arm and body joints with names of the best convention over what was found.

    For names that are a file's own statement and need no hand to be believed: its aliases.
    """
    convention = max(conventions.conventions, key=lambda c: len(_exact(rig, c.body_keys)))
    wrists = [h.wrist for h in found.hands.values()]
    body: dict[str, Any] = _body(rig, _exact(rig, convention.body_keys), wrists)
    hands = {}
    for side, hand in found.hands.items():
        roles = _exact(rig, convention.hand_keys.get(side, {}))
        arms: dict[str, Any] = {r: roles[r][0] for r in ARM_JOINTS[:3] if r in roles}
        hands[side] = replace(hand, **arms)
    return replace(found, hands=hands, **body)


def _exact(rig: NamedJoints, names: Mapping[str, Sequence[str]]) -> Candidates:
    """Joints with one of the names of each role, and nothing around it."""
    found = {
        role: tuple(j for k in keys for j in rig.by_key.get(k, ())) for role, keys in names.items()
    }
    return {role: joints for role, joints in found.items() if joints}


def _matches(rig: NamedJoints, convention: Convention) -> Iterator[_Match]:
    for prefix, suffix in _affixes(rig, convention):

        def joints(names: Sequence[str], pre: str = prefix, post: str = suffix) -> tuple[int, ...]:
            return next((f for n in names if (f := rig.by_key.get(pre + n + post))), ())

        hands: dict[Side | None, Candidates] = {}
        for side, roles in convention.hand_keys.items():
            found = {role: js for role, names in roles.items() if (js := joints(names))}
            if is_hand(found):
                hands[side] = found
        if not hands:
            continue
        body = {role: js for role, names in convention.body_keys.items() if (js := joints(names))}
        # The arms may hang from any spine joint: keep them all, the hierarchy decides.
        chests = [joints([n]) for n in convention.body_keys.get("chest", ())]
        body["chest"] = tuple(j for js in chests for j in js)
        rank = _rank(rig, convention, prefix, suffix, hands, body)
        yield _Match(convention, prefix, suffix, hands, body, rank)


def is_hand(roles: Mapping[str, object]) -> bool:
    """Two fingers with two joints each are the least that can be called a hand."""
    return sum(f + "MCP" in roles and f + "PIP" in roles for f in FINGERS) >= 2


def _affixes(rig: NamedJoints, convention: Convention) -> list[tuple[str, str]]:
    """Most frequent (prefix, suffix) around the names of finger joints; the plain one first."""
    text = "\n".join(rig.by_key)
    found: Counter[tuple[str, str]] = Counter()
    for roles in convention.hand_keys.values():
        for anchor in (n for f in FINGERS for j in ("MCP", "PIP") for n in roles.get(f + j, ())):
            if anchor not in text:
                continue
            for key in rig.by_key:
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


def _character(rig: NamedJoints, match: _Match, matches: Sequence[_Match]) -> CharacterMap | None:
    notes: list[str] = []
    if None in match.hands:
        same = [m for m in matches if m.convention is match.convention]
        hands = _unsided_hands(rig, same, notes)
    else:
        _refuse_twins(rig, match, matches)
        hands = {}
        for side in SIDES:
            roles = match.hands.get(side)
            if roles and (hand := _hand(rig, side, roles, notes)):
                hands[side] = hand
    if not hands:
        return None
    if len(hands) == 1:
        notes.append(f"only a {next(iter(hands))} hand was found")
    if any(m.rank[:-1] == match.rank[:-1] and m.rank[-1] < match.rank[-1] for m in matches):
        notes.append(f"names are those of {match.convention.name} by the place of the thumb")
    body = _body(rig, match.body, [h.wrist for h in hands.values()])
    return CharacterMap(hands, match.convention.name, **body, notes=tuple(notes))


def _refuse_twins(rig: NamedJoints, match: _Match, matches: Sequence[_Match]) -> None:
    """Refuse two complete sets of hands with different prefixes and nothing to prefer one."""
    for other in matches:
        if other is match or other.convention is not match.convention:
            continue
        # The first six places say how complete a match is and whose prefix it has; a plain set
        # wins over prefixed copies of it (FK and IK copies of the deforming joints).
        if other.rank[:6] == match.rank[:6] and match.prefix + match.suffix:
            side = next(iter(match.hands))
            role = next(r for r in HAND_JOINTS if r in match.hands[side])
            paths = [rig.path(m.hands[side][role][0]) for m in (match, other)]
            raise HandNotFoundError(
                f"two sets of joints are named as hands ({match.convention.name}), e.g. "
                f"{paths[0]} and {paths[1]}; {ADVICE}"
            )


def _hand(rig: NamedJoints, side: Side, roles: Candidates, notes: list[str]) -> HandMap | None:
    """Choose one joint for each role of a hand; None if it has no wrist."""
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
            _refuse(rig, f"{side} {role}", inside)
    _settle_thumb(rig, side, chosen, notes)
    _fill_gaps(rig, side, chosen, notes)
    digits = {r: chosen[r] for r in HAND_JOINTS if r in chosen}
    metacarpals = {d: chosen[r] for d, r in METACARPALS.items() if r in chosen}
    tips = {d: tip for d in TIPS if (tip := _tip(rig, d, chosen)) is not None}
    arms = {r: _nearest_above(rig, roles[r], wrist) for r in ARM_JOINTS[:3] if r in roles}
    return HandMap(side, wrist, digits, metacarpals, tips, **arms)


def _wrist(rig: NamedJoints, side: Side, roles: Candidates) -> int | None:
    fingers = [j for f in FINGERS for j in roles.get(f + "MCP", ())]
    if "wrist" not in roles:
        meeting = rig.skeleton.common_ancestor(fingers)
        return None if meeting in fingers else meeting
    below = {w: sum(w in rig.above[j] for j in fingers) for w in roles["wrist"]}
    best = [w for w in below if below[w] == max(below.values())]
    if len(best) > 1:
        _refuse(rig, f"{side} wrist", best)
    return best[0]


def _inside(rig: NamedJoints, joints: Sequence[int], wrist: int) -> Sequence[int]:
    """Of joints with one name, those below the wrist, else those below its parent, else all."""
    for above in (wrist, int(rig.skeleton.parents[wrist])):
        if inside := [j for j in joints if above in rig.above[j]]:
            return inside
    return joints


def _refuse(rig: NamedJoints, what: str, joints: Sequence[int]) -> NoReturn:
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


def _nearest_above(rig: NamedJoints, joints: Sequence[int], *below: int) -> int:
    """Return the lowest of ``joints`` above all of ``below``; the first if none is."""
    above = [j for j in joints if all(j in rig.above[b] for b in below)]
    return max(above, key=lambda j: len(rig.above[j])) if above else joints[0]


def _body(rig: NamedJoints, roles: Candidates, wrists: Sequence[int]) -> dict[str, int]:
    return {r: _nearest_above(rig, roles[r], *wrists) for r in BODY_JOINTS if roles.get(r)}


def _unsided_hands(
    rig: NamedJoints, matches: Sequence[_Match], notes: list[str]
) -> dict[Side, HandMap]:
    """Hands of a convention whose names have no side: from other names around, or the shape."""
    hands: dict[Side, HandMap] = {}
    for match in matches:
        roles = match.hands[None]
        for wrist in roles.get("wrist", ()):
            near = {r: _nearest(rig, js, wrist) for r, js in roles.items()} | {"wrist": (wrist,)}
            hand = _hand(rig, "left", near, notes)
            if hand is None or any(hand.wrist == h.wrist for h in hands.values()):
                continue
            side = named_side(rig.path(hand.joints["IndexMCP"])) or named_side(rig.path(wrist))
            how = "names"
            if side is None:
                side, how = chirality(rig.points, wrist, hand.joints), "shape"
            if side is None:
                raise HandNotFoundError(
                    f"a hand was found at {rig.path(wrist)} ({match.convention.name}), but neither "
                    f"names nor shape say whether it is left or right; {ADVICE}"
                )
            if side in hands:
                _refuse(rig, f"{side} wrist", [hands[side].wrist, wrist])
            hands[side] = replace(hand, side=side)
            notes.append(f"{side} side by {how}: {rig.path(wrist)}")
    return hands


def _nearest(rig: NamedJoints, joints: Sequence[int], wrist: int) -> tuple[int, ...]:
    """Those of ``joints`` that share most ancestors with the wrist."""
    line = rig.above[wrist] | {wrist}
    shared = [len(line & rig.above[j]) for j in joints]
    return tuple(j for j, n in zip(joints, shared, strict=True) if n == max(shared))
