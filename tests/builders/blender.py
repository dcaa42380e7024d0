"""Where Blender is, and its axes."""

from __future__ import annotations

import importlib.util
import os
import sys

import numpy as np
import pytest

Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # Blender is Z up


def blender_python() -> str:
    """Python that has bpy: its own environment by preference, for bpy pins an old numpy."""
    chosen = os.environ.get("USDHAND_BLENDER_PYTHON")
    if chosen:
        return chosen
    if importlib.util.find_spec("bpy"):
        return sys.executable
    pytest.skip("no Blender: set USDHAND_BLENDER_PYTHON to a Python with bpy 5.0")


def turned(matrices: np.ndarray) -> np.ndarray:
    u, _, vt = np.linalg.svd(matrices[..., :3, :3])
    return u @ vt
