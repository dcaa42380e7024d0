"""Where in a longer clip a shorter one happens: for advice on pins where a band cannot be right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.splice.markers import Markers
from usdhand.splice.phases import smoothed

RATE = 15.0
SMOOTHING_S = 0.1
# A place is named where clips differ by less than this share of what is usual elsewhere: on real
# takes put one after the other a take's own place has 0.02 to 0.2, the best other one 0.25 to 0.65.
DISTINCT = 0.25


def locate(longer: Sequence[Markers], shorter: Sequence[Markers]) -> tuple[float, float] | None:
    """Seconds of the longer clip at which the shorter one begins and ends, None if nowhere.

    The cheapest path through all of the shorter clip and any part of the longer one, from half to
    twice as fast at every moment, over what neither direction nor size changes: how wrists bend
    and palms tilt, and the speeds up and level in shares of their RMS.

    Parameters
    ----------
    longer, shorter : markers of the same hands
    """
    a, b = (np.concatenate([_features(m) for m in clip], axis=1) for clip in (longer, shorter))
    order = np.arange(len(a))
    far = np.full(len(a), np.inf)
    costs = [far, far, np.zeros(len(a))]  # two rows before, one before, before the first
    starts = [np.arange(len(a), dtype=np.float64)] * 3
    local = last = far
    for i, row in enumerate(b):
        last, local = local, np.sum((a - row) ** 2, axis=1)
        if i == 0:
            costs = [far, far, local]
            continue
        ways = np.stack(
            [
                _delayed(costs[2], 1) + local,
                _delayed(costs[2], 2) + local,
                _delayed(costs[1], 1) + last + local,
            ]
        )
        came = np.argmin(ways, axis=0)
        froms = np.stack([_delayed(starts[2], 1), _delayed(starts[2], 2), _delayed(starts[1], 1)])
        costs = [costs[1], costs[2], ways[came, order]]
        starts = [starts[1], starts[2], froms[came, order]]
    reached = np.isfinite(costs[2])
    if not reached.any():
        return None
    end = int(np.argmin(costs[2]))
    if costs[2][end] > DISTINCT * np.median(costs[2][reached]):
        return None
    return float(starts[2][end] / RATE), float(end / RATE)


def _delayed(row: Array, by: int) -> Array:
    """A row of which every value has moved on; before its first there is no way."""
    return np.concatenate([np.full(by, np.inf), row[:-by]])


def _features(markers: Markers) -> Array:
    """(frames, 7) at `RATE`: bend, tilts of the palm's axes, speeds up and level."""
    smooth = SMOOTHING_S * markers.fps
    count = int((len(markers) - 1) / markers.fps * RATE) + 1
    at = np.arange(count, dtype=np.float64) * markers.fps / RATE
    axes = markers.positions[:, [0, 3]] - markers.wrist[:, None]
    tilts = axes[..., 1] / np.maximum(np.linalg.norm(axes, axis=-1), 1e-9)
    velocity = smoothed(markers.wrist, smooth, 1)
    velocity = velocity / max(float(np.sqrt(np.mean(np.sum(velocity**2, axis=-1)))), 1e-9)
    speeds = np.stack([velocity[:, 1], np.hypot(velocity[:, 0], velocity[:, 2])], axis=1)
    postures = smoothed(np.concatenate([markers.forearm, tilts], axis=1), smooth)
    return np.asarray(interpolate(np.concatenate([postures, speeds], axis=1), at))
