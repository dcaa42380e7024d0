"""Every verb runs through here, whoever asks: the command line, a report, a batch, Python."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from usdhand.formats.atomic import written_beside
from usdhand.formats.dependencies import open_layers_below
from usdhand.formats.output import check_output
from usdhand.problems import Problem
from usdhand.progress import Steps
from usdhand.report.plots.style import write_plots
from usdhand.requests.base import Request
from usdhand.verbs.files import inputs_of
from usdhand.verbs.outcome import Journal, Outcome, Watch


def run(
    request: Request,
    *,
    listener: Callable[[Problem], object] | None = None,
    watch: Watch | None = None,
) -> Outcome:
    """Do what a request asks for.

    Parameters
    ----------
    listener : gets each problem at once
    watch : gets what is done, how many steps are done, and how many there are; what returns False
        stops the run

    Raises
    ------
    UsdHandError
        if it cannot be done; the class tells the kind of reason.
    """
    return run_verb(request, Journal(listener, watch))


def run_verb(request: Request, journal: Journal) -> Outcome:
    """Do what a request asks for, on a journal that is there; see `run`."""
    report, force = getattr(request, "report", None), getattr(request, "force", False)
    if report is not None:
        check_output(report, inputs_of(request), force, (".json",))
    module = importlib.import_module(f"usdhand.verbs.{request.verb.replace(' ', '_')}")
    verb: Callable[[Any, Journal], Outcome] = module.run
    Steps(1, journal.progress(request.verb))  # whoever watches may stop any verb
    outcome = verb(request, journal)
    written = tuple(_with_parts(outcome.written))
    layers = tuple(open_layers_below(outcome.inputs))
    problems = tuple(journal.problems)
    outcome = replace(outcome, written=written, problems=problems, layers=layers)
    if report is not None and outcome.request is request:
        check_output(report, outcome.inputs, force, (".json",))
        with written_beside(report) as temporary:
            temporary.write_text(outcome.to_json() + "\n", encoding="utf-8")
    folder = getattr(request, "plots", None)
    if folder is not None and outcome.figures is not None and outcome.request is request:
        write_plots(folder, outcome.figures(), force)
        outcome = replace(outcome, drawn=folder)
    return outcome


def _with_parts(written: Sequence[Path]) -> Iterator[Path]:
    """Files that were written, and the crates that keep the motion of ascii ones."""
    for path in written:
        yield path
        if path.suffix.lower() == ".usda":
            from usdhand.formats.usd.motion_crate import own_crate

            if crate := own_crate(path):
                yield crate
