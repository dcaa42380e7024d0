"""Which channels to leave free: those from which a linear model tells all others best.

A column subset of the covariance: greedy forward selection on the residual covariance, then
exchange of single channels while the error falls. With the channels S free and the others told by
least squares, the residual covariance is ``R = C - C[:, S] C[S, S]^-1 C[S, :]``; a channel j added
takes ``R[:, j] R[j, :] / R[j, j]`` off it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array

# What channels have of their own is known no better than to this share of their variance.
SAME_SHARE = 1e-9
TINY = 1e-300
MOST_TRIED = 1000  # sets of channels, where all are tried
# An exchange must lower the error by this share: a take more should not change the set for nothing.
CLEARLY = float(np.log1p(-1e-3))


@dataclass(frozen=True, eq=False)
class Measure:
    """What an error is made of: squared parts, each a quadratic form of the residuals.

    Attributes
    ----------
    name : "deg" or "mm"
    forms : (parts, n, n), or None where the parts are the squared channels themselves
    """

    name: str
    forms: Array | None = None

    def parts(self, residual: Array) -> Array:
        """(parts,) squared errors under a residual covariance (n, n)."""
        if self.forms is None:
            return np.diag(residual)
        return np.asarray(np.einsum("gij,ji->g", self.forms, residual))

    def falls(self, columns: Array, inverse: Array) -> Array:
        """(m, parts) what each of m groups takes off the parts.

        Parameters
        ----------
        columns : (m, n, s) of the residual covariance, of the channels of each group
        inverse : (m, s, s) inverse of the residual covariance among them
        """
        scaled = columns * inverse if columns.shape[2] == 1 else columns @ inverse
        if self.forms is None:
            return np.asarray((scaled * columns).sum(axis=2))
        m, n, s = columns.shape
        flat = columns.transpose(1, 0, 2).reshape(n, m * s)
        formed = (self.forms @ flat).reshape(-1, n, m, s)
        return np.asarray(np.einsum("mns,gnms->mg", scaled, formed))


@dataclass(frozen=True, eq=False)
class Subsets:
    """The search for the channels to leave free.

    Attributes
    ----------
    covariance : (n, n) degrees squared
    measure : what counts as error
    groups : channels that are free together, all of them in exactly one group
    keep : groups that are free in any case
    price : (groups,) factor by which a group must lower the error more than one of price 1
    largest : largest root of any part that is aimed at; None where their mean counts
    """

    covariance: Array
    measure: Measure
    groups: tuple[tuple[int, ...], ...]
    keep: frozenset[int] = frozenset()
    price: Array | None = None
    largest: float | None = None

    def best(self, count: int) -> frozenset[int]:
        """Groups to leave free, so that ``count`` of them have about the least error.

        Where there are few sets, all are tried. Else the better of a set that grew and of what is
        left of all by taking away, both exchanged; then every group outside is put in, some others
        are taken out, and the best put back.
        """
        everything = frozenset(range(len(self.groups)))
        if count >= len(everything):
            return everything
        open_, wanted = sorted(everything - self.keep), count - len(self.keep)
        if comb(len(open_), max(wanted, 0)) <= MOST_TRIED:
            each = combinations(open_, max(wanted, 0))
            return min((self.keep | set(some) for some in each), key=self.score)
        grown = self.grown(self.keep, count)
        left = self.exchanged(self._shrunk(everything, count))
        chosen = left if self.score(left) < self.score(grown) + CLEARLY else grown
        forced = sorted(everything - chosen)
        while forced:
            group = forced.pop(0)
            for fewer in (count - 1, count - 2):
                some = self._shrunk(chosen | {group}, max(fewer, 1), self.keep | {group})
                tried = self._grown(some, count)
                if len(tried) == count and self.score(tried) < self.score(chosen) + CLEARLY:
                    chosen = self.exchanged(tried)
                    forced = sorted(everything - chosen)
                    break
        return chosen

    def path(self) -> Iterator[frozenset[int]]:
        """Sets of groups, each of one group more than the last, from the fewest to all.

        Grown and exchanged: about as good as `best`, of all counts for the price of some.
        """
        chosen = self.exchanged(self.keep)
        yield chosen
        while len(chosen) < len(self.groups):
            chosen = self.grown(chosen, len(chosen) + 1)
            yield chosen

    def channels(self, chosen: frozenset[int]) -> tuple[int, ...]:
        """Channels of groups, in channel order."""
        return tuple(sorted(channel for group in chosen for channel in self.groups[group]))

    def residual(self, chosen: frozenset[int]) -> Array:
        """(n, n) residual covariance with groups free."""
        return self._solve(chosen).residual

    def score(self, chosen: frozenset[int]) -> float:
        """The logarithm of error and prices that is made small."""
        return float(self.scores(self.measure.parts(self.residual(chosen)), chosen))

    def exchanged(self, chosen: frozenset[int]) -> frozenset[int]:
        """Swap single groups, the best swap of each first, while that lowers the score."""
        score, solved = self.score(chosen), self._solve(chosen)
        left = sorted(chosen - self.keep)
        while left:
            group = left.pop(0)
            rest = chosen - {group}
            scores = self._scores_of_adding(self._without(solved, group), rest)
            best = int(scores.argmin())
            if best == group or scores[best] >= score + CLEARLY:
                continue
            swapped = rest | {best}
            found = self.score(swapped)
            if found < score + CLEARLY:  # rounding errors must not swap to and fro
                chosen, score, solved = swapped, found, self._solve(swapped)
                left = [*left, *sorted(chosen - self.keep - {best} - set(left))]
        return chosen

    def grown(self, chosen: frozenset[int], count: int) -> frozenset[int]:
        """The chosen groups and others, ``count`` in all, exchanged."""
        return self.exchanged(self._grown(chosen, count))

    def _grown(self, chosen: frozenset[int], count: int) -> frozenset[int]:
        """Add what lowers the score most, one group at a time."""
        while len(chosen) < count:
            scores = self._scores_of_adding(self.residual(chosen), chosen)
            chosen = chosen | {int(scores.argmin())}
        return chosen

    def _shrunk(
        self, chosen: frozenset[int], count: int, keep: frozenset[int] = frozenset()
    ) -> frozenset[int]:
        """Take away what raises the score least, one group at a time."""
        keep = keep | self.keep
        while len(chosen) > max(count, len(keep)):
            scores = self._scores_of_removing(self._solve(chosen), chosen)
            scores[list(keep)] = np.inf
            chosen = chosen - {int(scores.argmin())}
        return chosen

    @cached_property
    def _nugget(self) -> Array:
        return SAME_SHARE * np.diag(self.covariance) + TINY

    @cached_property
    def _by_size(self) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], ...]:
        """Numbers of the groups of each size, and their channels (groups, size)."""
        sizes = np.array([len(g) for g in self.groups])
        numbers = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
        return tuple((of, np.array([self.groups[i] for i in of])) for of in numbers)

    @cached_property
    def log_price(self) -> Array:
        """(groups,) what each adds to the score by its price."""
        return np.zeros(len(self.groups)) if self.price is None else np.log(self.price)

    def _solve(self, chosen: frozenset[int]) -> _Solved:
        free = list(self.channels(chosen))
        across = self.covariance[free]
        among = across[:, free]
        among.flat[:: len(free) + 1] += self._nugget[free]
        inverse = np.asarray(np.linalg.inv(among), dtype=np.float64)
        told = inverse @ across
        return _Solved(free, inverse, told, self.covariance - across.T @ told)

    def _without(self, solved: _Solved, group: int) -> Array:
        """Residual covariance (n, n) where one group is free no longer."""
        own = [solved.free.index(channel) for channel in self.groups[group]]
        back = solved.told[own]
        return np.asarray(
            solved.residual + back.T @ np.linalg.inv(solved.inverse[np.ix_(own, own)]) @ back
        )

    def _scores_of_adding(self, residual: Array, chosen: frozenset[int]) -> Array:
        """(groups,) scores of the chosen groups and each other one; infinite for the chosen."""
        parts = self.measure.parts(residual)
        scores = np.empty(len(self.groups))
        for numbers, groups in self._by_size:
            columns = residual[:, groups].transpose(1, 0, 2)
            among = residual[groups[:, :, None], groups[:, None, :]]
            diagonal = np.arange(groups.shape[1])
            among[:, diagonal, diagonal] += self._nugget[groups]
            falls = self.measure.falls(columns, _inverse(among))
            scores[numbers] = self.scores(parts - falls, chosen)
        scores += self.log_price
        scores[list(chosen)] = np.inf
        return scores

    def _scores_of_removing(self, solved: _Solved, chosen: frozenset[int]) -> Array:
        """(groups,) scores of the chosen groups without each one; infinite for the others."""
        parts = self.measure.parts(solved.residual)
        place = np.zeros(len(self.covariance), dtype=np.intp)
        place[solved.free] = np.arange(len(solved.free))
        scores = np.full(len(self.groups), np.inf)
        for numbers, groups in self._by_size:
            there = [i for i, number in enumerate(numbers) if number in chosen]
            own = place[groups[there]]
            columns = solved.told[own].transpose(0, 2, 1)
            among = solved.inverse[own[:, :, None], own[:, None, :]]
            rises = self.measure.falls(columns, _inverse(among))
            scores[numbers[there]] = self.scores(parts + rises, chosen)
        return np.asarray(scores - self.log_price)

    def scores(self, parts: Array, chosen: frozenset[int]) -> Array:
        """Logarithms of the errors of squared parts (..., parts), with the prices of the chosen."""
        parts = np.maximum(parts, 0.0)
        if self.largest is not None:
            parts = np.maximum(parts - self.largest**2, 0.0)
        price = self.log_price[list(chosen)].sum()
        return np.asarray(np.log(parts.mean(axis=-1) + SAME_SHARE * self._total + TINY) + price)

    @cached_property
    def _total(self) -> float:
        return float(self.measure.parts(self.covariance).mean())


@dataclass(frozen=True, eq=False)
class _Solved:
    """Least squares of all channels on the free ones: coefficients ``told`` (free, n)."""

    free: list[int]
    inverse: Array
    told: Array
    residual: Array


def _inverse(matrices: Array) -> Array:
    """Inverses of (m, s, s) matrices."""
    return 1.0 / matrices if matrices.shape[-1] == 1 else np.asarray(np.linalg.inv(matrices))
