"""Meshes from rounded solids: smooth unions of capsules and boxes, meshed by surface nets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from .body import MIRROR, Array, Vector

Distance = Callable[[Array], Array]
WEIGHT_STEPS = 64


@dataclass(frozen=True)
class Solid:
    """A signed distance and the joint that carries it.

    `soft` is the width over which its skin weight fades beyond its own surface; solids that only
    carve or decorate have the joint of what they sit on.
    """

    joint: str
    distance: Distance
    soft: float


@dataclass(frozen=True)
class Mesh:
    """A mesh with skin weights: quads, points, normals, joints and weights of each point."""

    quads: Array
    points: Array
    normals: Array
    joints: list[str]
    weights: Array

    def mirrored(self, rename: Callable[[str], str]) -> Mesh:
        """The mesh of the other side."""
        return Mesh(self.quads[:, ::-1], self.points @ MIRROR, self.normals @ MIRROR,
                    [rename(j) for j in self.joints], self.weights)  # fmt: skip


def capsule(a: Array, b: Array, ra: float, rb: float) -> Distance:
    """A capsule between two points whose radius changes along it."""

    def distance(p: Array) -> Array:
        line = b - a
        t = np.clip((p - a) @ line / (line @ line), 0.0, 1.0)
        return np.asarray(np.linalg.norm(p - a - t[:, None] * line, axis=1) - (ra + t * (rb - ra)))

    return distance


def ellipsoid(center: Array, radii: Vector, axes: Array | None = None) -> Distance:
    """An ellipsoid; the distance is a first-order estimate."""
    r, m = np.asarray(radii, dtype=float), np.eye(3) if axes is None else axes

    def distance(p: Array) -> Array:
        q = (p - center) @ m
        k0 = np.linalg.norm(q / r, axis=1)
        k1 = np.linalg.norm(q / r**2, axis=1)
        return np.asarray(np.where(k1 > 1e-9, k0 * (k0 - 1.0) / np.maximum(k1, 1e-9), -r.min()))

    return distance


def slab(corners: Sequence[Array], radius: float) -> Distance:
    """A flat quadrilateral (two triangles) blown up by a radius: a palm."""
    a, b, c, d = corners
    parts = [_triangle(a, b, c), _triangle(a, c, d)]

    def distance(p: Array) -> Array:
        return np.asarray(np.minimum(parts[0](p), parts[1](p)) - radius)

    return distance


def _triangle(a: Array, b: Array, c: Array) -> Distance:
    n = np.cross(b - a, c - a)
    n = n / np.linalg.norm(n)

    def distance(p: Array) -> Array:
        inside = np.ones(len(p), dtype=bool)
        edge = np.full(len(p), np.inf)
        for u, v in ((a, b), (b, c), (c, a)):
            line = v - u
            inside &= (p - u) @ np.cross(n, line) >= 0
            t = np.clip((p - u) @ line / (line @ line), 0, 1)
            edge = np.minimum(edge, np.linalg.norm(p - u - t[:, None] * line, axis=1))
        return np.where(inside, np.abs((p - a) @ n), edge)

    return distance


def union(parts: Sequence[Distance], blend: float) -> Distance:
    """Smooth union: joins fillet over about `blend`."""

    def distance(p: Array) -> Array:
        values = np.stack([part(p) for part in parts])
        low = values.min(axis=0)
        return np.asarray(low - blend * (logsumexp(-(values - low) / blend, axis=0)))

    return distance


def minus(a: Distance, b: Distance, blend: float) -> Distance:
    """What is in `a` but not in `b`, with a rounded edge."""
    outside = union([lambda p: -a(p), b], blend)
    return lambda p: -outside(p)


def _gradient(f: Distance, p: Array, step: float) -> Array:
    out = np.empty_like(p)
    for i, e in enumerate(np.eye(3) * step):
        out[:, i] = f(p + e) - f(p - e)
    return out / (2 * step)


def surface_nets(f: Distance, low: Array, high: Array, cell: float) -> tuple[Array, Array, Array]:
    """Quads, points and normals of the surface where `f` is zero.

    Parameters
    ----------
    f
        Signed distance, negative inside.
    low, high
        Corners of the box to search.
    cell
        Size of the grid cells.
    """
    n = np.ceil((high - low) / cell).astype(int) + 1
    axes = [low[i] + cell * np.arange(n[i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = f(grid.reshape(-1, 3)).reshape(n)
    inside = value < 0
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    m = n - 1

    def corner(a: NDArray[Any], c: tuple[int, ...]) -> NDArray[Any]:
        return np.asarray(a[c[0] : c[0] + m[0], c[1] : c[1] + m[1], c[2] : c[2] + m[2]])

    count = np.sum([corner(inside, c) for c in corners], axis=0)
    active = (count > 0) & (count < 8)
    total, hits = np.zeros((*m, 3)), np.zeros(m)
    for a in corners:
        for axis in range(3):
            if a[axis]:
                continue
            b = tuple(1 if i == axis else a[i] for i in range(3))
            va, vb = corner(value, a), corner(value, b)
            cross = (va < 0) != (vb < 0)
            t = np.where(cross, va / np.where(cross, va - vb, 1.0), 0.0)
            for i in range(3):
                total[..., i] += np.where(cross, a[i] + t * (i == axis), 0.0)
            hits += cross
    number = np.full(m, -1)
    number[active] = np.arange(active.sum())
    cells = np.argwhere(active)
    points = low + cell * (cells + total[active] / hits[active][:, None])
    quads = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        here = np.take(inside, range(n[axis] - 1), axis)
        there = np.take(inside, range(1, n[axis]), axis)
        edges = np.argwhere(here != there)
        edges = edges[np.all(edges[:, [i, j]] > 0, axis=1)]
        around = []
        for di, dj in ((1, 1), (0, 1), (0, 0), (1, 0)):
            at = edges.copy()
            at[:, i] -= di
            at[:, j] -= dj
            around.append(number[tuple(at.T)])
        quad = np.stack(around, axis=1)
        outward = here[tuple(edges.T)]
        quads.append(np.where(outward[:, None], quad, quad[:, ::-1]))
    for _ in range(2):  # pull the points onto the surface
        g = _gradient(f, points, 0.2 * cell)
        size = np.maximum(np.sum(g * g, axis=1, keepdims=True), 0.25)
        points = points - np.clip(f(points)[:, None], -cell, cell) * g / size
    normals = _gradient(f, points, 0.2 * cell)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return np.concatenate(quads), points, normals


def skin(
    solids: Sequence[Solid],
    surface: Distance,
    box: tuple[Array, Array],
    cell: float,
    related: Callable[[str, str], bool],
    influences: int = 4,
) -> Mesh:
    """Mesh a surface and weigh each point by its distance to the solids.

    Parameters
    ----------
    solids
        What carries the skin.
    surface
        The surface itself, usually the union of the solids.
    box
        Corners of the box to search.
    cell
        Size of the grid cells.
    related
        Whether two joints may share a point: neighbouring fingers may not.
    influences
        Joints a point at most.
    """
    quads, points, normals = surface_nets(surface, *box, cell)
    joints = sorted({s.joint for s in solids})
    depth = np.full((len(points), len(joints)), np.inf)
    for solid in solids:
        i = joints.index(solid.joint)
        depth[:, i] = np.minimum(depth[:, i], solid.distance(points) / solid.soft)
    best = depth.argmin(axis=1)
    allowed = np.array([[related(a, b) for b in joints] for a in joints])
    depth = np.where(allowed[best], depth, np.inf)
    weights = np.exp(depth.min(axis=1, keepdims=True) - depth)
    if influences < len(joints):
        cut = np.sort(weights, axis=1)[:, -influences][:, None]
        weights = np.where(weights >= cut, weights, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    # Few distinct values, which crate files store compactly; the largest takes what is left.
    weights = np.floor(weights * WEIGHT_STEPS + 0.4) / WEIGHT_STEPS
    row = np.arange(len(points))
    weights[row, best] += 1.0 - weights.sum(axis=1)
    return Mesh(quads, points, normals, joints, weights)
