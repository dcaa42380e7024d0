"""Files that refer to others are found by every path to their folder, symbolic links included."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from builders import stages
from builders.every_format import talk
from builders.rewriting import HAND, raw, rewrite, same
from builders.written_over import VERBS, assert_shows, in_memory, result_of, small_library
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st
from pxr import Sdf, Usd

import usdhand as api
from usdhand.fill.library import MotionLibrary
from usdhand.formats.paths import relative_path

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need rights there")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    return small_library(tmp_path_factory.mktemp("library"))


def linked(folder: Path, link: str, to: str) -> tuple[Path, Path]:
    """A folder, by a link to it and by its real path."""
    real = folder / to
    real.mkdir(parents=True)
    (folder / link).parent.mkdir(parents=True, exist_ok=True)
    (folder / link).symlink_to(real)
    return folder / link, real


def sublayer(path: Path) -> str:
    layer = Sdf.Layer.FindOrOpen(str(path))
    [found] = [path for path in layer.subLayerPaths if not path.endswith(".motion.usdc")]
    return found


@pytest.mark.parametrize("verb", VERBS)
def test_results_are_read_by_both_paths(verb: str, library: MotionLibrary, tmp_path: Path) -> None:
    api.write_clip(in_memory(talk()), tmp_path / "take.usdc")
    link, real = linked(tmp_path, "link", "real")
    result = result_of(verb, api.read_clip(tmp_path / "take.usdc"), library, tmp_path)
    result.write(link / "out.usda")
    for folder in (link, real):
        assert_shows(folder / "out.usda", result.clip)
    if verb != "expand":
        assert sublayer(real / "out.usda") == "../take.usdc"


@pytest.mark.parametrize(
    ("link", "to", "source", "expected"),
    [
        ("link", "real", "in.usda", "../in.usda"),
        ("link", "real", "real/in.usda", "./in.usda"),
        ("link", "real", "link/in.usda", "./in.usda"),
        ("link", "a/b/real", "link/in.usda", "./in.usda"),
        ("link", "a/b/real", "a/b/real/in.usda", "./in.usda"),
        ("a/b/link", "c/d/real", "in.usda", "../../../in.usda"),
        ("link", "a/b/real", "in.usda", None),
        ("a/link", "real", "a/in.usda", None),
    ],
)
def test_links_to_other_depths(
    link: str, to: str, source: str, expected: str | None, tmp_path: Path
) -> None:
    by_link, real = linked(tmp_path, link, to)
    path = stages.character(tmp_path / source)
    meant, _ = rewrite(path, by_link / "out.usda")
    shown = [api.read_clip(folder / "out.usda") for folder in (by_link, real)]
    for clip in shown:
        assert abs(clip.rotations - meant.rotations).max() < 1e-6
    assert sublayer(by_link / "out.usda") == (expected or path.as_posix())


def test_an_absolute_path_is_said(tmp_path: Path) -> None:
    by_link, _ = linked(tmp_path, "link", "a/b/real")
    api.write_clip(in_memory(talk()), tmp_path / "take.usdc")
    clip = api.read_clip(tmp_path / "take.usdc")
    [problem] = api.write_clip(clip, by_link / "out.usda")
    assert (problem.code, problem.severity) == ("absolute-path", "warning")
    assert str(tmp_path / "take.usdc") in str(problem)
    assert not api.write_clip(clip, by_link / "flat.usda", flatten=True)
    assert not api.write_clip(clip, tmp_path / "beside.usda")


def test_an_input_that_is_a_link_keeps_its_name(tmp_path: Path) -> None:
    (tmp_path / "store" / "v12").mkdir(parents=True)
    path = stages.character(tmp_path / "store" / "v12" / "take.usda")
    (tmp_path / "take.usda").symlink_to(path)
    rewrite(tmp_path / "take.usda", tmp_path / "out.usda")
    assert sublayer(tmp_path / "out.usda") == "./take.usda"
    assert same(raw(tmp_path / "out.usda", "rotations")[:, :5], raw(path, "rotations")[:, :5])
    assert HAND[0] == 5


def test_libraries_find_their_clips_by_both_paths(tmp_path: Path) -> None:
    clips = sorted((REPOSITORY / "samples" / "gestures").glob("ok_0[12].usdc"))
    for link, to in (("same", "real"), ("other", "a/b/deep")):
        by_link, real = linked(tmp_path, link, to)
        built = api.build_library(clips, by_link / "library.usda")
        api.write_library(built.library, by_link / "library.usda")
        for folder in (by_link, real):
            found = api.read_library(folder / "library.usda")
            assert [(folder / c.path).samefile(p) for c, p in zip(found.clips, clips, strict=True)]
            stage = Usd.Stage.Open(str(folder / "library.usda"))
            motion = stage.GetPrimAtPath("/Library/Clips/ok_01/Motion")
            assert motion.GetChildren()


FOLDERS = ("a", "a/b", "a/b/c", "d", "d/e", "links")


@given(
    to=st.sampled_from(FOLDERS), link=st.sampled_from(FOLDERS), target=st.sampled_from(FOLDERS),
    by_link=st.booleans(),
)  # fmt: skip
def test_a_relative_path_leads_there_from_both(
    to: str, link: str, target: str, by_link: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("tree")
    for folder in FOLDERS:
        (root / folder).mkdir(parents=True, exist_ok=True)
    (root / link / "link").symlink_to(root / to)
    file = root / target / "file"
    file.touch()
    if by_link and target == to:
        file = root / link / "link" / "file"
    folders = root / link / "link", (root / to).resolve()
    relative = relative_path(file, folders[0])
    if relative is None:
        # Each of them would do from one of the two folders only.
        assert Path(os.path.relpath(file, folders[0])) != Path(os.path.relpath(file, folders[1]))
        return
    for folder in folders:
        assert Path(os.path.normpath(folder / relative)).samefile(file)  # as USD reads it
    assert (folders[0] / relative).samefile(file)  # as the system does
