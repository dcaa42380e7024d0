"""The look of a person: skin, clothes and hair around a body in its bind pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .body import DIGITS, FINGERS, PARENT, Array, Body, Pose, Vector
from .surface import (
    Distance,
    Mesh,
    Solid,
    capsule,
    ellipsoid,
    minus,
    skin,
    slab,
    surface_nets,
    union,
)


@dataclass(frozen=True)
class Part:
    """A mesh and its colour (linear RGB) and roughness."""

    name: str
    mesh: Mesh
    color: tuple[float, float, float]
    roughness: float = 0.6


@dataclass(frozen=True)
class Look:
    """Colours of a person."""

    skin: tuple[float, float, float]
    top: tuple[float, float, float]
    trousers: tuple[float, float, float]
    shoes: tuple[float, float, float]
    hair: tuple[float, float, float]
    long_hair: bool


ADA_LOOK = Look((0.62, 0.36, 0.25), (0.03, 0.20, 0.24), (0.045, 0.05, 0.075), (0.30, 0.29, 0.27),
                (0.035, 0.018, 0.012), True)  # fmt: skip
BEN_LOOK = Look((0.27, 0.13, 0.078), (0.42, 0.17, 0.05), (0.10, 0.085, 0.07), (0.03, 0.03, 0.035),
                (0.010, 0.008, 0.007), False)  # fmt: skip

# Radii of the fingers (cm) at knuckle, middle joint, far joint and tip.
_GIRTH = {
    "thumb": (1.15, 1.0, 0.9, 0.66),
    "index": (0.92, 0.82, 0.70, 0.56),
    "middle": (0.95, 0.84, 0.72, 0.57),
    "ring": (0.90, 0.79, 0.67, 0.54),
    "pinky": (0.80, 0.68, 0.58, 0.47),
}


class _Builder:
    """Places solids by joint in the bind pose."""

    def __init__(self, body: Body, pose: Pose) -> None:
        self.body = body
        self.at = {j: p[0] for j, p in pose.positions(body).items()}
        self.turn = {j: r[0] for j, r in pose.turn.items()}
        self.g = body.proportions.girth

    def point(self, joint: str, offset: Vector = (0.0, 0.0, 0.0)) -> Array:
        """A point given in canonical directions from a joint, moved along with it."""
        return np.asarray(self.at[joint] + self.turn[joint] @ np.asarray(offset, dtype=float))

    def rod(self, joint: str, a: Array, b: Array, ra: float, rb: float, soft: float) -> Solid:
        """A capsule carried by a joint."""
        return Solid(joint, capsule(a, b, ra, rb), soft)

    def blob(self, joint: str, offset: Vector, radii: Vector,
             soft: float) -> Solid:  # fmt: skip
        """An ellipsoid carried by a joint."""
        center = self.point(joint, offset)
        return Solid(joint, ellipsoid(center, radii, self.turn[joint]), soft)


def _related(a: str, b: str) -> bool:
    """Whether two joints are next to each other (metacarpals count as the hand)."""

    def up(j: str) -> str | None:
        parent = PARENT[j]
        return up(parent) if parent and parent.endswith("0") else parent

    return a == b or up(a) == b or up(b) == a


def _any(_a: str, _b: str) -> bool:
    return True


def _box(near: Sequence[Array], margin: float) -> tuple[Array, Array]:
    points = np.stack(near)
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def _hand(b: _Builder) -> Mesh:
    """Skin of the left hand, into the sleeve."""
    s = b.body.proportions.hand
    k = 0.5 + 0.5 * s if s > 1 else s
    hand = b.turn["L_hand"]
    palmar = hand @ np.array([0.0, -1.0, 0.0])
    wrist = b.at["L_hand"]
    solids = []
    for finger in FINGERS:
        r = [s * v for v in _GIRTH[finger]]
        chain = [b.at[f"L_{finger}{i}"] for i in range(1, 5)]
        chain[3] = chain[3] + (chain[2] - chain[3]) * r[3] / np.linalg.norm(chain[2] - chain[3])
        for i in range(3):
            solids.append(b.rod(f"L_{finger}{i + 1}", chain[i], chain[i + 1], r[i], r[i + 1],
                                0.16 * r[i]))  # fmt: skip
        root = wrist + 0.22 * (chain[0] - wrist)
        solids.append(b.rod("L_hand", root, chain[0] - 0.1 * s * (chain[0] - root) / s, 1.15 * s,
                            1.02 * r[0], 0.2))  # fmt: skip
    inner, outer = b.at["L_index1"], b.at["L_pinky1"]
    low = 0.25 * s * palmar
    corners = [
        wrist + hand @ np.array([0.8, 0, 1.35]) * s + low,
        inner + 0.14 * (wrist - inner) + low,
        outer + 0.14 * (wrist - outer) + low,
        wrist + hand @ np.array([0.8, 0, -1.45]) * s + low,
    ]
    solids.append(Solid("L_hand", slab(corners, 1.1 * s), 0.2))
    # Ball of the little finger.
    solids.append(b.rod("L_hand", b.point("L_hand", np.array([1.8, -0.6, -1.5]) * s),
                        b.point("L_hand", np.array([5.2, -0.75, -2.2]) * s), 1.15 * s, 1.0 * s,
                        0.2))  # fmt: skip
    r = [s * v for v in _GIRTH["thumb"]]
    chain = [b.at[f"L_thumb{i}"] for i in range(1, 5)]
    chain[3] = chain[3] + (chain[2] - chain[3]) * r[3] / np.linalg.norm(chain[2] - chain[3])
    for i in range(3):
        soft = 0.5 if i == 0 else 0.16 * r[i]
        solids.append(b.rod(f"L_thumb{i + 1}", chain[i], chain[i + 1], r[i], r[i + 1], soft))
    web = b.point("L_hand", np.array([4.0, -0.5, 2.0]) * s)
    solids.append(b.rod("L_thumb1", chain[0], 0.55 * chain[1] + 0.45 * web, 1.25 * s, 0.7 * s, 0.7))
    cuff = b.point("L_hand", np.array([-4.5, 0, 0]) * s)
    solids.append(b.rod("L_hand", wrist, wrist + 0.15 * (inner - wrist), 1.75 * s, 1.5 * s, 0.3))
    solids.append(b.rod("L_forearm", cuff, wrist, 2.25 * k, 1.75 * s, 0.8))
    shape = union([x.distance for x in solids], 0.16)
    tips = [b.at[f"L_{d}4"] for d in DIGITS]
    return skin(solids, shape, _box([cuff, wrist, *tips], 2.8), 0.44 * s, _related, 3)


def _other_side(joint: str) -> str:
    return "R" + joint[1:] if joint.startswith("L_") else joint


def _sides(solids: list[Solid]) -> list[Solid]:
    """Left solids and their mirror images."""
    mirror = np.array([-1.0, 1.0, 1.0])
    out = list(solids)
    for s in solids:
        if s.joint.startswith("L_"):

            def other(p: Array, f: Distance = s.distance) -> Array:
                return f(p * mirror)

            out.append(Solid(_other_side(s.joint), other, s.soft))
    return out


def _top(b: _Builder) -> Mesh:
    """A sweater: torso, shoulders and sleeves."""
    g, at = b.g, b.at
    s = 2.2
    width = at["L_arm"][0]
    hand = b.body.proportions.hand
    chest = 0.5 * (at["spine3"] + at["neck"])
    rise = at["spine3"][1] - at["hips"][1]
    core = [
        b.blob("hips", (0, -4.5, -0.2), (17.2 * g, 17.0, 12.2 * g), s),
        b.blob("spine1", (0, 1.0, 0.2), (13.0 * g, 0.55 * rise, 9.4 * g), s),
        b.blob("spine2", (0, 3.0, 0.6), (13.0 * g, 0.60 * rise, 9.6 * g), s),
        b.blob("spine3", (0, 4.5, 0.9), (0.92 * width, 0.48 * rise, 10.2 * g), s),
    ]
    neck = [
        b.blob("spine3", (0, chest[1] - at["spine3"][1] + 3.0, -1.2), (0.84 * width, 6.5, 6.6 * g),
               s),
        b.rod("neck", b.point("neck", (0, -3, 0)), b.point("neck", (0, 1.2, 0.5)), 6.4 * g, 5.5 * g,
              s),
    ]  # fmt: skip
    arm, elbow, wrist = at["L_arm"], at["L_forearm"], at["L_hand"]
    cuff = wrist + 1.2 * (elbow - wrist) / np.linalg.norm(elbow - wrist)
    inner = b.point("L_clavicle", (3.0, 0.0, -2.0))
    limbs = _sides([
        b.rod("L_clavicle", inner, arm + 0.15 * (inner - arm), 4.4 * g, 4.9 * g, s),
        b.rod("L_arm", arm, elbow, 5.3 * g, 4.1 * g, 1.2),
        b.rod("L_forearm", elbow, elbow + 0.3 * (wrist - elbow), 4.1 * g, 4.0 * g, 1.2),
        b.rod("L_forearm", elbow + 0.3 * (wrist - elbow), cuff, 4.0 * g, 2.7 * hand, 1.2),
    ])  # fmt: skip
    solids = [*core, *neck, *limbs]
    torso = union([x.distance for x in core], 1.6)
    shape = union([torso, *(x.distance for x in (*neck, *limbs))], 1.2)
    # A straight hem reads as cloth.
    hem = at["hips"][1] - 5.0
    cut = minus(shape, lambda p: p[:, 1] - hem, 0.35)

    deep = np.array([0, 0, 9 * g])
    near = [at["L_hand"], at["R_hand"], at["neck"] + np.array([0, 3, 0]), np.array([0, hem, 0]),
            at["hips"] + deep, at["hips"] - deep, at["L_arm"]]  # fmt: skip
    box = _box(near, 6.5)
    return skin(solids, cut, box, 1.7, _any)


def _trousers(b: _Builder) -> Mesh:
    g, at = b.g, b.at
    solids = [b.blob("hips", (0, -3.0, -0.3), (14.8 * g, 9.5, 10.4 * g), 2.4)]
    thigh, knee, ankle = at["L_thigh"], at["L_shin"], at["L_foot"]
    calf = knee + 0.28 * (ankle - knee) - np.array([0, 0, 0.9])
    solids += _sides([
        b.rod("L_thigh", thigh - np.array([0, 3, 0]), knee, 8.4 * g, 5.7 * g, 1.8),
        b.rod("L_shin", knee, calf, 5.7 * g, 5.7 * g, 1.8),
        b.rod("L_shin", calf, ankle + np.array([0, 1.5, 0]), 5.7 * g, 4.5 * g, 1.8),
    ])  # fmt: skip
    shape = union([x.distance for x in solids], 0.9)

    def cut(p: Array) -> Array:
        return np.asarray(np.maximum(shape(p), ankle[1] - 4.0 - p[:, 1]))

    near = [ankle, at["R_foot"], at["hips"] + np.array([12 * g, 0, 8 * g]),
            at["hips"] - np.array([12 * g, 0, 8 * g])]  # fmt: skip
    return skin(solids, cut, _box(near, 8.0), 2.1, _any)


def _shoes(b: _Builder) -> Mesh:
    at, g = b.at, b.g
    ankle, ball = at["L_foot"], at["L_toe"]
    heel = np.array([ankle[0], 3.2, ankle[2] - 2.0])
    tip = ball + np.array([0.5, 0.3, 5.0])
    solids = _sides([
        b.rod("L_foot", ankle, heel, 4.0 * g, 3.4 * g, 1.0),
        b.rod("L_foot", heel, ball + np.array([0, 0.8, 0]), 3.5 * g, 3.7 * g, 1.0),
        b.rod("L_foot", ankle + np.array([0, 0, 1.5]), ball + np.array([0, 1.0, -1.0]), 3.6 * g,
              3.4 * g, 1.0),
        b.rod("L_toe", ball + np.array([0, 0.5, 0]), tip, 3.8 * g, 2.6 * g, 1.0),
    ])  # fmt: skip
    shape = union([x.distance for x in solids], 0.6)

    def cut(p: Array) -> Array:
        return np.maximum(shape(p), -p[:, 1])

    near = [ankle, at["R_foot"], tip, heel, np.zeros(3)]
    return skin(solids, cut, _box(near, 5.5), 1.2, _any)


def _head(b: _Builder, look: Look) -> list[Part]:
    k = b.body.proportions.skull
    solids = [
        b.blob("head", np.array([0, 9.6, 1.2]) * k, np.array([7.3, 9.0, 8.9]) * k, 1.5),
        b.blob("head", np.array([0, 4.6, 3.4]) * k, np.array([5.5, 6.2, 6.0]) * k, 1.5),
        b.blob("head", np.array([0, 0.2, 6.6]) * k, np.array([2.3, 1.9, 2.2]) * k, 1.5),
        b.rod("head", b.point("head", np.array([0, 7.4, 9.6]) * k),
              b.point("head", np.array([0, 4.9, 10.7]) * k), 0.7 * k, 1.1 * k, 1.5),
        b.rod("neck", b.point("neck", (0, -4, 0.2)), b.point("head", (0, 4, 0.0)), 5.4 * k,
              5.0 * k, 2.0),
        b.rod("head", b.point("head", np.array([-1.8, 2.6, 8.5]) * k),
              b.point("head", np.array([1.8, 2.6, 8.5]) * k), 0.75 * k, 0.75 * k, 1.5),
    ]  # fmt: skip
    for x in (-1.0, 1.0):
        solids.append(b.rod("head", b.point("head", np.array([x * 1.6, 9.1, 9.1]) * k),
                            b.point("head", np.array([x * 4.2, 9.0, 7.8]) * k), 0.75 * k,
                            0.7 * k, 1.5))  # fmt: skip
        solids.append(b.blob("head", np.array([x * 7.2, 6.4, 0.6]) * k,
                             np.array([0.8, 2.9, 1.8]) * k, 1.5))  # fmt: skip
    face = union([x.distance for x in solids], 0.45)
    top = b.point("head", np.array([0, 20, 0]) * k)
    box = _box([top, b.point("neck", (0, -4, 0)), b.point("head", (9 * k, 0, 11 * k)),
                    b.point("head", (-9 * k, 0, -9 * k))], 2.0)  # fmt: skip
    parts = [Part("Head", skin(solids, face, box, 0.85, _any), look.skin)]

    cap = [ellipsoid(b.point("head", np.array([0, 10.2, 0.4]) * k), np.array([8.0, 9.4, 9.4]) * k)]
    if look.long_hair:
        cap.append(ellipsoid(b.point("head", np.array([0, 4.5, -4.2]) * k),
                             np.array([7.6, 9.5, 5.0]) * k))  # fmt: skip
        cap.append(ellipsoid(b.point("head", np.array([0, 14.0, -8.2]) * k),
                             np.array([3.6, 3.4, 3.4]) * k))  # fmt: skip
    hole = ellipsoid(b.point("head", np.array([0, 4.0, 8.0]) * k), np.array([7.2, 10.4, 6.8]) * k)
    low = ellipsoid(b.point("head", np.array([0, -2.6, 3.0]) * k), np.array([12, 8.6, 7.5]) * k)
    hair = minus(minus(union(cap, 0.6), hole, 0.7), low, 0.7)
    mesh = skin([Solid("head", hair, 1.0)], hair, box, 0.85, _any)
    parts.append(Part("Hair", mesh, look.hair, 0.5))

    eyes: list[Mesh] = []
    for x in (-1.0, 1.0):
        eye = ellipsoid(b.point("head", np.array([x * 2.9, 7.3, 8.75]) * k),
                        np.array([1.15, 0.85, 0.75]) * k)  # fmt: skip
        middle = b.point("head", np.array([x * 2.9, 7.3, 8.75]) * k)
        q, p, n = surface_nets(eye, middle - 1.8, middle + 1.8, 0.3)
        eyes.append(Mesh(q, p, n, ["head"], np.ones((len(p), 1))))
    parts.append(Part("Eyes", merge(eyes), (0.012, 0.01, 0.009), 0.15))
    return parts


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    joints = sorted({j for m in meshes for j in m.joints})
    quads, weights, first = [], [], 0
    for m in meshes:
        quads.append(m.quads + first)
        first += len(m.points)
        w = np.zeros((len(m.points), len(joints)))
        w[:, [joints.index(j) for j in m.joints]] = m.weights
        weights.append(w)
    return Mesh(np.concatenate(quads), np.concatenate([m.points for m in meshes]),
                np.concatenate([m.normals for m in meshes]), joints,
                np.concatenate(weights))  # fmt: skip


def hands_only(body: Body, pose: Pose, look: Look, sides: str = "LR") -> list[Part]:
    """Hands and a stub of sleeve."""
    b = _Builder(body, pose)
    left = _hand(b)
    girth, elbow, wrist = body.proportions.hand, b.at["L_forearm"], b.at["L_hand"]
    cuff = wrist + 1.2 * (elbow - wrist) / np.linalg.norm(elbow - wrist)
    sleeve = b.rod("L_forearm", elbow, cuff, 4.2 * b.g, 2.75 * girth, 1.0)
    stub = skin([sleeve], sleeve.distance, _box([elbow, cuff], 5.0), 1.0, _any)

    def chosen(mesh: Mesh) -> Mesh:
        return merge([mesh if s == "L" else mesh.mirrored(_other_side) for s in sides])

    return [
        Part("Hands", chosen(left), look.skin),
        Part("Sleeves", chosen(stub), look.top, 0.8),
    ]


def person(body: Body, pose: Pose, look: Look) -> list[Part]:
    """All parts of a person, canonical centimetres, in the bind pose.

    Parameters
    ----------
    body
        Who.
    pose
        The bind pose; one frame, the same on both sides.
    look
        Colours.
    """
    b = _Builder(body, pose)
    left = _hand(b)
    return [
        Part("Hands", merge([left, left.mirrored(_other_side)]), look.skin),
        *_head(b, look),
        Part("Sweater", _top(b), look.top, 0.8),
        Part("Trousers", _trousers(b), look.trousers, 0.8),
        Part("Shoes", _shoes(b), look.shoes, 0.5),
    ]
