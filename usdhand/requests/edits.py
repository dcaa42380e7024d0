"""Files of edits, as a page or a person makes them: what a run is to keep to."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from usdhand.errors import InputError
from usdhand.inputs import read_json

SCHEMA = "usdhand.edits/1"
_PIN_KEYS = {"body", "hand", "tolerance", "side"}


def read_pins(path: Path) -> tuple[str, ...]:
    """Pins of a file of edits, as ``--pin`` takes them: time codes of the body and the hand clip.

    Raises
    ------
    InputError
        if it is no such file; the message says what is wrong, and at which pin.
    """
    try:
        edits = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise InputError(f"{path}: no JSON ({error}).") from error
    if not isinstance(edits, dict) or edits.get("schema") != SCHEMA:
        raise InputError(f'{path}: not a file of edits: it has no "schema": "{SCHEMA}".')
    if unknown := sorted(set(edits) - {"schema", "splice", "fill"}):
        raise InputError(
            f"{path}: unknown key '{unknown[0]}'; the pins of a splice are in \"splice\": "
            '{"pins": [...]}.'
        )
    section = edits.get("splice", {})
    pins = section.get("pins", []) if isinstance(section, dict) else None
    if not isinstance(pins, list) or set(section) - {"pins"}:
        raise InputError(f'{path}: "splice" must be an object with a list of "pins".')
    return tuple(_pin_text(pin, f"{path}: pin {k + 1}") for k, pin in enumerate(pins))


def _pin_text(pin: Any, where: str) -> str:
    if not isinstance(pin, dict) or not {"body", "hand"} <= set(pin):
        raise InputError(f'{where}: give the time codes "body" and "hand".')
    if unknown := sorted(set(pin) - _PIN_KEYS):
        raise InputError(f"{where}: unknown key '{unknown[0]}'.")
    side = pin.get("side")
    if side not in (None, "left", "right"):
        raise InputError(f'{where}: "side" is "left", "right" or null.')
    numbers = [pin["body"], pin["hand"], pin.get("tolerance", 0)]
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise InputError(f"{where}: {json.dumps(number)} is no number.")
        if not math.isfinite(number):
            raise InputError(f"{where}: {number} is no time code.")
    if numbers[2] < 0:
        raise InputError(f'{where}: "tolerance" must be 0 or more.')
    text = ":".join(repr(number) for number in numbers)
    return f"{side}:{text}" if side else text
