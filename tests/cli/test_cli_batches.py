"""Batches, folders, reports and help: what pipelines and newcomers run into."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from builders.cli_runner import edit, run
from conftest import REPOSITORY
from pxr import Vt

from usdhand.errors import OutputError
from usdhand.formats import output
from usdhand.requests.verbs import VERBS

GESTURES = REPOSITORY / "samples" / "gestures"
OK = GESTURES / "ok_01.usdc"


def damaged(folder: Path) -> Path:
    """A crate file that opens, but whose values cannot all be unpacked."""
    content = bytearray((REPOSITORY / "samples" / "characters" / "ada.usdc").read_bytes())
    middle = len(content) // 2
    for i in range(middle - 60_000, middle + 60_000):
        content[i] ^= 0x5A
    path = folder / "damaged.usdc"
    path.write_bytes(content)
    return path


def test_one_bad_file_does_not_spoil_a_batch(tmp_path: Path) -> None:
    shutil.copytree(REPOSITORY / "samples" / "characters", tmp_path / "characters")
    folder = tmp_path / "clips"
    folder.mkdir()
    shutil.copy(OK, folder / "good.usdc")
    damaged(folder)
    (folder / "text.usd").write_text("no usd")
    for verb in ("inspect", "check"):
        result = run(verb, folder, "--json", code=3)
        files = {Path(f["path"]).name: f for f in json.loads(result.stdout)["files"]}
        assert "error" not in files["good.usdc"]
        assert "error" in files["text.usd"]


@pytest.mark.parametrize("verb", ["inspect", "check"])
def test_quiet_still_says_why_it_fails(tmp_path: Path, verb: str) -> None:
    result = run(verb, tmp_path / "nope.usdc", "-q", code=3)
    assert result.stderr.startswith("Error: ")
    assert "nope.usdc" in result.stderr


def test_a_refused_report_leaves_no_output(tmp_path: Path) -> None:
    for report in (tmp_path / "none" / "r.json", tmp_path / "r.txt"):
        run("reduce", OK, "-o", tmp_path / "o.usda", "--report", report, code=2)
        assert list(tmp_path.iterdir()) == []
    rig = tmp_path / "rig.usda"
    run("reduce", OK, "-o", rig, "-q")
    run("expand", rig, "-o", tmp_path / "x.usda", "--report", rig, code=2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.motion.usdc", "rig.usda"]


def test_a_failed_batch_leaves_no_folder(tmp_path: Path) -> None:
    run("reduce", OK, tmp_path / "nope.usdc", "-o", tmp_path / "new" / "sub", code=3)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path) -> None:
        raise OutputError(f"{folder}: cannot write there (Permission denied).")

    monkeypatch.setattr(output, "_check_writable", refuse)
    pattern = GESTURES / "wipe_0[1-2].usdc"
    assert "Permission" in run("reduce", pattern, "-o", tmp_path / "rigs", code=2).output


def test_errors_of_hands_name_the_file(tmp_path: Path) -> None:
    right = REPOSITORY / "samples" / "hands" / "talk_01_hands_right.usdc"
    result = run("reduce", right, "-o", tmp_path / "o.usda", "--side", "left", code=4)
    assert "talk_01_hands_right.usdc" in result.output


def test_illegal_joint_names_are_reported(tmp_path: Path) -> None:
    def rename(stage: object) -> None:
        for path in ("/Ada/Skeleton", "/Ada/Animation"):
            joints = stage.GetPrimAtPath(path).GetAttribute("joints")  # type: ignore[attr-defined]
            joints.Set(Vt.TokenArray([str(j).replace("Left", "Left ") for j in joints.Get()]))

    clip = edit(OK, tmp_path / "spaces.usda", rename)
    [file] = json.loads(run("inspect", clip, "--json").stdout)["files"]
    problem = next(p for p in file["problems"] if p["code"] == "illegal-joint-name")
    assert "'Left_" in problem["message"]
    assert "not legal in USD" in run("reduce", clip, "-o", tmp_path / "o.usda").stderr


def test_absurd_rates_are_refused(tmp_path: Path) -> None:
    clip = edit(OK, tmp_path / "fast.usda", lambda s: s.SetTimeCodesPerSecond(1e12))
    assert "timeCodesPerSecond" in run("inspect", clip, code=3).output


def test_swapped_joints_of_a_map_are_refused(tmp_path: Path) -> None:
    table = tmp_path / "map.toml"
    table.write_text('[left]\nIndexMCP = "LeftHandIndex2"\nIndexPIP = "LeftHandIndex1"\n')
    assert "IndexPIP" in run("inspect", OK, "--map", table, code=4).output
    table.write_text('[right]\nwrist = "LeftHand"\nIndexMCP = "LeftHandIndex1"\n')
    assert "both hands" in run("inspect", OK, "--map", table, code=4).output


@pytest.mark.parametrize("verb", VERBS)
def test_examples_of_help_can_be_copied(verb: str) -> None:
    lines = run(*verb.split(), "--help").output.splitlines()
    assert not any("\\b" in line for line in lines)
    assert any(line.strip().startswith(("usdhand ", "export ")) for line in lines)
