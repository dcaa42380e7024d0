"""Method 1, reduce: a hand rig of a few channels (Joerg & O'Sullivan 2009)."""

from usdhand.reduce.errors import Errors, distances, measure_errors, pca_rms
from usdhand.reduce.fit import PRESETS, Fit, Statistics, Thresholds, fit_relations
from usdhand.reduce.method import Reduction, Target, apply_rig, expand, fit_rig
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.search import thresholds_for_count, thresholds_for_error

__all__ = [
    "PRESETS",
    "Errors",
    "Fit",
    "ReducedRig",
    "Reduction",
    "Relation",
    "Statistics",
    "Target",
    "Thresholds",
    "apply_rig",
    "distances",
    "expand",
    "fit_relations",
    "fit_rig",
    "measure_errors",
    "pca_rms",
    "thresholds_for_count",
    "thresholds_for_error",
]
