"""The method of Joerg & O'Sullivan 2009 as its text says it: slow, obvious, curve by curve.

Nothing here is shared with usdhand.reduce but the idea of a tie: numbers that differ by less than
rounding errors are the same, and among the same the earlier channel counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Curve = list[float]


@dataclass(frozen=True)
class Simplified:
    """What became of a channel; ``rmsd`` and ``sign`` are those against its controller."""

    kind: str
    controller: str | None = None
    sign: int = 0
    slope: float = 0.0
    offset: float = 0.0
    rmsd: float = 0.0


def mean(curve: Curve) -> float:
    return math.fsum(curve) / len(curve)


def std(curve: Curve) -> float:
    m = mean(curve)
    return math.sqrt(math.fsum((v - m) ** 2 for v in curve) / len(curve))


def standardised(curve: Curve) -> Curve:
    m, s = mean(curve), std(curve)
    return [(v - m) / s for v in curve]


def rmsd1(a: Curve, b: Curve) -> float:
    return math.sqrt(math.fsum((x - y) ** 2 for x, y in zip(a, b, strict=True)) / len(a))


def rmsd2(a: Curve, b: Curve) -> float:
    return math.sqrt(math.fsum((x + y) ** 2 for x, y in zip(a, b, strict=True)) / len(a))


def simplify(
    curves: dict[str, Curve], range_limit: float, rmsd_limit: float
) -> dict[str, Simplified]:
    """Steps 1 and 2, or 3 and 4, of the paper; curves in degrees, in channel order."""
    result: dict[str, Simplified] = {}

    # Section 4.1: what barely moves becomes its mean.
    for name, curve in curves.items():
        width = max(curve) - min(curve)
        if less(width, range_limit, 1e-9) or width < 1e-6:
            result[name] = Simplified("constant", offset=mean(curve))
    left = [name for name in curves if name not in result]
    z = {name: standardised(curves[name]) for name in left}
    spread = {name: std(curves[name]) for name in left}

    # Section 4.2: the curve with the smaller standard deviation follows the one with the larger;
    # section 5.2: of several, the one with the largest standard deviation.
    direct: dict[str, str] = {}
    for a in left:
        for b in left:
            if a == b or not controls(b, a, spread, left):
                continue
            if less(min(rmsd1(z[a], z[b]), rmsd2(z[a], z[b])), rmsd_limit, 1e-7) and (
                a not in direct or controls(b, direct[a], spread, left)
            ):
                direct[a] = b

    # Section 5.2: "curve b is already controlled by curve c. In this case we compute curve a based
    # on curve c, even if the distance metric exceeds the threshold".
    for a in left:
        if a not in direct:
            result[a] = Simplified("free")
            continue
        root = direct[a]
        while root in direct:
            root = direct[root]
        same, mirrored = rmsd1(z[a], z[root]), rmsd2(z[a], z[root])
        sign = -1 if less(mirrored, same, 1e-9) else 1
        slope = sign * spread[a] / spread[root]
        offset = mean(curves[a]) - slope * mean(curves[root])
        result[a] = Simplified("linear", root, sign, slope, offset, min(same, mirrored))
    return {name: result[name] for name in curves}


def controls(b: str, a: str, spread: dict[str, float], order: list[str]) -> bool:
    """Whether b comes before a: larger standard deviation, or as large and earlier in order."""
    if math.isclose(spread[a], spread[b], rel_tol=1e-9):
        return order.index(b) < order.index(a)
    return spread[b] > spread[a]


def less(a: float, b: float, same: float) -> bool:
    """Whether a is below b by more than rounding errors."""
    return a < b - same


def evaluate(curves: dict[str, Curve], rules: dict[str, Simplified]) -> dict[str, Curve]:
    """The simplified curves, by the equations of section 4.2."""
    result = {}
    for a, rule in rules.items():
        if rule.kind == "free":
            result[a] = curves[a]
        elif rule.kind == "constant":
            result[a] = [mean(curves[a])] * len(curves[a])
        else:
            assert rule.controller is not None
            b = curves[rule.controller]
            scale = rule.sign * std(curves[a]) / std(b)
            result[a] = [(v - mean(b)) * scale + mean(curves[a]) for v in b]
    return result
