"""Manifests of hand takes: which files, with which pins, go onto one body."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from usdhand.anatomy import SIDES, Side
from usdhand.errors import InputError

SCHEMA = "usdhand.takes/1"
_KEYS = {"schema", "body", "takes"}
_TAKE_KEYS = {"hands", "skel", "pins", "claps", "side"}


@dataclass(frozen=True)
class TakeFile:
    """One hand clip: its file, skeleton, pins and claps as the options have them, and sides."""

    hands: Path
    skel: str | None
    pins: tuple[str, ...]
    claps: tuple[str, ...]
    sides: tuple[Side, ...]


@dataclass(frozen=True)
class Manifest:
    """Takes of a body, which may be given elsewhere."""

    body: Path | None
    takes: tuple[TakeFile, ...]


def read_manifest(path: Path) -> Manifest:
    """Read a manifest of takes; names of files are relative to its folder.

    Raises
    ------
    InputError
        if it is no such file; the message says what is wrong, and at which take.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except (RecursionError, ValueError) as error:
        raise InputError(f"{path}: no JSON ({error}).") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise InputError(f'{path}: not a manifest of takes: it has no "schema": "{SCHEMA}".')
    _check_keys(data, _KEYS, str(path))
    body, takes = data.get("body"), data.get("takes")
    if not isinstance(takes, list) or not takes:
        raise InputError(f'{path}: "takes" must be a list of at least one take.')
    return Manifest(
        None if body is None else path.parent / _text(body, f'{path}: "body"'),
        tuple(_take(take, f"{path}: take {k + 1}", path.parent) for k, take in enumerate(takes)),
    )


def _take(data: Any, where: str, folder: Path) -> TakeFile:
    if not isinstance(data, dict) or "hands" not in data:
        raise InputError(f'{where}: give the file "hands".')
    _check_keys(data, _TAKE_KEYS, where)
    side = data.get("side", "both")
    if side not in (*SIDES, "both"):
        raise InputError(f'{where}: "side" is "left", "right" or "both".')
    skel = data.get("skel")
    return TakeFile(
        folder / _text(data["hands"], f'{where}: "hands"'),
        None if skel is None else _text(skel, f'{where}: "skel"'),
        _texts(data.get("pins", []), f'{where}: "pins"'),
        _texts(data.get("claps", []), f'{where}: "claps"'),
        SIDES if side == "both" else (side,),
    )


def _check_keys(data: dict[str, Any], known: set[str], where: str) -> None:
    if unknown := sorted(set(data) - known):
        raise InputError(
            f"{where}: unknown key '{unknown[0]}'; there are {', '.join(sorted(known))}."
        )


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or not value:
        raise InputError(f"{where} must be a text.")
    return value


def _texts(values: Any, where: str) -> tuple[str, ...]:
    if not isinstance(values, list):
        raise InputError(f'{where} must be a list of texts such as "120:98".')
    return tuple(_text(value, where) for value in values)
