"""The rig reads the same with and without the codeless schema."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY
from pxr import Sdf

import usdhand
from usdhand.formats.schema import schema_folder
from usdhand.formats.usd.rig import CHANNEL_PREFIX
from usdhand.reduce.settings import ReduceSettings

READ = """
import json, sys
from dataclasses import asdict
from pathlib import Path
from usdhand.formats.usd.rig import find_rig, read_stored_rig
stored = read_stored_rig(sys.argv[1])
prim = find_rig(stored.character.stage, Path(sys.argv[1]))
definition = prim.GetPrimDefinition()
print(json.dumps({
    "rig": asdict(stored.rig),
    "free": stored.free.values.tolist(),
    "defined": sorted(n for n in definition.GetPropertyNames() if n.startswith("usdhand:")),
}))
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("schema") / "rig.usda"
    clip = usdhand.read_clip(REPOSITORY / "samples" / "gestures" / "turn_01.usdc")
    [reduction] = usdhand.reduce_hands([clip], ReduceSettings(fit="least-squares", controllers=2))
    usdhand.write_rig(reduction, path)
    return path


def read(path: Path, plugins: str | None) -> dict[str, object]:
    environment = {k: v for k, v in os.environ.items() if k != "PXR_PLUGINPATH_NAME"}
    if plugins:
        environment["PXR_PLUGINPATH_NAME"] = plugins
    done = subprocess.run(
        [sys.executable, "-c", READ, str(path)],
        capture_output=True, text=True, check=True, env=environment, cwd=REPOSITORY,
    )  # fmt: skip
    result: dict[str, object] = json.loads(done.stdout)
    return result


def test_reads_the_same_with_and_without_the_plugin(rig: Path) -> None:
    without, with_plugin = read(rig, None), read(rig, str(schema_folder()))
    assert without.pop("defined") == []
    defined = with_plugin.pop("defined")
    assert isinstance(defined, list)
    assert {"usdhand:fit", "usdhand:channel:riIndexPIPy:kind"} <= set(defined)
    assert without == with_plugin


def test_everything_the_rig_writes_is_in_the_schema(rig: Path) -> None:
    schema = Sdf.Layer.FindOrOpen(str(schema_folder() / "schema.usda"))
    known = set(schema.GetPrimAtPath("/HandRigAPI").properties.keys())
    of_channels = set(schema.GetPrimAtPath("/HandChannelAPI").properties.keys())
    layer = Sdf.Layer.FindOrOpen(str(rig))
    assert len(layer.GetPrimAtPath("/Ada/HandRig").properties) > 50  # a channel has several
    for spec in layer.GetPrimAtPath("/Ada/HandRig").properties:
        assert spec.custom, spec.name
        if spec.name.startswith(f"{CHANNEL_PREFIX}:"):
            assert spec.name.split(":")[3] in of_channels
        else:
            assert spec.name in known


def test_the_generated_schema_is_of_the_source() -> None:
    folder = schema_folder()
    generated = Sdf.Layer.FindOrOpen(str(folder / "generatedSchema.usda"))
    source = Sdf.Layer.FindOrOpen(str(folder / "schema.usda"))
    for name in ("HandRigAPI", "HandChannelAPI"):
        mine = source.GetPrimAtPath(f"/{name}").properties
        assert len(mine) > 3
        theirs = generated.GetPrimAtPath(f"/{name}").properties
        assert {p.name for p in mine} == {p.name.rsplit("__:", 1)[-1] for p in theirs}
