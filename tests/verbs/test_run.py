"""Requests are run the same way whoever asks, and what is odd comes back as problems."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import REPOSITORY

from usdhand.errors import CancelledError, OutputError, UsageError
from usdhand.problems import Problem
from usdhand.requests.convert import ConvertRequest
from usdhand.requests.fill import FillRequest
from usdhand.requests.inspect import InspectRequest
from usdhand.requests.library import LibraryBuildRequest
from usdhand.requests.reduce import ReduceRequest
from usdhand.verbs.run import run

SAMPLES = REPOSITORY / "samples"
OK = SAMPLES / "gestures" / "ok_01.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"


def test_an_outcome_says_what_was_written_and_reports_when_asked(tmp_path: Path) -> None:
    out = tmp_path / "rig.usda"
    outcome = run(ReduceRequest(clips=(str(OK),), output=out))
    assert outcome.written == (out, tmp_path / "rig.motion.usdc")
    assert out.exists()
    assert outcome.exit_code == 0
    assert "result" not in vars(outcome), "nobody asked for the report yet"
    assert outcome.document["free_channels"] == outcome.result["free_channels"] == 6
    assert repr(outcome).startswith("Outcome(verb='reduce', written=(")
    assert repr(outcome).endswith(f"problems={len(outcome.problems)}, exit_code=0)")


def test_a_dry_run_writes_nothing(tmp_path: Path) -> None:
    request = ReduceRequest(clips=(str(OK),), output=tmp_path / "rig.usda", dry_run=True)
    outcome = run(request)
    assert outcome.written == ()
    assert list(tmp_path.iterdir()) == []
    assert "nothing written" in outcome.to_text()


def test_a_bad_file_of_several_is_a_problem_with_its_file(tmp_path: Path) -> None:
    bad = tmp_path / "bad.usda"
    bad.write_text("no usd")
    heard: list[Problem] = []
    request = InspectRequest(files=(str(OK), str(bad), str(tmp_path / "none.usd")))
    outcome = run(request, listener=heard.append)
    assert outcome.exit_code == 3
    assert [p.severity for p in heard] == ["error", "error"]
    assert [p for p in outcome.problems if p.severity == "error"] == heard
    assert [p.file for p in heard] == [str(bad), str(tmp_path / "none.usd")]
    assert {p.code for p in heard} == {"input"}
    assert ["error" in f for f in outcome.result["files"]] == [False, True, True]


def test_whoever_watches_may_stop(tmp_path: Path) -> None:
    steps: list[tuple[str, int, int]] = []

    def watch(doing: str, done: int, total: int) -> bool:
        steps.append((doing, done, total))
        return done < 2

    clips = (str(SAMPLES / "gestures"),)
    with pytest.raises(CancelledError, match="Stopped after 2 of 64"):
        run(LibraryBuildRequest(clips=clips, output=tmp_path / "l.usdc"), watch=watch)
    assert steps == [("library build", 0, 1), *(("reading", i, 64) for i in range(3))]
    assert not (tmp_path / "l.usdc").exists()
    again = run(LibraryBuildRequest(clips=clips, output=tmp_path / "l.usdc"))
    assert again.result["read"] == 62, "what was read before is kept"
    assert [p.name for p in tmp_path.iterdir()] == ["l.usdc"]


def test_a_refused_report_ends_the_run_before_it_begins(tmp_path: Path) -> None:
    out = tmp_path / "rig.usda"
    with pytest.raises(OutputError, match=r"r\.txt"):
        run(ReduceRequest(clips=(str(OK),), output=out, report=tmp_path / "r.txt"))
    assert not out.exists()


def test_requests_say_what_contradicts_itself(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="either -o OUTPUT or --out-dir"):
        run(ConvertRequest(files=(str(OK),)))
    out = tmp_path / "out.usda"
    library = tmp_path / "l.usdc"
    run(LibraryBuildRequest(clips=(str(OK),), output=library))
    with pytest.raises(UsageError, match="is a motion library"):
        run(FillRequest(body=library, library=library.with_name("l.usdc"), output=out))


def test_two_targets_of_one_name_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / OK.name).write_bytes(OK.read_bytes())
    files = (str(OK), str(other / OK.name))
    with pytest.raises(UsageError, match="Two results would both be"):
        run(ConvertRequest(files=files, out_dir=tmp_path / "out"))
    assert not (tmp_path / "out").exists()
