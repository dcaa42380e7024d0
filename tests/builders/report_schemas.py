"""Every report of the suite judged by its JSON Schema, which must know all keys."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import jsonschema
import pytest

from usdhand.report.document import dumps
from usdhand.requests.codec import make_request, to_data
from usdhand.verbs.outcome import FAILURE, Outcome
from usdhand.verbs.schema import failure_schema, report_schema


@contextmanager
def judged() -> Iterator[None]:
    """Judge every report that is made in this process."""
    make = Outcome.document.fget
    assert make is not None

    def document(outcome: Outcome) -> dict[str, Any]:
        made: dict[str, Any] = make(outcome)
        data = json.loads(dumps(made))
        validator(FAILURE if outcome.failed else data["request"]["verb"]).validate(data)
        assert to_data(make_request(data["request"])) == data["request"]
        return made

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Outcome, "document", property(document))
        yield


@cache
def validator(verb: str) -> jsonschema.Draft202012Validator:
    """Schema of a verb's reports, or of failures, that allows no key which it does not name."""
    schema = failure_schema() if verb == FAILURE else report_schema(verb)
    return jsonschema.Draft202012Validator(closed(schema))


def closed(schema: Any) -> Any:
    """The schema with objects that may have no other keys than those named."""
    if isinstance(schema, list):
        return [closed(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: closed(part) for key, part in schema.items()}
    if schema.get("type") == "object" and isinstance(schema.get("properties"), dict):
        own = schema["properties"]
        if not set(own) <= {"verb"}:  # requests have a schema of their own
            found.setdefault("additionalProperties", False)
    return found
