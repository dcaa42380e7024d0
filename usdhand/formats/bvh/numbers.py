"""The rows of numbers of a BVH file, as an array.

Two parsers: one in plain Python knows every odd case and what to say about it; a compiled one is
twenty times faster on large files that are as they should be, and leaves all others to the first.
"""

from __future__ import annotations

import math
import re
from array import array
from functools import cache
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array

LARGEST_VALUE = 1e9  # what is beyond is damage, and squares of it overflow
CHUNK = 1 << 20  # bytes; small enough to stay in the processor's cache

_LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"\S+")
_COMMENTS = (b"#", b"//", b";")


class RowError(ValueError):
    """What is wrong, ``place`` in the file and ``frame`` (from 0)."""

    def __init__(self, what: str, place: int, frame: int) -> None:
        super().__init__(what)
        self.place, self.frame = place, frame


def plain_rows(data: bytes, start: int, width: int) -> Array:
    """Numbers from ``start`` to the end of a file; shape (rows, width).

    A row may go over several lines; each begins on a line of its own.

    Raises
    ------
    RowError
        at the first thing that is no usable number, and at a row of another length.
    """
    values = array("d")
    filled, row_start, frame = 0, start, 0

    def wrong() -> RowError:
        return RowError(f"{filled} numbers where there are {width} channels", row_start, frame)

    for line in _LINE.finditer(data, start):
        words = line[0].split()
        if not words or words[0].startswith(_COMMENTS):
            continue
        if not filled:
            row_start = line.start()
        filled += len(words)
        if filled > width:
            raise wrong()
        values.extend(_floats(words, line, frame))
        if filled == width:
            filled, frame = 0, frame + 1
    if filled:
        raise wrong()
    return np.frombuffer(values, dtype=np.float64).reshape(frame, width)


def _floats(words: list[bytes], line: re.Match[bytes], frame: int) -> list[float]:
    try:
        row = [float(word) for word in words]
        # A sum knows of any not-a-number; without one, the largest and smallest are true.
        if math.isfinite(sum(row)) and max(map(abs, row)) <= LARGEST_VALUE and b"_" not in line[0]:
            return row
    except ValueError:
        pass
    for word in _WORD.finditer(line[0]):
        if not _usable(word[0]):
            text = word[0][:40].decode("latin-1")
            place = line.start() + word.start()
            raise RowError(f"'{text}' is not a usable number", place, frame)
    raise AssertionError("a line of numbers that cannot be read has a word that is not a number")


def _usable(word: bytes) -> bool:
    try:
        return b"_" not in word and abs(float(word)) <= LARGEST_VALUE
    except ValueError:
        return False


def compiled_rows(file: BinaryIO, shape: tuple[int, int]) -> Array | None:
    """Numbers of a regular file of just so many rows, a row a line; None for any other.

    ``file`` stands where the rows start.
    """
    rows, parse = np.empty(shape), _kernel()
    values = rows.reshape(-1)
    buffer = bytearray(CHUNK + 1)  # whole lines, and the beginning of the next one
    view, text = memoryview(buffer), np.frombuffer(buffer, dtype=np.uint8)
    filled = kept = 0
    while count := file.readinto(view[kept:CHUNK]):  # type: ignore[attr-defined]
        size = kept + count
        end = buffer.rfind(b"\n", 0, size) + 1
        filled = parse(text, end, values, filled, shape[1])
        if filled < 0:
            return None
        kept = size - end
        buffer[:kept] = buffer[end:size]
    if kept == CHUNK:  # a line that does not fit
        return None
    buffer[kept] = ord("\n")
    return rows if parse(text, kept + 1, values, filled, shape[1]) == rows.size else None


def _fill_values(
    text: NDArray[np.uint8], length: int, values: NDArray[np.float64], filled: int, width: int
) -> int:
    """Parse whole lines into ``values`` from ``filled`` on; how many are filled then.

    -1 for what is not ``width`` numbers a line. Up to 15 digits are read exactly (Clinger 1990: a
    whole number below 2**53 over a power of ten below 10**23 rounds once), more within an ulp.
    """
    powers = 10.0 ** np.arange(23)
    end, one = np.uint64(length), np.uint64(1)  # unsigned: no test for indices below zero
    place, row_end = np.uint64(0), filled + width
    while place < end:
        c = np.int64(text[place])
        if c <= 32:
            if c == 10:
                if filled == row_end:
                    row_end += width
                elif filled != row_end - width:
                    return -1
            elif c == 13:
                if text[place + one] != 10:  # ended lines on machines of another age
                    return -1
            elif c not in (32, 9):
                return -1
            place += one
            continue
        if filled == row_end or filled == len(values):
            return -1
        negative = c == 45
        place += np.uint64((c == 45) | (c == 43))
        begin = place
        mantissa = np.int64(0)
        c = np.int64(text[place]) - 48
        while c >= 0 and c <= 9:
            mantissa = mantissa * 10 + c
            place += one
            c = np.int64(text[place]) - 48
        digits, decimals = np.int64(place - begin), np.int64(0)
        if c == -2:  # the point
            place += one
            begin = place
            c = np.int64(text[place]) - 48
            while c >= 0 and c <= 9:
                mantissa = mantissa * 10 + c
                place += one
                c = np.int64(text[place]) - 48
            decimals = np.int64(place - begin)
            digits += decimals
        if digits == 0 or digits > 18 or c > -16:  # nothing, more than an int64 holds, or a letter
            return -1
        value = float(mantissa) / powers[decimals]
        if value > LARGEST_VALUE:
            return -1
        values[filled] = -value if negative else value
        filled += 1
    return filled


@cache
def _kernel() -> Any:
    """The parser, compiled on first use and kept on disk where that can be written."""
    import numba

    signature = "int64(uint8[::1], int64, float64[::1], int64, int64)"
    try:
        return numba.njit(signature, cache=True, nogil=True, error_model="numpy")(_fill_values)
    except RuntimeError:  # numba: "no locator available"
        return numba.njit(signature, nogil=True, error_model="numpy")(_fill_values)
