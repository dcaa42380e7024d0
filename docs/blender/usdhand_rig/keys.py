"""Fewer keys for one curve."""

import numpy as np


def thinned(keys: np.ndarray, tolerance: float) -> np.ndarray:
    """Keys (n, 2) of time and value without those that straight lines pass within ``tolerance``.

    Ramer, Douglas and Peucker's division, with distances along the value.
    """
    if tolerance <= 0.0 or len(keys) < 3:
        return keys
    keep = np.zeros(len(keys), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(keys) - 1)]
    while spans:
        first, last = spans.pop()
        times, values = keys[first : last + 1].T
        away = np.abs(values - np.interp(times, times[[0, -1]], values[[0, -1]]))
        middle = first + int(away.argmax())
        if away.max() > tolerance:
            keep[middle] = True
            spans += [(first, middle), (middle, last)]
    return keys[keep]
