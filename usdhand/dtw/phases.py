"""Compiled: the dynamic programme of splice. Import late, numba takes half a second.

*Rows* are frames of the body, *columns* frames of the hand clip; row i may use the columns
``low[i]`` to ``high[i]``, both included, and neither bound ever falls. Accumulated costs are kept
for two rows only; of every cell two bits remember where its path comes from, so that memory is
the band's area / 4 bytes.

A step to the next row or column alone costs what the cell does, or less where the clip that moves
on rests: then only what of its signs is not zero, see `REST_COST`.

Of predecessors with equal cost the diagonal one is taken, then the one in the row before (the hand
clip waits), then the one in the column before (the body waits).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.compiled import Bytes, Doubles, Floats, Ints, kernel

Words = NDArray[np.uint64]
Costs = NDArray[np.int32]

UNREACHED = np.int32(2**30)  # the cost of a cell that no path reaches
BLOCK = 4  # rows and columns of cells that share one turn about the vertical
# What a step in one clip alone costs beside the signs of a frame that rests. It is not free, so
# that clips that rest together go on together.
REST_COST = 2
NEVER_RESTS = -1
_DIAGONAL, _ROW_BEFORE, _COLUMN_BEFORE = 0, 1, 2
_U = np.uint64


@kernel
def phase_path(
    body: Words,
    hand: Words,
    body_windows: Floats,
    hand_windows: Floats,
    low: Ints,
    high: Ints,
    rest_signs: int = NEVER_RESTS,
) -> tuple[Ints, Ints, int]:
    """Least-cost path under the sign cost of Majkowska et al. 2006, equations (1) to (7).

    Signs are given as bits of two words, of those that are positive and those that are negative,
    so that the squared difference of up to 64 signs takes three counts of bits.

    Parameters
    ----------
    body : (2, rows) signs
    hand : (turns, 2, columns) signs after each of these turns about the vertical, see `turn_angles`
    body_windows : (row blocks, 2, n) level coordinates x, z of the markers around the middle of
        every `BLOCK` rows, less their mean
    hand_windows : (2, n, column blocks) likewise
    low, high : (rows,) bounds of the band
    rest_signs : a frame with at most as many signs that are not zero rests, and uses up
        frames of its own clip only

    Returns
    -------
    first, last : (rows,) columns of the path in every row
    cost : sum over the path

    Raises
    ------
    ValueError
        if no path fits in the band, or it leaves the matrix.
    """
    rows, columns = body.shape[1], hand.shape[2]
    if not _passable(low, high, rows, columns):
        raise ValueError("no path fits in the band")
    starts = np.zeros(rows + 1, np.int64)
    for i in range(rows):
        starts[i + 1] = starts[i] + (high[i] - low[i]) // 4 + 1
    moves = np.zeros(starts[rows], np.uint8)
    above = np.full(columns + 1, UNREACHED, np.int32)  # column j is at j + 1
    here = np.full(columns + 1, UNREACHED, np.int32)
    local = np.zeros(columns, np.int32)
    positive, negative = hand[0, 0].copy(), hand[0, 1].copy()
    waits = np.full(columns, UNREACHED, np.int32)  # cost of passing a column within a row
    for j in range(columns):
        waits[j] = _rest_cost(hand[0, 0, j], hand[0, 1, j], rest_signs)
    above[low[0]] = 0  # every path starts in the first cell
    for i in range(rows):
        first, last = low[i], high[i]
        if i % BLOCK == 0 and len(hand) > 1:
            end = high[min(i + BLOCK, rows) - 1]
            _turn_signs(
                body_windows[i // BLOCK], hand_windows, hand, first, end, positive, negative
            )
        _compare(body[0, i], body[1, i], positive, negative, first, last, local)
        down = _rest_cost(body[0, i], body[1, i], rest_signs)
        _accumulate(local, waits, down, above, here, first, last)
        _store_moves(local, down, above, here, first, last, moves, starts[i])
        for j in range(low[max(i - 1, 0)], first + 1):  # columns that the band has left behind
            here[j] = UNREACHED
        above[low[0]] = UNREACHED
        above, here = here, above
    begin, end_ = _backtrack(moves, starts, low, high)
    return begin, end_, above[high[rows - 1] + 1]


@kernel
def _passable(low: Ints, high: Ints, rows: int, columns: int) -> bool:
    """Whether a path that never goes back gets through a band."""
    if len(low) != rows or len(high) != rows or low[0] < 0 or high[-1] >= columns:
        return False
    for i in range(rows):
        if low[i] > high[i]:
            return False
        if i > 0 and not low[i - 1] <= low[i] <= high[i - 1] + 1:
            return False
        if i > 0 and high[i] < high[i - 1]:
            return False
    return True


def turn_angles(count: int) -> Doubles:
    """Angles (count,) in radians that the turns of `phase_path` stand for, a full circle.

    Steps are equal along a square instead of a circle: which of them a cell takes needs neither
    an arctangent nor a root, and no step is larger than 1.3 times their mean.
    """
    t = np.arange(count) * 4.0 / count
    x = np.abs(t - 2.0) - 1.0
    y = 1.0 - np.abs(np.where(t < 3.0, t, t - 4.0) - 1.0)
    return np.asarray(np.arctan2(y, x))


@kernel
def signs_along(vectors: Floats, axes: Floats, limit: float, words: Words) -> None:
    """Put the signs of vectors along axes into words, as their next bits.

    Parameters
    ----------
    vectors : (markers, 3, frames)
    axes : (turns, markers, axes, 3)
    limit : components up to this have the sign 0
    words : (turns, 2, frames) bits of positive and of negative signs, changed in place
    """
    for turn in range(_U(len(axes))):
        for marker in range(_U(axes.shape[1])):
            for k in range(_U(axes.shape[2])):
                ax, ay, az = (
                    axes[turn, marker, k, 0],
                    axes[turn, marker, k, 1],
                    axes[turn, marker, k, 2],
                )
                for t in range(_U(vectors.shape[2])):
                    value = (
                        ax * vectors[marker, 0, t]
                        + ay * vectors[marker, 1, t]
                        + az * vectors[marker, 2, t]
                    )
                    up, down = _U(value > limit), _U(value < -limit)
                    words[turn, 0, t] = (words[turn, 0, t] << _U(1)) | up
                    words[turn, 1, t] = (words[turn, 1, t] << _U(1)) | down


@kernel
def _turn_signs(
    window: Floats,
    hand_windows: Floats,
    hand: Words,
    first: int,
    last: int,
    positive: Words,
    negative: Words,
) -> None:
    """Signs of the hand, turned as it fits the body best, equation (7), for a block of rows."""
    turns = len(hand)
    left, right = first // BLOCK, last // BLOCK
    blocks = right - left + 1
    cosine, sine = np.zeros(blocks, np.float32), np.zeros(blocks, np.float32)
    for k in range(_U(window.shape[1])):
        x, z = window[0, k], window[1, k]
        for b in range(_U(blocks)):
            qx, qz = hand_windows[0, k, b + _U(left)], hand_windows[1, k, b + _U(left)]
            cosine[b] += x * qx + z * qz
            sine[b] += x * qz - z * qx
    quarter = np.float32(0.25 * turns)
    for b in range(blocks):
        length = abs(cosine[b]) + abs(sine[b])
        along = sine[b] / length if length > 0 else np.float32(0.0)
        if cosine[b] < 0:
            along = np.float32(2.0) - along
        turn = int(np.floor(along * quarter + np.float32(0.5))) % turns
        start = (left + b) * BLOCK
        for j in range(max(start, first), min(start + BLOCK, last + 1)):
            positive[j] = hand[turn, 0, j]
            negative[j] = hand[turn, 1, j]


@kernel
def _bits(word: np.uint64) -> np.uint64:
    """Count the bits of a word that are set."""
    pairs = word - ((word >> _U(1)) & _U(0x5555555555555555))
    fours = (pairs & _U(0x3333333333333333)) + ((pairs >> _U(2)) & _U(0x3333333333333333))
    bytes_ = (fours + (fours >> _U(4))) & _U(0x0F0F0F0F0F0F0F0F)
    return (bytes_ * _U(0x0101010101010101)) >> _U(56)


@kernel
def _compare(
    up: np.uint64,
    down: np.uint64,
    positive: Words,
    negative: Words,
    first: int,
    last: int,
    local: Costs,
) -> None:
    """Squared differences of signs, equation (6): 1 beside zero, 4 for opposite ones."""
    for j in range(_U(first), _U(last + 1)):
        p, n = positive[j], negative[j]
        different = _bits(up ^ p) + _bits(down ^ n)
        local[j] = np.int32(different + _U(2) * _bits((up & n) | (down & p)))


@kernel
def sign_costs(body: Words, hand: Words, columns: Ints) -> Costs:
    """Costs (rows,) of the cells that a path of one column a row goes through, equation (6)."""
    costs, one = np.zeros(len(columns), np.int32), np.zeros(1, np.int32)
    for i in range(len(columns)):
        j = columns[i]
        _compare(body[0, i], body[1, i], hand[0, j : j + 1], hand[1, j : j + 1], 0, 0, one)
        costs[i] = one[0]
    return costs


@kernel
def _rest_cost(up: np.uint64, down: np.uint64, rest_signs: int) -> np.int32:
    """Most that a step in one clip alone costs for a frame of these signs."""
    signs = np.int32(_bits(up | down))
    return signs + np.int32(REST_COST) if signs <= rest_signs else UNREACHED


@kernel
def _accumulate(
    local: Costs, waits: Costs, down: np.int32, above: Costs, here: Costs, first: int, last: int
) -> None:
    for j in range(_U(first), _U(last + 1)):
        cost = local[j]
        here[j + _U(1)] = min(above[j] + cost, above[j + _U(1)] + min(cost, down))
    left = UNREACHED
    for j in range(_U(first), _U(last + 1)):
        left = min(here[j + _U(1)], left + min(local[j], waits[j]))
        here[j + _U(1)] = left


@kernel
def _store_moves(
    local: Costs,
    down: np.int32,
    above: Costs,
    here: Costs,
    first: int,
    last: int,
    moves: Bytes,
    offset: int,
) -> None:
    cells = last + 1 - first
    for k in range(_U(cells >> 2)):
        j = _U(first) + (k << _U(2))
        move = _move(local, down, above, here, j) | (
            _move(local, down, above, here, j + _U(1)) << 2
        )
        move |= _move(local, down, above, here, j + _U(2)) << 4
        moves[_U(offset) + k] = np.uint8(move | (_move(local, down, above, here, j + _U(3)) << 6))
    for at in range(cells & ~3, cells):
        move = _move(local, down, above, here, _U(first + at))
        moves[offset + (at >> 2)] |= np.uint8(move << (2 * (at & 3)))


@kernel
def _move(local: Costs, down: np.int32, above: Costs, here: Costs, j: np.uint64) -> int:
    """Where the path to a cell comes from."""
    cost, total = local[j], here[j + _U(1)]
    move = _COLUMN_BEFORE
    if above[j + _U(1)] + min(cost, down) == total:
        move = _ROW_BEFORE
    if above[j] + cost == total:
        move = _DIAGONAL
    return move


@kernel
def _backtrack(moves: Bytes, starts: Ints, low: Ints, high: Ints) -> tuple[Ints, Ints]:
    rows = len(low)
    first, last = np.zeros(rows, np.int64), np.zeros(rows, np.int64)
    i, j = rows - 1, high[rows - 1]
    last[i] = j
    while i > 0 or j > low[0]:
        at = j - low[i]
        move = (moves[starts[i] + at // 4] >> np.uint8(2 * (at % 4))) & 3
        if move == _COLUMN_BEFORE:
            j -= 1
            continue
        first[i] = j
        i -= 1
        if move == _DIAGONAL:
            j -= 1
        last[i] = j
    first[0] = low[0]
    return first, last
