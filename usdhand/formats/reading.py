"""What to read of a file, and what holds where the file does not state it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from usdhand.display import displayed
from usdhand.options import check_values, option
from usdhand.units import read_unit


@displayed()
@dataclass(frozen=True)
class Reading:
    """What to read of a file, and what holds where the file does not state it.

    Attributes
    ----------
    skel : path or name of the skeleton where there are several
    animation : name of the animation where there are several (never in USD)
    cm_per_unit : centimetres of one unit, instead of what the file says or what is guessed
    up : "Y" or "Z", likewise
    positions : "replace" or "add": what position channels of a BVH joint do with its OFFSET; None
        if they replace it, unless the body would collapse to a point
    """

    skel: str | None = option(
        "Path or name of the skeleton where there are several.", default=None, metavar="PRIM"
    )
    animation: str | None = option(
        "Name of the animation where a file has several.", default=None, metavar="NAME"
    )
    cm_per_unit: float | None = option(
        "Unit of an input that is not USD: mm, cm, m, in, ft or a number of cm.",
        "--units",
        default=None,
        metavar="UNIT",
        read=read_unit,
    )
    up: Literal["Y", "Z"] | None = option(
        "Up axis of an input that is not USD.", "--input-up", default=None, key="input_up"
    )

    positions: Literal["replace", "add"] | None = option(
        "Whether position channels of a BVH joint replace its OFFSET or are added to it. By "
        "default they replace it, unless the body would collapse to a point.",
        default=None,
    )

    def __post_init__(self) -> None:
        check_values(self)


DEFAULT = Reading()
