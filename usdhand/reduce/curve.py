"""What a number of free channels costs: the error by count, fitted and on takes left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.reduce.choose import subsets
from usdhand.reduce.evidence import Takes
from usdhand.reduce.fit import Statistics, fit_relations
from usdhand.reduce.moments import Moments, pooled
from usdhand.reduce.relate import FEWEST_FOLDS, Shape, residual_moments, told_by
from usdhand.reduce.rig import ReducedRig, relation_matrix
from usdhand.reduce.settings import PRESETS, Criteria

# A ridge that serves takes left out about as well as the best one, whatever the count.
RIDGE = 0.1
# Counts that the curve is known at; all up to the first step, then wider ones.
COUNTS = (*range(13), 15, 17, 20, 23, 26, 30, 35, 40, 45)


@dataclass(frozen=True)
class Loss:
    """Errors over all channels: RMS degrees, and RMS mm over the fingertips."""

    deg: float
    mm: float

    @classmethod
    def of(cls, missed: Array, evidence: Takes) -> Loss:
        """From second moments (n, n) of what is missed."""
        parts = (evidence.measure(name).parts(missed) for name in ("deg", "mm"))
        deg, mm = (float(np.sqrt(max(p.mean(), 0.0))) if len(p) else 0.0 for p in parts)
        return cls(deg, mm)

    def by(self, measure: str) -> float:
        """The one that a measure means."""
        return self.mm if measure == "mm" else self.deg


@dataclass(frozen=True)
class CurvePoint:
    """Errors with so many free channels; of PCA, with as many components.

    ``left_out`` and ``pca_left_out`` are on takes that were not fitted, channels and all; None of
    a single take.
    """

    channels: int
    fitted: Loss
    pca: Loss
    left_out: Loss | None = None
    pca_left_out: Loss | None = None


@dataclass(frozen=True)
class ErrorCurve:
    """Errors by number of free channels.

    Attributes
    ----------
    points : by rising count
    presets : what the paper's steps 1 to 4 leave free, and lose
    suggested : number of channels at the knee, after which more of them gain less
    """

    points: tuple[CurvePoint, ...]
    presets: dict[int, tuple[int, Loss]]
    suggested: int


def error_curve(
    evidence: Takes, choice: Criteria | None = None, controllers: int | None = None
) -> ErrorCurve:
    """Errors of the best channels for some counts, by what ``choice`` says.

    Raises
    ------
    UsageError
        if a channel that is kept does not exist.
    """
    choice = choice or Criteria()
    folds = evidence.folds
    shape = Shape(controllers, RIDGE if len(folds) >= FEWEST_FOLDS else Shape().ridge)
    fitted = _losses(evidence, evidence.moments, [evidence.moments], shape, choice)
    unseen: dict[int, list[tuple[Loss, Loss]]] = {}
    weights = np.array([fold.seconds for fold in folds]) / evidence.moments.seconds
    if len(folds) > 1:
        for i, fold in enumerate(folds):
            others = pooled(f for j, f in enumerate(folds) if j != i)
            for count, losses in _losses(evidence, others, [fold], shape, choice).items():
                unseen.setdefault(count, []).append(losses)
    points = []
    for count, (own, pca) in fitted.items():
        there = unseen.get(count, [])
        left = [_together(weights, [pair[k] for pair in there]) for k in (0, 1)]
        whole = len(there) == len(folds)
        points.append(
            CurvePoint(count, own, pca, left[0] if whole else None, left[1] if whole else None)
        )
    return ErrorCurve(tuple(points), _presets(evidence), _knee(points, choice.measure))


def rig_loss(rig: ReducedRig, evidence: Takes) -> Loss:
    """What a rig's relations lose on the motion that it was fitted to, limits apart."""
    moments = evidence.moments
    missed = residual_moments(relation_matrix(rig.relations), moments, moments)
    return Loss.of(missed, evidence)


def _losses(
    evidence: Takes,
    fitted: Moments,
    shown: Sequence[Moments],
    shape: Shape,
    choice: Criteria,
) -> dict[int, tuple[Loss, Loss]]:
    """Loss of the best channels, and of PCA, on what is shown, by count."""
    search = subsets(evidence, choice, fitted=fitted)
    covariance = evidence.related * fitted.covariance
    axes = np.linalg.eigh(fitted.covariance)[1][:, ::-1]
    target = pooled(shown)
    found = {}
    last = len(search.channels(frozenset(range(len(search.groups)))))
    for chosen in search.path():
        free = search.channels(chosen)
        if len(free) not in (*COUNTS, last) and not choice.symmetric:
            continue
        first = axes[:, : len(free)]
        found[len(free)] = (
            Loss.of(residual_moments(told_by(covariance, free, shape), fitted, target), evidence),
            Loss.of(residual_moments(first @ first.T, fitted, target), evidence),
        )
    return found


def _together(weights: Array, losses: Sequence[Loss]) -> Loss | None:
    """RMS over takes."""
    if len(losses) != len(weights):
        return None
    deg, mm = (
        float(np.sqrt(weights @ np.square([getattr(loss, k) for loss in losses])))
        for k in ("deg", "mm")
    )
    return Loss(deg, mm)


def _presets(evidence: Takes) -> dict[int, tuple[int, Loss]]:
    statistics = Statistics.from_moments(evidence.moments)
    found = {}
    for preset, thresholds in PRESETS.items():
        relations = fit_relations(evidence.names, statistics, thresholds)
        missed = residual_moments(relation_matrix(relations), evidence.moments, evidence.moments)
        free = sum(r.kind == "free" for r in relations)
        found[preset] = free, Loss.of(missed, evidence)
    return found


def _knee(points: Sequence[CurvePoint], measure: str) -> int:
    """Count at which the curve is farthest below the line from its first to its last point."""
    counts = np.array([p.channels for p in points], dtype=float)
    errors = np.array([(p.left_out or p.fitted).by(measure) for p in points])
    width, height = np.ptp(counts), np.ptp(errors)
    if not (width > 0 and height > 0):
        return int(counts[0])
    below = 1.0 - (counts - counts[0]) / width - (errors - errors.min()) / height
    return int(counts[below.argmax()])
