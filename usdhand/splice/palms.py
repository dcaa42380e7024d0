"""Pass 2: the timing inside the phases, from how the wrist bends."""

from __future__ import annotations

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.splice.markers import Markers
from usdhand.splice.phases import smoothed

STEP = 0.5  # of the offset from pass 1, frames
# Wrists whose bend differs by less than this, in degrees, say nothing about timing.
LEAST_NOISE_DEG = 1.0


def refined(
    body: Markers, hand: Markers, warp: Array, width: float, smoothing: float, tether: float
) -> Array:
    """Warp (rows,) of pass 1 moved to where the wrists bend alike; equation (9) with a tether.

    The angle between the palms with the forearms aligned is the angle between the forearms in the
    axes of the palms, which needs no alignment. It is weighed by how well it agrees along pass 1,
    so that it has no say where it hardly changes or differs anyway.

    Parameters
    ----------
    width : of the band around the warp, frames
    smoothing : standard deviation of the Gaussian, seconds
    tether : frames by which pass 1 is typically off
    """
    from usdhand.alignment.phase_dtw import tethered_path

    bends = [_unit(smoothed(m.forearm, smoothing * m.fps)) for m in (body, hand)]
    at = np.clip(np.rint(warp), 0, len(hand) - 1).astype(np.intp)
    apart = np.arccos(np.clip(np.sum(bends[0] * bends[1][at], axis=-1), -1.0, 1.0))
    noise = max(float(np.median(apart)), np.radians(LEAST_NOISE_DEG))
    reach = max(int(min(width / 2, 4 * tether) / STEP), 1)
    offsets = tethered_path(bends[0], bends[1], warp, reach, STEP, noise, tether)
    return np.asarray(warp + offsets)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9))
