"""numba behind one typed door: the only module that knows how a kernel is compiled and cached."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

Features = NDArray[np.floating[Any]]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Ints = NDArray[np.int64]
Groups = NDArray[np.int32]
Codes = NDArray[np.uint16]
Bytes = NDArray[np.uint8]
Moves = NDArray[np.int8]

Function = TypeVar("Function", bound=Callable[..., object])

# Kernels see finite numbers only (`pack` and `prepare` refuse others), so minima need no care for
# NaN and vectorise. Sums keep their order: every candidate's cost is the same wherever it stands.
_FINITE = {"nnan", "ninf", "nsz", "contract"}


def kernel(function: Function) -> Function:
    """Compile on first use, without the GIL, cached on disk beside the source or per user.

    Where neither place can be written (a read-only installation without a home), it compiles
    in every process instead.
    """
    options = {"nogil": True, "error_model": "numpy", "fastmath": _FINITE}
    try:
        compiled: Function = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba: "no locator available"
        compiled = numba.njit(**options)(function)
    return compiled
