"""The command of a verb: what was given becomes a request, what came of it text and exit code."""

from __future__ import annotations

import inspect

import click

from usdhand.cli.bar import Bar
from usdhand.cli.console import foreseen, say, show
from usdhand.cli.given import request_of
from usdhand.cli.parameters import parameters
from usdhand.errors import UsdHandError
from usdhand.problems import Problem
from usdhand.requests.base import Request
from usdhand.requests.verbs import request_class


class Crash:
    """How the process that worked on a request ended, where another one makes its report."""

    error: UsdHandError | None = None


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

    from usdhand.verbs.outcome import Journal, failed
    from usdhand.verbs.run import run_verb

    journal = Journal(listen, bar)
    try:
        if Crash.error is not None:
            raise Crash.error
        outcome = run_verb(request, journal)
    except Exception as error:
        if as_json:
            click.echo(failed(request, journal, foreseen(error)).to_json())
        raise
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
