"""Chosen segments joined to one motion: Joerg, Hodgins & Safonova 2012, section 3.5."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from usdhand.fill.settings import Blend
from usdhand.motion.rotations import Array

# Offsets at a seam that are larger than these are blended out (the paper's thresholds).
BLEND_MEAN_DEG = 5.0
BLEND_MAX_DEG = 20.0

# Standard deviations, in seconds: of the smoothing at seams, and of how far it reaches.
SEAM_SMOOTHING_S = 0.033
SEAM_WINDOW_S = 0.1

# A curve that goes beyond a limit bends away from it so many seconds before and after.
LIMIT_REACH_S = 0.1


@dataclass(frozen=True, eq=False)
class FingerPiece:
    """A segment's finger curves in the body's time.

    Attributes
    ----------
    first, last : frames of the body; a piece begins on the last frame of the one before
    curves : (last - first + 1, channels) degrees
    """

    first: int
    last: int
    curves: Array


def join(pieces: Sequence[FingerPiece], blend: Blend = "smooth") -> Array:
    """Curves (frames, channels) of consecutive pieces without jumps at the seams.

    With ``linear``, as in the paper, the difference at a seam is added to the new piece as an
    offset, which stays unless its mean exceeds 5 degrees or its maximum 20, and then is blended
    out linearly. With ``smooth`` (the default) both pieces go half of the way, in angle and in
    speed, along a cubic each: offsets do not add up, speeds do not jump, and the hand does not come
    late, as it does where only the new piece has to give way.
    """
    curves = _halfway(pieces) if blend == "smooth" else _offset(pieces)
    result = np.empty((pieces[-1].last + 1, pieces[0].curves.shape[1]))
    for piece, own in zip(pieces, curves, strict=True):
        result[piece.first : piece.last + 1] = own
    return result


def _offset(pieces: Sequence[FingerPiece]) -> list[Array]:
    """Pieces that begin where the one before ends."""
    joined = [pieces[0].curves]
    for piece in pieces[1:]:
        offset = joined[-1][-1] - piece.curves[0]
        joined.append(piece.curves + offset * _linear_weights(offset, len(piece.curves)))
    return joined


def _halfway(pieces: Sequence[FingerPiece]) -> list[Array]:
    """Pieces that meet halfway, in angle and in speed."""
    joined = [piece.curves.copy() for piece in pieces]
    for i, (before, after) in enumerate(pairwise(pieces)):
        offset = 0.5 * (after.curves[0] - before.curves[-1])
        jump = 0.5 * (_velocity(after.curves, 0) - _velocity(before.curves, -1))
        joined[i] += _cubic(offset, -jump, len(before.curves))[::-1]
        joined[i + 1] += _cubic(-offset, -jump, len(after.curves))
    return joined


def smooth_seams(curves: Array, seams: Sequence[int], fps: float) -> Array:
    """Curves (frames, channels) smoothed around the seams only, so that they bend no faster there.

    Joined pieces agree in angle and speed but not in acceleration; captured motion has no such
    corners. Away from the seams nothing changes.
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter1d

    if not len(seams):
        return curves
    elsewhere = np.ones(len(curves), dtype=bool)
    elsewhere[list(seams)] = False
    smooth = gaussian_filter1d(curves, SEAM_SMOOTHING_S * fps, axis=0, mode="nearest")
    apart = distance_transform_edt(elsewhere) / fps
    weight = np.exp(-0.5 * (apart / SEAM_WINDOW_S) ** 2)[:, None]
    return np.asarray(curves + weight * (smooth - curves))


def within_limits(curves: Array, low: Array, high: Array, fps: float) -> Array:
    """Curves (frames, channels) kept within limits (channels,), without corners.

    Where a curve goes beyond a limit, the excess is taken off over a while before and after, too:
    the largest excess within reach, smoothed by a kernel that reaches no further, is nowhere less
    than the excess itself.
    """
    above = _eased(np.maximum(curves - high, 0.0), fps)
    below = _eased(np.maximum(low - curves, 0.0), fps)
    return np.clip(curves - above + below, low, high)


def _eased(excess: Array, fps: float) -> Array:
    """Smooth curves (frames, channels) that are nowhere below ``excess``."""
    from scipy.ndimage import convolve1d, maximum_filter1d

    beyond = np.flatnonzero(excess.any(axis=0))
    reach = max(1, round(LIMIT_REACH_S * fps))
    if not len(beyond):
        return excess
    kernel = np.hanning(2 * reach + 3)[1:-1]
    largest = maximum_filter1d(excess[:, beyond], 2 * reach + 1, axis=0, mode="nearest")
    eased = np.zeros_like(excess)
    eased[:, beyond] = convolve1d(largest, kernel / kernel.sum(), axis=0, mode="nearest")
    return eased


def _linear_weights(offset: Array, count: int) -> Array:
    size = np.abs(offset)
    if size.mean() <= BLEND_MEAN_DEG and size.max() <= BLEND_MAX_DEG:
        return np.ones((count, 1))
    return np.linspace(1.0, 0.0, count)[:, None]


def _cubic(offset: Array, jump: Array, count: int) -> Array:
    """Cubic from (offset, jump a frame) to rest over a piece, (count, channels)."""
    span = max(count - 1, 1)
    s = (np.arange(count) / span)[:, None]
    return offset * (1 + 2 * s) * (1 - s) ** 2 + jump * span * s * (1 - s) ** 2


def _velocity(curves: Array, end: int) -> Array:
    """Degrees a frame at the first (0) or last (-1) frame."""
    if len(curves) < 2:
        return np.zeros(curves.shape[1])
    step: Array = curves[1] - curves[0] if end == 0 else curves[-1] - curves[-2]
    return step
