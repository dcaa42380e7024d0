"""Fingers from every rig to every other: hinges bend by the same angles, tips come to one place.

Measured on the joints' places alone, not by channels. The rigs have names, axes, bind poses, sizes
and metacarpals of their own; the lengths of their bones are in proportion, so that nothing else may
move a fingertip.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from builders.copies import random_turns_of, reaxed
from builders.moving_hands import at_bind
from builders.rigs import Joint, build, known_rigs

import usdhand
from usdhand.anatomy import SIDES, Side
from usdhand.anatomy.channels import Channels
from usdhand.anatomy.hand import DIGITS, digit_joints
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit

FRAMES = 12
RIGS = tuple(
    name
    for name, names in known_rigs().items()
    if all((side, "IndexMCP") in names for side in SIDES)
)[:20]
# What hangs off another digit or carpal bones, or has two joints a finger, is built straight here.
HINGES_DEG, TIP_MM = 0.1, 0.2


def scaled(skeleton: Skeleton, factor: float) -> Skeleton:
    bind, rest = skeleton.bind.copy(), skeleton.rest.copy()
    bind[:, :3, 3] *= factor
    rest[:, :3, 3] *= factor
    return Skeleton(skeleton.joints, skeleton.parents, bind, rest)


@cache
def rig(name: str) -> tuple[Clip, Mapping[Joint, int], float]:
    """A character with the joint names of a rig at its bind pose, its joints, and its size."""
    number = RIGS.index(name)
    pose, curl = ("T", "A")[number % 2], (0.0, 8.0, 15.0, 25.0)[number % 4]
    skeleton, index = build(known_rigs()[name], pose=pose, curl=curl)
    size = (1.0, 0.8, 1.3)[number % 3]
    clip = at_bind(scaled(skeleton, size), FRAMES)
    return reaxed(clip, random_turns_of(clip.skeleton, 100 + number)), index, size


def moving(name: str) -> Clip:
    """The character with moving fingers."""
    clip, _, _ = rig(name)
    hands = usdhand.find_hands(clip)
    random = np.random.default_rng(RIGS.index(name))
    values = np.zeros((FRAMES, len(hands.all_names)))
    for column, channel in enumerate(hands.all_names):
        bends = channel[-1] == ("z" if "Thumb" in channel else "y")
        spread = 45.0 if bends else 10.0
        middle = 40.0 if bends else 0.0
        wave = np.sin(np.arange(FRAMES) * random.uniform(0.2, 0.5) + random.uniform(0.0, 6.0))
        values[:, column] = middle + spread * wave * random.uniform(0.5, 1.0)
    return hands.decode(Channels(hands.all_names, values), clip)


def places(clip: Clip, index: Mapping[Joint, int], side: Side, digit: str) -> Array | None:
    """(frames, 4 or 5, 3) wrist, joints of a digit, and its tip if there is one."""
    roles = ["wrist", *(digit + joint for joint in digit_joints(digit)), digit + "Tip"]
    if any((side, role) not in index for role in roles[:-1]):
        return None
    found = [index[side, role] for role in roles if (side, role) in index]
    return forward_kinematics(clip, found).positions


def hinges(points: Array) -> Array:
    """(frames, joints) angles between bones, degrees: at what bends behind the first joint."""
    bones = [unit(b - a) for a, b in pairwise(np.moveaxis(points, 1, 0)[1:])]
    cosines = [(a * b).sum(axis=-1) for a, b in pairwise(bones)]
    return np.degrees(np.arccos(np.clip(np.stack(cosines, axis=1), -1.0, 1.0)))


def palm(clip: Clip, index: Mapping[Joint, int], side: Side) -> tuple[Array, Array]:
    """The wrist (frames, 3), and axes (frames, 3, 3) along and across the palm."""
    roles = ("wrist", "MiddleMCP", "IndexMCP", "PinkyMCP")
    wrist, middle, first, last = np.moveaxis(
        forward_kinematics(clip, [index[side, role] for role in roles]).positions, 1, 0
    )
    along = unit(middle - wrist)
    normal = unit(np.cross(along, first - last))
    return wrist, np.stack([along, normal, np.cross(along, normal)], axis=1)


def check(source: str, target: str) -> None:
    clip, (body, theirs, size) = moving(source), rig(target)
    _, ours, own_size = rig(source)
    made = usdhand.retarget_hands(clip, body)
    for side in SIDES:
        frames = [palm(c, i, side) for c, i in ((clip, ours), (made, theirs))]
        for digit in DIGITS:
            both = [places(c, i, side, digit) for c, i in ((clip, ours), (made, theirs))]
            if both[0] is None or both[1] is None:
                continue
            count = min(both[0].shape[1], both[1].shape[1])
            one, other = (points[:, :count] for points in both if points is not None)
            away = np.abs(hinges(one) - hinges(other)).max()
            assert away < HINGES_DEG, (source, target, side, digit, away)
            ends = [
                np.einsum("fij,fj->fi", axes, points[:, -1] - wrist)
                for points, (wrist, axes) in zip((one, other), frames, strict=True)
            ]
            apart = 10.0 * np.linalg.norm(ends[0] / own_size - ends[1] / size, axis=-1).max()
            assert apart < TIP_MM, (source, target, side, digit, apart)


def test_there_are_twenty_rigs() -> None:
    assert len(RIGS) == 20


@pytest.mark.parametrize("number", range(len(RIGS)))
def test_fingers_go_to_the_next_rig(number: int) -> None:
    check(RIGS[number], RIGS[(number + 7) % len(RIGS)])


@pytest.mark.slow
@pytest.mark.parametrize("source", RIGS)
def test_fingers_go_to_every_rig(source: str) -> None:
    for target in RIGS:
        if target != source:
            check(source, target)
