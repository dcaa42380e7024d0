"""Schemas: the folder of the USD one, and the JSON ones of requests and reports."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from usdhand.errors import UsageError
from usdhand.formats.schema import schema_folder
from usdhand.requests.json_schema import request_schema
from usdhand.requests.schema import SchemaRequest
from usdhand.requests.verbs import request_class
from usdhand.verbs.outcome import FAILURE, Journal, Outcome

CHOICES = ("of_report", "of_request", "of_failure", "of_edits", "of_takes")


def run(request: SchemaRequest, journal: Journal) -> Outcome:
    """Say where the USD schema is, or print a JSON schema."""
    del journal
    asked = [f"--{name.replace('_', '-')}" for name in CHOICES if getattr(request, name)]
    if len(asked) > 1:
        raise UsageError(f"{' and '.join(asked)} exclude each other: give one of them.")
    found = _found(request)
    folder = str(schema_folder()) if found is None else None
    return Outcome(
        request,
        (),
        lambda: {"folder": folder, "json_schema": found},
        lambda *_: folder or json.dumps(found, indent=2),
    )


def _found(request: SchemaRequest) -> dict[str, Any] | None:
    """The JSON schema that is asked for, None where the USD one is."""
    if request.of_request is not None:
        return request_schema(request_class(request.of_request))
    if request.of_report is not None:
        return report_schema(request.of_report)
    if request.of_failure:
        return failure_schema()
    if request.of_edits:
        return _schema_file("edits")
    return _schema_file("takes") if request.of_takes else None


def report_schema(verb: str) -> dict[str, Any]:
    """Return the JSON schema of a verb's reports.

    Raises
    ------
    UsageError
        if there is no such verb, or it makes no report.
    """
    request_class(verb)
    schema = _schema_file(verb.split()[0])
    if schema is None:
        raise UsageError(f"'{verb}' makes no report.")
    return schema


def failure_schema() -> dict[str, Any]:
    """Return the JSON schema of reports of runs that failed as a whole."""
    schema = _schema_file(FAILURE)
    assert schema is not None
    return schema


def _schema_file(name: str) -> dict[str, Any] | None:
    """A JSON schema of the package, None if there is none of the name."""
    file = resources.files("usdhand.report").joinpath("schemas", f"{name}.json")
    if not file.is_file():
        return None
    schema: dict[str, Any] = json.loads(file.read_text("utf-8"))
    return schema
