"""The command of a verb: what was given becomes a request, what came of it text and exit code."""

from __future__ import annotations

import inspect
from typing import Any

import click

from usdhand.cli.console import Bar, say, show
from usdhand.cli.parameters import parameters, request_of
from usdhand.problems import Problem
from usdhand.requests.base import Request
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
    shown: dict[str, Any] = {k: context.params.get(k, False) for k in ("as_json", "quiet")}
    request = request_of(owner, context)

    def listen(problem: Problem) -> None:
        bar.close()
        if problem.severity == "error" or not (
            shown["quiet"] or (shown["as_json"] and problem.severity == "note")
        ):
            show(problem)

    from usdhand.verbs.run import run

    bar = Bar()
    try:
        outcome = run(request, listener=listen, watch=bar)
    finally:
        bar.close()
    if shown["as_json"]:
        click.echo(outcome.to_json())
    elif not shown["quiet"] and (text := outcome.to_text(context.params.get("verbose", False))):
        say(text)
    context.exit(outcome.exit_code)
