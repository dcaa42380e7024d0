"""Pass 2: the timing inside the phases, from how the wrist bends and how the hand moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit
from usdhand.splice.markers import Markers, resample_markers
from usdhand.splice.phases import align_about_vertical, smoothed
from usdhand.splice.settings import Align
from usdhand.splice.warps import EXACT, monotone, whittaker_smoothed

# Standard deviations of Gaussians in seconds: of what is compared; of the mean that positions and
# directions are compared around, as performers stand and reach differently; of the time over which
# they move with the same amplitude; and of that over which they differ by as much.
SMOOTHING_S, AROUND_S, AMPLITUDE_S, NOISE_S = 0.033, 1.0, 0.75, 0.33
# Differences below these, in radians and lengths of the palm, are no smaller noise.
LEAST_ANGLE, LEAST_PATH = np.radians(1.0), 0.005
STIFFNESS = 300.0
# Rounds of the linearised problem; more change the median error by less than 0.1 ms.
ROUNDS = 4


def refined(
    body: Markers, hand: Markers, warp: Array, freedom: Array, align: Align, tether: float
) -> Array:
    """Warp (rows,) of pass 1 moved to where both hands are most alike, by a part of a frame.

    The paper compares the angle between the palms with the forearms aligned, which is the one
    between the forearms in the axes of the palms and needs no alignment. Where a wrist hardly
    bends this tells nothing, so that the palm's directions and the wrist's path count as well.
    Each has the weight of how well it agrees there, and a warp is bent no more than that allows:
    what hardly changes, or differs anyway, has none. Only the first round weighs by how well it
    agrees on the whole, since then a lag would pass for a difference.

    Parameters
    ----------
    freedom : (rows,) hand clip frames by which the warp may move, 0: not at all
    tether : frames by which pass 1 is typically off
    """
    fps = body.fps
    independent = 1.0 / (2.0 * np.sqrt(np.pi) * SMOOTHING_S * fps)  # smoothed noise, frame by frame
    held = np.where(freedom > 0, 1.0 / tether**2, EXACT)
    moved = np.zeros(len(body))
    for again in range(ROUNDS):
        now = monotone(warp + moved)
        pair = align_about_vertical(body, resample_markers(hand, now, fps), align)
        slope = np.maximum(np.gradient(now), 0.1)[:, None]
        information, pull = np.zeros(len(body)), np.zeros(len(body))
        for ours, theirs, least in _compared(*pair):
            rate, apart = np.gradient(ours, axis=0) / slope, ours - theirs
            squares = _dot(apart, apart) / apart.shape[1]
            noise = np.full(len(squares), max(float(np.median(squares)), least**2))
            if again:
                noise = np.maximum(noise, smoothed(squares, NOISE_S * fps))
            information += independent * _dot(rate, rate) / noise
            pull += independent * _dot(rate, apart) / noise
        weights = information + held
        wanted = (information * moved + pull) / weights
        moved = np.clip(
            whittaker_smoothed(wanted, weights, STIFFNESS * (fps / 60.0) ** 4, warp),
            -freedom,
            freedom,
        )
    return monotone(warp + moved)


def _compared(body: Markers, hand: Markers) -> Iterator[tuple[Array, Array, float]]:
    """Curves (rows, n) of both hands in the same axes and time, and differences that are noise."""
    fps = body.fps

    def around(curve: Array) -> Array:
        return np.asarray(curve - smoothed(curve, AROUND_S * fps))

    bends = (unit(smoothed(m.forearm, SMOOTHING_S * fps)) for m in (body, hand))
    yield *bends, LEAST_ANGLE
    positions = [smoothed(m.positions, SMOOTHING_S * fps) for m in (body, hand)]
    wrists = [(p[:, 0] + p[:, 1]) / 2 for p in positions]
    palms = (unit(p[:, [0, 3]] - w[:, None]) for p, w in zip(positions, wrists, strict=True))
    ours, theirs = (around(p.reshape(len(p), -1)) for p in palms)
    yield ours, theirs, LEAST_ANGLE
    ours, theirs = (around(w) for w in wrists)
    both = np.stack([_dot(ours, theirs), _dot(theirs, theirs)], axis=1)
    both = np.maximum(smoothed(both, AMPLITUDE_S * fps), 1e-9)
    yield ours, theirs * (both[:, :1] / both[:, 1:]), LEAST_PATH * body.palm_length


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ti,ti->t", a, b))
