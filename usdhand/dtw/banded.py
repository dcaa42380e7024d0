"""Compiled: variances of a stiff curve, from its normal equations. Import late."""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Doubles, kernel


@kernel
def inverse_diagonal(main: Doubles, first: Doubles, second: Doubles) -> Doubles:
    """Diagonal (n,) of the inverse of a symmetric positive matrix with two bands beside it.

    Takahashi, Fagan & Chen 1973: the inverse within the bands, from the last row up, in linear
    time.

    Parameters
    ----------
    main : (n,) diagonal
    first, second : (n,) elements [i, i + 1] and [i, i + 2]; what is outside the matrix is not used
    """
    n = len(main)
    pivots, one, two = np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(n):
        pivot = main[i]
        if i > 0:
            pivot -= one[i - 1] ** 2 * pivots[i - 1]
        if i > 1:
            pivot -= two[i - 2] ** 2 * pivots[i - 2]
        pivots[i] = pivot
        if i + 1 < n:
            value = first[i]
            if i > 0:
                value -= one[i - 1] * two[i - 1] * pivots[i - 1]
            one[i] = value / pivot
        if i + 2 < n:
            two[i] = second[i] / pivot
    found, beside = np.zeros(n), np.zeros(n)  # elements [i, i] and [i, i + 1] of the inverse
    for i in range(n - 1, -1, -1):
        near = -one[i] * found[i + 1] - two[i] * beside[i + 1] if i + 1 < n else 0.0
        far = 0.0
        if i + 2 < n:
            far = -one[i] * beside[i + 1] - two[i] * found[i + 2]
        beside[i] = near
        found[i] = 1.0 / pivots[i] - one[i] * near - two[i] * far
    return found
