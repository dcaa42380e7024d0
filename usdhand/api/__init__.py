"""The verbs of usdhand as functions on values; what is odd comes back beside the result.

Example
-------
>>> import usdhand                                             # doctest: +SKIP
>>> clip = usdhand.read_clip("samples/gestures/ok_01.usdc")    # doctest: +SKIP
>>> [reduction] = usdhand.reduce_hands([clip], preset=4)       # doctest: +SKIP
>>> reduction.rig.free                                         # doctest: +SKIP
>>> usdhand.write_rig(reduction, "ok_rig.usdc")                # doctest: +SKIP
"""

from usdhand.api.clips import compare, conventions_from, find_hands, write_clip
from usdhand.api.reducing import (
    expand,
    expand_onto,
    read_rig,
    reduce_hands,
    reduction_target,
    write_rig,
)
from usdhand.compare import Comparison
from usdhand.formats.usd.check import Finding, check_file
from usdhand.formats.usd.read import read_character, read_clip
from usdhand.reduce import apply_rig

__all__ = [
    "Comparison",
    "Finding",
    "apply_rig",
    "check_file",
    "compare",
    "conventions_from",
    "expand",
    "expand_onto",
    "find_hands",
    "read_character",
    "read_clip",
    "read_rig",
    "reduce_hands",
    "reduction_target",
    "write_clip",
    "write_rig",
]
