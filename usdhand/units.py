"""Units of length by name, and axes. Standard library only."""

from __future__ import annotations

from typing import Literal

UpAxis = Literal["Y", "Z"]

# Centimetres of a unit of length.
UNITS = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}


def read_unit(text: str) -> float:
    """Return the centimetres of a unit's name, or of a number.

    Raises
    ------
    ValueError
        if it is neither.
    """
    if text in UNITS:
        return UNITS[text]
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.0 < number < float("inf"):
        raise ValueError(f"'{text}' is neither one of {', '.join(UNITS)} nor a number of cm.")
    return number
