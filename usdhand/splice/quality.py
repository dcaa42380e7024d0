"""How well the motions of both clips agree, phase by phase: where an artist should look."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.splice.markers import Markers
from usdhand.splice.phases import smoothed

# Phases that are shorter than this, in seconds, are one with the next.
SHORTEST_S = 0.15
# A wrist slower than this share of its RMS speed holds still.
HOLD_SHARE = 0.15
LOW_QUALITY = 0.6


@dataclass(frozen=True)
class Phase:
    """A phase of the body's motion, between two pauses of the wrist.

    ``start`` and ``end`` in seconds from the body's first frame. ``quality`` from -1 to 1: 1 if
    both clips move in the same directions with the same profile of speed; None for a hold, and
    where the hand clip waits.
    """

    start: float
    end: float
    quality: float | None

    @property
    def low(self) -> bool:
        """Whether the alignment is worth looking at here."""
        return self.quality is not None and self.quality < LOW_QUALITY


def phase_qualities(
    body: Markers, hand: Markers, warp: Array, smoothing: float
) -> tuple[Phase, ...]:
    """Cosine of the velocities of both wrists along a warp, for every phase.

    Parameters
    ----------
    warp : (body marker frames,) seconds of the hand clip
    """
    at = warp * hand.fps
    wrists = body.wrist, interpolate(hand.wrist, at)
    velocities = [smoothed(w, smoothing * body.fps, 1) for w in wrists]
    speed = np.linalg.norm(velocities[0], axis=-1)
    usual = float(np.sqrt(np.mean(speed**2)))
    found = []
    for first, last in _between_pauses(speed, round(SHORTEST_S * body.fps)):
        span = slice(first, last + 1)
        waits = warp[last] - warp[first] < HOLD_SHARE * (last - first) / body.fps
        hold = waits or speed[span].max() < HOLD_SHARE * usual
        quality = None if hold else _agreement(velocities[0][span], velocities[1][span])
        found.append(Phase(first / body.fps, last / body.fps, quality))
    return tuple(found)


def _between_pauses(speed: Array, shortest: int) -> Iterator[tuple[int, int]]:
    """First and last frames of phases, split where the speed has a local minimum."""
    inner = speed[1:-1]
    minima = 1 + np.flatnonzero((inner <= speed[:-2]) & (inner < speed[2:]))
    first, last = 0, len(speed) - 1
    for at in minima:
        if at - first >= shortest and last - at >= shortest:
            yield first, int(at)
            first = int(at)
    yield first, last


def _agreement(a: Array, b: Array) -> float:
    """Cosine of two curves of velocities (frames, 3), the second turned about the vertical."""
    level = np.hypot(
        np.sum(a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2]), np.sum(a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0])
    )
    length = np.sqrt(np.sum(a**2) * np.sum(b**2))
    return float((level + np.sum(a[:, 1] * b[:, 1])) / length) if length > 0 else 0.0
