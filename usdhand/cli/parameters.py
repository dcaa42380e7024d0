"""Options of requests as parameters of click, each also an environment variable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import click

from usdhand.options import Declared, alternatives, flat
from usdhand.requests.base import Request


def parameters(owner: type[Request]) -> list[click.Parameter]:
    """All options and arguments of a request, in the order of its fields."""
    return [_parameter(own, inside, owner.verb) for own, inside in flat(owner)]


def name_of(own: Declared, inside: Declared | None) -> str:
    """Name of the parameter of an option, which may be one of settings."""
    return own.name if inside is None else f"{inside.name}_{own.name}"


def _parameter(own: Declared, inside: Declared | None, verb: str) -> click.Parameter:
    kind = alternatives(own.type)[0]
    many = get_origin(kind) is tuple and get_args(kind)[1:] == (...,)
    details: dict[str, Any] = {"type": _type(own, get_args(kind)[0] if many else kind)}
    if own.option.read is not None:
        details["callback"] = _reader(own.option.read)
    if own.option.metavar:
        details["metavar"] = own.option.metavar
    if own.option.role == "argument":
        return click.Argument([own.name], nargs=-1 if many else 1, required=own.required, **details)
    if kind is bool:
        details = {"is_flag": True}
    elif many:
        details["multiple"] = True
    elif own.option.read is not None:
        details |= {"default": own.option.shown or None, "show_default": bool(own.option.shown)}
    elif own.default is not MISSING:
        details |= {"default": own.default, "show_default": own.default is not None}
    if own.option.reported:
        words = [*verb.split(), own.flags[-1].removeprefix("--").replace("-", "_")]
        details["envvar"] = "_".join(["usdhand", *words]).upper()
    names = [name_of(own, inside), *own.flags]
    return click.Option(names, required=own.required, help=own.option.help, **details)


def _type(own: Declared, kind: Any) -> click.ParamType[Any]:
    if own.option.read is not None:
        return click.STRING
    if get_origin(kind) is Literal:
        return click.Choice([str(choice) for choice in get_args(kind)])
    least, most = own.option.at_least, own.option.at_most
    if kind is int and (least, most) != (None, None):
        whole = click.IntRange(least, most)
        whole.name = "whole number"
        return whole
    if kind is Path:
        return click.Path(path_type=Path)
    simple: Mapping[type, click.ParamType[Any]] = {float: click.FLOAT, int: click.INT}
    return simple.get(kind, click.STRING)


def _reader(read: Callable[[str], Any]) -> Callable[..., Any]:
    def callback(context: click.Context, parameter: click.Parameter, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return read(value)
        except ValueError as error:
            raise click.BadParameter(str(error), context, parameter) from error

    return callback
