"""Smooth functions of time: moves from target to target, and slow noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .body import Array, Vector


def minimum_jerk(t: Array) -> Array:
    """Minimum-jerk step from 0 to 1."""
    t = np.clip(t, 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


@dataclass(frozen=True)
class Move:
    """A change of some values between two times (s), along a slight arc."""

    start: float
    end: float
    target: Array
    arc: Array | None = None


@dataclass
class Track:
    """Values that move from target to target; moves may overlap and stay smooth."""

    first: Array
    moves: list[Move] = field(default_factory=list)

    def to(self, start: float, end: float, target: Array, arc: Array | None = None) -> None:
        """Add a move."""
        self.moves.append(Move(start, end, np.asarray(target, dtype=float), arc))

    @property
    def last(self) -> Array:
        """The latest target."""
        return self.moves[-1].target if self.moves else self.first

    def at(self, t: Array, delay: Array | float = 0.0, pace: Array | float = 1.0) -> Array:
        """Values at some times, (times, values).

        Parameters
        ----------
        t
            Times in seconds.
        delay
            Seconds by which each value lags.
        pace
            By how much longer each value takes for its moves.
        """
        out = np.tile(self.first, (len(t), 1))
        previous = self.first
        delay, pace = np.broadcast_to(delay, out.shape[1]), np.broadcast_to(pace, out.shape[1])
        for move in self.moves:
            s = minimum_jerk((t[:, None] - move.start - delay) / ((move.end - move.start) * pace))
            out += s * (move.target - previous)
            if move.arc is not None:
                out += 4.0 * s * (1.0 - s) * move.arc
            previous = move.target
        return out


@dataclass(frozen=True)
class Wander:
    """Slow smooth noise: a few sines for each of several values."""

    frequency: Array
    phase: Array
    amplitude: Array

    @classmethod
    def make(cls, rng: np.random.Generator, size: Vector, fastest: float) -> Wander:
        """Noise of the given standard deviations and highest frequency (Hz)."""
        count = 4
        frequency = rng.uniform(0.12, 1.0, (count, len(size))) * fastest
        phase = rng.uniform(0, 2 * np.pi, (count, len(size)))
        weight = rng.uniform(0.5, 1.0, (count, len(size)))
        weight *= np.sqrt(2.0 / np.sum(weight**2, axis=0))
        return cls(frequency, phase, weight * np.asarray(size))

    def at(self, t: Array, delay: float = 0.0) -> Array:
        """Values at some times, (times, values)."""
        angle = 2 * np.pi * self.frequency * (t[:, None, None] - delay) + self.phase
        return np.asarray(np.sum(self.amplitude * np.sin(angle), axis=1))
