"""The motion that a rig does not keep, as its file has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd

from usdhand.errors import InputError
from usdhand.reduce.variation import EDGES_HZ, Residuals

LARGEST_DEG = 1e3  # more cannot be meant


def read_residuals(prim: Usd.Prim, path: Path) -> Residuals | None:
    """Residuals of a rig prim; None where it says nothing of them.

    Raises
    ------
    InputError
        if they are damaged, or in other bands of frequency than this version knows.
    """
    parts = ("channels", "bands", "mixtures")
    channels, bands, mixtures = (prim.GetAttribute(f"usdhand:residual:{p}").Get() for p in parts)
    if channels is None and bands is None and mixtures is None:
        return None
    try:
        names = tuple(str(name) for name in channels)
        edges = np.array(bands, dtype=np.float64)
        values = np.array(mixtures, dtype=np.float64)
        fits = edges.shape == (len(EDGES_HZ),) and bool(np.allclose(edges, EDGES_HZ))
        fits = fits and values.ndim == 1 and bool((np.abs(values) <= LARGEST_DEG).all())
        shaped = values.reshape(len(EDGES_HZ), -1, len(names))
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise InputError(f"{path}: what the rig says of its residuals is damaged.")
    return Residuals.from_array(names, shaped)
