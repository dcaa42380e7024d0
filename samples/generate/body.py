"""Anatomy of a procedural person, independent of any rig.

All geometry here is canonical: centimetres, Y up, facing +Z, the left side at +X, in the *zero
pose*: arms level, palms down, every finger straight. A pose is a world rotation per joint away
from the zero pose, so it can be put on any rig whose axes are known in the zero pose.

Only left sides are described; right sides are mirror images.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = Sequence[float] | Array

SIDES = ("L", "R")
FINGERS = ("index", "middle", "ring", "pinky")
DIGITS = ("thumb", *FINGERS)
MIRROR = np.diag([-1.0, 1.0, 1.0])

# The left hand in the zero pose: distal, radial (thumb side) and palmar directions.
DISTAL = np.array([1.0, 0.0, 0.0])
RADIAL = np.array([0.0, 0.0, 1.0])
PALMAR = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class Proportions:
    """Body measures in centimetres.

    `hand` scales the whole hand; `palm` and `finger` refine its length. Heights are measured
    from the floor, widths from the middle.
    """

    name: str
    hips: float
    spine: tuple[float, float, float]
    neck: float
    head: float
    shoulder: tuple[float, float, float]
    upper_arm: float
    forearm: float
    hip_width: float
    knee: float
    ankle: float
    foot: float
    hand: float = 1.0
    palm: float = 1.0
    finger: float = 1.0
    girth: float = 1.0
    skull: float = 1.0


ADA = Proportions(
    "Ada", 93.0, (101.0, 111.0, 122.0), 141.0, 149.5, (16.2, 137.5, -1.0), 27.0, 24.0,
    8.8, 48.5, 8.0, 12.5,
)  # fmt: skip
BEN = Proportions(
    "Ben", 105.0, (114.0, 125.5, 138.0), 158.5, 167.5, (19.4, 154.5, -1.2), 30.4, 26.6,
    9.6, 55.0, 9.0, 14.2, hand=1.1, palm=1.04, finger=0.98, girth=1.13, skull=1.06,
)  # fmt: skip

# Knuckles seen from the wrist: angle toward the thumb (deg), distance and palmar depth (cm).
_KNUCKLES = {
    "index": (15.0, 8.7, 0.10),
    "middle": (2.0, 8.7, 0.00),
    "ring": (-11.0, 8.2, 0.15),
    "pinky": (-24.5, 7.6, 0.45),
}
# Direction of the straight fingers (deg toward the thumb) and their phalanges (cm).
_FAN = {"index": 6.0, "middle": 0.0, "ring": -7.0, "pinky": -15.0}
_PHALANGES = {
    "thumb": (4.3, 3.2, 2.5),
    "index": (4.3, 2.4, 2.1),
    "middle": (4.8, 2.9, 2.2),
    "ring": (4.4, 2.7, 2.2),
    "pinky": (3.4, 1.9, 1.9),
}
_THUMB_BASE = (2.0, 1.9, 0.7)
_THUMB_RADIAL, _THUMB_PALMAR = 45.0, 20.0
# How far the plane in which the thumb bends is turned from the fingers' plane, at rest.
_THUMB_ROLL = 20.0


def _parents() -> dict[str, str | None]:
    tree: dict[str, str | None] = {"hips": None}
    for above, joint in pairwise(("hips", "spine1", "spine2", "spine3", "neck", "head")):
        tree[joint] = above
    for side in SIDES:
        above = "spine3"
        for child in ("clavicle", "arm", "forearm", "hand"):
            tree[f"{side}_{child}"] = above
            above = f"{side}_{child}"
        for digit in DIGITS:
            numbers = range(1, 5) if digit == "thumb" else range(5)
            above = f"{side}_hand"
            for number in numbers:
                tree[f"{side}_{digit}{number}"] = above
                above = f"{side}_{digit}{number}"
    for side in SIDES:
        above = "hips"
        for child in ("thigh", "shin", "foot", "toe"):
            tree[f"{side}_{child}"] = above
            above = f"{side}_{child}"
    return tree


PARENT = _parents()


def unit(v: Array) -> Array:
    """Vectors of length one, along the last axis."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def axis_angle(axis: Array, degrees: Array | float) -> Array:
    """Rotation matrices about one axis; one for each angle."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(np.asarray(degrees, dtype=float))[..., None, None]
    return np.asarray(np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * (k @ k))


def mirrored(rotation: Array) -> Array:
    """The same rotation seen in the mirror between left and right."""
    return np.asarray(MIRROR @ rotation @ MIRROR)


@dataclass(frozen=True)
class Body:
    """A person in the zero pose.

    Attributes
    ----------
    proportions
        The measures it was made from.
    zero
        Joint positions in the zero pose, cm.
    directions
        For each left digit the direction of its straight bones.
    bend
        For each left digit the direction its tip takes when it flexes.
    """

    proportions: Proportions
    zero: Mapping[str, Array]
    directions: Mapping[str, Array] = field(default_factory=dict)
    bend: Mapping[str, Array] = field(default_factory=dict)

    def length(self, joint: str) -> float:
        """Distance from the joint's parent, cm."""
        parent = PARENT[joint]
        return float(np.linalg.norm(self.zero[joint] - self.zero[parent])) if parent else 0.0


def make_body(p: Proportions) -> Body:
    """Place all joints of a person in the zero pose.

    Parameters
    ----------
    p
        Measures of the person.
    """
    at: dict[str, Array] = {"hips": np.array([0.0, p.hips, 0.0])}
    for number, (height, depth) in enumerate(zip(p.spine, (0.3, 0.0, -0.8), strict=True), 1):
        at[f"spine{number}"] = np.array([0.0, height, depth * p.girth])
    at["neck"] = np.array([0.0, p.neck, -2.0 * p.girth])
    at["head"] = np.array([0.0, p.head, -0.6 * p.girth])
    shoulder = np.array(p.shoulder)
    at["L_clavicle"] = np.array([1.8, p.shoulder[1] + 0.6, 1.5 * p.girth])
    at["L_arm"] = shoulder
    at["L_forearm"] = shoulder + p.upper_arm * DISTAL
    wrist = shoulder + (p.upper_arm + p.forearm) * DISTAL
    at["L_hand"] = wrist
    directions, bend = {}, {}
    for finger, (angle, distance, depth) in _KNUCKLES.items():
        a, f = np.radians(angle), np.radians(_FAN[finger])
        s = p.hand * p.palm
        knuckle = s * (distance * (np.cos(a) * DISTAL + np.sin(a) * RADIAL) + depth * PALMAR)
        at[f"L_{finger}0"] = wrist + 0.28 * knuckle
        at[f"L_{finger}1"] = wrist + knuckle
        directions[finger] = unit(np.cos(f) * DISTAL + np.sin(f) * RADIAL)
        bend[finger] = PALMAR
    s = p.hand * p.palm
    at["L_thumb1"] = wrist + s * (
        _THUMB_BASE[0] * DISTAL + _THUMB_BASE[1] * RADIAL + _THUMB_BASE[2] * PALMAR
    )
    a, b, r = np.radians([_THUMB_RADIAL, _THUMB_PALMAR, _THUMB_ROLL])
    flat = np.cos(a) * DISTAL + np.sin(a) * RADIAL
    directions["thumb"] = np.cos(b) * flat + np.sin(b) * PALMAR
    across = np.sin(a) * DISTAL - np.cos(a) * RADIAL
    bend["thumb"] = np.cos(r) * (np.cos(b) * PALMAR - np.sin(b) * flat) + np.sin(r) * across
    for digit in DIGITS:
        for number, length in enumerate(_PHALANGES[digit], 1):
            step = p.hand * p.finger * length * directions[digit]
            at[f"L_{digit}{number + 1}"] = at[f"L_{digit}{number}"] + step
    w = p.hip_width
    at["L_thigh"] = np.array([w, p.hips - 4.0, 0.0])
    at["L_shin"] = np.array([w + 0.2, p.knee, 0.6])
    at["L_foot"] = np.array([w + 0.4, p.ankle, -1.6])
    at["L_toe"] = np.array([w + 1.0, 2.2, p.foot - 0.5])
    for joint in [j for j in at if j.startswith("L_")]:
        at["R" + joint[1:]] = MIRROR @ at[joint]
    return Body(p, {joint: at[joint] for joint in PARENT}, directions, bend)


@dataclass(frozen=True)
class Pose:
    """World rotations away from the zero pose, over time.

    Attributes
    ----------
    turn
        For every joint, rotations of shape (frames, 3, 3).
    hips
        Position of the hips, (frames, 3), cm.
    """

    turn: Mapping[str, Array]
    hips: Array

    def positions(self, body: Body) -> dict[str, Array]:
        """World positions of all joints, (frames, 3) each, cm."""
        at: dict[str, Array] = {"hips": self.hips}
        for joint, parent in PARENT.items():
            if parent is not None:
                offset = body.zero[joint] - body.zero[parent]
                at[joint] = at[parent] + self.turn[parent] @ offset
        return at
