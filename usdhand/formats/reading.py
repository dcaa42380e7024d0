"""What to read of a file, and what it means where it does not say so itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed
from usdhand.options import option

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
        raise ValueError(f"'{text}' is none of {', '.join(UNITS)}, nor a number of cm.")
    return number


@displayed()
@dataclass(frozen=True)
class Reading:
    """What to read of a file, and what it means where it does not say so itself.

    Attributes
    ----------
    skel : path or name of the skeleton where there are several
    animation : name of the animation where there are several (never in USD)
    cm_per_unit : centimetres of one unit, instead of what the file says or what is guessed
    up : "Y" or "Z", likewise
    """

    skel: str | None = option(
        "Path or name of the skeleton where there are several.", default=None, metavar="PRIM"
    )
    animation: str | None = option(
        "Animation where a file has several.", default=None, metavar="NAME"
    )
    cm_per_unit: float | None = option(
        "Unit of an input that is not USD: mm, cm, m, in, ft or a number of cm.",
        "--units",
        default=None,
        metavar="UNIT",
        read=read_unit,
    )
    up: Literal["Y", "Z"] | None = option(
        "Its up axis, if it is not USD.", "--input-up", default=None, key="input_up"
    )


DEFAULT = Reading()
