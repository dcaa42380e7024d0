"""Outputs that are whole or not there, and never an input."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from usdhand.errors import OutputError


def check_output(
    output: Path, inputs: Iterable[str | Path], force: bool, suffixes: Iterable[str]
) -> None:
    """Refuse an output before any work is done; see `check_outputs`."""
    check_outputs([output], inputs, force, suffixes)


def check_outputs(
    outputs: Sequence[Path], inputs: Iterable[str | Path], force: bool, suffixes: Iterable[str]
) -> None:
    """Refuse outputs before any work is done.

    Raises
    ------
    OutputError
        if the format of one is unknown, it is one of the inputs, it exists and ``force`` is not
        given, or its folder is missing or read-only.
    """
    suffixes = tuple(suffixes)
    for output in outputs:
        if output.suffix.lower() not in suffixes:
            raise OutputError(
                f"{output}: cannot write '{output.suffix}' files; use one of {', '.join(suffixes)}."
            )
    own = {found for path in inputs if (found := _identity(path)) is not None}
    for output in outputs:
        identity = _identity(output)
        if identity is not None and identity in own:
            raise OutputError(f"{output} is an input of this command; inputs are never changed.")
        if output.is_dir():
            raise OutputError(f"{output} is a folder; give a file.")
        if identity is not None and not output.is_file():
            raise OutputError(f"{output} is a pipe or a device; give a file.")
        if identity is not None and not force:
            raise OutputError(f"{output} exists; use --force to replace it.")
    for folder, output in {o.absolute().parent: o for o in reversed(outputs)}.items():
        if not folder.is_dir():
            raise OutputError(f"{folder}: no such folder to write {output.name} to.")
        _check_writable(folder)


def _identity(path: str | Path) -> tuple[int, int] | None:
    """What tells a file from others, whatever its path; None for what is not there."""
    try:
        found = os.stat(path)  # noqa: PTH116  (texts too)
    except (OSError, ValueError):
        return None
    return found.st_dev, found.st_ino


def check_folder(folder: Path) -> None:
    """Refuse an output folder that cannot be made, before any work is done.

    Raises
    ------
    OutputError
        if its nearest existing parent is a file or read-only.
    """
    parent = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists())
    if not parent.is_dir():
        raise OutputError(f"{parent} is a file; several outputs need a folder.")
    _check_writable(parent)


def make_folder(folder: Path) -> None:
    """Make a folder and its parents, if they are not there.

    Raises
    ------
    OutputError
        if that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made ({error.strerror}).") from error


def _check_writable(folder: Path) -> None:
    try:
        # Not os.access: it tells nothing for root, nor on network drives.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot write there ({error.strerror}).") from error
