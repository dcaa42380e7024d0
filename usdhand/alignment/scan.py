"""Compiled: every candidate against every query, without lower bounds. Imported late."""

from __future__ import annotations

import numpy as np

from usdhand.alignment.compiled import Codes, Doubles, Floats, Groups, Ints, kernel
from usdhand.alignment.tiles import (
    LANES,
    NEVER,
    advance,
    fill_tile,
    first_frame,
    lane_costs,
    last_frame,
    rooms,
    set_out,
)

_LOOKS = 12  # how often to look whether all lanes of a tile are beyond the k-th best


@kernel
def scan(
    frames: Floats,
    parts: Ints,
    ranges: Ints,
    slacks: Doubles,
    margins: Doubles,
    excluded: Groups,
    k: int,
    codes: Codes,
    step: Floats,
    begins: Ints,
    lengths: Ints,
    groups: Groups,
    start: int,
    stop: int,
    costs: Floats,
) -> None:
    """Accumulated costs of candidates ``start`` to ``stop`` for many queries.

    Parameters
    ----------
    frames, parts : queries one after the other, and where each begins and ends
    ranges : (queries, 2) candidates of a length that may be warped
    slacks, margins : (queries,) see `Query`
    excluded : (queries, any) groups not allowed
    codes, step, begins, lengths, groups : see `SearchIndex`
    costs : (queries, candidates of the query) output, left alone for those excluded and those
        that are further away than k others of ``start`` to ``stop``
    """
    tile, state, local = rooms(frames.shape[1], lengths[stop - 1])
    best = np.full((len(ranges), k), NEVER)
    found = np.empty(LANES, np.float32)
    lane_begins = np.empty(LANES, np.int64)
    lane_lengths = np.empty(LANES, np.int64)
    for begin in range(start, stop, LANES):
        for lane in range(LANES):  # lanes left over repeat the last candidate
            lane_begins[lane] = begins[min(begin + lane, stop - 1)]
            lane_lengths[lane] = lengths[min(begin + lane, stop - 1)]
        fill_tile(codes, step, lane_begins, lane_lengths, lane_lengths[-1], tile)
        for query in range(len(ranges)):
            first = max(begin, ranges[query, 0])
            last = min(begin + LANES, stop, ranges[query, 1])
            if first >= last:
                continue
            own = frames[parts[query] : parts[query + 1]]
            n, shortest, longest = len(own), lengths[first], lengths[last - 1]
            limit = (np.sqrt(best[query, -1] * slacks[query]) + margins[query]) ** 2
            set_out(state)
            for look in range(_LOOKS):
                rows = n * (look + 1) // _LOOKS
                for i in range(n * look // _LOOKS, rows):
                    row_first, row_last = first_frame(i, n, shortest), last_frame(i, n, longest)
                    advance(own, i, tile, row_first, row_last, state, local)
                if rows:
                    lane_costs(state, rows, n, shortest, longest, lane_lengths, found)
                    if found[first - begin : last - begin].min() > limit * slacks[query]:
                        break
            else:
                for position in range(first, last):
                    if not is_excluded(groups[position], excluded[query]):
                        costs[query, position - ranges[query, 0]] = found[position - begin]
                        insert(best[query], found[position - begin])


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
    found = False
    for other in excluded:
        found |= group == other
    return found
