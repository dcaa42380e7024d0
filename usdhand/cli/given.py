"""What was given on the command line, as a request."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import click
from click.core import ParameterSource

from usdhand.cli.parameters import name_of
from usdhand.options import declared
from usdhand.requests.base import Request
from usdhand.requests.codec import base_of


def request_of(owner: type[Request], context: click.Context) -> Request:
    """Make the request of what was given on the command line.

    Of settings, what was not given is as the option that chooses between them says.
    """
    values = context.params
    made: dict[str, Any] = {}
    for own in declared(owner):
        if own.option.role != "settings":
            made[own.name] = values[own.name]
            continue
        inner = {d.name: name_of(d, own) for d in declared(own.type)}
        given = {n: values[p] for n, p in inner.items() if _given(context, p)}
        made[own.name] = replace(base_of(own, values.get(own.option.chosen_by)), **given)
    return owner(**made)


def _given(context: click.Context, name: str) -> bool:
    return context.get_parameter_source(name) is not ParameterSource.DEFAULT
