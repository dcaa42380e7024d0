"""The timeline of the page of preview, from reports and from files."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.preview_pages import (
    GESTURES,
    Results,
    page_data,
    shared_results,
)
from builders.shared_work import SharedWork

OK = GESTURES / "ok_01.usdc"


@pytest.fixture(scope="module")
def results(shared_work: SharedWork) -> Results:
    return shared_results(shared_work)


def test_segments_of_a_fill_report_are_on_the_timeline(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "fill.html"
    run("preview", results.filled, "--with-report", results.fill_report, "-o", page)
    report = json.loads(results.fill_report.read_text())
    rows = page_data(page)["rows"]
    assert [(r["label"], r["side"]) for r in rows] == [("segments", "left"), ("segments", "right")]
    for row in rows:
        segments = report["hands"][row["side"]]["segments"]
        assert [(s["start"], s["end"], s["label"]) for s in row["spans"]] == [
            (s["start"], s["end"], s["clip"]) for s in segments
        ]


def rows_with(report: Path, folder: Path, *files: Path) -> list[dict[str, Any]]:
    run("preview", *files, "--with-report", report, "-o", folder / "rows.html", "--force",
        "--max-points", "0")  # fmt: skip
    return list(page_data(folder / "rows.html")["rows"])


def test_rows_name_the_lane_that_they_tell_of(results: Results, tmp_path: Path) -> None:
    """The output, wherever it stands in the order, or else the clip that was filled."""
    body, fill = GESTURES / "ok_03.usdc", results.fill_report
    for files, lane in (
        ([OK, results.filled], "filled choice_1"),
        ([body, results.filled], "filled choice_1"),
        ([OK, body], "ok_03"),
    ):
        assert {r["lane"] for r in rows_with(fill, tmp_path, *files)} == {lane}
    hands = rows_with(results.splice_report, tmp_path, GESTURES / "ok_04.usdc")
    assert {r["lane"] for r in hands} == {"ok_04"}
    moved = [tmp_path / p.name for p in (results.filled, results.fill_report)]
    for old in (results.filled, results.filled.with_suffix(".motion.usdc"), results.fill_report):
        (tmp_path / old.name).write_bytes(old.read_bytes())
    assert {r["lane"] for r in rows_with(moved[1], tmp_path, moved[0])} == {"filled choice_1"}


def test_a_report_of_another_clip_is_refused(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "other.html"
    for report, words in (
        (results.fill_report, "but to filled.usda and ok_03.usdc"),
        (results.splice_report, "but to spliced.usda and ok_03.usdc and ok_04.usdc"),
    ):
        done = run("preview", OK, "--with-report", report, "-o", page, code=2)
        assert words in done.output
    # What stands where the output was, but is as long as another clip.
    report = json.loads(results.fill_report.read_text())
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(report | {"output": str(OK), "frames": report["frames"] + 1}))
    run("preview", OK, "--with-report", changed, "-o", page, code=2)
    changed.write_text(json.dumps(report | {"inputs": [{"path": "x"}]}))
    assert "not complete" in run("preview", OK, "--with-report", changed, "-o", page, code=3).output
    assert not page.exists()


def test_distance_and_cost_of_a_segment_are_told_apart(results: Results, tmp_path: Path) -> None:
    """Costs are those in the plot of the graph."""
    first = json.loads(results.fill_report.read_text())["hands"]["left"]["segments"][0]
    detail = rows_with(results.fill_report, tmp_path, results.filled)[0]["spans"][0]["detail"]
    assert detail.endswith(f"distance {first['cost']:.4g}, cost {first['node_cost']:.3g}")
    assert first["cost"] != pytest.approx(first["node_cost"], rel=0.1)


def test_a_splice_report_retimes_its_hand_clip(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "splice.html"
    run("preview", results.spliced, GESTURES / "ok_04.usdc", "--with-report",
        results.splice_report, "-o", page)  # fmt: skip
    data = page_data(page)
    report = json.loads(results.splice_report.read_text())["hands"]
    unsure = {r["side"]: r["spans"] for r in data["rows"] if r["label"] == "may be off"}
    assert {s: len(spans) for s, spans in unsure.items()} == {
        s: len(hand["doubts"]) for s, hand in report.items() if hand["doubts"]
    }
    rows = [r for r in data["rows"] if r["label"] != "may be off"]
    assert [r["label"] for r in rows] == ["phases", "seconds of hand clip"] * len(report)
    phases, seconds = rows[:2]
    assert len(phases["spans"]) == len(report["left"]["phases"])
    assert len(phases["marks"]) == len(report["left"]["pins"]) == 1
    body, hand = np.array(report["left"]["warp"]).T
    for mark in seconds["marks"]:
        assert np.interp(mark["time"], body, hand) == pytest.approx(float(mark["label"]), abs=0.02)
    spliced, hands = data["lanes"]
    assert spliced["retime"] == {}
    assert set(hands["retime"]) == set(report)


def test_warps_come_from_the_file_where_there_is_no_report(
    results: Results, tmp_path: Path
) -> None:
    run("preview", results.spliced, "-o", tmp_path / "warp.html")
    rows = page_data(tmp_path / "warp.html")["rows"]
    warp = np.array(json.loads(results.splice_report.read_text())["hands"]["left"]["warp"])
    row = next(r for r in rows if r["side"] == "left")
    assert len(row["marks"]) == int(warp[-1, 1]) + 1


def test_a_rig_says_how_its_channels_are_made(results: Results, tmp_path: Path) -> None:
    run("preview", results.rig, "-o", tmp_path / "rig.html")
    relations = page_data(tmp_path / "rig.html")["lanes"][0]["relations"]
    assert len(relations) == 50
    assert "free" in relations.values()
    linear = [words for words in relations.values() if words.startswith("= ")]
    assert linear
    assert all(re.search(r"-?\d\.\d\d \N{MULTIPLICATION SIGN} (le|ri)\w+", w) for w in linear)
