"""usdhand rerun: results made again from their reports, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from builders.cli_runner import run
from conftest import REPOSITORY
from pxr import Sdf, Usd

SAMPLES = REPOSITORY / "samples"
OK = SAMPLES / "gestures" / "ok_01.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"


def text(path: Path) -> str:
    found: str = Sdf.Layer.FindOrOpen(str(path)).ExportToString()
    return found


def remove(path: Path) -> None:
    """Remove an output with the crate that keeps its motion."""
    for one in (path, path.with_suffix(".motion.usdc")):
        one.unlink(missing_ok=True)


def copied(source: Path, target: Path) -> None:
    """A file that needs no other."""
    remove(target)
    Usd.Stage.Open(str(source)).Flatten().Export(str(target))


@pytest.fixture
def report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Of a reduction with settings that are not the default, with paths seen from its folder."""
    monkeypatch.chdir(tmp_path)
    copied(OK, tmp_path / "ok.usdc")
    run("reduce", "ok.usdc", "-o", "r.usda", "--target-dofs", 9, "--fit", "least-squares",
        "--controllers", 2, "--side", "right", "--report", "r.json")  # fmt: skip
    return tmp_path / "r.json"


def test_a_result_is_made_again(report: Path) -> None:
    first, kept = json.loads(report.read_text()), text(Path("r.usda"))
    assert "exists; use --force" in run("rerun", report, code=2).output
    remove(Path("r.usda"))
    run("rerun", report, "--report", "again.json")
    assert text(Path("r.usda")) == kept
    again = json.loads(Path("again.json").read_text())
    assert again["request"]["report"] == "again.json"
    for made in (first, again):
        made["request"].pop("report")
    assert again == first


def test_a_result_goes_elsewhere(report: Path) -> None:
    before = report.read_bytes()
    printed = json.loads(run("rerun", report, "-o", "new.usda", "--json").stdout)
    assert printed["output"] == "new.usda"
    assert printed["free_channels"] == 9
    assert Path("new.usda").exists()
    assert report.read_bytes() == before


def test_a_changed_input_is_refused_until_it_is_accepted(report: Path) -> None:
    copied(SAMPLES / "gestures" / "ok_02.usdc", Path("ok.usdc"))
    message = run("rerun", report, "-o", "new.usda", code=3).output
    assert "ok.usdc changed since" in message
    assert "--accept-changes" in message
    assert not Path("new.usda").exists()
    Path("ok.usdc").rename("elsewhere.usdc")
    for more in ([], ["--accept-changes"]):
        message = run("rerun", report, "-o", "new.usda", *more, code=3).output
        assert "ok.usdc cannot be found from here" in message
    Path("elsewhere.usdc").rename("ok.usdc")
    assert "has changed" in run("rerun", report, "-o", "new.usda", "--accept-changes").output
    assert Path("new.usda").exists()


def test_splice_is_made_again_with_its_pins(tmp_path: Path) -> None:
    out, report = tmp_path / "s.usda", tmp_path / "s.json"
    run("splice", BODY, HANDS, "--pin", "1:1", "--pin", "181:403", "--band", "0.25,0.08",
        "-o", out, "--report", report)  # fmt: skip
    before = text(out)
    remove(out)
    run("rerun", report)
    assert text(out) == before


def _report(request: str, inputs: str = "[]") -> str:
    return f'{{"schema": "usdhand.reduce/1", "request": {request}, "inputs": {inputs}}}'


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "not a JSON report"),
        ("[" * 100_000, "not a JSON report"),
        ("[]", "no JSON object"),
        ("{}", "its 'schema' is none of usdhand"),
        ('{"schema": "usdhand.reduce/1"}', "no 'request'"),
        ('{"schema": "usdhand.reduce/2", "request": {}, "inputs": []}', "knows usdhand.reduce/1"),
        (_report('{"verb": "reduce"}', "[1]"), "no list of 'inputs'"),
        ('{"schema": "usdhand.reduce/1", "request": {"verb": "reduce"}}', "no list of 'inputs'"),
        (_report('{"verb": "dance"}'), "no verb 'dance'"),
        (_report('{"verb": "reduce", "clips": 3}'), "'clips' cannot be 3"),
        (_report('{"verb": "rerun", "report_file": "r.json"}'), "cannot be run again"),
    ],
)
def test_what_is_no_report_is_refused(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "r.json"
    path.write_text(content)
    assert words in run("rerun", path, code=3).output
    assert "no such file" in run("rerun", tmp_path / "none.json", code=3).output.lower()


def test_an_option_that_the_verb_has_not_is_refused(tmp_path: Path) -> None:
    report = tmp_path / "i.json"
    report.write_text(run("inspect", OK, "--json").stdout)
    assert "'inspect' has no --output" in run("rerun", report, "-o", "x.usda", code=2).output
    assert "hands by convention" in run("rerun", report).output
