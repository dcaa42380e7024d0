"""Requests in JSON and back, judged by the types of their fields."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from usdhand.errors import UsageError
from usdhand.options import WORDS, Declared, allows_none, alternatives, declared, is_settings
from usdhand.requests.base import Request
from usdhand.requests.verbs import request_class

R = TypeVar("R", bound=Request)


def to_data(request: Request) -> dict[str, Any]:
    """Return a request as plain data that JSON has: its verb and all fields."""
    own = {f.name: _plain(getattr(request, f.name)) for f in fields(request)}
    return {"verb": request.verb, **own}


def make_request(data: Mapping[str, Any]) -> Request:
    """Make a request of plain data; fields that are not there have their defaults.

    Raises
    ------
    UsageError
        if the verb or a field is unknown, missing, or has a value of another type.
    """
    verb = data.get("verb")
    if not isinstance(verb, str):
        raise UsageError("A request needs a 'verb', such as \"fill\".")
    return _request(request_class(verb), {k: v for k, v in data.items() if k != "verb"})


def _request(owner: type[R], data: Mapping[str, Any]) -> R:
    known = {own.name: own for own in declared(owner)}
    _check_names(data, known, f"A request '{owner.verb}'")
    values: dict[str, Any] = {}
    for name, own in known.items():
        if own.option.role == "settings":
            base = base_of(own, data.get(own.option.chosen_by))
            values[name] = _changed(base, data.get(name, {}), name)
        elif name in data:
            values[name] = _bounded(own, _value(own.type, data[name], name), name)
        elif own.default is MISSING:
            raise UsageError(f"A request '{owner.verb}' needs '{name}': {own.option.help}")
    return owner(**values)


def base_of(own: Declared, chosen: object) -> Any:
    """Return the settings that single options change, by the value of another option."""
    bases: Mapping[Any, Any] = own.option.bases or {}
    return bases.get(chosen, own.default)


def _changed(base: Any, data: Any, where: str) -> Any:
    """Settings with what the data says instead."""
    if not isinstance(data, Mapping):
        raise UsageError(f"'{where}' is not an object of settings.")
    hints = get_type_hints(type(base))
    _check_names(data, hints, f"'{where}'")
    given = {k: _value(hints[k], v, f"{where}.{k}") for k, v in data.items()}
    for own in declared(type(base)):
        if own.name in given:
            _bounded(own, given[own.name], f"{where}.{own.name}")
    return replace(base, **given)


def _bounded(own: Declared, value: Any, where: str) -> Any:
    """The value, if it is within the option's bounds."""
    least, most = own.option.at_least, own.option.at_most
    if isinstance(value, int):
        if least is not None and value < least:
            raise UsageError(f"'{where}' cannot be {value}: it must be at least {least}.")
        if most is not None and value > most:
            raise UsageError(f"'{where}' cannot be {value}: it must be at most {most}.")
    return value


def _check_names(data: Mapping[str, Any], known: Mapping[str, Any], who: str) -> None:
    for name in data:
        if name not in known:
            near = difflib.get_close_matches(str(name), known, 1)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            raise UsageError(f"{who} has no '{name}'.{hint}")


def _value(kind: Any, value: Any, where: str) -> Any:
    if value is None and allows_none(kind):
        return None
    for one in alternatives(kind):
        try:
            return _of(one, value, where)
        except TypeError:
            continue
    raise UsageError(f"'{where}' cannot be {value!r}: {described(kind)} is needed.")


def _of(kind: Any, value: Any, where: str) -> Any:
    """A value of exactly one type; TypeError where it is none."""
    origin = get_origin(kind)
    if origin is Literal and value in get_args(kind) and not isinstance(value, bool):
        return value
    if origin is tuple and isinstance(value, (list, tuple)):
        kinds = get_args(kind)
        if kinds[1:] == (...,):
            return tuple(_value(kinds[0], v, f"{where}[{i}]") for i, v in enumerate(value))
        if len(kinds) == len(value):
            each = zip(kinds, value, strict=True)
            return tuple(_value(k, v, f"{where}[{i}]") for i, (k, v) in enumerate(each))
    if is_settings(kind) and isinstance(value, Mapping):
        hints = get_type_hints(kind)
        _check_names(value, hints, f"'{where}'")
        needed = [f.name for f in fields(kind) if f.default is f.default_factory is MISSING]
        if missing := [name for name in needed if name not in value]:
            raise UsageError(f"'{where}' needs '{missing[0]}'.")
        return kind(**{k: _value(hints[k], v, f"{where}.{k}") for k, v in value.items()})
    if origin is Mapping and isinstance(value, Mapping):
        names, values = get_args(kind)
        return {
            _value(names, k, where): _value(values, v, f"{where}.{k}") for k, v in value.items()
        }
    if kind is Path and isinstance(value, str):
        return Path(value)
    if kind is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if kind in (bool, str, int) and type(value) is kind:
        return value
    raise TypeError


def described(kind: Any) -> str:
    """Say a type in words."""
    parts = []
    for one in alternatives(kind):
        if get_origin(one) is Literal:
            parts.append("one of " + ", ".join(map(repr, get_args(one))))
        elif get_origin(one) is tuple:
            parts.append("a list")
        elif is_settings(one) or get_origin(one) is Mapping:
            parts.append("an object")
        else:
            parts.append(WORDS.get(one, "a path"))
    return " or ".join(parts)


def _plain(value: Any) -> Any:
    if is_settings(type(value)):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    return str(value) if isinstance(value, Path) else value
