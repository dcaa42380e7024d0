"""What carries the hands: joints' places, arms, spine and legs, by hierarchy and bind pose."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.transforms import unit

Chain = tuple[int, ...]
SAME_PLACE = 1e-3  # of the character's size: joints that lie no further apart are in one place


def joint_points(skeleton: Skeleton) -> Array:
    """World positions (joints, 3) at the bind pose, with misplaced joints put back, cm.

    Exporters leave joints that move no skin in one place, mostly the origin, at the end of absurdly
    long bones. They go where the rest pose puts them, or if that is as wrong, a bone is continued.
    """
    world, parents = np.nan_to_num(skeleton.bind), skeleton.parents
    if not np.ptp(world[:, :3, 3], axis=0).any():
        return np.asarray(skeleton.accumulated(np.nan_to_num(skeleton.rest))[:, :3, 3])
    misplaced = _misplaced(skeleton)
    for joint in skeleton.order:
        if joint not in misplaced:
            continue
        parent = int(parents[joint])
        offset = skeleton.rest[joint]
        if np.linalg.norm(offset[:3, 3]) > _bone(skeleton, joint) / _ABSURD:
            bone = world[parent, :3, 3] - world[max(parents[parent], 0), :3, 3]
            world[joint, :3, 3] = world[parent, :3, 3] + 0.7 * bone
        else:
            world[joint] = world[parent] @ offset
    return np.asarray(world[:, :3, 3])


_ABSURD = 3.0  # times as long as the bone before it


def _bone(skeleton: Skeleton, joint: int) -> float:
    places, parent = skeleton.bind_positions, skeleton.parents[joint]
    return float(np.linalg.norm(places[joint] - places[parent])) if parent >= 0 else 0.0


def _misplaced(skeleton: Skeleton) -> set[int]:
    """Joints in one place with another branch's joint and much too far from their parent."""
    at: dict[bytes, list[int]] = {}
    for joint, place in enumerate(np.round(skeleton.bind_positions, 4) + 0.0):
        at.setdefault(place.tobytes(), []).append(joint)
    return {
        joint
        for joints in at.values()
        if len({int(skeleton.parents[j]) for j in joints}) > 1
        for joint in joints
        if skeleton.parents[joint] >= 0
        and _bone(skeleton, joint) > _ABSURD * _bone(skeleton, int(skeleton.parents[joint]))
    }


def arm_joints(skeleton: Skeleton, points: Array, wrist: int, chest: int | None) -> dict[str, int]:
    """Clavicle, shoulder and elbow between the chest and a wrist, as far as there are joints.

    Twist joints may divide the arm: of three joints or more the first is the clavicle, and the
    shoulder and elbow are the two that make the shorter of upper arm and forearm longest.
    """
    line = skeleton.ancestors(wrist)
    if chest is None or chest not in line:
        return {}
    arm = line[: line.index(chest)][::-1]
    if not arm:
        return {}
    if len(arm) == 1:
        return {"elbow": arm[0]}

    def length(a: int, b: int) -> float:
        return float(np.linalg.norm(points[a] - points[b]))

    def shorter(pair: tuple[int, int]) -> float:
        return min(length(*pair), length(pair[1], wrist))

    pairs = combinations(arm if len(arm) == 2 else arm[1:], 2)
    shoulder, elbow = max(pairs, key=shorter)
    found = {"shoulder": shoulder, "elbow": elbow}
    if arm[0] != shoulder:
        found["clavicle"] = arm[0]
    return found


@dataclass(frozen=True)
class Body:
    """What carries the hands: joints where found, and directions (3,) of the bind pose."""

    joints: Mapping[str, int]
    up: Array
    facing: Array | None


def body_of(skeleton: Skeleton, points: Array, wrists: Sequence[int]) -> Body:
    """Find chest, hips, neck and head from the wrists, and which way the character looks.

    The chest is where both arms meet, or below that neck, the hips the spine joint nearest to where
    the legs start. Up runs from the feet to the hips, or without legs along the spine, or is Y; the
    toes say what is in front.
    """
    up = np.array([0.0, 1.0, 0.0])
    chest = skeleton.common_ancestor(wrists) if len(wrists) > 1 else None
    if chest is None or chest in wrists:
        return Body({}, up, None)
    heights = heights_of(skeleton)
    spine = (chest, *skeleton.ancestors(chest))
    joints, facing = {"chest": chest}, None
    legs = _legs(skeleton, points, spine, heights)
    if len(spine) > 1 and np.ptp(points[[chest, spine[-1]]], axis=0).any():
        up = unit(points[chest] - points[spine[-1]])
    if legs:
        tops = np.mean([points[leg[0]] for leg in legs], axis=0)
        joints["hips"] = _nearest(points, spine[:0:-1], tops)
        up = unit(tops - np.mean([points[leg[-1]] for leg in legs], axis=0))
        facing = _toe_direction(points, legs, up)
    arms = {a for w in wrists for a in (w, *skeleton.ancestors(w))}
    if _below(skeleton, points, wrists, chest, up) and len(spine) > 2:
        # The arms hang down from the neck, as in 3ds Max Biped.
        joints |= {"neck": chest, "chest": spine[1]}
    above = [c for c in skeleton.children[chest] if c not in arms and heights[c] > 0]
    above = above or [c for c in skeleton.children[chest] if c not in arms]
    if above and "neck" in joints:
        joints["head"] = max(above, key=lambda c: float(points[c] @ up))
    elif above:
        neck = max(above, key=lambda c: float(points[c] @ up))
        joints["neck"] = neck
        if skeleton.children[neck]:
            joints["head"] = max(skeleton.children[neck], key=lambda c: (heights[c], -c))
    return Body(joints, up, facing)


def _nearest(points: Array, line: Sequence[int], place: Array) -> int:
    """The joint nearest to a place; of joints in one place the first of the line."""
    apart = np.linalg.norm(points[list(line)] - place, axis=1)
    same = SAME_PLACE * float(np.ptp(points, axis=0).max())
    return line[int(np.flatnonzero(apart <= apart.min() + same)[0])]


def _below(skeleton: Skeleton, points: Array, wrists: Sequence[int], joint: int, up: Array) -> bool:
    """Whether clavicles and shoulders lie below a joint: a neck does, a chest lies lower.

    Clavicles alone may start below the chest.
    """
    tops = [
        points[c]
        for c in skeleton.children[joint]
        if any(c == w or c in skeleton.ancestors(w) for w in wrists)
    ]
    arms = [arm_joints(skeleton, points, wrist, joint) for wrist in wrists]
    shoulders = [points[arm["shoulder"]] for arm in arms if "shoulder" in arm]
    return all(
        float((np.mean(places, axis=0) - points[joint]) @ up) < 0
        for places in (tops, shoulders)
        if places
    )


def _legs(
    skeleton: Skeleton, points: Array, spine: Chain, heights: Sequence[int]
) -> tuple[Chain, Chain] | None:
    """Return the two long branches off the spine that end farthest from the chest."""
    chest = points[spine[0]]

    def reach(line: Chain) -> float:
        return float(np.linalg.norm(points[line[-1]] - chest))

    for below, joint in pairwise(spine):
        branches = [c for c in skeleton.children[joint] if c != below and heights[c] >= 2]
        lines = [_line_to_farthest(skeleton, c, reach) for c in branches]
        # What ends hardly farther away than it starts is a skirt, a pouch, a control.
        lines = [line for line in lines if reach(line) > 1.5 * reach(line[:1])]
        if len(lines) >= 2:
            lines.sort(key=reach, reverse=True)
            return lines[0], lines[1]
    return None


def _toe_direction(points: Array, legs: Iterable[Chain], up: Array) -> Array | None:
    """Sum of the legs' level bones (feet, toes), None where they are no part of the legs."""
    total, length = np.zeros(3), 0.0
    for leg in legs:
        for bone in np.diff(points[list(leg)], axis=0):
            length += float(np.linalg.norm(bone))
            level = bone - up * (bone @ up)
            if np.linalg.norm(level) > abs(bone @ up):
                total += level
    # Feet and toes are 0.13 to 0.22 of real legs; knees and ankles a little out of line much less.
    return unit(total) if np.linalg.norm(total) > 0.08 * length else None


def heights_of(skeleton: Skeleton) -> list[int]:
    """Return the number of bones from each joint down to its deepest leaf."""
    heights = [0] * len(skeleton)
    for joint in reversed(skeleton.order):
        parent = int(skeleton.parents[joint])
        if parent >= 0:
            heights[parent] = max(heights[parent], heights[joint] + 1)
    return heights


def _line_to_farthest(skeleton: Skeleton, joint: int, reach: Callable[[Chain], float]) -> Chain:
    """Line of joints from ``joint`` down to the leaf of the largest ``reach``."""
    below = (joint, *skeleton.descendants(joint))
    leaf = max((j for j in below if not skeleton.children[j]), key=lambda j: reach((j,)))
    line = (leaf, *skeleton.ancestors(leaf))
    return line[line.index(joint) :: -1]
