"""Inputs as people give them: files, folders, wildcards."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from usdhand.errors import InputError, UsageError, UsdHandError
from usdhand.formats.paths import MOTION_SUFFIX
from usdhand.formats.suffixes import READABLE, USD_SUFFIXES
from usdhand.options import declared
from usdhand.requests.base import Request, named_inputs


def check_several(name: str, values: object) -> None:
    """Refuse one value where several are taken: a text would be taken for its letters.

    Raises
    ------
    UsageError
        if it is one.
    """
    if isinstance(values, (str, Path)) or not isinstance(values, Iterable):
        one = repr(str(values)) if isinstance(values, (str, Path)) else type(values).__name__
        raise UsageError(f"{name}: several are taken, not {one} alone: give a list.")


def find_files(arguments: Iterable[str], suffixes: Sequence[str] = READABLE) -> list[Path]:
    """Files named, in folders, or matching wildcards; in the order given, each once.

    Wildcards are expanded here, so that all shells agree.

    Raises
    ------
    UsageError
        if a wildcard matches nothing or a folder holds no such file.
    InputError
        if a folder cannot be read.
    """
    found: dict[Path, None] = {}
    try:
        for argument in arguments:
            found.update(dict.fromkeys(_named(argument, suffixes)))
    except OSError as error:
        raise InputError(f"{error.filename}: cannot be read ({error.strerror}).") from error
    return [path for path in found if not _part_of(path, found)]


def find_files_below(arguments: Iterable[str]) -> list[Path]:
    """Like `find_files`, but a folder stands for all clips in it and in the folders below.

    Raises the errors of `find_files`, and InputError for a file that is not there.
    """
    found: dict[Path, Path] = {}
    for argument in arguments:
        folder = Path(argument)
        paths = _below(folder) if argument and folder.is_dir() else find_files([argument])
        for path in paths:
            if not os.path.lexists(path):
                raise InputError(f"{path}: no such file or folder.")
            found.setdefault(path.absolute(), path)
    return list(found.values())


def _part_of(path: Path, others: Iterable[Path] = ()) -> bool:
    """Whether a file is but the motion of a layer, which is among others, or wherever it is."""
    if not path.name.endswith(MOTION_SUFFIX):
        return False
    from usdhand.formats.usd.motion_crate import motion_of

    name = motion_of(path)
    return name is not None and (not others or path.with_name(name) in others)


def inputs_of(request: Request) -> list[Path]:
    """Files that a request names now: those in its folders and that match its wildcards, too.

    What names nothing is there as it was given.
    """
    found: dict[Path, None] = {}
    for own in declared(type(request)):
        for name in getattr(request, own.name) if own.option.several else ():
            try:
                found.update(dict.fromkeys(EXPANDED[own.option.several]([name])))
            except UsdHandError:
                found[Path(name)] = None
    return list(found | dict.fromkeys(named_inputs(request)))


EXPANDED: Mapping[str, Callable[[Sequence[str]], list[Path]]] = {
    "files": find_files,
    "usd": partial(find_files, suffixes=USD_SUFFIXES),
    "below": find_files_below,
}


def _named(argument: str, suffixes: Sequence[str]) -> list[Path]:
    if not argument:
        raise UsageError("A file name is empty.")
    path = Path(argument)
    if path.is_dir():
        inside = sorted(p for p in path.iterdir() if p.suffix.lower() in suffixes)
        if not inside:
            raise UsageError(f"{path} holds no {', '.join(suffixes)} file.")
        return [p for p in inside if not p.name.startswith(".") and not _part_of(p)]
    if not path.exists() and glob.has_magic(argument):
        matches = sorted(Path(p) for p in glob.glob(argument, recursive=True))  # noqa: PTH207
        if not matches:
            raise UsageError(f"No file matches {argument}.")
        return [p for p in matches if not _part_of(p)] or matches
    return [path]


def _below(folder: Path) -> list[Path]:
    below = (p for p in sorted(folder.rglob("*")) if p.suffix.lower() in READABLE)
    files = (p for p in below if p.is_file() and not _hidden(p.relative_to(folder)))
    paths = [p for p in files if not _part_of(p)]
    if not paths:
        raise UsageError(f"{folder} and the folders below hold no {', '.join(READABLE)} file.")
    return paths


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)
