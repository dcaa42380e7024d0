"""The motion that a rig does not keep, as it was: its correlations in bands of frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np
from scipy import fft

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.motion.rotations import Array

# Bands of frequency, from the first to the second, from the second to the third, ... to the end.
EDGES_HZ = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
KEPT_SHARE = 0.99  # of the variance that is not kept
LEAST_S = 32.0  # a shorter clip is cut out of noise of this length, which has all frequencies


@displayed()
@dataclass(frozen=True)
class Variation:
    """How much of the motion that a rig does not keep is put back: 1 is as much as there was.

    Attributes
    ----------
    seed : another one is another motion; the same gives the same
    """

    amount: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.amount) and self.amount >= 0.0):
            raise UsageError(f"A variation of {self.amount:g} is not possible: give 0 or more.")
        if self.seed < 0:
            raise UsageError(f"A seed of {self.seed} is not possible: give 0 or more.")


def band_covariances(curves: Array, fps: float) -> Array:
    """(bands, n, n) shares of the bands in the covariance of curves (frames, n).

    They add up to the covariance. The ends of the curves are faded, lest a step from the last frame
    to the first be taken for fast motion, and the mean is left out.
    """
    frames = len(curves)
    faded = np.ascontiguousarray(curves.T)  # by channels, so that bands are blocks
    faded = faded - faded.mean(axis=1, keepdims=True)
    wanted = np.einsum("nf,nf->n", faded, faded) / frames
    faded *= np.hanning(frames + 2)[1:-1]
    size = fft.next_fast_len(frames, real=True)
    parts = fft.rfft(faded, size, axis=1).view(np.float64)
    first = 2 * np.searchsorted(bands_of(size, fps), np.arange(len(EDGES_HZ) + 1))
    found = np.stack([parts[:, a:b] @ parts[:, a:b].T for a, b in pairwise(first)])
    power = np.einsum("bii->i", found)
    scale = np.sqrt(np.divide(wanted, power, out=np.zeros_like(power), where=power > 0))
    return np.asarray(scale[:, None] * found * scale)


def bands_of(size: int, fps: float) -> Array:
    """Number of the band of every bin of a real transform of that size."""
    return np.asarray(np.searchsorted(EDGES_HZ, fft.rfftfreq(size, 1.0 / fps), side="right") - 1)


@dataclass(frozen=True)
class Residuals:
    """What a rig does not keep: mixtures of independent noises, by band of frequency.

    Attributes
    ----------
    names : d channels that are not free
    mixtures : by band and noise, degrees of each channel for one standard deviation of the noise
    """

    names: tuple[str, ...]
    mixtures: tuple[tuple[tuple[float, ...], ...], ...]

    @classmethod
    def of(cls, names: Sequence[str], told: Array, dependent: Sequence[int], bands: Array) -> Self:
        """Residuals of a model ``told`` (n, n) of all channels ``names``.

        Parameters
        ----------
        bands : (bands, n, n) covariance of the channels in each band
        """
        missed = (np.eye(len(told)) - told)[list(dependent)]
        variances, axes = np.linalg.eigh(missed @ bands @ missed.T)
        variances, axes = np.maximum(variances[:, ::-1], 0.0), axes[:, :, ::-1]
        kept = variances.sum(axis=0).cumsum() <= KEPT_SHARE * variances.sum()
        noises = min(int(kept.sum()) + 1, len(kept))
        mixtures = np.swapaxes(axes * np.sqrt(variances)[:, None], 1, 2)[:, :noises]
        return cls.from_array([names[i] for i in dependent], mixtures)

    @classmethod
    def from_array(cls, names: Sequence[str], mixtures: Array) -> Self:
        """Residuals of mixtures (bands, noises, d)."""
        bands = (tuple(tuple(noise) for noise in band) for band in mixtures.tolist())
        return cls(tuple(names), tuple(bands))

    @property
    def array(self) -> Array:
        """(bands, noises, d) mixtures."""
        return np.array(self.mixtures, dtype=np.float64).reshape(
            len(self.mixtures), -1, len(self.names)
        )

    def noise(self, frames: int, fps: float, seed: int) -> Array:
        """(frames, d) motion in degrees with these correlations; the same for the same seed."""
        random = np.random.default_rng(seed)
        size = fft.next_fast_len(max(frames, round(LEAST_S * fps)), real=True)
        band = bands_of(size, fps)
        total = np.zeros((frames, len(self.names)))
        for number, mixture in enumerate(self.array):
            own = (band == number) & (np.arange(len(band)) > 0)  # the mean is no motion
            if not own.any() or not len(mixture):
                continue
            spectrum = np.zeros((len(band), len(mixture)), dtype=complex)
            shape = (int(own.sum()), len(mixture))
            spectrum[own] = random.normal(size=shape) + 1j * random.normal(size=shape)
            # Bins at both ends of the spectrum count once, all others twice.
            spectrum *= size / (2.0 * np.sqrt(own.sum()))
            total += fft.irfft(spectrum, size, axis=0)[:frames] @ mixture
        return total
