"""Transforms as matrices for column vectors, vectorised over leading axes.

A joint's local transform is TRS: a point is scaled, then rotated, then translated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Y_UP_FROM_Z_UP, Array

ROUNDED = 1e-5  # what rounding leaves in the linear part of a rotation
FLAT = 1e-12  # a singular value up to this flattens everything
# Each quaternion component of a diagonal matrix of ones and minus ones, four times, less one.
_HALF_TURNS: Array = np.array(
    [[1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0]]
)


def unit(v: Array) -> Array:
    """Vectors (..., n) scaled to length 1; a zero vector stays zero."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def to_y_up(up: str) -> Array:
    """Rotation (3, 3) from axes of which "Y" or "Z" is up to those with Y up."""
    return Y_UP_FROM_Z_UP if up == "Z" else np.eye(3)


def affine(linear: Array, translation: Array) -> Array:
    """Matrices (..., 4, 4) of linear parts (..., 3, 3) and translations (..., 3)."""
    leading = np.broadcast_shapes(linear.shape[:-2], translation.shape[:-1])
    result = np.zeros((*leading, 4, 4))
    result[..., :3, :3], result[..., :3, 3], result[..., 3, 3] = linear, translation, 1.0
    return result


def compose_trs(translations: Array, rotations: Array, scales: Array | None = None) -> Array:
    """Matrices (..., 4, 4) of translations (..., 3), quaternions (..., 4) and scales (..., 3)."""
    linear = rot.to_matrix(rotations)
    return affine(linear if scales is None else linear * scales[..., None, :], translations)


def decompose_trs(matrices: Array) -> tuple[Array, Array, Array]:
    """Translations, quaternions and scales of matrices (..., 4, 4), without their shear.

    What a matrix has of mirroring is in the signs of its scale, all three of which are one sign.
    """
    linear = matrices[..., :3, :3]
    scales = np.linalg.norm(linear, axis=-2) * _handedness(linear)[..., None]
    return matrices[..., :3, 3], rot.from_matrix(orientation(linear)), scales


def decompose(matrices: Array) -> tuple[Array, Array, Array, Array]:
    """Translations, quaternions, scales and shears of matrices (..., 4, 4), nothing left out.

    A shear (..., 3, 3) comes before the scale, and is the identity of nearly every matrix. Scales
    and shears that rounding explains are exactly none.
    """
    linear = matrices[..., :3, :3]
    translations, quaternions, scales = decompose_trs(matrices)
    turned = nearest_rotation(linear)
    whole = np.abs(linear - turned).max(axis=(-1, -2)) <= ROUNDED
    scales = np.where(whole[..., None], 1.0, scales)
    unscaled = np.swapaxes(rot.to_matrix(quaternions), -1, -2) @ linear
    shears = unscaled / scales[..., :, None]
    straight = whole | (np.abs(shears - np.eye(3)).max(axis=(-1, -2)) <= ROUNDED)
    return translations, quaternions, scales, np.where(straight[..., None, None], np.eye(3), shears)


def nearest_rotation(linear: Array) -> Array:
    """Rotation matrices nearest to matrices (..., 3, 3): no scale, shear or reflection.

    Of a matrix that mirrors, the direction that it enlarges least is turned round. Source: Kabsch
    1976, "A solution for the best rotation to relate two sets of vectors".
    """
    u, _, vt = np.linalg.svd(linear)
    u[..., :, 2] *= _handedness(u @ vt)[..., None]
    return np.asarray(u @ vt)


def orientation(linear: Array) -> Array:
    """Rotations (..., 3, 3) of joints with these axes, without scale and shear.

    The axes of a mirrored joint are all turned round: what mirrors is the same below it, so that
    the rotations of joints go together there as they do elsewhere.
    """
    return nearest_rotation(linear * _handedness(linear)[..., None, None])


def rigid(matrices: Array) -> Array:
    """Matrices (..., 4, 4) with the nearest rotation in place of their linear part."""
    return affine(nearest_rotation(matrices[..., :3, :3]), matrices[..., :3, 3])


def mean_scale(linear: Array) -> Array:
    """Factor (...) by which matrices (..., 3, 3) enlarge, in the geometric mean of all directions.

    0 where a matrix flattens.
    """
    singular = np.linalg.svd(linear, compute_uv=False)
    flat = singular.min(axis=-1) <= FLAT
    logarithms = np.log(np.where(flat[..., None], 1.0, singular))
    return np.where(flat, 0.0, np.exp(logarithms.mean(axis=-1)))


def local_matrices(world: Array, parents: NDArray[np.intp], above: Array | None = None) -> Array:
    """Joint-to-parent matrices (joints, 4, 4) of joint-to-world ones.

    Parameters
    ----------
    parents : (joints,) -1 for roots
    above : (4, 4) what roots hang off; the world itself if None

    Raises
    ------
    InputError
        if what hangs off a joint has no place in it, since its size is 0.
    """
    hangs = (parents >= 0)[:, None, None]
    holders = np.where(hangs, world[parents], np.eye(4) if above is None else above)
    try:
        return np.asarray(np.linalg.inv(holders) @ world)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "A joint with joints below it has a transform without an inverse: its size is 0 along "
            "an axis. Give it a size."
        ) from error


def with_even_signs(rotations: Array, scales: Array) -> tuple[Array, Array]:
    """Quaternions (frames, joints, 4) and scales (frames, joints, 3), no scale of mixed signs.

    The matrices stay what they are, since two negative scales are half a turn: only that a joint
    mirrors is left to its scale, and the product of rotations down a chain is right below it too.
    """
    one = scales.strides[0] == 0  # a view of one row for all frames
    rows = scales[:1] if one else scales
    if not (rows < 0).any():
        return rotations, scales
    signs = np.where(rows < 0, -1.0, 1.0)
    mirrors = signs.prod(axis=-1, keepdims=True)
    turns = (1.0 + (signs * mirrors) @ _HALF_TURNS.T) / 4.0
    even = np.abs(rows) * mirrors
    turned = rot.make_continuous(rot.multiply(rotations, turns))
    return turned, np.broadcast_to(even[0], scales.shape) if one else even


def _handedness(linear: Array) -> Array:
    """-1 for matrices that mirror, 1 for others."""
    return np.where(np.linalg.det(linear) < 0, -1.0, 1.0)
