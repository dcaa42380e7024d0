"""Inputs that can be read at all: files, not folders, pipes or devices, and of a sensible size."""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, NoReturn

MOST_TEXT = 100_000_000  # bytes of a text that is read as a whole: a report of hours of motion


def why_no_file(path: str | Path) -> str:
    """Why a path cannot be read as a file: "no such file", "it is a folder"; "" if it can.

    What is neither file nor folder (a pipe, a device) would be waited for without end.
    """
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116  (texts too)
    except FileNotFoundError:
        return "no such file"
    except (OSError, ValueError) as error:
        return f"cannot be read: {getattr(error, 'strerror', None) or 'no such name'}"
    if stat.S_ISDIR(mode):
        return "it is a folder"
    return "" if stat.S_ISREG(mode) else "it is neither a file nor a folder"


def is_text(name: str) -> bool:
    """Whether a name can be written as UTF-8: bytes that are none, and half a character, cannot."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def read_text(path: Path, most: int = MOST_TEXT) -> str:
    """Read a whole text file.

    Raises
    ------
    OSError
        if it is no file, cannot be read, or has more than ``most`` bytes; ``strerror`` says why.
    UnicodeDecodeError
        if it is not UTF-8.
    """
    why = why_no_file(path)
    if not why and path.stat().st_size > most:
        why = f"it has more than {most // 1_000_000 or 1} MB"
    if why:
        raise OSError(0, why, str(path))
    with path.open(encoding="utf-8", newline="") as file:  # as it is: a CSV tells line ends apart
        return file.read()


def read_json(path: Path) -> Any:
    """Read a JSON file whose numbers are finite and whose texts are text.

    Raises
    ------
    OSError
        see `read_text`.
    ValueError
        if it is no such JSON; the message says why.
    """
    text = read_text(path)
    try:
        value = json.loads(
            text, parse_constant=_no_number, parse_float=_finite, parse_int=_short_integer
        )
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error
    if "\\ud" in text.lower():  # half of a surrogate pair is no text
        json.dumps(value, ensure_ascii=False).encode()
    return value


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _no_number(text[:20])


def _short_integer(text: str) -> int:
    return int(text) if len(text) < 20 else _no_number(f"{text[:20]}...")
