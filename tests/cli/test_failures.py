"""Runs that fail as a whole still make one JSON document, and nothing else on stdout."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from builders.cli_runner import run
from builders.report_schemas import validator
from conftest import REPOSITORY

from usdhand.verbs.outcome import FAILURE

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"

FAILING = {
    "missing": (["reduce", "gone.usdc", "-o", "r.usda"], 3, "input"),
    "same file": (["convert", OK, "-o", OK], 2, "output"),
    "no rig": (["expand", OK, "-o", "e.usda"], 3, "input"),
    "no library": (["fill", OK, "--library", "gone.usdc", "-o", "f.usda"], 3, "input"),
    "no report": (["rerun", "gone.json"], 3, "input"),
    "no such verb": (["schema", "--of-report", "fil"], 2, "usage"),
}


@pytest.mark.parametrize("name", FAILING)
def test_a_failed_run_makes_one_document(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, exit_code, kind = FAILING[name]
    done = run(*arguments, "--json", code=exit_code)
    report = json.loads(done.stdout)
    validator(FAILURE).validate(report)
    assert report["request"]["verb"] == arguments[0]
    assert report["outcome"]["exit_code"] == exit_code
    last = report["outcome"]["problems"][-1]
    assert (last["severity"], last["code"]) == ("error", kind)
    assert last["message"] in done.stderr


def test_inputs_of_a_failed_run_are_named(tmp_path: Path) -> None:
    gone = tmp_path / "gone.usdc"
    command = ["splice", OK, gone, "-o", tmp_path / "s.usda", "--json"]
    inputs = json.loads(run(*command, code=3).stdout)["inputs"]
    assert [entry["path"] for entry in inputs] == [str(OK), str(gone)]
    assert [entry["sha256"] is None for entry in inputs] == [False, True]


def test_an_unforeseen_error_is_in_the_document(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise ArithmeticError("two and two are five")

    monkeypatch.setattr("usdhand.verbs.check.run", fails)
    report = json.loads(run("check", OK, "--json", code=1).stdout)
    said = report["outcome"]["problems"][-1]
    assert said["code"] == "unforeseen"
    assert "ArithmeticError: two and two are five" in said["message"]


def test_inspect_has_its_notes_among_the_problems() -> None:
    report = json.loads(run("inspect", OK, "--json").stdout)
    told = [problem for file in report["files"] for problem in file["problems"]]
    kept = [{k: v for k, v in p.items() if k != "file"} for p in report["outcome"]["problems"]]
    assert kept == told
