"""One joint's rotations as three angles and back: Euler angles, or swing and twist.

Quaternions here have their components first, (4, frames), so that every component is one run of
memory: this is where most of the arithmetic on hands is done. Angles are (3, frames) in degrees:
abduction about x, flexion about y, twist about z, the long axis of the bone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

# Amplitudes (see `euler_angles`) below this belong to more than 75 degrees of abduction, where a
# small rotation may change flexion and twist by half a turn.
NEAR_LOCK = 0.185
# Below this their phase is noise, and leaving it out turns a joint by less than 1e-5 degrees.
LOCKED = 1e-7


def euler_angles(q: Array) -> Array:
    """Angles of ``R_y(flexion) R_x(abduction) R_z(twist)``, continuous in time.

    With half angles, flexion - twist and flexion + twist are the phases of two pairs of a
    quaternion's components, and abduction follows from their amplitudes. So every angle is exact
    up to gimbal lock, where one amplitude is zero, and passing through it is a change of sign of
    that amplitude rather than a jump of the angles (compare Bernardes & Viollet 2022,
    "Quaternion to Euler angles conversion").
    """
    x, y, z, w = q
    a, b, c, d = y - z, w + x, y + z, w - x
    minus, plus = np.arctan2(a, b), np.arctan2(c, d)
    p, r = np.hypot(a, b), np.hypot(c, d)
    if np.minimum(p, r).min(initial=2.0) < NEAR_LOCK:
        flips = _sign_changes(q) * np.pi
        minus, p = _through_zero(minus + flips, p)
        plus, r = _through_zero(plus + flips, r)
    abduction = 2.0 * np.arctan2(p, r) - np.pi / 2
    angles = unwrapped(np.degrees(np.stack([abduction, plus + minus, plus - minus])))
    if abs(angles[0].mean()) > 90.0:  # the other triple of the same rotation is the natural one
        angles = unwrapped(angles * [[-1.0], [1.0], [1.0]] + 180.0)
    return angles


def from_euler(angles: Array) -> Array:
    """Quaternions (4, frames) of Euler angles (3, frames)."""
    half = np.radians(angles) / 2.0
    p, r = np.sin(half[0] + np.pi / 4), np.cos(half[0] + np.pi / 4)
    minus, plus = half[1] - half[2], half[1] + half[2]
    a, b, c, d = p * np.sin(minus), p * np.cos(minus), r * np.sin(plus), r * np.cos(plus)
    return np.asarray(np.sqrt(0.5) * np.stack([b - d, a + c, c - a, b + d]))


def swing_twist_angles(q: Array) -> Array:
    """Rotation vector of the swing (two angles) after a twist about the bone.

    Nowhere near a lock until the bone has turned round to its opposite direction, where the swing
    goes on beyond half a turn.
    """
    x, y, z, w = same_signs(q)
    half, length = np.arctan2(z, w), np.hypot(z, w)
    if length.min(initial=2.0) < NEAR_LOCK:
        half, length = _through_zero(half, length)
        if length.mean() < 0:  # the shorter way round for most of the time
            half, length = half + np.pi, -length
    s, c = np.sin(half), np.cos(half)
    sine = np.hypot(x, y)
    moving = sine > 1e-12
    # Of a small swing, angle / sine is 2.
    scale = np.where(moving, 2.0 * np.arctan2(sine, length) / np.where(moving, sine, 1.0), 2.0)
    swing = np.degrees([(x * c - y * s) * scale, (x * s + y * c) * scale])
    return np.concatenate([swing, unwrapped(np.degrees(2.0 * half)[None])])


def from_swing_twist(angles: Array) -> Array:
    """Quaternions (4, frames) of swing and twist (3, frames)."""
    half = np.radians(angles) / 2.0
    swing = np.hypot(half[0], half[1])
    ratio = np.sinc(swing / np.pi)  # sin(swing) / swing
    sx, sy, length = half[0] * ratio, half[1] * ratio, np.cos(swing)
    s, c = np.sin(half[2]), np.cos(half[2])
    return np.stack([sx * c + sy * s, sy * c - sx * s, length * s, length * c])


def unwrapped(degrees: Array) -> Array:
    """Angles (n, frames) without jumps by a turn, their mean within half a turn of zero."""
    continuous = degrees
    turns = np.rint(np.diff(degrees, axis=1) / 360.0)
    if turns.any():
        continuous = degrees.copy()
        continuous[:, 1:] -= 360.0 * np.cumsum(turns, axis=1)
    return np.asarray(continuous - 360.0 * np.rint(continuous.mean(axis=1, keepdims=True) / 360.0))


def product(a: Array, b: Array) -> Array:
    """Hamilton product of quaternions (4, frames) with the components first."""
    return np.stack(rot.product(a, b))


def inverse(q: Array) -> Array:
    """Inverse of unit quaternions (4, frames)."""
    return np.stack([-q[0], -q[1], -q[2], q[3]])


def rotate(q: Array, v: Array) -> Array:
    """Vectors (3, frames) turned by unit quaternions (4, frames)."""
    x, y, z, w = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return np.stack(
        [
            vx + w * tx + y * tz - z * ty,
            vy + w * ty + z * tx - x * tz,
            vz + w * tz + x * ty - y * tx,
        ]
    )


def same_signs(q: Array) -> Array:
    """The same rotations (4, frames), neighbours in one half space."""
    odd = _sign_changes(q)
    return np.where(odd % 2 == 1, -q, q) if odd.any() else q


def _sign_changes(q: Array) -> NDArray[np.intp]:
    """(frames,) how often the sign of the quaternion has changed so far."""
    flips = np.einsum("it,it->t", q[:, 1:], q[:, :-1]) < 0
    return np.concatenate([[0], np.cumsum(flips)])


def _through_zero(phase: Array, amplitude: Array) -> tuple[Array, Array]:
    """Phase (frames,) in radians without half turns at zeros of the amplitude, and its signs.

    Near a zero, half a turn of the phase is taken for a change of the amplitude's sign; at a zero
    the phase is that of the last frame.
    """
    known = amplitude > LOCKED
    if not known.any():
        return np.zeros_like(phase), amplitude
    last = np.maximum.accumulate(np.where(known, np.arange(len(phase)), np.argmax(known)))
    phase = phase[last]
    near = np.minimum(amplitude[1:], amplitude[:-1]) < NEAR_LOCK
    unit = np.where(near, 1.0, 2.0)
    half_turns = np.rint(np.diff(phase) / (np.pi * unit)) * unit
    count = np.concatenate([[0.0], np.cumsum(half_turns)])
    return phase - np.pi * count, np.where(count % 2 == 1, -amplitude, amplitude)
