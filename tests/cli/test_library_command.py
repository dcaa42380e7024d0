"""Motion libraries: what is kept, what is read again, and what people do to them."""

from __future__ import annotations

import json
import os
import shutil
import signal
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from conftest import REPOSITORY
from pxr import Sdf, Usd

from usdhand.errors import InputError
from usdhand.fill.library import MotionLibrary
from usdhand.formats.usd.library import read_library, write_library
from usdhand.verbs.library import build_library

GESTURES = REPOSITORY / "samples" / "gestures"
CHARACTERS = REPOSITORY / "samples" / "characters"
NAMES = ("big_01", "ok_01", "ok_02", "wipe_01")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder like the samples, with a few gestures and their character."""
    place = tmp_path / "place"
    (place / "gestures").mkdir(parents=True)
    shutil.copytree(CHARACTERS, place / "characters")
    for name in NAMES:
        shutil.copy(GESTURES / f"{name}.usdc", place / "gestures")
    return place


@pytest.fixture
def library(folder: Path) -> Path:
    path = folder / "library.usdc"
    run("library", "build", folder / "gestures", "-o", path)
    return path


def build(folder: Path, *more: object) -> dict[str, object]:
    text = run(
        "library", "build", folder / "gestures", "-o", folder / "library.usdc", "--json", *more
    ).stdout
    return dict(json.loads(text))


def assert_same(a: MotionLibrary, b: MotionLibrary) -> None:
    assert [c.name for c in a.clips] == [c.name for c in b.clips]
    for x, y in zip(a.clips, b.clips, strict=True):
        for name in ("path", "skel", "label", "actor", "height", "fps", "duration", "content_hash"):
            assert getattr(x, name) == getattr(y, name)
        assert set(x.hands) == set(y.hands)
        for side in x.hands:
            one, other = x.hands[side], y.hands[side]
            assert (one.joints, one.segments) == (other.joints, other.segments)
            np.testing.assert_allclose(one.fingers, other.fingers, atol=1e-4)
            for field in fields(one.arm):
                ours, theirs = getattr(one.arm, field.name), getattr(other.arm, field.name)
                np.testing.assert_allclose(ours, theirs, atol=1e-4)


def test_round_trip(folder: Path) -> None:
    paths = sorted((folder / "gestures").iterdir())
    built = build_library(paths, folder / "library.usda").library
    write_library(built, folder / "library.usda")
    read = read_library(folder / "library.usda")
    assert_same(built, read)
    assert read.segmentation == built.segmentation
    assert [c.label for c in read.clips] == ["big", "ok", "ok", "wipe"]


@pytest.mark.usefixtures("library")
def test_only_what_changed_is_read_again(folder: Path) -> None:
    assert (build(folder)["read"], build(folder)["unchanged"]) == (0, 4)
    shutil.copy(GESTURES / "small_03.usdc", folder / "gestures" / "ok_02.usdc")
    assert (build(folder)["read"], build(folder)["unchanged"]) == (1, 0 + 4)
    (folder / "gestures" / "ok_01.usdc").unlink()
    assert build(folder)["clips"] == 3
    assert build(folder, "--rebuild")["read"] == 3


def test_other_segments_need_no_reading(folder: Path, library: Path) -> None:
    before = read_library(library)
    assert build(folder, "--longest", 1)["read"] == 0
    after = read_library(library)
    assert sum(len(c.hands["left"].segments) for c in after.clips) < sum(
        len(c.hands["left"].segments) for c in before.clips
    )
    run("library", "build", folder / "gestures", "-o", folder / "new.usdc", "--longest", 1)
    assert_same(after, read_library(folder / "new.usdc"))


def test_what_someone_edited_stays(folder: Path, library: Path) -> None:
    stage = Usd.Stage.Open(str(library))
    stage.GetPrimAtPath("/Library/Clips/ok_02").GetAttribute("usdhand:label").Set("circle")
    stage.RemovePrim("/Library/Clips/big_01")
    stage.Save()
    del stage
    assert [c.label for c in read_library(library).clips] == ["ok", "circle", "wipe"]
    (folder / "gestures" / "ok_01.usdc").rename(folder / "gestures" / "fine_01.usdc")
    build(folder)
    clips = read_library(library).clips
    assert [c.label for c in clips] == ["big", "fine", "circle", "wipe"]


def words(library: Path) -> dict[str, tuple[str, str]]:
    return {c.name: (c.label, c.actor) for c in read_library(library).clips}


def test_hand_work_outlives_changed_files_and_rebuild(folder: Path, library: Path) -> None:
    edit_prim(library, "/Clips/ok_02.usdhand:label", "circle")
    edit_prim(library, "/Clips/ok_02.usdhand:actor", "Ada")
    edit_prim(library, "/Clips/wipe_01.usdhand:label", "")
    shutil.copy(GESTURES / "small_03.usdc", folder / "gestures" / "ok_02.usdc")
    expected = {"ok_02": ("circle", "Ada"), "wipe_01": ("", "")}
    expected |= {"big_01": ("big", ""), "ok_01": ("ok", "")}
    assert build(folder)["read"] == 1
    assert words(library) == expected
    assert build(folder, "--rebuild")["read"] == 4
    assert words(library) == expected
    table = folder / "labels.csv"
    table.write_text("file,label\nok_02,ring\n")
    build(folder, "--labels", table, "--rebuild")
    assert words(library) == expected | {"ok_02": ("ring", "Ada")}
    # A file that was renamed takes its label along; the new one of its name has none yet.
    (folder / "gestures" / "ok_02.usdc").rename(folder / "gestures" / "fine_01.usdc")
    shutil.copy(GESTURES / "ok_02.usdc", folder / "gestures" / "ok_02.usdc")
    build(folder)
    assert words(library) == expected | {"fine_01": ("ring", "Ada"), "ok_02": ("ok", "")}


def test_clips_that_are_not_given_any_more_are_listed(folder: Path, library: Path) -> None:
    edit_prim(library, "/Clips/ok_02.usdhand:label", "circle")
    one = folder / "gestures" / "ok_01.usdc"
    shutil.copy(library, folder / "copy.usdc")
    text = run("library", "build", one, "-o", library).output
    assert "3 clips of the old library removed" in text
    assert "gestures/ok_02.usdc: circle" in text
    assert "gestures/big_01.usdc: big" not in text
    data = json.loads(run("library", "build", one, "-o", folder / "copy.usdc", "--json").stdout)
    assert {x["path"]: x["label"] for x in data["removed"]} == {
        "gestures/big_01.usdc": "big",
        "gestures/ok_02.usdc": "circle",
        "gestures/wipe_01.usdc": "wipe",
    }
    assert build(folder)["removed"] == []


def test_labels_from_a_table(folder: Path) -> None:
    table = folder / "labels.csv"
    table.write_text(
        "file,label,actor\nok_01,circle,Ada\ngestures/big_01.usdc,wide,\n", "utf-8-sig"
    )
    build(folder, "--labels", table)
    clips = read_library(folder / "library.usdc").clips
    assert [(c.label, c.actor) for c in clips[:3]] == [("wide", ""), ("circle", "Ada"), ("ok", "")]
    table.write_text("file,label,colour\nok_01,circle,red\n")
    arguments = ("library", "build", folder / "gestures", "-o", folder / "library.usdc")
    assert "unknown columns colour" in run(*arguments, "--labels", table, code=3).output
    table.write_text("file;label;actor\nok_01;ring, small;Eve\n")
    build(folder, "--labels", table)
    assert words(folder / "library.usdc")["ok_01"] == ("ring, small", "Eve")
    table.write_text("name;label\nok_01;circle\n")
    assert "columns file and label" in run(*arguments, "--labels", table, code=3).output


def test_a_broken_clip_is_left_out(folder: Path) -> None:
    (folder / "gestures" / "broken_01.usdc").write_bytes(b"PXR-USDC nothing")
    text = run("library", "build", folder / "gestures", "-o", folder / "library.usdc").output
    assert "left out: gestures/broken_01.usdc" in text
    assert text.count("broken_01.usdc") == 1
    read = read_library(folder / "library.usdc")
    assert len(read.clips) == 4
    assert [x.file for x in read.left_out] == ["gestures/broken_01.usdc"]


def test_no_clip_at_all(folder: Path) -> None:
    (folder / "only").mkdir()
    (folder / "only" / "broken.usda").write_text("#usda 1.0\n")
    run("library", "build", folder / "only", "-o", folder / "library.usdc", code=3)
    assert not (folder / "library.usdc").exists()


@pytest.mark.usefixtures("library")
def test_a_moved_folder_still_works(folder: Path) -> None:
    moved = folder.with_name("elsewhere")
    folder.rename(moved)
    info = json.loads(run("library", "info", moved / "library.usdc", "--json").stdout)
    assert info["gone"] == []
    stage = Usd.Stage.Open(str(moved / "library.usdc"))
    assert len(list(stage.GetPrimAtPath("/Library/Clips/ok_01/Motion").GetChildren())) > 0
    (moved / "gestures" / "ok_01.usdc").unlink()
    info = json.loads(run("library", "info", moved / "library.usdc", "--json").stdout)
    assert info["gone"] == ["gestures/ok_01.usdc"]


def test_same_names_and_odd_names(folder: Path) -> None:
    for place, name in (
        ("a", "ok_01"),
        ("b", "ok_01"),
        ("a", "grüß 1"),
        ("a", "gräß 1"),
        ("a", "1"),
    ):
        (folder / place).mkdir(exist_ok=True)
        shutil.copy(GESTURES / "ok_03.usdc", folder / place / f"{name}.usdc")
    run("library", "build", folder / "a", folder / "b", "-o", folder / "library.usdc")
    clips = read_library(folder / "library.usdc").clips
    assert [c.name for c in clips] == ["1", "a_ok_01", "b_ok_01", "gräß 1", "grüß 1"]
    assert len({c.path for c in clips}) == 5


def test_two_processes_give_the_same(folder: Path, library: Path) -> None:
    run("library", "build", folder / "gestures", "-o", folder / "two.usdc", "--jobs", 2)
    assert_same(read_library(library), read_library(folder / "two.usdc"))


def test_an_interrupted_build_goes_on(folder: Path) -> None:
    paths, output = sorted((folder / "gestures").iterdir()), folder / "library.usdc"

    def interrupted(done: int, _: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_library(paths, output, progress=interrupted)
    assert not output.exists()
    assert (build(folder)["read"], sorted(p.name for p in folder.glob(".*"))) == (2, [])


def test_what_is_no_library_is_not_replaced(folder: Path) -> None:
    other = folder / "gestures" / "ok_01.usdc"
    before = other.read_bytes()
    for more in ((), ("--force",), ("--rebuild", "--force")):
        run("library", "build", CHARACTERS / "ada.usdc", "-o", other, *more, code=2)
    assert other.read_bytes() == before


def edit_prim(library: Path, name: str, value: object) -> None:
    layer = Sdf.Layer.FindOrOpen(str(library))
    layer.GetAttributeAtPath(f"/Library{name}").default = value
    layer.Save()


def test_a_library_of_another_version_is_refused(library: Path) -> None:
    edit_prim(library, ".usdhand:libraryVersion", 99)
    with pytest.raises(InputError, match=r"version 99.*--rebuild"):
        read_library(library)
    gesture = library.parent / "gestures" / "ok_01.usdc"
    again = library.with_name("again.usdc")
    shutil.copy(library, again)
    run("library", "build", gesture, "-o", again, code=3)
    assert "are lost" in run("library", "build", gesture, "-o", again, "--rebuild").output
    assert len(read_library(again).clips) == 1
    edit_prim(library, ".usdhand:libraryVersion", 2)
    edit_prim(library, ".usdhand:segmentation:speed", -1.0)
    with pytest.raises(InputError, match="segmentation"):
        read_library(library)


def test_a_library_with_other_thumb_axes_is_built_anew_and_keeps_its_labels(library: Path) -> None:
    name = next(
        clip.name for clip in read_library(library).clips if clip.path.endswith("ok_01.usdc")
    )
    edit_prim(library, f"/Clips/{name}.usdhand:label", "by hand")
    edit_prim(library, ".usdhand:libraryVersion", 1)
    gesture = library.parent / "gestures" / "ok_01.usdc"
    assert "--rebuild" in run("library", "build", gesture, "-o", library, code=3).output
    run("library", "build", gesture, "-o", library, "--rebuild")
    [clip] = read_library(library).clips
    assert clip.label == "by hand"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("right:arm", [1.0, 2.0]),
        ("right:arm", []),
        ("right:segments", [(0, 100000)]),
        ("right:segments", [(4, 4)]),
        ("right:joints", ["Nose"]),
        ("height", 0.0),
        ("height", float("nan")),
        ("height", -170.0),
        ("fps", float("inf")),
        ("left:fingers", None),
        ("left:fingers", [1e12] * 45),
        ("left:arm", [1e30] * 35),
    ],
)
def test_a_damaged_clip_is_left_out_and_listed(library: Path, name: str, value: object) -> None:
    edit_prim(library, f"/Clips/ok_01.usdhand:{name}", value)
    read = read_library(library)
    assert [c.name for c in read.clips] == ["big_01", "ok_02", "wipe_01"]
    assert [entry.file for entry in read.damaged] == ["/Library/Clips/ok_01"]
    text = run("library", "info", library).output
    assert "cannot be used: /Library/Clips/ok_01: " in text


def test_not_a_number_and_foreign_prims(folder: Path, library: Path) -> None:
    layer = Sdf.Layer.FindOrOpen(str(library))
    fingers = layer.GetAttributeAtPath("/Library/Clips/ok_01.usdhand:left:fingers")
    values = list(fingers.default)
    values[7] = float("nan")
    fingers.default = values
    layer.Save()
    stage = Usd.Stage.Open(str(library))
    stage.DefinePrim("/Library/Clips/Camera", "Camera")
    for name in ("big_01", "wipe_01"):
        stage.GetPrimAtPath(f"/Library/Clips/{name}").SetActive(False)
    stage.Save()
    del stage
    read = read_library(library)
    assert [c.name for c in read.clips] == ["ok_02"]
    reasons = {entry.file: entry.message for entry in read.damaged}
    assert "no usdhand:name" in reasons["/Library/Clips/Camera"]
    assert "not numbers" in reasons["/Library/Clips/ok_01"]
    body = REPOSITORY / "samples" / "conversations" / "talk_01_body.usdc"
    text = run("fill", body, "--library", library, "-o", library.parent / "o.usda").output
    assert "/Library/Clips/ok_01 of the library cannot be used" in text
    assert build(folder)["read"] == 3  # what is damaged is read again
    assert read_library(library).damaged == ()
    stage = Usd.Stage.Open(str(library))
    for prim in stage.GetPrimAtPath("/Library/Clips").GetChildren():
        prim.GetAttribute("usdhand:duration").Set(0.0)
    stage.Save()
    with pytest.raises(InputError, match="none of its 4 clips"):
        read_library(library)


def test_folders_in_folders(folder: Path) -> None:
    (folder / "gestures" / "more" / "deep").mkdir(parents=True)
    (folder / "gestures" / ".cache").mkdir()
    flat = Usd.Stage.Open(str(GESTURES / "small_03.usdc")).Flatten()
    for place in ("more/deep", ".cache"):
        flat.Export(str(folder / "gestures" / place / "small_03.usdc"))
    built = build(folder)
    assert built["clips"] == 5
    clips = read_library(folder / "library.usdc").clips
    assert clips[3].path == "gestures/more/deep/small_03.usdc"
    again = run("library", "build", folder, "-o", folder / "library.usdc", "--json")
    left = {x["path"]: x["reason"] for x in json.loads(again.stdout)["left_out"]}
    assert all(path.startswith("characters/") for path in left)
    shutil.copy(folder / "library.usdc", folder / "gestures" / "old.usdc")
    text = run("library", "build", folder / "gestures", "-o", folder / "library.usdc").output
    assert text.count("left out: gestures/old.usdc: it is a motion library") == 1
    (folder / "empty" / "inside").mkdir(parents=True)
    message = run("library", "build", folder / "empty", "-o", folder / "e.usdc", code=2).output
    assert "folders below" in message


def test_labels_without_a_clip_are_reported(folder: Path) -> None:
    table = folder / "labels.csv"
    table.write_text("file,label\nok_01,circle\nok_9,x\nother/ok_02,y\n")
    arguments = ("library", "build", folder / "gestures", "-o", folder / "library.usdc")
    text = run(*arguments, "--labels", table).output
    assert "2 rows match no clip: ok_9, other/ok_02" in text
    data = json.loads(run(*arguments, "--labels", table, "--json").stdout)
    assert data["labels_without_clip"] == ["ok_9", "other/ok_02"]
    assert data["settings"]["segmentation"]["speed"] == 15.0


def test_an_interruption_says_what_was_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from usdhand.verbs import library as verb

    def interrupted(items, *_):  # type: ignore[no-untyped-def]
        for number, item in enumerate(items):
            if number == 2:
                raise KeyboardInterrupt
            yield item

    monkeypatch.setattr(verb, "each", interrupted)
    arguments = ("library", "build", folder / "gestures", "-o", folder / "library.usdc")
    text = run(*arguments, code=130).output
    assert "2 clips read so far are kept" in text
    monkeypatch.undo()
    assert build(folder)["read"] == 2


def test_sigterm_is_an_interruption_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from usdhand.verbs import library as verb

    def terminated(items, *_):  # type: ignore[no-untyped-def]
        for number, item in enumerate(items):
            if number == 2:
                os.kill(os.getpid(), signal.SIGTERM)
            yield item

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(verb, "each", terminated)
    arguments = ("library", "build", folder / "gestures", "-o", folder / "library.usdc")
    assert "2 clips read so far are kept" in run(*arguments, code=143).output
    assert signal.getsignal(signal.SIGTERM) is before
    monkeypatch.undo()
    assert build(folder)["read"] == 2


def test_output_is_valid(library: Path) -> None:
    result = json.loads(run("check", library, "--json").stdout)
    assert "error" not in {f["severity"] for file in result["files"] for f in file["findings"]}
