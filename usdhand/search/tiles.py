"""Compiled: warps of many candidates at once. Imported late, since numba takes half a second.

A *query* of n frames is warped against *candidates* of m frames; `LANES` candidates go through
the dynamic programme side by side, as one *tile*, so that every inner loop runs over contiguous
float32 and becomes vector instructions. Costs are sums over the query's frames.

Indices inside the hot loops are unsigned: numba wraps negative signed ones, which keeps LLVM from
vectorising. Arrays are not sliced there: each slice costs atomic reference counting.
"""

from __future__ import annotations

import numpy as np

from usdhand.compiled import Codes, Features, Floats, Ints, Moves, kernel
from usdhand.search.index import UNROLL

LANES = 16
UNREACHED = np.float32(1e30)  # the cost of a cell that no path reaches
PADDING = np.float32(1e12)  # a feature after the end of a lane: never part of the best path
_U = np.uint64


@kernel
def first_frame(i: int, n: int, m: int) -> int:
    """First candidate frame that a warp can meet at query frame ``i`` (never stays twice)."""
    return max((i + 1) // 2, m - 1 - 2 * (n - 1 - i))


@kernel
def last_frame(i: int, n: int, m: int) -> int:
    """Last candidate frame that a warp can meet at query frame ``i`` (at most two a frame)."""
    return min(2 * i, m - 1 - (n - 1 - i) // 2)


@kernel
def warp_moves(query: Features, candidate: Features, moves: Moves) -> float:
    """Accumulated cost in float64; the way back in ``moves`` (n, m).

    Two costs a cell: of arriving by a step of 1 or 2, and of arriving in any way, where a stay is
    only allowed after a step. ``moves`` holds the step, plus 4 where staying is the better way.
    """
    n, m = len(query), len(candidate)
    stepped = np.full((2, m + 2), np.inf)  # two columns before the first frame: never reached
    arrived = np.full((2, m + 2), np.inf)
    for i in range(n):
        old, new = (i + 1) % 2, i % 2
        stepped[new] = np.inf
        arrived[new] = np.inf
        for j in range(first_frame(i, n, m), last_frame(i, n, m) + 1):
            local = 0.0
            for d in range(candidate.shape[1]):
                local += (np.float64(query[i, d]) - np.float64(candidate[j, d])) ** 2
            if i == 0:
                arrived[new, 2] = local
                continue
            one, two = arrived[old, j + 1], arrived[old, j]
            stepped[new, j + 2] = min(one, two) + local
            stay = stepped[old, j + 2] + local
            arrived[new, j + 2] = min(stepped[new, j + 2], stay)
            moves[i, j] = (1 if one <= two else 2) + (4 if stay < stepped[new, j + 2] else 0)
    return float(arrived[(n - 1) % 2, m + 1])


@kernel
def warp_path(query: Features, candidate: Features, path: Ints) -> float:
    """Accumulated cost in float64; ``path`` (n,) gets the candidate frame of each query frame."""
    moves = np.zeros((len(query), len(candidate)), np.int8)
    cost = warp_moves(query, candidate, moves)
    frame = len(candidate) - 1
    path[-1] = frame
    stayed = False
    for i in range(len(query) - 1, 0, -1):
        # before a stay there was a step
        stayed = moves[i, frame] & 4 != 0 and not stayed
        if not stayed:
            frame -= moves[i, frame] & 3
        path[i - 1] = frame
    return cost


@kernel
def warp_paths(
    queries: Features,
    query_spans: Ints,
    candidates: Features,
    candidate_spans: Ints,
    paths: Ints,
    path_begins: Ints,
) -> None:
    """``warp_path`` of many pairs: their spans (pairs, 2) of rows, and where their paths begin."""
    for pair in range(len(query_spans)):
        first, stop = query_spans[pair]
        begin, end = candidate_spans[pair]
        at = path_begins[pair]
        warp_path(queries[first:stop], candidates[begin:end], paths[at : at + stop - first])


@kernel
def fill_tile(
    codes: Codes, step: Floats, begins: Ints, lengths: Ints, stop: int, tile: Floats
) -> None:
    """Frames 0 to ``stop`` of each lane, from the origin, into ``tile`` (D, frames x lanes)."""
    for start in range(0, stop, 4):  # a few frames of all lanes at a time stay in the cache
        for lane in range(LANES):
            begin, length = begins[lane], lengths[lane]
            for j in range(start, min(start + 4, stop)):
                at, frame = _U(j * LANES + lane), _U(begin + j)
                for d in range(_U(0), _U(codes.shape[1]), _U(UNROLL)):
                    e, f, g = d + _U(1), d + _U(2), d + _U(3)
                    if j < length:
                        tile[d, at] = np.float32(codes[frame, d]) * step[d]
                        tile[e, at] = np.float32(codes[frame, e]) * step[e]
                        tile[f, at] = np.float32(codes[frame, f]) * step[f]
                        tile[g, at] = np.float32(codes[frame, g]) * step[g]
                    else:
                        tile[d, at] = tile[e, at] = tile[f, at] = tile[g, at] = PADDING


@kernel
def advance(
    query: Floats, i: int, tile: Floats, first: int, last: int, state: Floats, local: Floats
) -> None:
    """Row ``i`` of the dynamic programme of a tile, for candidate frames ``first`` to ``last``.

    ``state`` (4, cells) holds stepped and arrived costs of even rows, then of odd rows; its
    columns begin two frames before the candidate, and two frames on either side of a row's band
    are set out of reach, which is as far as the next row looks.
    """
    width = _U((last - first + 1) * LANES)
    base = _U(first * LANES)
    row, old, new = _U(i), _U(2 * ((i + 1) % 2)), _U(2 * (i % 2))
    final = _U(query.shape[1] - UNROLL)
    for x in range(width):
        local[x] = 0.0
    for d in range(_U(0), final, _U(UNROLL)):
        q0, q1 = query[row, d], query[row, d + _U(1)]
        q2, q3 = query[row, d + _U(2)], query[row, d + _U(3)]
        for x in range(width):
            e0 = q0 - tile[d, base + x]
            e1 = q1 - tile[d + _U(1), base + x]
            e2 = q2 - tile[d + _U(2), base + x]
            e3 = q3 - tile[d + _U(3), base + x]
            local[x] += e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3
    q0, q1 = query[row, final], query[row, final + _U(1)]
    q2, q3 = query[row, final + _U(2)], query[row, final + _U(3)]
    for x in range(width):
        e0 = q0 - tile[final, base + x]
        e1 = q1 - tile[final + _U(1), base + x]
        e2 = q2 - tile[final + _U(2), base + x]
        e3 = q3 - tile[final + _U(3), base + x]
        cost = local[x] + (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
        arrive(state, old, new, base + x, cost)
    end_row(state, new, base, width)


@kernel
def arrive(state: Floats, old: np.uint64, new: np.uint64, cell: np.uint64, cost: float) -> None:
    """Stepped and arrived costs of a cell with this local cost, from those of the row before.

    ``old`` and ``new`` are where the two rows begin in the state.
    """
    at, one = cell + _U(2 * LANES), _U(1)
    step = min(state[old + one, at - _U(LANES)], state[old + one, at - _U(2 * LANES)]) + cost
    state[new, at] = step
    state[new + one, at] = min(step, state[old, at] + cost)


@kernel
def end_row(state: Floats, new: np.uint64, base: np.uint64, width: np.uint64) -> None:
    """Set two frames on either side of a row's band out of reach."""
    behind = base + width + _U(2 * LANES)
    for x in range(_U(2 * LANES)):
        state[new, base + x] = UNREACHED
        state[new + _U(1), base + x] = UNREACHED
        state[new, behind + x] = UNREACHED
        state[new + _U(1), behind + x] = UNREACHED


@kernel
def init_state(state: Floats) -> None:
    """Ready `state` for the first row."""
    for row in range(4):
        for x in range(8 * LANES):
            state[row, x] = UNREACHED
    for lane in range(LANES):  # as if a stay had led to the first frame: no other may follow
        state[3, LANES + lane] = 0.0


@kernel
def lane_costs(
    state: Floats, stop: int, n: int, shortest: int, longest: int, lengths: Ints, costs: Floats
) -> None:
    """Least cost of each lane before query frame ``stop``; at the end of the lane if that is n."""
    arrived = _U(1 + 2 * ((stop - 1) % 2))
    if stop == n:
        for lane in range(LANES):
            costs[lane] = state[arrived, _U((lengths[lane] + 1) * LANES + lane)]
        return
    costs[:] = UNREACHED
    first, last = first_frame(stop - 1, n, shortest), last_frame(stop - 1, n, longest)
    for j in range(_U(first + 2), _U(last + 3)):
        for lane in range(_U(LANES)):
            costs[lane] = min(costs[lane], state[arrived, j * _U(LANES) + lane])


@kernel
def warp_some(
    query: Floats,
    codes: Codes,
    step: Floats,
    begins: Ints,
    lengths: Ints,
    positions: Ints,
    stop: int,
) -> Floats:
    """Accumulated costs of candidates, up to query frame ``stop``.

    The whole cost where ``stop`` is n; less than that, and it is a lower bound of the whole.
    ``positions`` are in order of length, the order of ``begins`` and ``lengths``.
    """
    costs = np.empty(len(positions), np.float32)
    if not len(positions):
        return costs
    tile, state, local = workspace(query.shape[1], lengths[positions[-1]])
    n = len(query)
    lane_begins = np.empty(LANES, np.int64)
    lane_lengths = np.empty(LANES, np.int64)
    found = np.empty(LANES, np.float32)
    for start in range(0, len(positions), LANES):
        count = min(LANES, len(positions) - start)
        for lane in range(LANES):  # lanes left over repeat the last candidate
            position = positions[start + min(lane, count - 1)]
            lane_begins[lane] = begins[position]
            lane_lengths[lane] = lengths[position]
        shortest, longest = lane_lengths[0], lane_lengths[-1]
        last = last_frame(stop - 1, n, longest)
        fill_tile(codes, step, lane_begins, lane_lengths, last + 1, tile)
        init_state(state)
        for i in range(stop):
            first, last = first_frame(i, n, shortest), last_frame(i, n, longest)
            advance(query, i, tile, first, last, state, local)
        lane_costs(state, stop, n, shortest, longest, lane_lengths, found)
        costs[start : start + count] = found[:count]
    return costs


@kernel
def workspace(width: int, longest: int) -> tuple[Floats, Floats, Floats]:
    """Room for a tile, a state and a row of local costs."""
    cells = (longest + 8 | 1) * LANES  # odd, so that rows do not share cache sets
    return (
        np.zeros((width, cells), np.float32),
        np.empty((4, cells), np.float32),
        np.empty(cells, np.float32),
    )
