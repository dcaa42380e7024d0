"""A result made again from its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from usdhand.errors import InputError, UsageError
from usdhand.formats.hashing import file_hash
from usdhand.inputs import read_json
from usdhand.problems import Problem, listed
from usdhand.requests.base import Request
from usdhand.requests.codec import from_data
from usdhand.requests.rerun import RerunRequest
from usdhand.verbs.outcome import Journal, Outcome
from usdhand.verbs.run import run_verb


def run(request: RerunRequest, journal: Journal) -> Outcome:
    """Do what a report says was asked for, once its inputs are what they were."""
    report = _read(request.report_file)
    asked = _changed(from_data(report["request"]), request)
    if isinstance(asked, RerunRequest):
        raise UsageError(f"{request.report_file}: a report of rerun cannot be run again.")
    changed = _changes(report)
    if changed and not request.accept_changes:
        raise InputError(
            f"{request.report_file}: {listed(changed)} changed since, or cannot be found from "
            "here. Go to the folder where the report was made, or give --accept-changes to take "
            "the inputs as they are now."
        )
    for path in changed:
        journal.tell(Problem("changed-input", "it has changed since the report", file=path))
    return run_verb(asked, journal)


def _read(path: Path) -> dict[str, Any]:
    try:
        report: Any = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise InputError(f"{path}: this is not a JSON report of usdhand.") from error
    if not _is_report(report):
        raise InputError(
            f"{path}: this report has no request; only reports of usdhand that have the key "
            "'request' can be run again."
        )
    found: dict[str, Any] = report
    return found


def _is_report(value: object) -> bool:
    return (
        isinstance(value, dict)
        and isinstance(value.get("request"), dict)
        and isinstance(value.get("inputs"), list)
        and all(isinstance(entry, dict) for entry in value["inputs"])
    )


def _changed(asked: Request, request: RerunRequest) -> Request:
    """The request with what is to be otherwise this time."""
    own = {f.name for f in fields(asked)}
    wanted = {"report": request.report, "force": request.force, "dry_run": request.dry_run}
    if request.output is not None:
        wanted["output"] = request.output
    for name, value in wanted.items():
        if value and name not in own:
            flag = "--" + name.replace("_", "-")
            raise UsageError(f"'{asked.verb}' has no {flag}, so it cannot be given to rerun.")
    return replace(asked, **{name: value for name, value in wanted.items() if name in own})


def _changes(report: Mapping[str, Any]) -> list[str]:
    """Paths of inputs whose content is not what it was."""
    entries = [(str(entry.get("path")), entry.get("sha256")) for entry in report["inputs"]]
    return [path for path, content in entries if file_hash(Path(path)) != content]
