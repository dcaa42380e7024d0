"""The script that compares two versions finds what differs, and nothing else."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.gltf_files import moving_arm
from conftest import REPOSITORY
from pxr import Sdf, Usd, UsdSkel, Vt

sys.path.append(str(REPOSITORY / "benchmarks"))
from same_values import Difference, file_differences, layer_differences


def found(before: Path, after: Path) -> list[Difference]:
    return list(file_differences(before, after))


@pytest.fixture
def take(tmp_path: Path) -> Path:
    path = stages.character(tmp_path / "take.usda")
    stage = stages.edited(path)
    variants = stage.GetPrimAtPath(stages.ANIMATION).GetVariantSets().AddVariantSet("fingers")
    variants.AddVariant("one")
    variants.SetVariantSelection("one")
    with variants.GetVariantEditContext():
        stage.GetPrimAtPath(stages.ANIMATION).CreateAttribute("size", Sdf.ValueTypeNames.Float).Set(
            1.0
        )
    stage.Save()
    return path


def rotations(stage: Usd.Stage) -> Usd.Attribute:
    return UsdSkel.Animation.Get(stage, stages.ANIMATION).GetRotationsAttr()


def one_rotation(stage: Usd.Stage) -> None:
    values = np.array(rotations(stage).Get(5.0))
    values[3, 1] += 1e-6
    rotations(stage).Set(Vt.QuatfArray.FromNumpy(values), 5.0)


def other_signs(stage: Usd.Stage) -> None:
    rotations(stage).Set(Vt.QuatfArray.FromNumpy(-np.array(rotations(stage).Get(5.0))), 5.0)


def in_the_variant(stage: Usd.Stage) -> None:
    layer = stage.GetRootLayer()
    layer.GetAttributeAtPath(f"{stages.ANIMATION}{{fingers=one}}.size").default = 1.5


def offset(stage: Usd.Stage) -> None:
    stage.GetRootLayer().subLayerPaths.append("other.usda")
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(2.0)


CHANGES: dict[str, tuple[Callable[[Usd.Stage], object], str, float | None, str]] = {
    "one number": (one_rotation, "/Hero/Anim.rotations at samples", 1e-6, "1 of 44"),
    "signs": (other_signs, "/Hero/Anim.rotations at samples", None, "signs of quaternions"),
    "in a variant": (in_the_variant, "/Hero/Anim{fingers=one}.size default", 0.5, "1 of 1"),
    "a sample less": (
        lambda s: rotations(s).ClearAtTime(5.0),
        "/Hero/Anim.rotations times of samples", None, "12",
    ),
    "an attribute less": (
        lambda s: s.GetPrimAtPath(stages.ANIMATION).RemoveProperty("scales"),
        "/Hero/Anim.scales", None, "",
    ),
    "a prim more": (lambda s: s.DefinePrim("/Hero/New"), "/Hero/New", None, "a new spec"),
    "metadata": (lambda s: s.SetEndTimeCode(40), "/ endTimeCode", 28.0, ""),
    "a sublayer": (offset, "/ subLayerOffsets", None, "[[2.0, 1.0]]"),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_layers(name: str, suffix: str, take: Path, tmp_path: Path) -> None:
    change, place, size, detail = CHANGES[name]
    before, after = tmp_path / f"before{suffix}", tmp_path / f"after{suffix}"
    Sdf.Layer.OpenAsAnonymous(str(take)).Export(str(before))
    layer = Sdf.Layer.OpenAsAnonymous(str(take))
    change(Usd.Stage.Open(layer))
    layer.Export(str(after))
    assert list(layer_differences(take, before)) == []
    first = found(before, after)[0]
    assert first.place == place
    assert detail in first.detail
    if size is not None:
        assert first.size == pytest.approx(size, rel=0.1)


def test_packages(take: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.usda"
    stage = Usd.Stage.Open(Sdf.Layer.OpenAsAnonymous(str(take)))
    one_rotation(stage)
    stage.GetRootLayer().Export(str(other))
    packages = []
    for name, layer in (("a", take), ("b", other)):
        packages.append(tmp_path / f"{name}.usdz")
        with zipfile.ZipFile(packages[-1], "w") as package:
            package.writestr("take.usda", layer.read_bytes())
    [difference] = found(*packages)
    assert difference.place == "take.usda /Hero/Anim.rotations at samples"


def test_reports(tmp_path: Path) -> None:
    before, after = tmp_path / "a.json", tmp_path / "b.json"
    before.write_text(json.dumps({"usdhand": "1", "x": [1, 2.0], "gone": 1, "n": {"a": "text"}}))
    after.write_text(json.dumps({"usdhand": "2", "x": [1, 2.5], "n": {"a": "text", "more": 1}}))
    assert [(d.place, d.what) for d in found(before, after)] == [
        ("x", "changed"), ("gone", "missing"), ("n.more", "new"),
    ]  # fmt: skip
    assert found(before, after)[0].size == 0.5


def test_gltf(tmp_path: Path) -> None:
    paths = []
    for name, by in (("a", 0.0), ("b", 1e-3)):
        file = moving_arm(np.arange(4) / 30.0 + by)
        paths.append(file.write(tmp_path / f"{name}.glb"))
    first = found(*paths)[0]
    assert first.place.startswith("accessor")
    assert first.size == pytest.approx(1e-3, rel=1e-3)


def test_pages(tmp_path: Path) -> None:
    paths = []
    for name, values in (("a", [0, 3, 4]), ("b", [0, 3, 6])):
        steps = np.diff(values, prepend=0).astype("<i2").tobytes()
        planes = steps[0::2] + steps[1::2]
        array = {"rows": 3, "columns": 1, "kind": "i2", "middle": 1.0, "step": 0.5}
        packed = base64.b64encode(zlib.compress(planes)).decode()
        data = json.dumps({"title": "t", "pack": {"arrays": [array], "data": packed}})
        paths.append(tmp_path / f"{name}.html")
        paths[-1].write_text(f'<p>{name}</p><script id="page-data">{data}</script>')
    [difference] = found(*paths)
    assert (difference.place, difference.size) == ("pack.arrays[].values", 1.0)


def test_texts(tmp_path: Path) -> None:
    before, numbers, words = (tmp_path / f"{name}.bvh" for name in "abc")
    before.write_text("Frames: 2\n1.5 2 3\n")
    numbers.write_text("Frames: 2\n1.5 2.25 3\n")
    words.write_text("Rows: 2\n1.5 2 3\n")
    assert [d.size for d in found(before, numbers)] == [0.25]
    [difference] = found(before, words)
    assert "'Frames: 2' -> 'Rows: 2'" in difference.detail


def test_the_whole_script(tmp_path: Path) -> None:
    """Programs that answer alike and others, run as versions."""
    program = tmp_path / "program.py"
    program.write_text("import sys\nprint(sys.argv[1])\n")

    def compared(before: str, after: str) -> subprocess.CompletedProcess[str]:
        versions = [f"{sys.executable} {program} {word}" for word in (before, after)]
        script = REPOSITORY / "benchmarks" / "same_results.py"
        return subprocess.run(
            [sys.executable, script, *versions, "--verbs", "version", "--work", tmp_path / "w"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip

    same, other = compared("one", "one"), compared("one", "two")
    assert same.returncode == 0, same.stderr
    assert "DIFFERENT" not in same.stdout
    assert other.returncode == 1, other.stderr
    assert "'one' -> 'two'" in other.stdout
