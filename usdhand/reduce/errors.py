"""What a reduction loses: in degrees a channel, in millimetres at the fingertips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy.channels import Channels
from usdhand.display import displayed
from usdhand.motion.rotations import Array


@displayed(
    lambda errors: {
        "channels": len(errors.names),
        "rms_deg": errors.rms_deg,
        "max_deg": errors.max_deg,
        "fingertip_mean": errors.fingertip_mean,
        "fingertip_max": errors.fingertip_max,
    }
)
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

    def of_channels(self, names: Sequence[str], fingertips: Array) -> Errors:
        """Return the errors of some channels, with other ``fingertips`` (see `distances_mm`)."""
        index = {name: i for i, name in enumerate(self.names)}
        chosen = [index[name] for name in names]
        return Errors(
            tuple(names),
            self.rms[chosen],
            self.max[chosen],
            float(fingertips.mean()),
            float(fingertips.max()),
        )


def measure_errors(truth: Channels, other: Channels, fingertips: Array) -> Errors:
    """Compare two sets of the same channels, by the shorter way round.

    Parameters
    ----------
    fingertips : (frames, tips) mm, see `distances_mm`
    """
    rms, largest = np.zeros(len(truth)), np.zeros(len(truth))
    pairs = zip(truth.values.T, other.select(truth.names).values.T, strict=True)
    for i, (a, b) in enumerate(pairs):  # curve by curve stays in the processor's cache
        difference = b - a
        difference -= 360.0 * np.rint(difference / 360.0)
        rms[i] = np.sqrt(difference @ difference / len(difference))
        largest[i] = max(difference.max(), -difference.min())
    return Errors(
        truth.names,
        rms,
        largest,
        float(fingertips.mean()),
        float(fingertips.max()),
    )


def distances_mm(a: Array, b: Array) -> Array:
    """(frames, tips) distances in mm of two sets of points (frames, tips, 3) in cm."""
    return np.asarray(10.0 * np.linalg.norm(b - a, axis=-1))


def pca_rms(curves: Array, components: int) -> float:
    """RMS error in degrees, over all channels, of the best linear model of that size.

    The smallest error that any linear reduction of curves (frames, channels) can have, at the price
    of controls that mean nothing; named beside the method by Joerg & O'Sullivan 2009, section 6.
    """
    centred = curves - curves.mean(axis=0)
    variances = np.linalg.eigvalsh(centred.T @ centred / len(curves))[::-1]
    return float(np.sqrt(max(variances[components:].sum(), 0.0) / curves.shape[1]))
