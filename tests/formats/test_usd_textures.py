"""Textures of files that are converted: plain, in UDIM tiles, and inside packages."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest
from builders import stages
from builders.cli_runner import run
from pxr import Sdf, Usd, UsdShade, UsdUtils

from usdhand.errors import OutputError
from usdhand.formats.usd import saving, write
from usdhand.formats.usd.check import check_file

TILES = ("1001", "1002")


@pytest.fixture
def textured(tmp_path: Path) -> Path:
    """A character with textures beside its file, one in tiles, one in a variant."""
    folder = tmp_path / "in" / "t"
    (folder / "other").mkdir(parents=True)
    for name in ("p.png", "other/p.png", *(f"u.{tile}.png" for tile in TILES)):
        (folder / name).write_bytes(f"the picture {name}".encode())
    path = stages.character(tmp_path / "in" / "in.usda")
    stage = stages.edited(path)
    for name, asset in (("Plain", "./t/p.png"), ("Tiles", "./t/u.<UDIM>.png")):
        shader = UsdShade.Shader.Define(stage, f"/Hero/{name}")
        shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(asset)
    prim = stage.DefinePrim("/Hero/Look")
    look = prim.GetVariantSets().AddVariantSet("look")
    look.AddVariant("one")
    look.SetVariantSelection("one")
    with look.GetVariantEditContext():
        prim.CreateAttribute("inputs:file", Sdf.ValueTypeNames.Asset).Set("./t/other/p.png")
    stage.Save()
    return path


@pytest.fixture
def packed(textured: Path, tmp_path: Path) -> Path:
    """The same as a package that USD made."""
    path = tmp_path / "in.usdz"
    here = Path.cwd()
    os.chdir(textured.parent)
    try:
        assert UsdUtils.CreateNewUsdzPackage(textured.name, str(path))
    finally:
        os.chdir(here)
    return path


def pictures(path: Path) -> list[str]:
    """What the textures of a file hold, as USD finds them: plain, tiles, variant."""
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    plain, look = (
        stage.GetAttributeAtPath(f"/Hero/{name}.inputs:file").Get().resolvedPath
        for name in ("Plain", "Look")
    )
    tiles = stage.GetAttributeAtPath("/Hero/Tiles.inputs:file").Get().path
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(tiles, layer)
    assert tuple(tile for _, tile in found) == TILES
    return [content(path) for path in (plain, *(path for path, _ in found), look)]


def content(path: str) -> str:
    if "[" not in path:
        return Path(path).read_text()
    package, inner = path.rstrip("]").split("[")
    return zipfile.ZipFile(package).read(inner).decode()


ALL = [f"the picture {name}" for name in ("p.png", "u.1001.png", "u.1002.png", "other/p.png")]


@pytest.mark.parametrize("suffix", ["usda", "usdz"])
@pytest.mark.parametrize("source", ["textured", "packed"])
def test_textures_go_along(
    source: str,
    suffix: str,
    tmp_path: Path,
    request: pytest.FixtureRequest,
    capfd: pytest.CaptureFixture[str],
) -> None:
    path: Path = request.getfixturevalue(source)
    (tmp_path / "out").mkdir()
    target = tmp_path / "out" / f"new.{suffix}"
    run("convert", path, "-o", target)
    assert "Warning" not in capfd.readouterr().err
    assert pictures(target) == ALL
    assert not [f for f in check_file(target) if f.severity == "error"]
    if suffix == "usdz":
        names = zipfile.ZipFile(target).namelist()
        assert len(names) == 5
        assert not [name for name in names if ".." in name or name.endswith(".usdz")]
        textured = tmp_path / "moved.usdz"
        target.rename(textured)
        assert pictures(textured) == ALL
    beside = sorted(p.name for p in (tmp_path / "out").rglob("*"))
    if (source, suffix) == ("packed", "usda"):
        own = [
            "2_p.png",
            "new.motion.usdc",
            "new.usda",
            "new_textures",
            "p.png",
            "u.1001.png",
            "u.1002.png",
        ]
        assert beside == own
    else:
        assert len(beside) == 2 * (suffix == "usda")  # with the motion


def test_where_textures_of_a_package_are_is_said(packed: Path, tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous()
    layer.subLayerPaths.append(str(packed))
    [said] = write.save_layer(layer, tmp_path / "new.usda", flatten=True)
    assert (said.code, said.severity) == ("textures", "note")
    assert said.message == "the textures inside in.usdz are copied to new_textures"


def test_files_beside_are_never_replaced(packed: Path, tmp_path: Path) -> None:
    target, folder = tmp_path / "new.usda", tmp_path / "new_textures"
    folder.mkdir()
    (folder / "p.png").write_text("mine")
    run("convert", packed, "-o", target)
    assert (folder / "p.png").read_text() == "mine"
    assert [p.name for p in folder.iterdir()] == ["p.png"]
    assert pictures(target) == ALL
    run("convert", packed, "-o", target, "--force")  # the same files again need no third folder
    assert sorted(p.name for p in tmp_path.glob("new*")) == [
        *("new.motion.usdc", "new.usda", "new_textures", "new_textures2")
    ]


@pytest.mark.parametrize("failure", ["replace", "verify"])
def test_a_failure_takes_textures_back(
    failure: str, packed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(*((os, "replace") if failure == "replace" else (saving, "verify")), fail)
    layer = Sdf.Layer.CreateAnonymous()
    layer.subLayerPaths.append(str(packed))
    with pytest.raises(OutputError, match="No space left"):
        write.save_layer(layer, tmp_path / "new.usda", flatten=True)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_texture_that_is_missing_stays_named(textured: Path, tmp_path: Path) -> None:
    for path in (textured.parent / "t").glob("*.png"):
        path.unlink()
    target = tmp_path / "new.usda"
    run("convert", textured, "-o", target)
    stage = Usd.Stage.Open(str(target))
    names = [
        stage.GetAttributeAtPath(f"/Hero/{name}.inputs:file").Get().path
        for name in ("Plain", "Tiles")
    ]
    assert names == ["./in/t/p.png", "./in/t/u.<UDIM>.png"]
    result = run("convert", textured, "-o", tmp_path / "new.usdz", code=2)
    assert str(textured.parent / "t" / "p.png") in result.output.replace("\n", "")
    assert not list(tmp_path.glob("*new.usdz*"))
