"""The verbs as users call them: on good files, and on what people have instead."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders.made import BEN, OK, SAMPLES, Run
from pxr import Sdf, Usd


def test_reduce_tells_what_users_ask_for(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "rig.usdc"
    text = run("reduce", OK, "-o", out, "--report", tmp_path / "r.json").output
    report = json.loads((tmp_path / "r.json").read_text())
    assert out.exists()
    assert f"{report['free_channels']} of 50 channels stay free" in text
    for words in ("free: ", " deg", " mm", f"written to {out}"):
        assert words in text
    assert report["schema"] == "usdhand.reduce/1"
    assert report["total_channels"] == 50 == len(report["channels"])
    assert report["inputs"][0]["sha256"]
    assert {"mean", "max"} <= set(report["fingertip_error_mm"])
    wanted = {
        "name", "kind", "controller", "slope", "offset", "rmsd", "rms_error_deg", "max_error_deg",
    }  # fmt: skip
    assert all(wanted <= set(c) for c in report["channels"])


def test_expand_returns_free_channels_and_obeys_the_rig(
    run: Run, rig: Path, tmp_path: Path
) -> None:
    out = tmp_path / "ok.usdc"
    run("expand", rig, "-o", out)
    compared = json.loads(run("compare", OK, out, "--json").stdout)
    error = {c["name"]: c["max_deg"] for c in compared["channels"]}
    report = json.loads(run("reduce", OK, "-o", tmp_path / "x.usda", "-n", "--json").stdout)
    for channel in report["channels"]:
        if channel["kind"] == "free":
            assert error[channel["name"]] < 1e-3, channel
        else:
            assert error[channel["name"]] == pytest.approx(channel["max_error_deg"], abs=2e-3)
    baked = json.loads(run("compare", rig, out, "--json").stdout)
    assert baked["max_deg"] < 1e-3


def test_expand_after_an_edit_moves_the_dependents(run: Run, rig: Path, tmp_path: Path) -> None:
    import usdhand

    stored = usdhand.read_rig(rig)
    linear = next(r for r in stored.relations if r.kind == "linear")
    controller = linear.controllers[0]
    layer = Sdf.Layer.FindOrOpen(str(rig))
    stage = Usd.Stage.Open(layer)
    prim = stage.GetPrimAtPath("/Ada/HandRig")
    attribute = prim.GetAttribute(f"usdhand:channel:{controller}:value")
    attribute.Clear()
    attribute.Set(10.0, 1.0)  # two keys instead of a curve
    attribute.Set(20.0, 47.0)
    edited = tmp_path / "edited.usda"
    layer.Export(str(edited))
    out = tmp_path / "out.usda"
    run("expand", edited, "-o", out)
    clip = usdhand.read_clip(out)
    channels = usdhand.find_hands(clip).encode(clip)
    curve = dict(zip(channels.names, channels.values.T, strict=True))
    np.testing.assert_allclose(curve[controller], np.linspace(10, 20, 47), atol=1e-3)
    expected = linear.offset + linear.slopes[0] * np.linspace(10, 20, 47)
    np.testing.assert_allclose(curve[linear.name], expected, atol=1e-3)


def test_expand_onto_another_character(run: Run, rig: Path, tmp_path: Path) -> None:
    own, other = tmp_path / "own.usda", tmp_path / "other.usda"
    run("expand", rig, "-o", own)
    run("expand", rig, "--onto", BEN, "-o", other)
    compared = json.loads(run("compare", own, other, "--json").stdout)
    assert len(compared["channels"]) == 90
    assert compared["max_deg"] < 2e-3
    assert compared["frames"] == 47
    assert run("check", other).exit_code == 0


def test_a_rig_applies_to_other_clips(run: Run, rig: Path, tmp_path: Path) -> None:
    other = SAMPLES / "gestures_ben" / "ok_01.usdc"
    out = tmp_path / "ben.usda"
    report = json.loads(run("reduce", other, "--rig", rig, "-o", out, "--json").stdout)
    assert report["fitted_to"] == ["ok_01"]
    first = json.loads(run("reduce", OK, "-n", "-o", tmp_path / "x.usda", "--json").stdout)
    assert report["free_channels"] == first["free_channels"]
    assert report["rms_error_deg"] > first["rms_error_deg"]


def test_many_clips_go_to_a_folder_with_one_rig(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "rigs"
    pattern = SAMPLES / "gestures" / "wipe_0[1-3].usdc"
    report = json.loads(run("reduce", pattern, "-o", folder, "--json").stdout)
    assert len(report["clips"]) == 3
    assert sorted(p.name for p in folder.iterdir()) == [f"wipe_0{i}.rig.usdc" for i in (1, 2, 3)]
    kinds = [[c["kind"] for c in clip["channels"]] for clip in report["clips"]]
    assert kinds[0] == kinds[1] == kinds[2]


@pytest.mark.parametrize("count", [1, 7, 20])
def test_a_number_of_channels_is_met(run: Run, tmp_path: Path, count: int) -> None:
    out = tmp_path / "x.usda"
    arguments = ("reduce", OK, "-n", "-o", out, "--target-dofs", count, "--json")
    assert json.loads(run(*arguments).stdout)["free_channels"] == count
    assert not out.exists()


def test_a_largest_error_is_met(run: Run, tmp_path: Path) -> None:
    arguments = ("reduce", OK, "-n", "-o", tmp_path / "x.usda", "--max-error", 1.5, "--json")
    report = json.loads(run(*arguments, "--fit", "least-squares").stdout)
    assert max(c["rms_error_deg"] for c in report["channels"]) <= 1.5


def test_inspect_and_check_all_samples(run: Run) -> None:
    folders = [p for p in SAMPLES.iterdir() if list(p.glob("*.usdc"))]
    inspected = json.loads(run("inspect", *folders, "--json").stdout)
    assert len(inspected["files"]) >= 90
    for file in inspected["files"]:
        assert file["hands"], file["path"]
    checked = json.loads(run("check", *folders, "--json").stdout)
    assert all(file["ok"] for file in checked["files"])


def test_schema_prints_a_plugin_folder(run: Run) -> None:
    folder = Path(run("schema").output.strip())
    assert (folder / "plugInfo.json").exists()
    assert (folder / "generatedSchema.usda").exists()


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd", ".usdz"])
@pytest.mark.parametrize("flatten", [False, True])
def test_outputs_pass_our_own_check(run: Run, tmp_path: Path, suffix: str, flatten: bool) -> None:
    rig_file, motion = tmp_path / f"rig{suffix}", tmp_path / f"motion{suffix}"
    extra = ["--flatten"] if flatten else []
    run("reduce", OK, "-o", rig_file, *extra)
    run("expand", rig_file, "-o", motion, *extra)
    assert run("check", rig_file, motion, "--strict").exit_code == 0
    parts = [] if flatten or suffix != ".usda" else ["rig.motion.usdc", "motion.motion.usdc"]
    found = sorted(p.name for p in tmp_path.iterdir())
    assert found == sorted([rig_file.name, motion.name, *parts])


def test_a_quality_limit_has_its_exit_code(run: Run, rig: Path) -> None:
    run("compare", OK, rig, "--max-rms", 10)
    assert "more than" in run("compare", OK, rig, "--max-rms", 0.001, code=5).output


def shell(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "usdhand", *map(str, arguments)],
        capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def test_shelled_out_data_and_messages_are_apart(tmp_path: Path) -> None:
    out = tmp_path / "rig.usda"
    done = shell("reduce", OK, "-o", out, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["output"] == str(out)
    failed = shell("expand", tmp_path / "none.usda", "-o", tmp_path / "x.usda")
    assert failed.returncode == 3
    assert failed.stdout == ""
    assert failed.stderr.startswith("Error: ")
    assert len(failed.stderr.strip().splitlines()) == 1


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from usdhand.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'pxr', 'scipy', 'rich', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("[]")
