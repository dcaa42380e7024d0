"""Compiled: every candidate against every query, without lower bounds. Imported late.

Squared distances are made of products, |q|^2 + |c|^2 - 2 q c, which takes half of the operations of
differences; what that costs in exactness is `Query.error`.
"""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Codes, Doubles, Floats, Groups, Ints, kernel
from usdhand.search.index import CODES, UNROLL
from usdhand.search.tiles import (
    LANES,
    PADDING,
    UNREACHED,
    arrive,
    end_row,
    first_frame,
    init_state,
    lane_costs,
    last_frame,
    workspace,
)

_U = np.uint64
_MIDDLE = np.float32(CODES / 2)
_NARROWINGS = 16  # how often to look which cells of a tile are beyond the k-th best


@kernel
def scan(
    frames: Floats,
    squares: Floats,
    parts: Ints,
    ranges: Ints,
    slacks: Doubles,
    margins: Doubles,
    errors: Doubles,
    excluded: Groups,
    k: int,
    codes: Codes,
    step: Floats,
    begins: Ints,
    lengths: Ints,
    groups: Groups,
    start: int,
    stop: int,
    worst: Floats,
    costs: Floats,
) -> None:
    """Accumulated costs of candidates ``start`` to ``stop`` for many queries.

    Cells that cost more than the k-th best are no part of a better path: rows are narrowed to what
    is left, and end where nothing is.

    Parameters
    ----------
    frames : queries one after the other, from the middle of the codes
    squares : (frames,) their squared lengths
    parts : where each query begins and ends
    ranges : (queries, 2) candidates of a length that may be warped
    slacks, margins, errors : (queries,) see `Query`
    excluded : (queries, any) groups not allowed, rising
    codes, step, begins, lengths, groups : see `SearchIndex`
    worst : (queries,) the k-th best cost so far, shared by all threads; whichever of them writes
        last, it is that of k candidates, so that no result depends on it
    costs : (queries, candidates of the query) output, left alone for those excluded and those
        that are further away than k others
    """
    tile, state, local = workspace(frames.shape[1] + 1, lengths[stop - 1])
    best = np.full((len(ranges), k), UNREACHED)
    found = np.empty(LANES, np.float32)
    lane_begins = np.empty(LANES, np.int64)
    lane_lengths = np.empty(LANES, np.int64)
    for begin in range(start, stop, LANES):
        for lane in range(LANES):  # lanes left over repeat the last candidate
            lane_begins[lane] = begins[min(begin + lane, stop - 1)]
            lane_lengths[lane] = lengths[min(begin + lane, stop - 1)]
        fill_products(codes, step, lane_begins, lane_lengths, lane_lengths[-1], tile)
        for query in range(len(ranges)):
            first = max(begin, ranges[query, 0])
            last = min(begin + LANES, stop, ranges[query, 1])
            if first >= last:
                continue
            own = frames[parts[query] : parts[query + 1]]
            own_squares = squares[parts[query] : parts[query + 1]]
            n, shortest, longest = len(own), lengths[first], lengths[last - 1]
            kth = max(min(best[query, -1], worst[query]) + errors[query], 0.0)
            limit = (np.sqrt(kth * slacks[query]) + margins[query]) ** 2 * slacks[query]
            limit += errors[query]
            low, high = 0, longest
            init_state(state)
            for narrowing in range(_NARROWINGS):
                row_first, row_last = low, high
                for i in range(n * narrowing // _NARROWINGS, n * (narrowing + 1) // _NARROWINGS):
                    row_first = max(first_frame(i, n, shortest), low)
                    row_last = min(last_frame(i, n, longest), high)
                    if row_first > row_last:
                        break
                    advance_products(own, own_squares, i, tile, row_first, row_last, state, local)
                    high = row_last + 2
                if n * (narrowing + 1) // _NARROWINGS:
                    row = n * (narrowing + 1) // _NARROWINGS - 1
                    low, high = within(state, row, row_first, row_last, limit)
                if low > high:
                    break
                high += 2
            else:
                lane_costs(state, n, n, shortest, longest, lane_lengths, found)
                for position in range(first, last):
                    lane = position - begin
                    reached = low < lane_lengths[lane] <= high
                    if reached and not is_excluded(groups[position], excluded[query]):
                        costs[query, position - ranges[query, 0]] = found[lane]
                        insert(best[query], found[lane])
                if best[query, -1] < worst[query]:
                    worst[query] = best[query, -1]


@kernel
def fill_products(
    codes: Codes, step: Floats, begins: Ints, lengths: Ints, stop: int, tile: Floats
) -> None:
    """Like `fill_tile`: -2 times the frames from the middle of the codes, and their squares."""
    width = codes.shape[1]
    for j in range(stop):
        for lane in range(LANES):
            at, frame, square = _U(j * LANES + lane), _U(begins[lane] + j), np.float32(0)
            if j < lengths[lane]:
                for d in range(_U(width)):
                    value = (np.float32(codes[frame, d]) - _MIDDLE) * step[d]
                    tile[d, at] = np.float32(-2) * value
                    square += value * value
            else:
                for d in range(_U(width)):
                    tile[d, at] = 0.0
                square = PADDING
            tile[_U(width), at] = square


@kernel
def advance_products(
    query: Floats,
    squares: Floats,
    i: int,
    tile: Floats,
    first: int,
    last: int,
    state: Floats,
    local: Floats,
) -> None:
    """Like `advance`, on a tile of `fill_products`."""
    width = _U((last - first + 1) * LANES)
    base = _U(first * LANES)
    row, old, new = _U(i), _U(2 * ((i + 1) % 2)), _U(2 * (i % 2))
    final = _U(query.shape[1] - UNROLL)
    square, norms = squares[row], _U(query.shape[1])
    for x in range(width):
        local[x] = square + tile[norms, base + x]
    for d in range(_U(0), final, _U(UNROLL)):
        q0, q1 = query[row, d], query[row, d + _U(1)]
        q2, q3 = query[row, d + _U(2)], query[row, d + _U(3)]
        for x in range(width):
            at = base + x
            cost = local[x] + q0 * tile[d, at] + q1 * tile[d + _U(1), at]
            local[x] = cost + q2 * tile[d + _U(2), at] + q3 * tile[d + _U(3), at]
    q0, q1 = query[row, final], query[row, final + _U(1)]
    q2, q3 = query[row, final + _U(2)], query[row, final + _U(3)]
    for x in range(width):
        at = base + x
        cost = local[x] + q0 * tile[final, at] + q1 * tile[final + _U(1), at]
        cost = cost + q2 * tile[final + _U(2), at] + q3 * tile[final + _U(3), at]
        arrive(state, old, new, at, cost)
    end_row(state, new, base, width)


@kernel
def within(state: Floats, row: int, first: int, last: int, limit: float) -> tuple[int, int]:
    """First and last cell of a row, of ``first`` to ``last``, where a lane is within the limit.

    The first is behind the last where there is none.
    """
    arrived = 1 + 2 * (row % 2)
    while first <= last and lowest_lane(state, arrived, first) > limit:
        first += 1
    while last > first and lowest_lane(state, arrived, last) > limit:
        last -= 1
    return first, last


@kernel
def lowest_lane(state: Floats, arrived: int, frame: int) -> float:
    """Least cost of the lanes at a candidate frame."""
    row, base = _U(arrived), _U((frame + 2) * LANES)
    low: float = state[row, base]
    for lane in range(_U(LANES)):
        low = min(low, state[row, base + lane])
    return low


@kernel
def insert(best: Floats, cost: float) -> None:
    """Keep the smallest costs in rising order."""
    at = len(best) - 1
    if cost >= best[at]:
        return
    while at > 0 and best[at - 1] > cost:
        best[at] = best[at - 1]
        at -= 1
    best[at] = cost


@kernel
def is_excluded(group: int, excluded: Groups) -> bool:
    """True for a group that the query may not be answered from."""
    at = np.searchsorted(excluded, group)
    return bool(at < len(excluded) and excluded[at] == group)
