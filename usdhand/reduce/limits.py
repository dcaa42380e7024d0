"""How far channels go: what was seen, what a hand can do, and a soft way from one to the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdhand.motion.rotations import Array

# Degrees of flexion, abduction and rotation about the bone that a hand can do, about (Palastanga et
# al., Anatomy and Human Movement), by the end of a joint's name.
ANATOMY: dict[str, tuple[tuple[float, float], ...]] = {
    "ThumbCMC": ((-50.0, 60.0), (-50.0, 50.0), (-60.0, 60.0)),
    "ThumbMCP": ((-30.0, 80.0), (-30.0, 30.0), (-30.0, 30.0)),
    "ThumbIP": ((-40.0, 90.0), (-15.0, 15.0), (-15.0, 15.0)),
    "MCP": ((-30.0, 100.0), (-30.0, 30.0), (-30.0, 30.0)),
    "PIP": ((-10.0, 120.0), (-15.0, 15.0), (-15.0, 15.0)),
    "DIP": ((-15.0, 90.0), (-15.0, 15.0), (-15.0, 15.0)),
}
# What was seen at the end of a channel's range may be exceeded by so much, whatever anatomy says.
MARGIN_DEG = 5.0


@dataclass(frozen=True)
class Limits:
    """Ends of a channel's range in degrees, ``low <= soft_low <= soft_high <= high``.

    Between the soft ends a value stays as it is; beyond, it goes ever more slowly towards the hard
    ones.
    """

    low: float
    soft_low: float
    soft_high: float
    high: float

    @classmethod
    def of(cls, channel: str, seen_low: float, seen_high: float) -> Limits:
        """Limits of a channel that was seen between two angles.

        The soft ends are midway between what was seen and what is possible.
        """
        least, most = anatomical_range(channel)
        low, high = min(least, seen_low - MARGIN_DEG), max(most, seen_high + MARGIN_DEG)
        return cls(low, 0.5 * (low + seen_low), 0.5 * (high + seen_high), high)

    @property
    def middle(self) -> float:
        """Between the soft ends."""
        return 0.5 * (self.soft_low + self.soft_high)

    def soften(self, values: Array) -> Array:
        """Values that stay within the limits, without a corner: beyond e, ``m e / (m + e)``."""
        inside = np.clip(values, self.soft_low, self.soft_high)
        for sign, room in ((1.0, self.high - self.soft_high), (-1.0, self.soft_low - self.low)):
            beyond = np.maximum(sign * (values - inside), 0.0)
            if room > 0.0:
                inside = inside + sign * room * beyond / (room + beyond)
        return inside


def anatomical_range(channel: str) -> tuple[float, float]:
    """What a hand can do in a channel, degrees."""
    joint, letter = channel[2:-1], channel[-1]
    ranges = next((r for end, r in ANATOMY.items() if joint.endswith(end)), ((-90.0, 90.0),) * 3)
    return ranges[("zxy" if joint.startswith("Thumb") else "yxz").index(letter)]
