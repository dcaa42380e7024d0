"""Hands of a character at its bind pose, as a library keeps them for bodies without fingers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pxr import Sdf, Usd, Vt

from usdhand.anatomy import HAND_JOINTS, SIDES, Side
from usdhand.rigs.conventions import METACARPALS, TIPS
from usdhand.rigs.graft import HandShape

ROLES = {*HAND_JOINTS, *METACARPALS.values(), *TIPS.values()}
LARGEST_CM = 1e4
_TYPES = Sdf.ValueTypeNames


def shape_values(shape: HandShape) -> Mapping[str, tuple[Sdf.ValueTypeName, Any]]:
    """Attributes of a hand, without its height, and their types."""
    parents = [shape.parents[role] for role in shape.roles]
    # USD's matrices turn rows.
    rotations = np.ascontiguousarray(np.swapaxes(shape.rotations, 1, 2), dtype=np.float64)
    positions = np.ascontiguousarray(shape.positions, dtype=np.float64)
    return {
        "shape:roles": (_TYPES.TokenArray, Vt.TokenArray(list(shape.roles))),
        "shape:parents": (_TYPES.TokenArray, Vt.TokenArray(parents)),
        "shape:positions": (_TYPES.Double3Array, Vt.Vec3dArray.FromNumpy(positions)),
        "shape:rotations": (_TYPES.Matrix3dArray, Vt.Matrix3dArray.FromNumpy(rotations)),
        "shape:forearm": (_TYPES.Double, shape.forearm or 0.0),
    }


def read_shapes(prim: Usd.Prim, height: float) -> dict[Side, HandShape]:
    """Hands that a prim has; none where someone removed them.

    Raises
    ------
    ValueError
        if the attributes of a hand do not fit together.
    """
    found: dict[Side, HandShape] = {}
    for side in SIDES:
        if (roles := _get(prim, f"{side}:shape:roles")) is not None:
            found[side] = _read_shape(prim, side, tuple(str(role) for role in roles), height)
    return found


def _read_shape(prim: Usd.Prim, side: Side, roles: tuple[str, ...], height: float) -> HandShape:
    parents, positions, rotations = (
        _get(prim, f"{side}:shape:{name}") for name in ("parents", "positions", "rotations")
    )
    forearm = float(_get(prim, f"{side}:shape:forearm") or 0.0)
    above = dict(zip(roles, map(str, parents or ()), strict=True))
    points = np.array(positions, dtype=np.float64)
    turns = np.array(rotations, dtype=np.float64)
    if not set(roles) <= ROLES or len(above) < len(roles):
        raise ValueError(f"roles of the {side} hand")
    if any(a and a not in roles[:i] for i, a in enumerate(above.values())):
        raise ValueError(f"parents of the {side} hand")
    if points.shape != (len(roles), 3) or turns.shape != (len(roles), 3, 3):
        raise ValueError(f"{len(roles)} joints of the {side} hand")
    turns = np.swapaxes(turns, 1, 2)
    products = turns @ np.swapaxes(turns, 1, 2)
    square = np.abs(products - np.eye(3)).max(initial=0.0) < 1e-3
    plausible = np.abs(points).max(initial=0.0) < LARGEST_CM and 0.0 <= forearm < LARGEST_CM
    if not (square and plausible):
        raise ValueError(f"the {side} hand is no hand")
    return HandShape(side, roles, above, points, turns, forearm or None, height)


def _get(prim: Usd.Prim, name: str) -> Any:
    return prim.GetAttribute(f"usdhand:{name}").Get()
