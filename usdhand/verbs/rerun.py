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
from usdhand.report.document import SCHEMA_VERSION
from usdhand.requests.base import Request
from usdhand.requests.codec import make_request
from usdhand.requests.rerun import RerunRequest
from usdhand.verbs.files import inputs_of
from usdhand.verbs.outcome import Journal, Outcome
from usdhand.verbs.run import run_verb


def run(request: RerunRequest, journal: Journal) -> Outcome:
    """Do what a report says was asked for, once its inputs are what they were."""
    report = _read(request.report_file)
    asked = _changed(_request(request.report_file, report), request)
    changed, missing = _changes(report)
    changed += _new(asked, report)
    if missing:
        raise InputError(
            f"{request.report_file}: {listed(missing)} cannot be found from here. Go to the folder "
            "where the report was made."
        )
    if changed and not request.accept_changes:
        raise InputError(
            f"{request.report_file}: {listed(changed)} changed since, or new there. Give "
            "--accept-changes to take the inputs as they are now."
        )
    for path in changed:
        journal.tell(
            Problem("changed-input", "it has changed since the report, or is new", file=path)
        )
    return run_verb(asked, journal)


def _request(path: Path, report: Mapping[str, Any]) -> Request:
    """The request of a report; what is wrong with it is the file's fault."""
    try:
        asked = make_request(report["request"])
    except UsageError as error:
        raise InputError(f"{path}: the request of this report cannot be run. {error}") from error
    if isinstance(asked, RerunRequest):
        raise InputError(f"{path}: a report of rerun cannot be run again.")
    return asked


def _read(path: Path) -> dict[str, Any]:
    try:
        report: Any = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise InputError(f"{path}: this is not a JSON report of usdhand.") from error
    if why := _why_none(report):
        raise InputError(f"{path}: this is no report that can be run again: {why}.")
    found: dict[str, Any] = report
    return found


def _why_none(value: object) -> str:
    """Say why a value is no report of ours, "" where it is one."""
    if not isinstance(value, dict):
        return "it is no JSON object"
    name, _, version = str(value.get("schema", "")).partition("/")
    if not name.startswith("usdhand."):
        return "its 'schema' is none of usdhand"
    if version != str(SCHEMA_VERSION):
        return (
            f"its schema is {name}/{version}, this version of usdhand knows {name}/{SCHEMA_VERSION}"
        )
    if not isinstance(value.get("request"), dict):
        return "it has no 'request'"
    inputs = value.get("inputs")
    if not isinstance(inputs, list) or not all(isinstance(entry, dict) for entry in inputs):
        return "it has no list of 'inputs'"
    return ""


def _changed(asked: Request, request: RerunRequest) -> Request:
    """The request with what is to be otherwise this time."""
    own = {f.name for f in fields(asked)}
    wanted = {
        "report": request.report,
        "plots": request.plots,
        "force": request.force,
        "dry_run": request.dry_run,
    }
    if request.output is not None:
        wanted["output"] = request.output
    for name, value in wanted.items():
        if value and name not in own:
            flag = "--" + name.replace("_", "-")
            raise UsageError(f"'{asked.verb}' has no {flag}, so it cannot be given to rerun.")
    return replace(asked, **{name: value for name, value in wanted.items() if name in own})


def _new(asked: Request, report: Mapping[str, Any]) -> list[str]:
    """Files that folders and wildcards of the request stand for now, and did not then."""
    then = {Path(str(entry.get("path"))) for entry in report["inputs"]}
    output = getattr(asked, "output", None)
    now = [path for path in inputs_of(asked) if path not in then and path.is_file()]
    return [str(path) for path in now if output is None or not _same(path, output)]


def _same(a: Path, b: Path) -> bool:
    return a.exists() and b.exists() and a.samefile(b)


def _files(report: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Entries of the inputs and of the layers that these are composed of."""
    return [*report["inputs"], *report.get("layers", [])]


def _changes(report: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Paths of inputs whose content is not what it was, and of those that are not there."""
    before = {str(entry.get("path")): entry.get("sha256") for entry in _files(report)}
    now = {path: file_hash(Path(path)) for path in before}
    missing = [path for path in before if before[path] is not None and now[path] is None]
    changed = [path for path in before if before[path] != now[path] and path not in missing]
    return changed, missing
