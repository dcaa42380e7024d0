"""Values that are not finite or absurd, and files that are damaged, are refused in words."""

from __future__ import annotations

import math
import os
import re
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import edit, run
from builders.in_memory import in_memory, sample
from click.testing import CliRunner
from pxr import Sdf, Usd, UsdGeom

import usdhand
from usdhand.cli.main import main
from usdhand.errors import InputError, UsageError
from usdhand.formats.usd.damage import damage_refused, first_line
from usdhand.inputs import read_json, why_no_file
from usdhand.motion import Clip
from usdhand.motion.plausible import LARGEST, check_clip

REPOSITORY = Path(__file__).resolve().parents[2]
OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"


def clip() -> Clip:
    return in_memory(sample("gestures/ok_01"))


# -- not finite, or absurd ----------------------------------------------------------------------


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("name", ["rotations", "translations", "scales"])
@pytest.mark.parametrize("suffix", ["usda", "usdz", "bvh", "glb"])
def test_no_writer_takes_what_is_not_finite(
    tmp_path: Path, name: str, value: float, suffix: str
) -> None:
    whole = clip()
    values = getattr(whole, name).copy()
    values[2, 5, 0] = value
    joint = whole.skeleton.joints[5]
    has = "is .* cm from its parent" if name == "translations" else f"has a {name[:-1]} .*"
    with pytest.raises(InputError, match=f"{joint} of the result {has} at time code"):
        usdhand.write_new(replace(whole, **{name: values}), tmp_path / f"out.{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("pose", ["bind", "rest"])
def test_poses_are_finite_too(tmp_path: Path, pose: str) -> None:
    whole = clip()
    matrices = getattr(whole.skeleton, pose).copy()
    matrices[3, 0, 3] = math.inf
    broken = replace(whole, skeleton=replace(whole.skeleton, **{pose: matrices}))
    with pytest.raises(InputError, match=f"a {pose} transform"):
        usdhand.write_new(broken, tmp_path / "out.bvh")


def test_what_does_not_move_is_seen_in_one_row() -> None:
    whole = clip()
    row = whole.scales[0].copy()
    check_clip(replace(whole, scales=np.broadcast_to(row, whole.scales.shape)), "f")
    row[1, 1] = 2 * LARGEST
    with pytest.raises(InputError, match="time code"):
        check_clip(replace(whole, scales=np.broadcast_to(row, whole.scales.shape)), "f")


def test_scales_that_half_floats_cannot_hold_are_refused(tmp_path: Path) -> None:
    whole = clip()
    scales = whole.scales.copy()
    scales[1, 4] = 1e6
    with pytest.raises(InputError, match=r"scales at time code .* too large for USD"):
        usdhand.write_new(replace(whole, scales=scales), tmp_path / "out.usda")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("metres", [1e300, 1e-300, math.inf, 0.0, -1.0])
def test_units_that_cannot_be_meant(tmp_path: Path, metres: float) -> None:
    path = edit(OK, tmp_path / "odd.usda", lambda s: UsdGeom.SetStageMetersPerUnit(s, metres))
    with pytest.raises(InputError, match="metersPerUnit is"):
        usdhand.read_clip(path)


@pytest.mark.parametrize("far", [1e300, math.nan, math.inf])
def test_transforms_above_a_skeleton_that_cannot_be_meant(tmp_path: Path, far: float) -> None:
    def move(stage: Usd.Stage) -> None:
        UsdGeom.Xformable(stage.GetDefaultPrim()).AddTranslateOp(opSuffix="far").Set((far, 0, 0))

    with pytest.raises(InputError, match=r"not plausible|not numbers"):
        usdhand.read_clip(edit(OK, tmp_path / "far.usda", move))


# -- damaged ------------------------------------------------------------------------------------


def test_what_usd_raises_is_an_error_for_people(tmp_path: Path) -> None:
    for error in (UnicodeDecodeError("utf-8", b"\x81", 0, 1, "no"), MemoryError()):
        with (
            pytest.raises(InputError, match=r"a\.usdc: the file is damaged"),
            damage_refused("a.usdc"),
        ):
            raise error
    with pytest.raises(InputError, match=r"the file is damaged"), damage_refused("a.usdc"):
        Sdf.Layer.FindOrOpen(str(tmp_path)).GetPrimAtPath("nonsense")
    with pytest.raises(TypeError, match="another"), damage_refused("a.usdc"):
        raise TypeError("another mistake is ours")


def test_what_usd_says_is_short_and_printable() -> None:
    assert first_line("a\x00b\x1b[31m.\nsecond") == "a?b?[31m"
    assert len(first_line("x" * 9000)) < 300
    assert first_line() == "no reason given"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{" * 100_000, "property name"),
        ("[" * 100_000 + "]" * 100_000, "nested"),
        ('{"a": NaN}', "NaN"),
        ('{"a": -Infinity}', "Infinity"),
        ('{"a": 1e999}', "1e999"),
        (f'{{"a": {"9" * 5000}}}', "99"),
        ('{"a": "\\ud800"}', "surrogates"),
        ("nonsense", "Expecting value"),
    ],
)
def test_json_that_no_report_has(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "report.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=reason):
        read_json(path)
    run("preview", OK, "--with-report", path, "-o", tmp_path / "page.html", code=3)
    run("rerun", path, code=3)
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]


def test_pairs_of_surrogates_are_text(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text('{"a": "\\ud83d\\ude00"}')
    assert read_json(path) == {"a": "😀"}


# -- files that are none ------------------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize(
    "arguments",
    [
        ("inspect", "p.bvh"),
        ("inspect", "p.usda"),
        ("inspect", "p.glb"),
        ("inspect", "p.fbx"),
        ("check", "p.usdc"),
        ("inspect", OK, "--map", "p.toml"),
        ("preview", OK, "--with-report", "p.json", "-o", "page.html"),
        ("preview", OK, "--figure", "p.svg", "-o", "page.html"),
        ("rerun", "p.json"),
        ("library", "info", "p.usdc"),
        ("library", "build", OK, "--labels", "p.csv", "-o", "l.usdc"),
        ("convert", OK, "-o", "p.bvh", "--force"),
    ],
    ids=lambda arguments: " ".join(str(a) for a in arguments if a is not OK),
)
def test_pipes_are_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    name = next(str(a) for a in arguments if str(a).startswith("p."))
    os.mkfifo(name)
    kind = 2 if "--map" in arguments or ("-o" in arguments and arguments[-2] == name) else 3
    assert "neither a file nor a folder" in run(*arguments, code=kind).stderr or kind == 2
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_an_empty_name_is_no_folder() -> None:
    for arguments in (("inspect", ""), ("library", "build", "", "-o", "l.usdc")):
        assert "A file name is empty" in run(*arguments, code=2).stderr


def test_why_a_path_is_no_file(tmp_path: Path) -> None:
    assert why_no_file(tmp_path) == "it is a folder"
    assert why_no_file(tmp_path / "none") == "no such file"
    assert why_no_file("a\0b").startswith("cannot be read")
    assert why_no_file(OK) == ""


def test_a_name_that_is_no_text_is_shown_and_written(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"s\xff.bvh")
    usdhand.write_new(clip(), path)
    run("convert", path, "-o", tmp_path / "out.glb")
    run("preview", path, "-o", tmp_path / "out.html")
    assert "\\udcff" in run("inspect", path).stdout


# -- map files ----------------------------------------------------------------------------------


def test_a_joint_named_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    names = '["Left{digit}1", "Left{digit}2", "Left{digit}2"]'
    path.write_text(f'[house]\nside = ["L", "R"]\nwrist = "{{side}}Hand"\nfinger = {names}\n')
    assert "for both IndexPIP and IndexDIP" in run("inspect", OK, "--map", path, code=2).stderr
    joint = "LeftHandIndex1"
    path.write_text(f'[left]\nIndexMCP = "{joint}"\nIndexPIP = "{joint}"\n')
    assert "for both IndexMCP and IndexPIP" in run("inspect", OK, "--map", path, code=4).stderr


def test_keys_that_the_parser_needs_gigabytes_for(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    for text in (
        "a." * 20_000 + "a = 1",
        "[" + "a." * 20_000 + "a]",
        "a = {" + "b." * 20_000 + "b=1}",
    ):
        path.write_text(text)
        assert "more than 100 dots in line 1" in run("inspect", OK, "--map", path, code=2).stderr
    path.write_text("#" + "." * 300 + "\n")
    run("inspect", OK, "--map", path)
    path.write_text("#" * 2_000_000)
    assert "more than 1 MB" in run("inspect", OK, "--map", path, code=2).stderr


# -- files that a package takes in --------------------------------------------------------------


def textured(folder: Path, *assets: str) -> Path:
    def paint(stage: Usd.Stage) -> None:
        for i, asset in enumerate(assets):
            prim = stage.DefinePrim(f"{stage.GetDefaultPrim().GetPath()}/Shader{i}", "Shader")
            prim.CreateAttribute("inputs:file", Sdf.ValueTypeNames.Asset).Set(asset)

    return edit(OK, folder / "textured.usda", paint)


def test_files_from_outside_are_packed_only_if_that_is_allowed(tmp_path: Path) -> None:
    own = tmp_path / "own"
    (own / "textures").mkdir(parents=True)
    secret, texture = tmp_path / "secret.png", own / "textures" / "skin.png"
    secret.write_bytes(b"secret")
    texture.write_bytes(b"skin")
    (own / "linked.png").symlink_to(secret)
    out = own / "out.usdz"
    for asset in (str(secret), "../secret.png", "linked.png"):
        source = textured(own, asset, "textures/skin.png")
        assert "secret.png would be packed" in run("convert", source, "-o", out, code=2).stderr
        with pytest.raises(UsageError, match="secret"):
            usdhand.convert(source, out)
        assert not out.exists()
        run("convert", source, "-o", out, "--allow-outside")
        assert b"secret" in out.read_bytes()
        out.unlink()
    run("convert", textured(own, "textures/skin.png"), "-o", out)
    run("reduce", textured(own, "../secret.png"), "-o", own / "rig.usdz", code=2)
    run("convert", textured(own, "../secret.png"), "-o", own / "out.usda")


def test_compressed_files_in_packages_are_refused(tmp_path: Path) -> None:
    """USD refuses layers; textures could be of any size."""
    (tmp_path / "skin.png").write_bytes(b"skin" * 1000)
    whole = tmp_path / "whole.usdz"
    run("convert", textured(tmp_path, "skin.png"), "-o", whole)
    for packed, code in ((".png", 3), (".usdc", 3), (".none", 0)):
        odd = tmp_path / f"odd{packed}.usdz"  # USD maps files: one that is open is not rewritten
        with zipfile.ZipFile(whole) as source, zipfile.ZipFile(odd, "w") as target:
            for info in source.infolist():
                stored = not info.filename.endswith(packed)
                kind = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
                target.writestr(info.filename, source.read(info), kind)
        said = run("convert", odd, "-o", tmp_path / "out.usda", "--force", code=code).stderr
        assert "compressed" in said or not code


def test_a_knuckle_on_the_wrist_gives_no_fingers_without_a_word(tmp_path: Path) -> None:
    whole = clip()
    skeleton = whole.skeleton
    knuckle = skeleton.names.index("LeftHandIndex1")
    moved, rest, bind = whole.translations.copy(), skeleton.rest.copy(), skeleton.bind.copy()
    moved[:, knuckle] = rest[knuckle, :3, 3] = 0.0
    away = bind[skeleton.parents[knuckle], :3, 3] - bind[knuckle, :3, 3]
    for joint in (knuckle, *skeleton.descendants(knuckle)):
        bind[joint, :3, 3] += away
    flat = replace(skeleton, rest=rest, bind=bind)
    source = tmp_path / "flat.bvh"
    usdhand.write_new(replace(whole, skeleton=flat, translations=moved), source)
    out = tmp_path / "out.usda"
    for arguments in (("convert", source, "--onto", OK), ("convert", OK, "--onto", source)):
        done = CliRunner().invoke(main, [*map(str, arguments), "-o", str(out), "--force"])
        assert done.exit_code in (0, 3, 4), done.output
        assert done.exit_code or not re.search(r"\bnan\b|\binf\b", out.read_text())
