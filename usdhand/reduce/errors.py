"""What a reduction loses: in degrees a channel, in millimetres at the fingertips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.channels import Channels, Hands
from usdhand.motion import Clip
from usdhand.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class Errors:
    """Differences of two motions of the same hands.

    Attributes
    ----------
    names : channels compared
    rms, max : (channels,) degrees
    fingertip_mean, fingertip_max : mm, relative to the wrist, over frames and fingertips
    """

    names: tuple[str, ...]
    rms: Array
    max: Array
    fingertip_mean: float
    fingertip_max: float

    @property
    def rms_deg(self) -> float:
        """RMS over all channels and frames, degrees."""
        return float(np.sqrt(np.mean(self.rms**2))) if len(self.rms) else 0.0

    @property
    def max_deg(self) -> float:
        """Largest difference of any channel in any frame, degrees."""
        return float(self.max.max(initial=0.0))


def channel_differences(truth: Channels, other: Channels, names: tuple[str, ...]) -> Array:
    """(frames, channels) degrees, by the shorter way round."""
    difference = other.select(names).values - truth.select(names).values
    return (difference + 180.0) % 360.0 - 180.0


def measure_errors(
    truth: Channels, other: Channels, names: tuple[str, ...], clip: Clip, hands: Hands
) -> Errors:
    """Compare two sets of channels of a clip's hands.

    Parameters
    ----------
    truth, other : all channels of ``hands``
    names : those to compare in degrees
    """
    difference = channel_differences(truth, other, names)
    distance = 10.0 * np.linalg.norm(
        hands.fingertips(hands.decode(other, clip)) - hands.fingertips(hands.decode(truth, clip)),
        axis=-1,
    )
    return Errors(
        names,
        np.sqrt(np.mean(difference**2, axis=0)),
        np.abs(difference).max(axis=0, initial=0.0),
        float(distance.mean()),
        float(distance.max()),
    )


def pca_rms(curves: Array, components: int) -> float:
    """RMS error in degrees, over all channels, of the best linear model of that size.

    The yardstick of Joerg & O'Sullivan 2009, section 6: the smallest error that any linear
    reduction of curves (frames, channels) can have, at the price of controls that mean nothing.
    """
    centred = curves - curves.mean(axis=0)
    variances = np.linalg.eigvalsh(centred.T @ centred / len(curves))[::-1]
    return float(np.sqrt(max(variances[components:].sum(), 0.0) / curves.shape[1]))
