"""The schemas of reports: there, valid, and not blind."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import jsonschema
import pytest
from builders.cli_runner import run
from builders.report_schemas import validator
from conftest import REPOSITORY

from usdhand.requests.verbs import VERBS
from usdhand.verbs.schema import failure_schema, report_schema

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
REPORTING = [verb for verb in VERBS if verb != "rerun"]


@pytest.mark.parametrize("verb", REPORTING)
def test_every_verb_has_a_schema(verb: str) -> None:
    schema = report_schema(verb)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["properties"]["schema"] == {"const": f"usdhand.{verb.split()[0]}/1"}
    assert json.loads(run("schema", "--of-report", verb).stdout) == schema


def test_verbs_without_a_report_say_so() -> None:
    assert "'rerun' makes no report" in run("schema", "--of-report", "rerun", code=2).output
    assert "Did you mean 'fill'" in run("schema", "--of-request", "fil", code=2).output


def test_schemas_of_what_is_no_verb() -> None:
    assert json.loads(run("schema", "--of-failure").stdout) == failure_schema()
    assert json.loads(run("schema", "--of-edits").stdout)["title"]
    report = json.loads(run("schema", "--of-report", "fill", "--json").stdout)
    assert report["json_schema"] == report_schema("fill")
    assert report["folder"] is None
    said = run("schema", "--of-report", "fill", "--of-request", "fill", code=2).output
    assert "--of-report and --of-request exclude each other" in said


def test_a_report_with_a_fault_is_refused(tmp_path: Path) -> None:
    report = json.loads(run("reduce", OK, "-n", "-o", tmp_path / "r.usda", "--json").stdout)
    judge = validator("reduce")
    judge.validate(report)
    for spoil in ("free_channels", "settings", "outcome", "channels"):
        bad = copy.deepcopy(report)
        del bad[spoil]
        assert not judge.is_valid(bad), spoil
    for key, value in (("free_channels", "6"), ("new_key", 1)):
        assert not judge.is_valid(report | {key: value}), key
    bad = copy.deepcopy(report)
    bad["channels"][0]["kind"] = 3
    assert not judge.is_valid(bad)
