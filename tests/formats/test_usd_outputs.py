"""Outputs: never an input, never half a file, nothing left behind."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from builders.rewriting import HAND, payload, plain, rewrite
from conftest import REPOSITORY
from pxr import Usd, UsdSkel

from usdhand.errors import OutputError
from usdhand.formats.usd import saving, write
from usdhand.formats.usd.read import clip_from_character, read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion

TALK = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"


def refused(path: Path, output: Path, match: str, **options: object) -> None:
    folder = path.parent
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    with pytest.raises(OutputError, match=match) as caught:
        rewrite(path, output, **options)
    assert caught.value.exit_code == 2
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


def test_an_output_that_exists_needs_force(tmp_path: Path) -> None:
    path = plain(tmp_path)
    (tmp_path / "out.usda").write_text("precious")
    refused(path, tmp_path / "out.usda", "exists; use --force")
    meant, found = rewrite(path, tmp_path / "out.usda", force=True)
    assert np.abs(found.rotations - meant.rotations).max() < 1e-6


def test_writing_twice_in_one_process_shows_the_second(tmp_path: Path) -> None:
    path = plain(tmp_path)
    stale = [
        Usd.Stage.Open(str(tmp_path / "out.usda")) for _ in [rewrite(path, tmp_path / "out.usda")]
    ]
    character = find_character(path)
    clip = clip_from_character(character)
    write_motion(character, clip, HAND, tmp_path / "out.usda", force=True)
    assert stale
    found = read_clip(tmp_path / "out.usda")
    assert np.abs(found.rotations - clip.rotations).max() < 1e-6


@pytest.mark.parametrize("name", ["in.usda", "asset.usda"])
def test_inputs_are_never_replaced(name: str, tmp_path: Path) -> None:
    refused(payload(tmp_path), tmp_path / name, "is an input", force=True)


def test_inputs_are_seen_through_links_and_relative_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = plain(tmp_path)
    (tmp_path / "link.usdc").symlink_to(path)
    (tmp_path / "folder").mkdir()
    refused(path, tmp_path / "link.usdc", "is an input", force=True)
    refused(tmp_path / "link.usdc", path, "is an input", force=True)
    refused(path, tmp_path / "folder" / ".." / "in.usdc", "is an input", force=True)
    os.link(path, tmp_path / "hard.usdc")
    refused(path, tmp_path / "hard.usdc", "is an input", force=True)
    monkeypatch.chdir(tmp_path)
    refused(path, Path("in.usdc"), "is an input", force=True)
    refused(Path("in.usdc"), path, "is an input", force=True)


def test_relative_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain(tmp_path)
    monkeypatch.chdir(tmp_path)
    meant, found = rewrite(Path("in.usdc"), Path("out.usdc"))
    assert np.abs(found.rotations - meant.rotations).max() < 1e-6


@pytest.mark.skipif(os.name == "nt", reason="names are text there")
@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_names_that_are_no_text_are_refused(suffix: str, tmp_path: Path) -> None:
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff"))
    path = plain(tmp_path)
    refused(
        path, odd.with_suffix(suffix), r"\\xff\.usd.: this name is not valid UTF-8", flatten=True
    )
    output = odd.with_suffix(suffix)
    result = run("convert", path, "-o", output, code=2)
    assert r"\xff.usd" in result.output
    path = path.rename(odd.with_suffix(".usdc"))
    for verb in (["inspect"], ["check"], ["convert", "-o", tmp_path / "out.usda"]):
        result = run(*verb, path, code=3)
        assert r"\xff.usdc: this name is not valid UTF-8" in result.output.replace("\n", "")
    assert list(tmp_path.iterdir()) == [path]


def test_further_inputs_are_safe_too(tmp_path: Path) -> None:
    other = stages.character(tmp_path / "other.usda")
    refused(plain(tmp_path), other, "is an input", force=True, inputs=[other])


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("out.fbx", r"cannot write '\.fbx'"),
        ("out", "cannot write ''"),
        ("nowhere/out.usda", "no such folder"),
    ],
)
def test_outputs_that_cannot_be(name: str, match: str, tmp_path: Path) -> None:
    refused(plain(tmp_path), tmp_path / name, match)


def test_a_folder_is_no_output(tmp_path: Path) -> None:
    (tmp_path / "out.usda").mkdir()
    refused(plain(tmp_path), tmp_path / "out.usda", "is a folder")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc, a read-only file system")
def test_a_read_only_folder(tmp_path: Path) -> None:
    # Not chmod: it does not stop root, who runs many a container.
    refused(plain(tmp_path), Path("/proc/self/out.usda"), "cannot write there")


FAILURES: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "export": lambda m: _set(m, "export", OutputError("USD cannot write there")),
    "replace": lambda m: m.setattr(os, "replace", _raise(OSError(28, "No space left on device"))),
    "verify": lambda m: m.setattr(saving, "open_stage", _raise(OutputError("cannot be read back"))),
    "interrupt": lambda m: _set(m, "verify", KeyboardInterrupt()),
}


def _set(patch: pytest.MonkeyPatch, name: str, error: BaseException) -> None:
    for module in (saving, write):
        patch.setattr(module, name, _raise(error))


def _raise(error: BaseException) -> Callable[..., None]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


@pytest.mark.parametrize("suffix", [".usdc", ".usdz"])
@pytest.mark.parametrize("flatten", [False, True])
@pytest.mark.parametrize("failure", FAILURES)
def test_a_failure_leaves_nothing_behind(
    failure: str, flatten: bool, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = plain(tmp_path)
    output = tmp_path / f"out{suffix}"
    output.write_text("the old result")
    FAILURES[failure](monkeypatch)
    expected = KeyboardInterrupt if failure == "interrupt" else OutputError
    with pytest.raises(expected):
        rewrite(path, output, flatten=flatten, force=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.usdc", output.name]
    assert output.read_text() == "the old result"


def test_a_full_disk_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    FAILURES["replace"](monkeypatch)
    refused(plain(tmp_path), tmp_path / "out.usdc", "No space left on device")


def test_an_output_that_would_lose_its_input_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "_relative", lambda *_: "./elsewhere.usdc")
    refused(plain(tmp_path), tmp_path / "out.usdc", "elsewhere.usdc cannot be found")


@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_a_default_prim_of_any_depth_is_kept(suffix: str, tmp_path: Path) -> None:
    path = stages.referencing(tmp_path / "in.usda", TALK, prim="/World/Hero")
    stage = stages.edited(path)
    stage.GetRootLayer().defaultPrim = "/World/Hero"
    stage.Save()
    for verb in ("reduce", "convert"):
        target = tmp_path / f"{verb}.{suffix}"
        run(verb, path, "-o", target)
        shot = Usd.Stage.CreateInMemory()
        shot.DefinePrim("/Shot").GetReferences().AddReference(str(target))
        assert any(prim.IsA(UsdSkel.Skeleton) for prim in shot.Traverse())
