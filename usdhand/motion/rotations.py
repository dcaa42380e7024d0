"""Rotations as unit quaternions ``(x, y, z, w)``, vectorised over leading axes, float64.

``scipy.spatial.transform`` does most of this too, but takes 0.4 s to import, which would make every
command feel slow; the few lines needed are here instead and tested against it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.array([0.0, 0.0, 0.0, 1.0])
# Quaternions whose length is 1 within this are rounded, even in half precision; what is further off
# is no rotation.
UNIT_TOLERANCE = 1e-3
Y_UP_FROM_Z_UP: Array = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product ``a * b`` (first ``b``, then ``a``), broadcasting; shape (..., 4)."""
    return np.stack(product(np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)), axis=-1)


def product(a: Iterable[Array], b: Iterable[Array]) -> list[Array]:
    """Hamilton product of quaternions by their components x, y, z and w, as components."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def conjugate(q: Array) -> Array:
    """Inverse of unit quaternions, shape (..., 4)."""
    return np.asarray(q * np.array([-1.0, -1.0, -1.0, 1.0]))


def rotate(q: Array, v: Array) -> Array:
    """Vectors (..., 3) turned by unit quaternions (..., 4)."""
    u, w = q[..., :3], q[..., 3:]
    t = 2.0 * np.cross(u, v)
    return np.asarray(v + w * t + np.cross(u, t))


def normalize(q: Array) -> Array:
    """Quaternions (..., 4) scaled to unit length."""
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) for column vectors."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)


def from_matrix(m: Array) -> Array:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), by the largest of four roots."""
    d = np.diagonal(m, axis1=-2, axis2=-1)
    trace = d.sum(axis=-1)
    choice = np.argmax(np.concatenate([d, trace[..., None]], axis=-1), axis=-1)
    m00, m11, m22 = d[..., 0], d[..., 1], d[..., 2]
    # Each candidate is the quaternion times four of its own component of largest magnitude.
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    candidates = np.stack(
        [
            np.stack([1 + m00 - m11 - m22, xy, xz, a], axis=-1),
            np.stack([xy, 1 - m00 + m11 - m22, yz, b], axis=-1),
            np.stack([xz, yz, 1 - m00 - m11 + m22, c], axis=-1),
            np.stack([a, b, c, 1 + trace], axis=-1),
        ],
        axis=-2,
    )
    q = np.take_along_axis(candidates, choice[..., None, None], axis=-2)[..., 0, :]
    return normalize(q)


def from_axis_angle(axis: Array, angle: Array | float) -> Array:
    """Quaternions (..., 4) turning by ``angle`` (...) radians about unit ``axis`` (..., 3)."""
    half = np.asarray(angle, dtype=np.float64)[..., None] / 2.0
    vector = np.asarray(axis * np.sin(half))
    return np.concatenate([vector, np.broadcast_to(np.cos(half), (*vector.shape[:-1], 1))], axis=-1)


def to_rotation_vector(q: Array) -> Array:
    """Rotation vectors (..., 3) in radians, of the shorter way round."""
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    return np.asarray(q[..., :3] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0))


def angle_between(a: Array, b: Array) -> Array:
    """Angle in degrees (...) of the rotation from ``a`` to ``b``, exact for small angles too."""
    d = multiply(conjugate(a), b)
    sine = np.linalg.norm(d[..., :3], axis=-1)
    return np.asarray(np.degrees(2.0 * np.arctan2(sine, np.abs(d[..., 3]))))


def between_vectors(a: Array, b: Array) -> Array:
    """Shortest rotation (..., 4) that turns unit vectors ``a`` onto ``b``."""
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    axis = np.cross(a, b)
    # Opposite vectors: half a turn about any axis across them.
    helper = np.where(np.abs(a[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    across = np.cross(a, helper)
    opposite = w < 1e-9
    return normalize(
        np.concatenate([np.where(opposite, across, axis), np.where(opposite, 0.0, w)], -1)
    )


def slerp(a: Array, b: Array, t: Array) -> Array:
    """Spherical interpolation from ``a`` to ``b`` (..., 4) by ``t`` (...) in 0..1, shorter way."""
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0, -b, b)
    theta = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(theta)
    t = np.asarray(t)[..., None]
    small = sine < 1e-6
    safe = np.where(small, 1.0, sine)
    wa = np.where(small, 1.0 - t, np.sin((1.0 - t) * theta) / safe)
    wb = np.where(small, t, np.sin(t * theta) / safe)
    return normalize(wa * a + wb * b)


def make_continuous(q: NDArray[Any]) -> NDArray[Any]:
    """Signs chosen so that neighbours along axis 0 lie in one half space; same rotations."""
    if len(q) < 2:
        return q
    flips = np.einsum("t...i,t...i->t...", q[1:], q[:-1]) < 0
    if not flips.any():
        return q
    odd = np.zeros(q.shape[:-1], dtype=bool)
    odd[1:] = np.logical_xor.accumulate(flips, axis=0)
    return np.where(odd[..., None], -q, q)


def mean(q: Array) -> Array:
    """Average rotation over axis 0 (..., 4): the largest eigenvector of the sum of outer products.

    Source: Markley et al. 2007, "Averaging Quaternions", equation (13).
    """
    m = np.einsum("t...i,t...j->...ij", q, q)
    _, vectors = np.linalg.eigh(m)
    average = vectors[..., :, -1]
    return np.asarray(np.where(average[..., 3:] < 0, -average, average))
