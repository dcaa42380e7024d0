"""A BVH file as it stands: hierarchy, rows of channel values, frame time."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NoReturn

from usdhand.errors import InputError
from usdhand.formats.bvh.hierarchy import Hierarchy, line_at, parse_hierarchy
from usdhand.formats.bvh.numbers import RowError, compiled_rows, plain_rows
from usdhand.motion import Problem
from usdhand.motion.rotations import Array

# Bytes from which the compiled parser is used: loading it first takes a second.
LARGE, LARGE_ONCE_LOADED = 40_000_000, 4_000_000
HEAD = 1 << 20  # bytes that hold nearly every hierarchy

_MOTION = re.compile(rb"\bMOTION\b", re.IGNORECASE)

_FRAMES = re.compile(rb"\s*frames\s*:?\s*(\S+)", re.IGNORECASE)
_FRAME_TIME = re.compile(rb"\s*frame\s*time\s*:?\s*(\S+)[^\S\r\n]*(?:\r\n|\r|\n)?", re.IGNORECASE)

# Rates that people mean, the more usual of two neighbours first.
_USUAL_FPS = (
    *(30.0, 60.0, 24.0, 25.0, 50.0, 120.0, 100.0, 240.0, 15.0, 12.0, 48.0, 90.0, 20.0, 10.0),
    *(200.0, 250.0, 72.0, 75.0, 80.0, 96.0, 125.0, 144.0, 150.0, 180.0, 300.0, 360.0, 480.0),
    *(500.0, 1000.0),
    *(rate * 1000 / 1001 for rate in (30.0, 60.0, 24.0, 120.0)),
)
SLOWEST_FPS, FASTEST_FPS = 0.1, 10_000.0


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
            data = file.read(HEAD)
            if not _MOTION.search(data):
                data += file.read()
            hierarchy = parse_hierarchy(data, path)
            declared, time, start = _motion_header(data, hierarchy.motion, path)
            fps, problems = frame_rate(time)
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
        message = f"the file declares {declared} frames and has {found}: all are read"
        problems = (*problems, Problem("more-frames", message))
    return BvhFile(hierarchy, rows, fps, problems)


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
        fail(f"'{_shown(frames[1])}' is no number of frames", frames.start(1))
    time = _FRAME_TIME.match(data, frames.end())
    if time is None:
        fail("no 'Frame Time:' after 'Frames:'", frames.end())
    seconds = _decimal(time[1])
    if not Decimal(1) / Decimal(FASTEST_FPS) <= seconds <= Decimal(1) / Decimal(SLOWEST_FPS):
        fail(f"'{_shown(time[1])}' is no usable time of a frame in seconds", time.start(1))
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


def frame_rate(time: str) -> tuple[float, tuple[Problem, ...]]:
    """Frames a second of a frame time, as it is written: ``0.0333`` is 30, not 30.03.

    The rate is that of the usual ones whose frame time, rounded or cut off to the digits written,
    is this; whole ones are preferred to those of NTSC video, and near ones to far ones.
    """
    written = Decimal(time)
    exponent = written.as_tuple().exponent
    digit = 10.0**exponent if isinstance(exponent, int) else 0.0
    seconds = float(written)
    # The other tolerance is what a float32 leaves of a frame time.
    within = min(max(digit, 2e-7 * seconds), 0.2 * seconds) * (1 + 1e-9)
    if not any(abs(1.0 / fps - seconds) < 1e-9 * seconds for fps in _USUAL_FPS):
        meant = [fps for fps in _USUAL_FPS if abs(1.0 / fps - seconds) < within]
        whole = [fps for fps in meant if fps == int(fps)] or meant
        if whole:
            fps = min(whole, key=lambda fps: abs(1.0 / fps - seconds))
            if abs(fps * seconds - 1.0) < 1e-6:  # rounding that nobody sees
                return fps, ()
            message = f"a frame time of {time} s is read as {fps:.5g} frames a second"
            return fps, (Problem("guessed-fps", message, severity="note"),)
        return 1.0 / seconds, ()
    return min(_USUAL_FPS, key=lambda fps: abs(1.0 / fps - seconds)), ()
