"""The command of a verb: what was given becomes a request, what came of it text and exit code."""

from __future__ import annotations

import inspect
from dataclasses import replace
from typing import Any

import click
from click.core import ParameterSource

from usdhand.cli.console import Bar, say, show
from usdhand.cli.parameters import name_of, parameters
from usdhand.options import declared
from usdhand.problems import Problem
from usdhand.requests.base import Request
from usdhand.requests.codec import base_of
from usdhand.requests.verbs import request_class


def command_of(verb: str) -> click.Command:
    """Make the command of a verb from the options that its request declares."""
    owner = request_class(verb)
    shown = [
        click.Option(["as_json", "--json"], is_flag=True, help="Print one JSON document."),
        click.Option(["-q", "--quiet"], is_flag=True, help="Print errors only."),
    ]
    if owner.verbose:
        shown.append(click.Option(["-v", "--verbose"], is_flag=True, help=owner.verbose))
    return click.Command(
        verb.split()[-1],
        params=[*parameters(owner), *shown],
        help=inspect.getdoc(owner),
        short_help=verb,
        callback=lambda **_: _call(owner),
    )


def _call(owner: type[Request]) -> None:
    context = click.get_current_context()
    quiet, as_json = context.params["quiet"], context.params["as_json"]
    request = request_of(owner, context)
    bar = Bar()

    def listen(problem: Problem) -> None:
        bar.close()
        if problem.severity == "error" or not (quiet or (as_json and problem.severity == "note")):
            show(problem)

    from usdhand.verbs.run import run

    try:
        outcome = run(request, listener=listen, watch=bar)
    finally:
        bar.close()
    if as_json:
        click.echo(outcome.to_json())
    elif not quiet:
        if text := outcome.to_text(context.params.get("verbose", False)):
            say(text)
        if outcome.drawn is not None:
            say(f"plots written to {outcome.drawn}")
    context.exit(outcome.exit_code)


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
