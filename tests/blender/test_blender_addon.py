"""The Blender add-on: what an animator sees while moving free channels is what expand gives."""

from __future__ import annotations

import importlib
import json
import os
import re
import shlex
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from builders.blender import blender_python, turned
from builders.cli_runner import run
from conftest import REPOSITORY, shared_data
from numpy.typing import NDArray
from pxr import Usd

import usdhand
from usdhand.anatomy.angles import from_euler, from_swing_twist
from usdhand.anatomy.channels import Channels
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.reduce.limits import Limits
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.settings import ReduceSettings

ADD_ON = REPOSITORY / "docs" / "blender" / "usdhand_rig"
SAMPLES = REPOSITORY / "samples"
TOLERANCE_DEG = 0.002
in_blender = pytest.mark.blender


def blender(folder: Path, **session: object) -> dict[str, object]:
    """One session of the add-on in a Blender of its own."""
    script = folder / "session.json"
    script.write_text(json.dumps(session, default=str), encoding="utf-8")
    hidden = ("PYTHONPATH", "PXR_PLUGINPATH_NAME")
    done = subprocess.run(
        [blender_python(), str(REPOSITORY / "tests" / "blender" / "addon_session.py"), str(script)],
        capture_output=True, text=True, check=False,
        env={k: v for k, v in os.environ.items() if k not in hidden},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "cycle" not in done.stdout + done.stderr
    said: dict[str, object] = json.loads(done.stdout.splitlines()[-1])
    return said


def reduced(clip: Clip, target: Path, **settings: object) -> ReducedRig:
    [reduction] = usdhand.reduce_hands([clip], ReduceSettings(**settings))  # type: ignore[arg-type]
    usdhand.write_rig(reduction, target)
    return reduction.rig


def some_frames(clip: Clip) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, len(clip) - 1, 8).astype(int))


def hand_angles(clip: Clip, poses: Path, index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Degrees (frames, joints) between hand joints in Blender and of a clip, from their parents."""
    shown, skeleton = np.load(poses), clip.skeleton
    joints = [j for f in usdhand.find_hands(clip).frames.values() for j in f.joints]
    assert len(joints) == 30
    turns, bones = turned(shown["posed"]), list(shown["names"])
    own = [bones.index(skeleton.names[j]) for j in joints]
    above = [bones.index(skeleton.names[skeleton.parents[j]]) for j in joints]
    local = np.swapaxes(turns[:, above], -1, -2) @ turns[:, own]
    return rot.angle_between(rot.from_matrix(local), clip.rotations[index][:, joints])


def edits_of(rig: ReducedRig, frame: float) -> list[list[object]]:
    """On each hand a key of one channel and an offset of another, both with followers if any."""
    edits: list[list[object]] = []
    followed = {c for r in rig.relations for c in r.controllers}
    for side in ("ri", "le"):
        own = sorted((n for n in rig.free if n[:2] == side), key=lambda n: n not in followed)
        if own:
            edits.append(["offset", own[0], 6.0])
            edits.append(["key", own[-1], frame, 12.5])
    assert edits
    return edits


def trip(clip: Clip, folder: Path, edits: list[list[object]], rig: Path) -> dict[str, object]:
    """Rig -> Blender -> edits -> export -> expand, which must give what Blender showed."""
    index = some_frames(clip)
    before, edited = rig.read_bytes(), folder / "edited.usda"
    said = blender(
        folder,
        **{"import": rig, "edits": edits, "export": edited, "save": folder / "trip.blend"},
        frames=clip.time_codes[index].tolist(),
        poses=folder / "poses.npz",
    )
    assert rig.read_bytes() == before
    assert said["simple"]
    assert said["valid"]
    assert said["fought_over"] == []
    assert said["fps"] == pytest.approx(clip.origin.time_codes_per_second)
    stage = Usd.Stage.Open(str(rig))
    assert said["range"] == [stage.GetStartTimeCode(), stage.GetEndTimeCode()]
    assert "HandRig" not in said["objects"]  # type: ignore[operator]
    run("expand", edited, "-o", folder / "expanded.usdc")
    expanded = usdhand.read_clip(folder / "expanded.usdc")
    assert len(expanded) == len(clip)
    away = hand_angles(expanded, folder / "poses.npz", index).max()
    print(f"{away:.4f} degrees at most")
    assert away < TOLERANCE_DEG
    unedited = hand_angles(usdhand.expand(rig), folder / "poses.npz", index).max()
    assert (unedited > 5.0) == bool(edits)
    return said


@in_blender
def test_the_guide_works_as_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "samples").symlink_to(SAMPLES)
    monkeypatch.chdir(tmp_path)
    text = (ADD_ON.parent / "README.md").read_text(encoding="utf-8")
    shown = [shlex.split(line)[1:] for line in re.findall(r"^ +(usdhand .*)$", text, re.M)]
    assert [verb for verb, *_ in shown] == ["reduce", "expand"]
    run(*shown[0])
    export = tmp_path / shown[1][1]
    said = blender(tmp_path, **{"import": tmp_path / shown[0][-1], "export": export})
    assert "refused" not in said
    run(*shown[1])
    assert (tmp_path / shown[1][-1]).exists()


@in_blender
def test_an_unedited_rig_comes_back_as_it_was(tmp_path: Path) -> None:
    clip = usdhand.read_clip(SAMPLES / "gestures" / "ok_02.usdc")
    rig = reduced(clip, tmp_path / "rig.usda")
    said = trip(clip, tmp_path, [], tmp_path / "rig.usda")
    assert set(said["keys"]) == set(rig.free)  # type: ignore[call-overload]
    panel = said["panel"]
    assert isinstance(panel, list)
    assert {name for name, _, on in panel if on} == set(rig.free)
    followers = {r.name for r in rig.relations if r.kind == "linear"}
    assert {name for name, _, on in panel if not on} == followers
    assert ["riIndexMCPy", "MCP flexion"] in [row[:2] for row in panel]
    assert ["riThumbCMCy", "CMC rotation"] in [row[:2] for row in panel]
    text = (tmp_path / "edited.usda").read_text(encoding="utf-8")
    assert "timeSamples" not in text


@in_blender
def test_edits_come_back_and_the_blend_file_keeps_its_drivers(tmp_path: Path) -> None:
    clip = usdhand.read_clip(SAMPLES / "gestures" / "big_03.usdc")
    rig = reduced(clip, tmp_path / "rig.usdc", fit="least-squares", controllers=2)
    assert any(len(r.controllers) == 2 for r in rig.relations)
    frame = float(clip.time_codes[some_frames(clip)[3]])
    edits = edits_of(rig, frame)
    trip(clip, tmp_path, edits, tmp_path / "rig.usdc")
    text = (tmp_path / "edited.usda").read_text(encoding="utf-8")
    assert text.count("timeSamples") == len({channel for _, channel, *_ in edits})

    # In a Blender without the add-on and without leave to run scripts.
    frames = clip.time_codes[some_frames(clip)].tolist()
    again = partial(blender, tmp_path, open=tmp_path / "trip.blend", frames=frames)
    assert again(poses=tmp_path / "again.npz")["valid"]
    before, after = np.load(tmp_path / "poses.npz"), np.load(tmp_path / "again.npz")
    assert np.abs(before["posed"] - after["posed"]).max() < 1e-5
    again(poses=tmp_path / "moved.npz", edits=[["offset", edits[0][1], 20.0]])
    moved = turned(np.load(tmp_path / "moved.npz")["posed"]) - turned(after["posed"])
    assert np.abs(moved).max() > 0.2


@in_blender
@pytest.mark.parametrize("controllers", [3, None], ids=["three", "all"])
def test_many_controllers_and_edits_beyond_the_limits(
    tmp_path: Path, controllers: int | None
) -> None:
    """Sums too long for one driver, and free channels moved so far that dependents bend off."""
    clip = usdhand.read_clip(SAMPLES / "gestures" / "big_03.usdc")
    rig = reduced(clip, tmp_path / "rig.usdc", free_channels=22, controllers=controllers)
    most = max(len(r.controllers) for r in rig.relations)
    assert most == 3 if controllers else most > 18
    followed = [n for n in rig.free if any(n in r.controllers for r in rig.relations)]
    edits: list[list[object]] = [["offset", name, 150.0] for name in followed[::3]]
    trip(clip, tmp_path, edits, tmp_path / "rig.usdc")
    stored = usdhand.read_rig(tmp_path / "rig.usdc")
    assert stored.relations == rig.relations
    moved = {str(name): 150.0 for _, name, _ in edits}
    reached = 0
    for r in rig.relations:
        if r.kind == "linear" and r.limits:
            by = sum(s * moved.get(c, 0.0) for c, s in zip(r.controllers, r.slopes, strict=True))
            reached += abs(by) > r.limits.soft_high - r.limits.soft_low
    assert reached


@in_blender
def test_other_units_and_up_axis(tmp_path: Path) -> None:
    clip = usdhand.read_clip(SAMPLES / "gestures_ben" / "wipe_01.usdc")
    rig = reduced(clip, tmp_path / "rig.usda")
    trip(clip, tmp_path, edits_of(rig, 20.0), tmp_path / "rig.usda")


@in_blender
@pytest.mark.real_data
def test_a_character_of_maya(tmp_path: Path) -> None:
    reduced(usdhand.read_clip(SAMPLES / "gestures" / "big_03.usdc"), tmp_path / "big.usda")
    maya = shared_data("maya", "HIK_Export.usda")
    usdhand.write_clip(usdhand.expand_onto(tmp_path / "big.usda", maya), tmp_path / "maya.usdc")
    clip = usdhand.read_clip(tmp_path / "maya.usdc")
    rig = reduced(clip, tmp_path / "rig.usda")
    trip(clip, tmp_path, edits_of(rig, 20.0), tmp_path / "rig.usda")


@in_blender
@pytest.mark.real_data
@pytest.mark.parametrize("rig_size", ["full", "mini"])
def test_a_real_take_whose_thumbs_hang_off_the_forearm(tmp_path: Path, rig_size: str) -> None:
    folder = shared_data("studiogalt", rig_size)
    take = "SG_ASL_7_2023_1_29.usdc" if rig_size == "full" else sorted(folder.iterdir())[0].name
    clip = usdhand.read_clip(folder / take)
    rig = reduced(clip, tmp_path / "rig.usda")
    said = trip(clip, tmp_path, edits_of(rig, 20.0), tmp_path / "rig.usda")
    assert said["drivers"] == 120 + sum(r.kind == "linear" for r in rig.relations)


@in_blender
def test_files_that_are_no_rig_and_outputs_that_are_are_refused(tmp_path: Path) -> None:
    clip = SAMPLES / "gestures" / "ok_02.usdc"
    said = blender(tmp_path, **{"import": clip})
    assert "no hand rig" in str(said["refused"])
    assert said["objects"] == 0
    rig = tmp_path / "rig.usda"
    reduced(usdhand.read_clip(clip), rig)
    before = rig.read_bytes()
    said = blender(tmp_path, **{"import": rig, "export": rig, "thin": 0.5})
    assert "stays as it is" in str(said["refused"])
    assert rig.read_bytes() == before
    assert sum(said["keys"].values()) < 0.5 * len(said["keys"]) * 40  # type: ignore[attr-defined,arg-type]
    left = sorted(p.name for p in tmp_path.iterdir())
    assert left == ["rig.motion.usdc", "rig.usda", "session.json"]


def module(name: str) -> ModuleType:
    """A module of the add-on that needs no Blender, in a package that is not loaded."""
    package = sys.modules.setdefault("usdhand_rig_bare", ModuleType("usdhand_rig_bare"))
    package.__path__ = [str(ADD_ON)]
    return importlib.import_module(f"usdhand_rig_bare.{name}")


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    rig_file = module("rig_file")
    missing = tmp_path / "none.usda"
    with pytest.raises(rig_file.RigError, match=r"none\.usda: no such file"):
        rig_file.read_rigs(str(missing))
    missing.write_text("no USD")
    with pytest.raises(rig_file.RigError, match="cannot be read as USD"):
        rig_file.read_rigs(str(missing))
    rig = tmp_path / "rig.usda"
    reduced(usdhand.read_clip(SAMPLES / "gestures" / "ok_02.usdc"), rig)
    [found] = rig_file.read_rigs(str(rig))
    edited = {c.name: c for c in found.free[:1]}
    with pytest.raises(rig_file.RigError, match="no such folder to write edited"):
        rig_file.write_edits(str(rig), found.path, str(tmp_path / "new" / "edited.usda"), edited)
    assert not (tmp_path / "new").exists()
    rig_file.write_edits(str(rig), found.path, str(tmp_path / "edited.usda"), edited)
    assert len(rig_file.read_rigs(str(tmp_path / "edited.usda"))) == 1


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("ball", [False, True])
def test_expressions_are_the_rotations_of_channels(side: str, ball: bool) -> None:
    rotations, chance = module("rotations"), np.random.default_rng(0)
    mirror = np.array([-1.0, 1.0, -1.0]) if side == "left" else np.ones(3)
    cosines = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "radians": np.radians, "max": max}
    for angles in (np.zeros(3), *chance.uniform(-120, 120, (50, 3))):
        before, after = (q / np.linalg.norm(q) for q in chance.normal(size=(2, 4)))
        channels = (from_swing_twist if ball else from_euler)((angles * mirror)[:, None])[:, 0]
        expected = rot.multiply(rot.multiply(before, channels), after)
        expressions = rotations.expressions(before, after, side, ball)
        assert max(map(len, expressions)) <= rotations.LONGEST
        values = {**cosines, **dict(zip("aft", angles, strict=True))}
        w, *xyz = (eval(e, {"__builtins__": {}}, values) for e in expressions)
        assert np.allclose([*xyz, w], expected, atol=1e-6)


@pytest.mark.parametrize("count", [1, 3, 9, 22, 49])
@pytest.mark.parametrize("limits", [None, (-30.0, -12.25, 41.5, 100.0), (-5.0, -5.0, 9.0, 9.0)])
def test_expressions_of_followers_are_their_relations(
    count: int, limits: tuple[float, ...] | None
) -> None:
    followers, rig_file = module("followers"), module("rig_file")
    chance = np.random.default_rng(count)
    slopes, names = chance.normal(size=count), tuple(f"riChannel{i}" for i in range(count))
    channel = rig_file.Channel(
        "riFollower", "linear", (), (0.0,), names, tuple(slopes), 3.5, limits
    )
    relation = Relation(
        "riFollower",
        "linear",
        3.5,
        names,
        tuple(slopes),
        limits=Limits(*limits) if limits else None,
    )
    rig = ReducedRig((*(Relation(n, "free") for n in names), relation))
    curves = chance.uniform(-150, 150, (40, count))
    expected = rig.evaluate(Channels(names, curves)).select(["riFollower"]).values[:, 0]
    found = []
    for row in curves:
        values = dict(zip(names, row.tolist(), strict=True))
        for name, expression, variables in followers.drivers(channel):
            assert len(expression) <= followers.LONGEST
            own = {letter: values[of] for letter, of in variables}
            scope = {"min": min, "max": max, "__builtins__": {}, **own}
            values[name] = eval(expression, scope)
        found.append(values["riFollower"])
    assert np.abs(np.array(found) - expected).max() < 1e-3
    drawn = [name for name, *_ in followers.drivers(channel)]
    assert drawn[-1] == "riFollower"
    assert count > 1 or len(drawn) == 1
    assert count < 22 or len(drawn) > 1


def test_thinned_keys_stay_within_the_tolerance() -> None:
    thinned = module("keys").thinned
    times = np.arange(200.0)
    keys = np.stack([times, 40 * np.sin(times / 20)], axis=1)
    fewer = thinned(keys, 0.5)
    assert len(fewer) < 50
    assert np.abs(np.interp(times, *fewer.T) - keys[:, 1]).max() <= 0.5
    assert len(thinned(keys, 0.0)) == 200


@in_blender
def test_blender_takes_the_manifest(tmp_path: Path) -> None:
    code = "import bpy, pathlib; print(pathlib.Path(bpy.utils.resource_path('LOCAL')))"
    python = blender_python()
    found = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    tool = Path(found.stdout.splitlines()[-1]) / "scripts/addons_core/bl_pkg/cli/blender_ext.py"
    built = tmp_path / "usdhand_rig.zip"
    for verb in (
        ["validate", ADD_ON],
        ["build", "--source-dir", ADD_ON, "--output-filepath", built],
    ):
        done = subprocess.run(
            [python, tool, *verb], capture_output=True, text=True, check=False, cwd=tmp_path
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert built.stat().st_size > 5000
