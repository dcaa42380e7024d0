"""Markers of a hand that moves in a known way."""

from __future__ import annotations

import numpy as np

from usdhand.splice.markers import Markers


def moving_hand(seconds: np.ndarray) -> Markers:
    """Markers of a hand that moves and bends, at these moments of it."""
    t = seconds[:, None] * [1.0, 1.3, 0.7] * 2 * np.pi * 0.6
    wrist = 15.0 * np.sin(t + np.arange(3.0))
    bend = 0.4 * np.sin(t[:, :1] * 1.4)
    forearm = np.concatenate([np.sin(bend), 0 * bend, np.cos(bend)], axis=1)
    around = np.array([[4.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [0.0, 0.0, -18.0], [0.0, 0.0, 13.0]])
    return Markers(wrist[:, None] + around, wrist, forearm, None, 60.0, "shoulder")
