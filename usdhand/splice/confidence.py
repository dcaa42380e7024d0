"""How sure a timing is, frame by frame: where an artist should look, and where a pin helps most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.splice.quality import Phase
from usdhand.splice.refine import STAGES, MarkerPair, evidence
from usdhand.splice.settings import Align
from usdhand.splice.warps import deviations

# Variance of a timing, fitted to pairs of which the true timing is known: of the stiff curve, of
# what the passes, and of what one hand and both together say differently, and at least.
OF_CURVE, OF_PASSES, OF_HANDS, LEAST_S = 2.2, 0.32, 0.55, 0.0055
# Seconds that a frame without any evidence is off, beside those around it.
UNKNOWN_S = 1.0
# A timing is off by up to so many standard deviations: 95 % of the frames that move are.
UP_TO = 2.0
# Joerg, Hodgins & O'Sullivan 2010: what is off by more than this is seen.
VISIBLE_S = 0.1
# Doubtful ranges that are so near are one, and a pin helps so far: seconds, and its remaining
# deviation a second away.
TOGETHER_S, PIN_SHARE = 0.3, 0.1
MOST_PINS = 3


@dataclass(frozen=True)
class Doubt:
    """Seconds of the body within which the timing may be off by up to ``off`` seconds."""

    start: float
    end: float
    off: float


def deviation(
    pair: MarkerPair, rows: Array, phase_rows: Array, other_rows: Array | None, align: Align
) -> Array:
    """Standard deviation (rows,) of a warp in seconds of the hand clip.

    Parameters
    ----------
    rows : the warp in frames of the hand's markers
    phase_rows, other_rows : the same after pass 1, and as fewer or more hands tell it
    """
    body, hand = pair
    information = evidence(body, hand, rows, align).information
    stiffness = STAGES[-1].stiffness * (body.fps / 60.0) ** 4
    curve = deviations(information + 1.0 / (UNKNOWN_S * hand.fps) ** 2, stiffness)
    variance = OF_CURVE * curve**2 + OF_PASSES * (rows - phase_rows) ** 2
    if other_rows is not None:
        variance += OF_HANDS * (rows - other_rows) ** 2
    return np.asarray(np.sqrt(variance / hand.fps**2 + LEAST_S**2))


def doubts(times: Array, spread: Array, phases: Sequence[Phase]) -> tuple[Doubt, ...]:
    """Ranges that move, and in which the timing may be off visibly.

    Parameters
    ----------
    spread : (times,) standard deviation in seconds
    """
    at = np.flatnonzero((UP_TO * spread > VISIBLE_S) & _moving(times, phases))
    if not len(at):
        return ()
    parts = np.split(at, 1 + np.flatnonzero(np.diff(times[at]) > TOGETHER_S))
    return tuple(
        Doubt(float(times[p[0]]), float(times[p[-1]]), UP_TO * float(spread[p].max()))
        for p in parts
    )


def wanted_pins(times: Array, spread: Array, phases: Sequence[Phase]) -> tuple[Doubt, ...]:
    """Moments at which pins would help most, in this order; each ends where it starts."""
    left = np.where(_moving(times, phases), spread, 0.0)
    found: list[Doubt] = []
    while len(found) < MOST_PINS and UP_TO * left.max() > VISIBLE_S:
        at = int(np.argmax(left))
        found.append(Doubt(float(times[at]), float(times[at]), UP_TO * float(left[at])))
        left = np.minimum(left, PIN_SHARE * np.abs(times - times[at]))
    return tuple(found)


def _moving(times: Array, phases: Sequence[Phase]) -> NDArray[np.bool_]:
    moving = np.zeros(len(times), bool)
    for phase in phases:
        if phase.quality is not None:
            moving |= (times >= phase.start) & (times <= phase.end)
    return moving
