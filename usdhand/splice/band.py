"""Where a warp may go: the band around the diagonal, bent to pass through pins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.hand import Side
from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.splice.settings import Pin


@dataclass(frozen=True, eq=False)
class Band:
    """Columns ``low`` to ``high`` (rows,) that every row may use, both included, never falling."""

    low: NDArray[np.int64]
    high: NDArray[np.int64]

    @property
    def cells(self) -> int:
        """How many cells there are."""
        return int((self.high - self.low + 1).sum())


Anchor = tuple[int, int, int]  # row, column, tolerance


def checked_pins(pins: Sequence[Pin], side: Side, body: float, hand: float) -> tuple[Pin, ...]:
    """Pins of one hand in order of time, refused before any work where they cannot all hold.

    Parameters
    ----------
    body, hand : lengths of the clips in seconds

    Raises
    ------
    UsageError
        naming the pin that is out of range, or the two that contradict each other.
    """
    own = sorted((p for p in pins if p.side in (None, side)), key=lambda p: (p.body, p.hand))
    for pin in own:
        if not (np.isfinite(pin.tolerance) and pin.tolerance >= 0):
            raise UsageError(f"Pin {pin}: the tolerance must be 0 or more.")
        for name, time, length in (("body", pin.body, body), ("hand", pin.hand, hand)):
            if not -1e-6 <= time <= length + 1e-6:
                raise UsageError(
                    f"Pin {pin} is outside the {name} clip, which lasts {length:.3f} s "
                    f"from its first frame; the pin is at {time:.3f} s."
                )
    kept: list[Pin] = []
    for pin in own:
        before = kept[-1] if kept else None
        if before and pin.body - before.body < 1e-9:
            if abs(pin.hand - before.hand) > 1e-9:
                raise UsageError(f"Pins {before} and {pin} contradict each other.")
            if pin.tolerance < before.tolerance:
                kept[-1] = pin
            continue
        latest = max(kept, key=lambda p: p.hand - p.tolerance, default=pin)
        if pin.hand + pin.tolerance < latest.hand - latest.tolerance - 1e-9:
            raise UsageError(f"Pins {latest} and {pin} cross: the hand clip would run backward.")
        kept.append(pin)
    return tuple(kept)


def anchors_of(pins: Sequence[Pin], rows: int, columns: int, fps: float) -> tuple[Anchor, ...]:
    """Cells (row, column, tolerance) of pins, the first and the last of which end the path.

    Both clips begin and end together, unless a pin on the first or last frame says otherwise.
    Several pins within one frame are one anchor, their last.
    """
    found: dict[int, Anchor] = {0: (0, 0, 0), rows - 1: (rows - 1, columns - 1, 0)}
    for pin in pins:
        row = min(round(pin.body * fps), rows - 1)
        column = min(round(pin.hand * fps), columns - 1)
        found[row] = (row, column, 0 if row in (0, rows - 1) else int(pin.tolerance * fps))
    ordered = tuple(found[row] for row in sorted(found))
    return ordered if all(a[1] <= b[1] for a, b in pairwise(ordered)) else _narrowed(ordered)


def _narrowed(anchors: Sequence[Anchor]) -> tuple[Anchor, ...]:
    """Anchors that cross within their tolerances, narrowed to what a path can pass in order."""
    at, middle, slack = np.array(anchors).T
    low = np.maximum.accumulate(middle - slack)
    high = np.maximum(np.minimum.accumulate((middle + slack)[::-1])[::-1], low)
    narrowed = zip(at, (low + high) // 2, (high - low) // 2, strict=True)
    return tuple((int(row), int(column), int(tolerance)) for row, column, tolerance in narrowed)


def pinned_band(anchors: Sequence[Anchor], width: float) -> Band:
    """Band of Majkowska et al. 2006, equations (4), (5) and Algorithm 1.

    Parameters
    ----------
    anchors : cells in order, from the first row to the last
    width : W in frames, measured across the band; half of it lies on either side
    """
    rows = anchors[-1][0] + 1
    low, high = np.zeros(rows), np.zeros(rows)
    low[0] = high[0] = anchors[0][1]
    high[0] += width / 2
    for (x0, y0, before), (x1, y1, after) in pairwise(anchors):
        run, rise = x1 - x0, y1 - y0
        extent = width * np.hypot(run, rise) / (2 * run)
        centre = y0 + np.arange(1, run + 1) * rise / run
        low[x0 + 1 : x1 + 1] = np.maximum(y0 - before, centre - extent)
        high[x0 + 1 : x1 + 1] = np.minimum(y1 + after, centre + extent)
    high[0] = min(high[0], anchors[1][1] + anchors[1][2])
    return _whole_columns(low, high, anchors[0][1], anchors[-1][1])


def band_along(first: NDArray[np.int64], last: NDArray[np.int64], band: Band, reach: float) -> Band:
    """The part of a band that is within ``reach`` columns of a path through it.

    Parameters
    ----------
    first, last : (rows,) columns of the path in every row; all of them stay, so that there is
        a way through, however many columns a row has
    """
    low = np.maximum(band.low, np.floor(first - reach).astype(np.int64))
    high = np.minimum(band.high, np.ceil(last + reach).astype(np.int64))
    return Band(low, high)


def band_near(band: Band, path: Array, reach: float) -> Band:
    """The part of a band near a path (rows,) that may leave it; the ends stay where they are."""
    low = np.clip(np.floor(path - reach).astype(np.int64), band.low[0], band.high[-1])
    high = np.clip(np.ceil(path + reach).astype(np.int64), band.low[0], band.high[-1])
    low[0], high[-1] = band.low[0], band.high[-1]
    low, high = np.maximum(low, band.low), np.minimum(high, band.high)
    low, high = np.maximum.accumulate(low), np.minimum.accumulate(high[::-1])[::-1]
    return Band(np.minimum(low, high), high)


def _whole_columns(low: Array, high: Array, first: int, last: int) -> Band:
    """Whole columns that a path which never goes back can use."""
    least = np.clip(np.ceil(low - 1e-9), first, last).astype(np.int64)
    most = np.clip(np.floor(high + 1e-9), first, last).astype(np.int64)
    least[0], most[-1] = first, last
    return Band(np.maximum.accumulate(least), np.minimum.accumulate(most[::-1])[::-1])
