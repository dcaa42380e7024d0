"""The motion of an ascii result, in a crate beside it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.in_memory import in_memory, sample
from builders.random_stages import random_stage
from conftest import REPOSITORY
from hypothesis import HealthCheck, assume, given, reject, settings
from hypothesis import strategies as st
from oracles.composition import assert_composes_alike
from pxr import Sdf, Tf, Usd

import usdhand
from usdhand.errors import InputError, OutputError
from usdhand.formats import atomic
from usdhand.formats.usd import motion_crate
from usdhand.formats.usd.damage import usd_diagnostics
from usdhand.formats.usd.saving import save
from usdhand.motion import Clip
from usdhand.motion.editing import trim

SAMPLES = REPOSITORY / "samples"
OK = SAMPLES / "gestures" / "ok_01.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
LENIENT = {"suppress_health_check": list(HealthCheck), "print_blob": True}


def clip(first: int = 0, frames: int = 6) -> Clip:
    whole = sample("gestures/ok_01")
    part = trim(whole, whole.time_code(first), whole.time_code(first + frames - 1))
    return replace(in_memory(part), name="Ada")


def report(*arguments: object) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(run(*arguments, "--json").stdout)
    return document


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def shown(path: Path) -> str:
    """All that a file and its parts compose to; what they say of each other left out."""
    layer = Usd.Stage.Open(str(path)).Flatten(addSourceFileComment=False)
    layer.ClearCustomLayerData()
    layer.comment = ""
    return str(layer.ExportToString())


def assert_split_alike(source: Path, folder: Path) -> None:
    one, two = Sdf.Layer.FindOrOpen(str(source)), Sdf.Layer.CreateAnonymous(".usda")
    two.TransferContent(one)
    target = source.with_name("split.usda")
    save(two, target, split=True)
    assert (folder / "split.motion.usdc").exists() == bool(motion_crate._heavy(one))
    stages = [Usd.Stage.Open(str(path)) for path in (source, target)]
    assert_composes_alike(*stages)
    for before, after in zip(*(stage.TraverseAll() for stage in stages), strict=True):
        assert before.GetPath() == after.GetPath()  # in the same order


@settings(max_examples=30, **LENIENT)
@given(st.data())
def test_random_layers_compose_as_before(data: st.DataObject) -> None:
    with (
        TemporaryDirectory() as name,
        usd_diagnostics(),
        pytest.MonkeyPatch.context() as patch,
    ):
        source = random_stage(Path(name), data.draw)
        try:
            stage = Usd.Stage.Open(str(source))
        except Tf.ErrorException:  # USD trips over some arcs that lead nowhere
            reject()
        assume(len(list(stage.TraverseAll())) <= 200)
        patch.setattr(motion_crate, "MANY_SAMPLES", data.draw(st.integers(0, 2)))
        patch.setattr(motion_crate, "LONG_ARRAY", 0)
        assert_split_alike(source, Path(name))


def test_text_and_motion_are_apart(tmp_path: Path) -> None:
    usdhand.write_new(clip(), tmp_path / "a.usda")
    usdhand.write_new(clip(), tmp_path / "whole.usda", flatten=True)
    usdhand.write_new(clip(frames=4), tmp_path / "short.usda")
    assert names(tmp_path) == ["a.motion.usdc", "a.usda", "short.usda", "whole.usda"]
    assert "timeSamples" not in (tmp_path / "a.usda").read_text()
    assert shown(tmp_path / "a.usda") == shown(tmp_path / "whole.usda")
    crate = Sdf.Layer.FindOrOpen(str(tmp_path / "a.motion.usdc"))
    assert crate.timeCodesPerSecond == clip().fps


@pytest.mark.parametrize(
    "arguments",
    [
        ("convert", OK),
        ("reduce", OK),
        ("splice", BODY, HANDS, "--pin", "1:1", "--pin", "181:403"),
    ],
)
def test_results_are_pairs_that_move_together(
    arguments: tuple[object, ...], tmp_path: Path
) -> None:
    one, two, three = (tmp_path / name for name in ("one", "two", "three"))
    for folder in (one, two):
        folder.mkdir()
        done = report(*arguments, "-o", folder / "out.usda")
        assert [Path(path).name for path in done["outcome"]["written"]] == names(folder)[::-1]
    for name in names(one):
        assert (one / name).read_bytes() == (two / name).read_bytes()
    run(*arguments, "--flatten", "-o", tmp_path / "flat.usda")
    if arguments[0] == "convert":  # the others are over their input
        one.rename(three)
        assert shown(three / "out.usda") == shown(tmp_path / "flat.usda")
    else:
        assert shown(one / "out.usda") == shown(tmp_path / "flat.usda")


def test_alternatives_are_in_the_crate_too(tmp_path: Path, gestures_library: Path) -> None:
    target, flat = tmp_path / "out.usda", tmp_path / "flat.usda"
    given = ["fill", BODY, "--library", gestures_library, "--alternatives", 2]
    run(*given, "-o", target)
    run(*given, "-o", flat, "--flatten")
    assert "timeSamples" not in target.read_text()
    one, two = (Usd.Stage.Open(str(path)) for path in (target, flat))
    for variant in ("choice_1", "choice_2"):
        for stage in (one, two):
            stage.SetEditTarget(stage.GetSessionLayer())
            prim = stage.GetPrimAtPath("/Ada/HandMotion")
            prim.GetVariantSet("fingers").SetVariantSelection(variant)
        assert_composes_alike(one, two)


def test_a_pair_is_written_over_and_read(tmp_path: Path) -> None:
    first, second = tmp_path / "a.usda", tmp_path / "b.usda"
    run("convert", OK, "-o", first)
    run("reduce", first, "-o", second)
    assert report("inspect", second)["files"][0]["fps"] == 30
    run("expand", second, "-o", tmp_path / "c.usda")
    run("convert", tmp_path / "c.usda", "-o", tmp_path / "d.usda")
    one, other = (usdhand.read_clip(tmp_path / name) for name in ("c.usda", "d.usda"))
    assert np.abs(one.rotations - other.rotations).max() < 1e-6


def test_a_changed_pair_is_another_source(tmp_path: Path) -> None:
    """A rig knows its clip by the content of the layer, which knows its crate."""
    source, rig = tmp_path / "a.usda", tmp_path / "r.usda"
    usdhand.write_new(clip(), source)
    run("reduce", source, "-o", rig)
    assert "has changed" not in run("expand", rig, "-o", tmp_path / "e.usda").stderr
    usdhand.write_new(clip(first=9), source, force=True)
    assert "has changed" in run("expand", rig, "-o", tmp_path / "f.usda").stderr


def test_the_motion_is_no_take_of_its_own(tmp_path: Path) -> None:
    takes, library = tmp_path / "takes", tmp_path / "library.usda"
    takes.mkdir()
    for name, first in (("a", 0), ("b", 20)):
        usdhand.write_new(replace(clip(first, 20), name=name), takes / f"{name}.usda")
    for arguments in ([takes], [takes / "*"], sorted(takes.iterdir())):
        files = report("inspect", *arguments)["files"]
        assert [Path(f["path"]).name for f in files] == ["a.usda", "b.usda"]
    done = run("inspect", takes / "a.motion.usdc", code=3)
    assert "the motion of a.usda" in done.stderr
    run("library", "build", takes, "-o", library)
    assert names(tmp_path) == ["library.motion.usdc", "library.usda", "takes"]
    again = report("library", "build", tmp_path, "-o", library)
    assert again["outcome"]["exit_code"] == 0
    usdhand.write_new(replace(clip(5, 20), name="a"), takes / "a.usda", force=True)
    assert len(usdhand.read_library(library).clips) == 2


def test_no_file_is_replaced_unasked(tmp_path: Path) -> None:
    crate = tmp_path / "a.motion.usdc"
    crate.write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"a\.motion\.usdc exists; use --force"):
        usdhand.write_new(clip(), tmp_path / "a.usda")
    usdhand.write_new(clip(), tmp_path / "a.usda", flatten=True)
    assert crate.read_bytes() == b"mine"
    shutil.copy(OK, tmp_path / "b.motion.usdc")
    done = run("convert", tmp_path / "b.motion.usdc", "-o", tmp_path / "b.usda", "--force", code=2)
    assert "is an input" in done.stderr


def test_what_is_replaced_leaves_no_motion(tmp_path: Path) -> None:
    for flatten, frames in ((True, 6), (False, 4)):
        usdhand.write_new(clip(), tmp_path / "a.usda", force=True)
        assert names(tmp_path) == ["a.motion.usdc", "a.usda"]
        usdhand.write_new(clip(frames=frames), tmp_path / "a.usda", flatten=flatten, force=True)
        assert names(tmp_path) == ["a.usda"]


def test_another_motion_is_told(tmp_path: Path) -> None:
    usdhand.write_new(clip(), tmp_path / "a.usda")
    usdhand.write_new(clip(first=9), tmp_path / "b.usda")
    shutil.copy(tmp_path / "b.motion.usdc", tmp_path / "a.motion.usdc")
    assert {p.code for p in usdhand.read_clip(tmp_path / "a.usda").problems} == {"other-motion"}
    (tmp_path / "a.motion.usdc").unlink()
    with pytest.raises(InputError):
        usdhand.read_clip(tmp_path / "a.usda")


def test_what_a_layer_says_of_its_motion_does_not_go_on(tmp_path: Path) -> None:
    usdhand.write_new(clip(), tmp_path / "a.usda")
    for options in ([], ["--flatten"]):
        run("reduce", tmp_path / "a.usda", "-o", tmp_path / "r.usdc", "--force", *options)
        layer = Sdf.Layer.FindOrOpen(str(tmp_path / "r.usdc"))
        assert "motionSha256" not in str(layer.customLayerData)


# -- ended at any moment ------------------------------------------------------------------------


def ended_at(write: Callable[[], object], number: int, how: Callable[[], object]) -> bool:
    """Do it in a child whose ``number``-th call that changes a folder ends it; whether it did."""
    child = os.fork()
    if not child:
        left = [number]

        def counted(function: Callable[..., object]) -> Callable[..., object]:
            def call(*arguments: object, **options: object) -> object:
                left[0] -= 1
                if left[0] < 0 and left[0] == -1:
                    how()
                return function(*arguments, **options)

            return call

        for name in ("replace", "link", "fsync", "unlink"):
            setattr(os, name, counted(getattr(os, name)))
        Path.unlink = counted(Path.unlink)  # type: ignore[method-assign]
        Sdf.Layer.Export = counted(Sdf.Layer.Export)
        try:
            write()
        except BaseException:
            os._exit(3)
        os._exit(4 if left[0] >= 0 else 0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 4


def killed() -> None:
    os._exit(9)


def full() -> None:
    raise OSError(28, "No space left on device")


def told_to_end() -> None:
    os.kill(os.getpid(), 15)


@pytest.mark.slow  # alone (-n 0): a fork beside threads of USD may wait for ever
@pytest.mark.skipif(os.name != "posix", reason="this system has no fork")
@pytest.mark.parametrize("how", [killed, full, told_to_end])
@pytest.mark.parametrize("was_there", [True, False])
def test_a_pair_is_whole_or_as_it_was(
    how: Callable[[], object], was_there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new, target = clip(), clip(first=9), tmp_path / "out" / "a.usda"
    for name, motion in (("old", old), ("new", new)):
        usdhand.write_new(motion, tmp_path / f"{name}.usda")
    before, after = (shown(tmp_path / f"{name}.usda") for name in ("old", "new"))
    files = ["a.motion.usdc", "a.usda"]
    number, going = 0, True
    while going:
        shutil.rmtree(target.parent, ignore_errors=True)
        target.parent.mkdir()
        if was_there:
            usdhand.write_new(old, target)
        going = ended_at(lambda: usdhand.write_new(new, target, force=True), number, how)
        is_there = target.exists()
        assert is_there or not was_there
        assert not is_there or shown(target) in (before, after), number
        monkeypatch.setattr(atomic, "_tidied", set())
        atomic.tidy(target.parent)
        assert names(target.parent) == (files if is_there else []), number
        assert not is_there or shown(target) in (before, after), number
        number += 1
    assert number > 8
    assert shown(target) == after
