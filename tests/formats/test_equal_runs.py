"""Equal runs give equal results, also where USD composes in an order that is left to chance."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from builders import stages
from pxr import Sdf, Usd, Work

from usdhand.formats.usd.flatten import flat_layer
from usdhand.formats.usd.stage import compose, one_thread, usd_diagnostics

KINDS, EACH = 12, 6
in_order = pytest.mark.skipif(
    Usd.GetVersion() < (0, 26, 11),
    reason="USD before 26.11 does not keep to one thread once it has composed with several",
)


def add_crowd(layer: Sdf.Layer) -> None:
    """Instances of several classes, whose connections lead to the first instance of each.

    USD keeps such a connection only where it makes the prototype of the first instance, and takes
    whichever instance its threads meet first.
    """
    for kind in range(KINDS):
        model = Sdf.CreatePrimInLayer(layer, f"/_Model{kind}")
        model.specifier = Sdf.SpecifierClass
        part = Sdf.PrimSpec(model, "Part", Sdf.SpecifierDef, "Xform")
        wire = Sdf.AttributeSpec(part, "inputs:in", Sdf.ValueTypeNames.Double)
        wire.connectionPathList.prependedItems = [f"/Copy0_{kind}/Part.out"]
        for number in range(EACH):
            copy = Sdf.CreatePrimInLayer(layer, f"/Copy{number}_{kind}")
            copy.specifier = Sdf.SpecifierDef
            copy.inheritPathList.prependedItems = [model.path]
            copy.SetInfo("instanceable", True)


def crowded(folder: Path) -> Path:
    path = stages.character(folder / "in.usda")
    stage = stages.edited(path)
    add_crowd(stage.GetRootLayer())
    stage.Save()
    return path


def connections(stage: Usd.Stage) -> list[list[Sdf.Path]]:
    places = [f"/Copy1_{kind}/Part.inputs:in" for kind in range(KINDS)]
    return [stage.GetAttributeAtPath(place).GetConnections() for place in places]


@in_order
def test_stages_with_instances_flatten_alike_each_time(tmp_path: Path) -> None:
    path = str(crowded(tmp_path))
    with usd_diagnostics():
        texts = {flat_layer(compose(path))[0].ExportToString() for _ in range(8)}
    assert len(texts) == 1


@in_order
def test_targets_out_of_instances_are_those_of_the_first_instance(tmp_path: Path) -> None:
    path = str(crowded(tmp_path))
    expected = [[Sdf.Path(f"/Copy0_{kind}/Part.out")] for kind in range(KINDS)]
    with usd_diagnostics():
        for _ in range(50):
            assert connections(compose(path)) == expected


def test_the_host_keeps_its_threads() -> None:
    before = Work.GetConcurrencyLimit()
    with one_thread():
        assert Work.GetConcurrencyLimit() == 1
    assert Work.GetConcurrencyLimit() == before


def test_programs_write_equal_bytes(tmp_path: Path) -> None:
    path = crowded(tmp_path)
    written = set()
    for run in range(4):
        output = tmp_path / f"out{run}" / "out.usda"
        output.parent.mkdir()
        done = subprocess.run(
            [sys.executable, "-m", "usdhand", "convert", path, "-o", output],
            env=os.environ | {"PYTHONHASHSEED": str(run), "TMPDIR": str(output.parent)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert "USD_ASSIGN" not in done.stderr
        written.add(output.read_bytes())
    assert len(written) == 1
