"""The best few channels for a number or an error that is asked for, and how others follow them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache

import numpy as np

from usdhand.anatomy.channels import is_flexion
from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.reduce.evidence import Takes
from usdhand.reduce.fit import SMALLEST_RANGE_DEG
from usdhand.reduce.limits import Limits
from usdhand.reduce.moments import Moments
from usdhand.reduce.relate import RIDGES, Shape, best_shape, left_out, residual_moments, told_by
from usdhand.reduce.rig import Relation
from usdhand.reduce.settings import Criteria, Target
from usdhand.reduce.sparse import exchanged_for_few, grown_for_few
from usdhand.reduce.subset import Subsets

# A twist or spread must lower the squared error so many times more than a flexion.
PREFERENCE = 1.2


@dataclass(frozen=True, eq=False)
class Model:
    """Free channels, and the matrix by which all follow from them (see `relate`)."""

    free: tuple[int, ...]
    shape: Shape
    told: Array


def choose(evidence: Takes, target: Target, controllers: int | None, choice: Criteria) -> Model:
    """Channels for a number of them, or the fewest for a largest error.

    Raises
    ------
    UsageError
        if the number is negative or less than what is kept, or a kept channel does not exist.
    """
    if target.free_channels is not None:
        return _for_count(evidence, target.free_channels, controllers, choice)
    assert target.max_error is not None
    return _for_error(evidence, target.max_error, controllers, choice)


def subsets(
    evidence: Takes,
    choice: Criteria,
    largest: float | None = None,
    fitted: Moments | None = None,
) -> Subsets:
    """The search among the channels that move, or that are kept.

    Parameters
    ----------
    largest : error that no channel or fingertip is to exceed, on the motion that is fitted itself
    fitted : moments of some of the takes instead of all

    Raises
    ------
    UsageError
        if a kept channel does not exist, or the same channels are wanted of one hand.
    """
    names, moments = evidence.names, fitted or evidence.moments
    kept = {name for pattern in choice.keep for name in _named(names, pattern)}
    moving = moments.high - moments.low > SMALLEST_RANGE_DEG
    wanted = {name for name, moves in zip(names, moving, strict=True) if moves} | kept
    if choice.symmetric:
        if len({name[:2] for name in names}) < 2:
            raise UsageError(
                "--symmetric leaves the same channels of both hands free, but there is one hand."
            )
        digits = {name[2:] for name in wanted}
        wanted = {name for name in names if name[2:] in digits}
    together: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        if name in wanted:
            together.setdefault(name[2:] if choice.symmetric else name, []).append(i)
    groups = tuple(tuple(own) for own in together.values())
    keep = frozenset(g for g, own in enumerate(groups) if any(names[i] in kept for i in own))
    dear = [not any(is_flexion(names[i]) for i in own) for own in groups]
    price = np.where(dear, PREFERENCE, 1.0) if choice.prefer == "flexion" else None
    covariance = evidence.related * moments.covariance
    return Subsets(covariance, evidence.measure(choice.measure), groups, keep, price, largest)


def model_of(
    evidence: Takes, free: Sequence[int], controllers: int | None, choice: Criteria
) -> Model:
    """How all channels follow the free ones."""
    measure, related = evidence.measure(choice.measure), evidence.related
    shape = best_shape(evidence.folds, free, measure, controllers, related)
    return Model(tuple(free), shape, told_by(related * evidence.moments.covariance, free, shape))


def relations_of(evidence: Takes, model: Model) -> tuple[Relation, ...]:
    """The model as relations of a rig."""
    moments, names = evidence.moments, evidence.names
    std = moments.std
    missed = residual_moments(model.told, moments, moments)
    errors = np.sqrt(np.maximum(np.diag(missed), 0.0))
    unseen: list[float | None] = [None] * len(names)
    if len(evidence.folds) > 1:
        square = np.diag(left_out(evidence.folds, model.free, model.shape, evidence.related))
        unseen = [float(e) for e in np.sqrt(np.maximum(square, 0.0))]
    free = set(model.free)

    def relation(a: int) -> Relation:
        limits = Limits.of(names[a], float(moments.low[a]), float(moments.high[a]))
        if a in free:
            return Relation(names[a], "free", std=float(std[a]), limits=limits)
        chosen = np.flatnonzero(model.told[a])
        slopes = model.told[a, chosen]
        linear = len(chosen) > 0
        return Relation(
            names[a],
            "linear" if linear else "constant",
            offset=float(moments.mean[a] - slopes @ moments.mean[chosen]),
            controllers=tuple(names[b] for b in chosen),
            slopes=tuple(float(s) for s in slopes),
            rms_error=float(errors[a]),
            left_out_error=unseen[a],
            std=float(std[a]),
            limits=limits if linear else None,
        )

    return tuple(relation(a) for a in range(len(names)))


def _for_count(evidence: Takes, count: int, controllers: int | None, choice: Criteria) -> Model:
    if count < 0:
        raise UsageError(f"{count} free channels are not possible: give 0 or more.")
    search = subsets(evidence, choice)
    if len(search.channels(search.keep)) > count:
        raise UsageError(
            f"{len(search.channels(search.keep))} channels are to be kept free, which is more than "
            f"the {count} that are asked for."
        )
    sizes = sorted(len(group) for group in search.groups)
    groups = int(np.searchsorted(np.cumsum(sizes), count, side="right"))
    free = search.best(groups)
    while len(search.channels(free)) > count:
        groups -= 1
        free = search.best(groups)
    free = _to_follow(search, free, controllers)
    return model_of(evidence, search.channels(free), controllers, choice)


def _to_follow(search: Subsets, free: frozenset[int], controllers: int | None) -> frozenset[int]:
    """About the same channels, those that serve where each channel follows so many of them."""
    if controllers is None or controllers >= len(search.channels(free)):
        return free
    return exchanged_for_few(search, free, controllers)


def _for_error(evidence: Takes, most: float, controllers: int | None, choice: Criteria) -> Model:
    search = subsets(evidence, choice, most)
    measure, moments = search.measure, evidence.moments

    def met(told: Array) -> bool:
        parts = measure.parts(residual_moments(told, moments, moments))
        return bool(parts.max(initial=0.0) <= most**2)

    @cache
    def model(chosen: frozenset[int]) -> Model | None:
        """What serves takes left out if it meets the error, else what fits most closely."""
        free = search.channels(chosen)
        found = model_of(evidence, free, controllers, choice)
        if met(found.told):
            return found
        shape = Shape(controllers, RIDGES[0], 0.0)
        closest = told_by(evidence.related * moments.covariance, free, shape)
        return Model(tuple(free), shape, closest) if met(closest) else None

    for chosen in search.path():
        if measure.parts(search.residual(chosen)).max(initial=0.0) > most**2:
            continue  # not even with all controllers
        if controllers is not None:
            chosen = _fewest(search, chosen, controllers, lambda some: model(some) is not None)
        tried = [chosen]
        if len(chosen) > len(search.keep):
            tried.insert(0, _to_follow(search, search.best(len(chosen) - 1), controllers))
        found = next((m for m in map(model, tried) if m is not None), None)
        if found is not None:
            return found
    return model_of(evidence, search.channels(frozenset(range(len(search.groups)))), None, choice)


def _fewest(
    search: Subsets,
    chosen: frozenset[int],
    controllers: int,
    enough: Callable[[frozenset[int]], bool],
) -> frozenset[int]:
    """The chosen groups, or about the fewest more that are enough with few controllers."""
    less, step = exchanged_for_few(search, chosen, controllers), 1
    if enough(less):
        return less
    while True:
        more = grown_for_few(search, less, min(len(less) + step, len(search.groups)), controllers)
        if enough(more) or len(more) == len(search.groups):
            break
        less, step = more, 2 * step
    while len(more) > len(less) + 1:
        between = grown_for_few(search, less, (len(less) + len(more)) // 2, controllers)
        less, more = (less, between) if enough(between) else (between, more)
    return more


def _named(names: Sequence[str], pattern: str) -> list[str]:
    found = [name for name in names if fnmatchcase(name, pattern)]
    if not found:
        raise UsageError(
            f"There is no channel '{pattern}' to keep free; there are {', '.join(names)}."
        )
    return found
