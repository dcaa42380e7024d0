"""Angles of different clips on one turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.rotations import Array


def whole_turns(names: Sequence[str], away: Array) -> Array:
    """(n,) whole turns in angles ``away`` from where they should be.

    Swing is a rotation vector, of which a whole turn more is another rotation.
    """
    swing = np.array([name[2:-1] == "ThumbCMC" and name[-1] in "xz" for name in names], dtype=bool)
    return np.where(swing, 0.0, np.rint(away / 360.0))
