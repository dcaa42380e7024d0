"""Paths of files that belong together: relative ones that hold by every way, and pairs."""

from __future__ import annotations

import os
from pathlib import Path

MOTION_SUFFIX = ".motion.usdc"


def motion_crate(layer: Path) -> Path:
    """Where the motion of an ascii layer is kept."""
    return layer.with_name(f"{layer.stem}{MOTION_SUFFIX}")


def written_files(output: Path, *, flatten: bool = False) -> list[Path]:
    """All files that a result may consist of."""
    beside = output.suffix.lower() == ".usda" and not flatten
    return [output, *([motion_crate(output)] if beside else [])]


def relative_path(target: Path, folder: Path) -> str | None:
    """How a file in ``folder`` refers to ``target``, None where only an absolute path will do.

    USD takes ``..`` to be the folder above in the text of a path, the system that above the real
    folder. Where a folder is a symbolic link the two differ, so that a path must lead to the same
    file from the folder as it is given and from the real one.
    """
    folders = [os.path.abspath(folder), os.path.realpath(folder)]  # noqa: PTH100
    wanted = os.path.realpath(target)
    for goal in (os.path.abspath(target), wanted):  # noqa: PTH100
        ways = [way for start in folders if (way := _way(goal, start)) is not None]
        holding = [
            way
            for way in ways
            if all(os.path.realpath(os.path.normpath(f"{f}/{way}")) == wanted for f in folders)
        ]
        if holding:
            return min(holding, key=lambda way: way.count("/"))
    return None


def _way(target: str, folder: str) -> str | None:
    try:
        return Path(os.path.relpath(target, folder)).as_posix()
    except ValueError:  # another drive
        return None
