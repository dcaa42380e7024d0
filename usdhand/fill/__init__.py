"""Method 2, fill: fingers for body clips from a motion library (Joerg, Hodgins, Safonova 2012)."""

from usdhand.fill.library import LibraryClip, MotionLibrary, library_clip
from usdhand.fill.method import fill, space_for
from usdhand.fill.results import Filled
from usdhand.fill.segment import PAPER_SEGMENTATION, Segmentation
from usdhand.fill.settings import PAPER, FillSettings

__all__ = [
    "PAPER",
    "PAPER_SEGMENTATION",
    "FillSettings",
    "Filled",
    "LibraryClip",
    "MotionLibrary",
    "Segmentation",
    "fill",
    "library_clip",
    "space_for",
]
