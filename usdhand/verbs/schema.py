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
from usdhand.verbs.outcome import Journal, Outcome


def run(request: SchemaRequest, journal: Journal) -> Outcome:
    """Say where the USD schema is, or print a JSON schema."""
    del journal
    if request.of_request is not None:
        found = request_schema(request_class(request.of_request))
    elif request.of_report is not None:
        found = report_schema(request.of_report)
    elif request.of_edits:
        found = _schema_file("edits") or {}
    else:
        folder = str(schema_folder())
        return Outcome(request, (), lambda: {"folder": folder}, lambda *_: folder)
    return Outcome(request, (), lambda: found, lambda *_: json.dumps(found, indent=2))


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


def _schema_file(name: str) -> dict[str, Any] | None:
    """A JSON schema of the package, None if there is none of the name."""
    file = resources.files("usdhand.report").joinpath("schemas", f"{name}.json")
    if not file.is_file():
        return None
    schema: dict[str, Any] = json.loads(file.read_text("utf-8"))
    return schema
