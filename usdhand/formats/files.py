"""Reading and writing motion in any format: USD, BVH, glTF, VRM and FBX look alike from here."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from usdhand.errors import InputError, UsageError
from usdhand.formats.reading import DEFAULT, Reading
from usdhand.formats.sources import remembered
from usdhand.formats.suffixes import FORMATS, READABLE, USD_SUFFIXES
from usdhand.formats.usd import read as usd
from usdhand.formats.usd.character import legal_clip
from usdhand.formats.usd.stage import find_character
from usdhand.inputs import why_no_file
from usdhand.motion import Clip
from usdhand.motion.plausible import check_clip
from usdhand.problems import Problem


def read_clip(path: str | Path, skel: str | None = None, reading: Reading = DEFAULT) -> Clip:
    """Read the motion of one character from a file of any format.

    Parameters
    ----------
    path : a file with one of the suffixes `usdhand.formats.suffixes.READABLE`
    skel : path or name of the skeleton where there are several
    reading : what the file itself does not state, and what to choose of it

    Returns
    -------
    Clip
        with everything that is odd or was guessed in ``problems``, and what it was read from as its
        ``source``, to be written over.

    Raises
    ------
    InputError
        if the file, skeleton or animation cannot be used.
    UsageError
        if there are several skeletons or animations and none is chosen.
    """
    path = Path(path)
    reading = _read_as(path, reading, skel)
    if is_usd(path):
        return usd.read_clip(path, _usd_skel(path, reading))
    return _remembered(_reader(path).read_clip(path, reading), animated=True)


def read_character(path: str | Path, skel: str | None = None, reading: Reading = DEFAULT) -> Clip:
    """Read a character that may have no motion: a clip of one frame at its bind pose.

    Raises
    ------
    InputError
        if the file or skeleton cannot be used.
    UsageError
        if there are several skeletons and none is chosen.
    """
    path = Path(path)
    reading = _read_as(path, reading, skel)
    if is_usd(path):
        return usd.read_character(path, _usd_skel(path, reading))
    return _remembered(_reader(path).read_character(path, reading), animated=False)


def read_any(
    path: str | Path, skel: str | None = None, reading: Reading = DEFAULT
) -> tuple[Clip, bool]:
    """Read a character's motion, or its bind pose where it has none; and whether it moves.

    Raises the errors of `read_character`.
    """
    path = Path(path)
    reading = _read_as(path, reading, skel)
    if is_usd(path):
        return usd.motion_or_pose(find_character(path, _usd_skel(path, reading)))
    animated = bool(_reader(path).animation_names(path))
    return (read_clip if animated else read_character)(path, None, reading), animated


def animation_names(path: str | Path) -> tuple[str, ...]:
    """Names of the animations that a file holds; ("",) for USD, where one is bound.

    Raises
    ------
    InputError
        if the file cannot be used.
    """
    path = Path(path)
    own = is_usd(path)
    _check_file(path)
    return ("",) if own else tuple(_reader(path).animation_names(path))


def write_other(clip: Clip, path: Path, suffix: str, up: str = "Y") -> tuple[Problem, ...]:
    """Write a clip to exactly ``path`` in the format of ``suffix``, which is not USD.

    Returns what the format could not keep.
    """
    check_clip(clip, clip.origin.path or clip.name, "the result")
    module = importlib.import_module(f"{FORMATS[suffix]}.write")
    options = {"up": up} if suffix == ".bvh" else {}
    return tuple(module.write_clip(clip, path, **options))


def is_usd(path: Path) -> bool:
    """Whether a file is USD by its suffix, which must be one that is read at all.

    Raises
    ------
    InputError
        if it is of no format that is read here.
    """
    suffix = path.suffix.lower()
    if suffix not in READABLE:
        if why := why_no_file(path):
            raise InputError(f"{path}: {why}.")
        raise InputError(
            f"{path}: '{path.suffix}' files are not read; expected one of {', '.join(READABLE)}."
        )
    return suffix in USD_SUFFIXES


def _check_file(path: Path) -> None:
    if why := why_no_file(path):
        raise InputError(f"{path}: {why}.")


def _reader(path: Path) -> Any:
    _check_file(path)
    return importlib.import_module(f"{FORMATS[path.suffix.lower()]}.read")


def _remembered(clip: Clip, *, animated: bool) -> Clip:
    clip = legal_clip(replace(clip, name=clip.name.encode("utf-8", "backslashreplace").decode()))
    check_clip(clip, clip.origin.path or clip.name)
    return remembered(clip, animated=animated)


def _read_as(path: Path, reading: Reading, skel: str | None) -> Reading:
    if reading.positions is not None and path.suffix.lower() != ".bvh":
        raise UsageError(f"{path}: --positions is for BVH files only.")
    return reading if skel is None else replace(reading, skel=skel)


def _usd_skel(path: Path, reading: Reading) -> str | None:
    for name, value in (
        ("--animation", reading.animation),
        ("--units", reading.cm_per_unit),
        ("--input-up", reading.up),
    ):
        if value is not None:
            raise UsageError(f"{path}: {name} is for other formats; a USD file states this itself.")
    return reading.skel
