"""A BVH file as it stands: hierarchy, rows of channel values, frame time."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NoReturn

from usdhand.errors import InputError
from usdhand.formats.bvh.encoding import encoding_of, is_wide
from usdhand.formats.bvh.hierarchy import Hierarchy, line_at, parse_hierarchy
from usdhand.formats.bvh.numbers import RowError, compiled_rows, plain_rows
from usdhand.motion.rotations import Array
from usdhand.motion.timing import FASTEST_FPS, SLOWEST_FPS, rate_of_frame_time
from usdhand.problems import Problem

# Bytes from which the compiled parser is used: loading it first takes a second.
LARGE, LARGE_ONCE_LOADED = 40_000_000, 4_000_000
HEAD_BYTES = 1 << 20  # bytes that hold nearly every hierarchy

_MOTION = re.compile(rb"\bMOTION\b", re.IGNORECASE)

_FRAMES = re.compile(rb"\s*frames\s*:?\s*(\S+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*frame\s*time\s*:?\s*(\S+)[^\S\r\n]*(?:\r\n|\r|\n)?", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class BvhFile:
    """What a file says, in its own units, axes and degrees; ``rows`` are (frames, channels)."""

    hierarchy: Hierarchy
    rows: Array
    fps: float
    problems: tuple[Problem, ...]


def parse_file(path: Path) -> BvhFile:
    """Read a whole file.

    Raises
    ------
    InputError
        if the file is missing, damaged or cut off, naming the line and frame.
    """
    try:
        with path.open("rb") as file:
            data = file.read(HEAD_BYTES)
            if not _MOTION.search(data):
                data += file.read()
            if is_wide(data):
                raise InputError(f"{path}: the file is UTF-16 text. Save it as UTF-8.")
            encoding, unsure = encoding_of(data)
            hierarchy = parse_hierarchy(data, path, encoding)
            declared, time, start = _motion_header(data, hierarchy.motion, path)
            fps, problems = _frame_rate(time)
            size, shape = path.stat().st_size, (declared, hierarchy.width)
            rows = None
            # A number and what parts it from the next take two bytes.
            if size > _large() and 0 < declared * hierarchy.width <= size // 2:
                file.seek(start)
                rows = compiled_rows(file, shape)
            else:
                data += file.read()
        if rows is None:
            data = path.read_bytes() if size > len(data) else data
            rows = plain_rows(data, start, hierarchy.width)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except RowError as error:
        raise InputError(
            f"{path}, line {line_at(data, error.place)} (frame {error.frame + 1}): {error}."
        ) from error
    found = len(rows)
    if hierarchy.width and found < declared:
        raise InputError(
            f"{path}, line {line_at(data, len(data.rstrip()))}: the file is cut off after frame "
            f"{found} of {declared}. Export it again, or set 'Frames: {found}' if it ends there."
        )
    if hierarchy.width and found > declared:
        message = f"the file declares {declared} frames and has {found}; all of them are read"
        problems = (*problems, Problem("more-frames", message))
    return BvhFile(hierarchy, rows, fps, (*unsure, *problems))


def _large() -> int:
    return LARGE_ONCE_LOADED if "numba" in sys.modules else LARGE


def _motion_header(data: bytes, position: int, path: Path) -> tuple[int, str, int]:
    """Frames declared, frame time as written, and where the rows start."""

    def fail(what: str, place: int) -> NoReturn:
        raise InputError(f"{path}, line {line_at(data, place)}: {what}.")

    frames = _FRAMES.match(data, position)
    if frames is None:
        fail("no 'Frames:' after MOTION", position)
    if not re.fullmatch(rb"\d{1,18}", frames[1]):
        fail(f"'{_shown(frames[1])}' is not a number of frames", frames.start(1))
    time = _FRAME_TIME.match(data, frames.end())
    if time is None:
        fail("no 'Frame Time:' after 'Frames:'", frames.end())
    seconds = _decimal(time[1])
    if not Decimal(1) / Decimal(FASTEST_FPS) <= seconds <= Decimal(1) / Decimal(SLOWEST_FPS):
        fail(f"'{_shown(time[1])}' is not a usable frame time in seconds", time.start(1))
    return int(frames[1]), time[1].decode(), time.end()


def _decimal(text: bytes) -> Decimal:
    """A number as written, 0 for what is none."""
    try:
        value = Decimal(text.decode("latin-1"))
    except InvalidOperation:
        return Decimal(0)
    return value if value.is_finite() and b"_" not in text and text.isascii() else Decimal(0)


def _shown(text: bytes) -> str:
    return text[:40].decode("latin-1")


def _frame_rate(time: str) -> tuple[float, tuple[Problem, ...]]:
    fps, guessed = rate_of_frame_time(time)
    message = f"a frame time of {time} s is read as {fps:.5g} frames a second"
    return fps, (Problem("guessed-fps", message, severity="note"),) if guessed else ()
