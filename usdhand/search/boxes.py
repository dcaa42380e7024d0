"""Compiled: codes and boxes of candidates, and lower bounds from boxes. Imported late.

Everything is in whole numbers of 8 and 16 bits, many to a vector instruction. See `tiles` for why
indices are unsigned.
"""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Bytes, Codes, Doubles, Floats, Ints, kernel
from usdhand.search.tiles import UNREACHED, first_frame, last_frame

_CHUNK = 512
_U = np.uint64


@kernel
def encode(
    features: Floats, origin: Doubles, step: Doubles, start: int, stop: int, codes: Codes
) -> None:
    """Features of frames ``start`` to ``stop`` in whole steps from the origin."""
    for d in range(features.shape[1]):
        if step[d] > 0:
            for frame in range(start, stop):
                codes[frame, d] = np.uint16(
                    np.rint((np.float64(features[frame, d]) - origin[d]) / step[d])
                )


@kernel
def cell_start(edges: Doubles, cell: int, m: int) -> int:
    """First frame of a cell of a candidate; cells share the frames at their borders."""
    return int(np.floor(edges[cell] * (m - 1)))


@kernel
def cell_end(edges: Doubles, cell: int, m: int) -> int:
    """Last frame of a cell of a candidate."""
    return int(np.ceil(edges[cell + 1] * (m - 1)))


@kernel
def fill_boxes(
    features: Floats,
    begins: Ints,
    lengths: Ints,
    edges: Doubles,
    origin: Doubles,
    unit: float,
    start: int,
    stop: int,
    low: Bytes,
    high: Bytes,
) -> None:
    """Boxes of the candidates ``start`` to ``stop``, see `SearchIndex`."""
    for at in range(start, stop):
        for cell in range(len(edges) - 1):
            first = begins[at] + cell_start(edges, cell, lengths[at])
            last = begins[at] + cell_end(edges, cell, lengths[at])
            for d in range(features.shape[1]):
                smallest = largest = features[first, d]
                for frame in range(first + 1, last + 1):
                    smallest = min(smallest, features[frame, d])
                    largest = max(largest, features[frame, d])
                # what is out of range is boxed at its end, and queries are held to the range:
                # gaps can only become smaller
                below = np.floor((np.float64(smallest) - origin[d]) / unit - 1e-6)
                above = np.ceil((np.float64(largest) - origin[d]) / unit + 1e-6)
                low[cell, d, at] = np.uint8(min(max(below, 0.0), 255.0))
                high[cell, d, at] = np.uint8(min(max(above, 0.0), 255.0))


@kernel
def cells_met(
    edges: Doubles, i_first: int, i_last: int, n: int, shortest: int, longest: int
) -> tuple[int, int]:
    """First and last cell that query frames can be warped to, in candidates of these lengths."""
    first, last = len(edges) - 2, 0
    for m in range(shortest, longest + 1):
        while cell_start(edges, first, m) > max(0, first_frame(i_first, n, m)):
            first -= 1
        while cell_end(edges, last, m) < min(m - 1, last_frame(i_last, n, m)):
            last += 1
    return first, last


@kernel
def square_gap(
    low: np.uint8, high: np.uint8, below: np.uint8, above: np.uint8, most: np.uint8
) -> np.uint16:
    """Squared distance of two ranges, in 16 bits: vectors of bytes, hence the many casts."""
    over = np.uint8(max(low, above) - above)
    under = np.uint8(below - min(high, below))
    gap = np.uint16(min(max(over, under), most))
    return np.uint16(gap * gap)


@kernel
def join_cells(low: Bytes, high: Bytes, begin: int, count: int, lows: Bytes, highs: Bytes) -> None:
    """Boxes of 1, 2, 4 and 8 cells in a row, of ``count`` candidates from ``begin`` on.

    Any run of cells is the union of two of these. ``lows`` and ``highs`` are
    (4, cells, D, candidates).
    """
    for cell, d in np.ndindex(low.shape[0], low.shape[1]):
        c, e = _U(cell), _U(d)
        for x in range(_U(count)):
            lows[_U(0), c, e, x] = low[c, e, _U(begin) + x]
            highs[_U(0), c, e, x] = high[c, e, _U(begin) + x]
    for level in range(1, 4):
        size = 2 ** (level - 1)
        for cell, d in np.ndindex(low.shape[0] - 2 * size + 1, low.shape[1]):
            here, c, e, other = _U(level), _U(cell), _U(d), _U(cell + size)
            for x in range(_U(count)):
                lows[here, c, e, x] = min(
                    lows[here - _U(1), c, e, x], lows[here - _U(1), other, e, x]
                )
                highs[here, c, e, x] = max(
                    highs[here - _U(1), c, e, x], highs[here - _U(1), other, e, x]
                )


@kernel
def part_gaps(
    lows: Bytes,
    highs: Bytes,
    first: int,
    last: int,
    below: Bytes,
    above: Bytes,
    most: int,
    start: int,
    count: int,
    gaps: Codes,
) -> None:
    """Squared distances of a part of a query to the boxes of the cells ``first`` to ``last``.

    See `join_cells` for the boxes, of which ``count`` from ``start`` on are wanted.
    """
    level = 0
    while level < 3 and 2 ** (level + 1) <= last - first + 1:
        level += 1
    v, one, two = _U(level), _U(first), _U(last + 1 - 2**level)
    for x in range(_U(count)):
        gaps[x] = np.uint16(0)
    for d in range(_U(len(below))):
        b, a, limit = below[d], above[d], np.uint8(most)
        for x in range(_U(count)):
            at = _U(start) + x
            low = min(lows[v, one, d, at], lows[v, two, d, at])
            high = max(highs[v, one, d, at], highs[v, two, d, at])
            gaps[x] = np.uint16(gaps[x] + square_gap(low, high, b, a, limit))


@kernel
def box_bounds(
    low: Bytes,
    high: Bytes,
    edges: Doubles,
    lengths: Ints,
    below: Bytes,
    above: Bytes,
    parts: Ints,
    ranges: Ints,
    cuts: Ints,
    squared_unit: float,
    most: int,
    start: int,
    stop: int,
    bounds: Floats,
) -> None:
    """Lower bounds of the accumulated costs of candidates ``start`` to ``stop`` for many queries.

    A mean of squared distances to a box is at least the squared distance of the mean, so a
    part of the query needs only its mean, and the box of all frames it can be warped to.

    Parameters
    ----------
    low, high : (cells, D, candidates) boxes, see `SearchIndex`
    edges : (cells + 1,) normalised times
    lengths : (candidates,)
    below, above : (queries, parts, D) enclose the mean of the query's features over that part,
        in the units of the boxes
    parts : (queries, parts + 1) first query frame of each part, and the query's length
    ranges : (queries, 2) candidates of a length that may be warped
    cuts : (parts,) which of ``bounds`` is the sum from this part on, -1 for none
    squared_unit : of the boxes
    most : gaps are held to this, so that their squares add up in 16 bits
    bounds : (queries, cuts, candidates of the query) output
    """
    width = low.shape[1]
    lows = np.empty((4, len(low), width, _CHUNK), np.uint8)
    highs = np.empty((4, len(low), width, _CHUNK), np.uint8)
    gaps = np.empty(_CHUNK, np.uint16)
    sums = np.empty(_CHUNK, np.float32)
    for begin in range(start, stop, _CHUNK):
        end = min(begin + _CHUNK, stop)
        join_cells(low, high, begin, end - begin, lows, highs)
        for query in range(len(ranges)):
            first, last = max(begin, ranges[query, 0]), min(end, ranges[query, 1])
            if first >= last:
                continue
            count, out = _U(last - first), _U(first - ranges[query, 0])
            n = parts[query, -1]
            sums[:] = 0
            for part in range(below.shape[1] - 1, -1, -1):
                frames = parts[query, part + 1] - parts[query, part]
                if frames:
                    one, two = cells_met(
                        edges,
                        parts[query, part],
                        parts[query, part + 1] - 1,
                        n,
                        lengths[first],
                        lengths[last - 1],
                    )
                    part_gaps(
                        lows,
                        highs,
                        one,
                        two,
                        below[query, part],
                        above[query, part],
                        most,
                        first - begin,
                        last - first,
                        gaps,
                    )
                    weight = np.float32(frames * squared_unit)
                    for x in range(count):
                        sums[x] += weight * np.float32(gaps[x])
                if cuts[part] >= 0:
                    for x in range(count):
                        bounds[_U(query), _U(cuts[part]), out + x] = sums[x]


@kernel
def lowest(bounds: Floats, count: int) -> Ints:
    """Positions of the ``count`` lowest bounds below `UNREACHED`, fewer where there are fewer."""
    positions = np.empty(count, np.int64)
    found = 0
    highest = UNREACHED
    for position in range(len(bounds)):
        if bounds[position] < highest:
            at = min(found, count - 1)
            found = min(found + 1, count)
            while at > 0 and bounds[positions[at - 1]] > bounds[position]:
                positions[at] = positions[at - 1]
                at -= 1
            positions[at] = position
            if found == count:
                highest = bounds[positions[count - 1]]
    return positions[:found]
