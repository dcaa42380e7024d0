"""Euler angles of rotations, as curves that people can edit: no jumps."""

from __future__ import annotations

import numpy as np

from usdhand.motion.rotations import Array


def zxy_angles(q: Array) -> Array:
    """Angles in degrees (frames, ..., 3) about Z, X and Y, Z outermost, of quaternions.

    Every rotation has two such triples, and each angle any number of full turns: those nearest to
    the frame before are taken. The third angle undoes what the first two leave, so that all three
    give back the rotation at gimbal lock too, where the first is anything.
    """
    x, y, z, w = np.moveaxis(q, -1, 0)
    m00, m01, m02 = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    m10, m11, m12 = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    first = np.arctan2(-m01, m11)
    c, s = np.cos(first), np.sin(first)
    second = np.arctan2(2 * (y * z + x * w), c * m11 - s * m01)
    third = np.arctan2(c * m02 + s * m12, c * m00 + s * m10)
    return np.degrees(np.unwrap(_nearest_triples(np.stack([first, second, third], -1)), axis=0))


def _nearest_triples(angles: Array) -> Array:
    """Of the two triples of each rotation, the one nearer to that of the frame before."""
    other = np.stack(
        [angles[..., 0] + np.pi, np.pi - angles[..., 1], angles[..., 2] + np.pi], axis=-1
    )
    # The other triple of both frames is as far: so a choice holds until the next change.
    stay = _apart(angles[1:], angles[:-1])
    change = _apart(other[1:], angles[:-1])
    swapped = np.zeros(angles.shape[:-1], dtype=bool)
    swapped[1:] = np.logical_xor.accumulate(change < stay, axis=0)
    return np.where(swapped[..., None], other, angles)


def _apart(a: Array, b: Array) -> Array:
    turn = a - b
    turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
    return np.asarray(np.abs(turn).sum(axis=-1))
