"""What fitting needs to know of curves, added up clip by clip: memory does not grow with them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from usdhand.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class Moments:
    """Means, covariance and extremes of curves (frames, n) in degrees.

    Attributes
    ----------
    frames : how many
    seconds : how long; takes count by time, whatever their rates
    mean, low, high : (n,)
    covariance : (n, n) over the population (``ddof=0``)
    """

    frames: int
    seconds: float
    mean: Array
    covariance: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, curves: Array, fps: float = 1.0) -> Moments:
        """Moments of curves (frames, n), at least one frame."""
        mean = curves.mean(axis=0)
        centred = curves - mean
        return cls(
            len(curves),
            len(curves) / fps,
            mean,
            np.asarray(centred.T @ centred / len(curves)),
            curves.min(axis=0),
            curves.max(axis=0),
        )

    @property
    def std(self) -> Array:
        """(n,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def turned(self, turns: Array) -> Moments:
        """The same of the curves with ``turns`` (n,) whole turns taken off."""
        by = 360.0 * turns
        return replace(self, mean=self.mean - by, low=self.low - by, high=self.high - by)

    def about(self, mean: Array) -> Array:
        """(n, n) second moments about another mean (n,)."""
        away = self.mean - mean
        return np.asarray(self.covariance + np.outer(away, away))

    def plus(self, other: Moments) -> Moments:
        """Moments of the frames of both."""
        seconds = self.seconds + other.seconds
        share = other.seconds / seconds
        away = other.mean - self.mean
        return Moments(
            self.frames + other.frames,
            seconds,
            self.mean + share * away,
            (1.0 - share) * self.covariance
            + share * other.covariance
            + share * (1.0 - share) * np.outer(away, away),
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
        )


def pooled(parts: Iterable[Moments]) -> Moments:
    """Moments of the frames of all parts, of which there is at least one."""
    first, *others = parts
    for other in others:
        first = first.plus(other)
    return first
