"""Time codes in files: whole ones stay whole, and a sample alone does not stretch a clip."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from builders.fbx_files import Node, write_fbx
from builders.gltf_files import moving_arm
from oracles.usdskel import assert_same_world
from pxr import Sdf, Usd

from usdhand import read_clip, write_clip
from usdhand.formats.fbx import read as fbx
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.editing import counted_in_frames, recounted

RATES = [24.0, 29.97, 30000 / 1001, 23.976, 59.94]
FIRST, FRAMES = 1003, 12
CODES = [float(code) for code in range(FIRST, FIRST + FRAMES)]
COUNT = len(stages.JOINTS)


def character(path: Path, rate: float, codes: list[float] = CODES) -> Path:
    return stages.character(path, rate=rate, times=codes, start=codes[0], end=codes[-1])


def assert_written(path: Path, codes: list[float], rate: float) -> None:
    """A file has its motion and its range at these very time codes, and no sample at others."""
    stage = Usd.Stage.Open(str(path))
    clip = read_clip(path)
    assert clip.time_codes.tolist() == codes
    assert clip.fps == stage.GetTimeCodesPerSecond() == rate
    rotations = stage.GetPrimAtPath(clip.origin.animation_path).GetAttribute("rotations")
    assert rotations.GetTimeSamples() == codes
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (codes[0], codes[-1])
    layer = stage.GetRootLayer()
    assert set(layer.ListAllTimeSamples()) <= set(codes)


@pytest.mark.parametrize("rate", RATES)
def test_usd_to_usd(tmp_path: Path, rate: float) -> None:
    source = character(tmp_path / "a.usda", rate)
    for name, options, codes in (
        ("plain", (), CODES),
        ("trimmed", ("--trim", "1005:1010"), CODES[2:8]),
        ("at the same rate", ("--fps", repr(rate)), CODES),
        ("started", ("--start", 1001), [c - 2 for c in CODES]),
        (
            "all",
            ("--trim", "1005:", "--fps", repr(rate), "--start", 7),
            [*map(float, range(7, 17))],
        ),
    ):
        out = tmp_path / f"{name}.usda"
        run("convert", source, "-o", out, *options)
        assert_written(out, codes, rate)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("old", [24.0, 25.0])
def test_another_rate_and_start(tmp_path: Path, rate: float, old: float) -> None:
    out = tmp_path / "b.usda"
    run("convert", character(tmp_path / "a.usda", old), "-o", out, "--fps", repr(rate),
        "--start", FIRST)  # fmt: skip
    count = int(np.floor(11 * rate / old + 1e-6)) + 1
    assert_written(out, [float(c) for c in range(FIRST, FIRST + count)], rate)


@pytest.mark.parametrize("rate", RATES)
def test_through_gltf_and_back(tmp_path: Path, rate: float) -> None:
    source = character(tmp_path / "a.usda", rate)
    run("convert", source, "-o", tmp_path / "a.glb")
    run("convert", tmp_path / "a.glb", "-o", tmp_path / "b.usda")
    found = read_clip(tmp_path / "b.usda")
    assert found.time_codes.tolist() == CODES
    assert found.fps == pytest.approx(rate, rel=1e-5)  # glTF says no rate: 23.976 is 24000 / 1001


@pytest.mark.parametrize("rate", [24.0, 29.97])
def test_from_fbx(tmp_path: Path, rate: float) -> None:
    span = (FIRST / rate, (FIRST + 11) / rate)
    nodes = [Node("Hips", keys={("Lcl Rotation", "X"): [(span[0], 0.0), (span[1], 45.0)]})]
    settings = {"TimeMode": 14, "CustomFrameRate": rate}
    path = write_fbx(tmp_path / "a.fbx", nodes, takes={"Take": span}, settings=settings)
    run("convert", path, "-o", tmp_path / "b.usda")
    assert_written(tmp_path / "b.usda", CODES, rate)


@pytest.mark.parametrize("rate", RATES)
def test_clips_that_are_written_anew(tmp_path: Path, rate: float) -> None:
    """A clip of a file that counts otherwise: two time codes a frame, or ticks."""
    for each in (1.0, 2.0, 1000.0):
        codes = [code * each for code in CODES]
        path = stages.character(
            tmp_path / f"a{each:g}.usda", rate=rate * each, times=codes, start=None, end=None
        )
        stage = stages.edited(path)
        stage.SetFramesPerSecond(rate)
        stage.Save()
        clip = read_clip(path)
        assert clip.time_codes.tolist() == codes
        assert clip.fps == rate
        run("convert", path, "-o", tmp_path / "c.glb", "--force")
        found = read_clip(tmp_path / "c.glb")
        assert found.time_codes.tolist() == CODES


def test_time_codes_that_are_no_whole_numbers_stay_what_they_are(tmp_path: Path) -> None:
    codes = [1003.2, 1003.6, 1004.0, 1004.4, 1004.8]
    source = character(tmp_path / "a.usda", 24.0, codes)
    clip = read_clip(source)
    assert clip.time_codes.tolist() == codes
    assert clip.fps == 60.0
    run("convert", source, "-o", tmp_path / "b.usda", "--trim", "1003.5:")
    found = Sdf.Layer.FindOrOpen(str(tmp_path / "b.usda"))
    rotations = Sdf.Path(f"{clip.origin.animation_path}.rotations")
    assert found.ListTimeSamplesForPath(rotations) == codes[1:]


@pytest.mark.parametrize("rate", RATES)
def test_results_over_a_file_have_its_time_codes(tmp_path: Path, rate: float) -> None:
    source = character(tmp_path / "a.usda", rate)
    clip = read_clip(source)
    turned = clip.with_rotations(rot.normalize(clip.rotations + 0.1))
    for name, result in (
        ("same", turned),
        ("counted otherwise", recounted(turned, 2.0 * rate)),
        ("in memory", counted_in_frames(turned)),
    ):
        out = tmp_path / f"{name}.usda"
        write_motion(find_character(source), result, [3], out)
        assert_written(out, CODES, rate)
    write_clip(replace(turned, source=None), tmp_path / "new.usda")
    assert_written(tmp_path / "new.usda", CODES, rate)


# --- one sample ----------------------------------------------------------------------------------


def samples(path: Path, **times: list[float]) -> Clip:
    """A character whose attributes have samples at these times, or a default value."""
    animation = stages.character(path, without=("rotations", "translations", "scales"))
    stage = stages.edited(animation)
    values = {"rotations": stages.waves, "scales": lambda t, n: np.ones((len(t), n, 3))}
    values["translations"] = lambda t, n: np.repeat(stages.offsets(n)[None], len(t), axis=0)
    for name, make in values.items():
        at = times.get(name, [])
        prim = stage.GetPrimAtPath(stages.ANIMATION)
        stages.set_values(prim, name, at, make(at or [0.0], COUNT))
        if len(at) == 1 and name != "rotations":  # which are a sample already
            attribute = prim.GetAttribute(name)
            value = attribute.Get()
            attribute.Clear()
            attribute.Set(value, at[0])
    stage.Save()
    return read_clip(path)


MOVING = [float(t) for t in range(1, 48)]


@pytest.mark.parametrize("once", [-1000.0, 20.5, 1e6])
@pytest.mark.parametrize("name", ["scales", "translations"])
def test_a_sample_alone_does_not_stretch_a_clip(tmp_path: Path, name: str, once: float) -> None:
    clip = samples(tmp_path / "a.usda", rotations=MOVING, **{name: [once]})
    assert clip.time_codes.tolist() == MOVING
    assert "resampled" not in {problem.code for problem in clip.problems}
    assert_same_world(clip)
    assert clip.scales.strides[0] == 0
    run("convert", tmp_path / "a.usda", "-o", tmp_path / "b.usda", "--fps", 24)
    found = read_clip(tmp_path / "b.usda")
    assert found.time_codes.tolist() == MOVING
    assert_same_world(found)


def test_rotations_alone_do_not_either(tmp_path: Path) -> None:
    clip = samples(tmp_path / "a.usda", rotations=[500.0], translations=MOVING)
    assert clip.time_codes.tolist() == MOVING
    assert_same_world(clip)


def test_samples_that_are_all_alone_are_one_frame(tmp_path: Path) -> None:
    clip = samples(tmp_path / "a.usda", rotations=[7.0], translations=[-1000.0], scales=[50.0])
    assert clip.time_codes.tolist() == [7.0]
    assert_same_world(clip)
    late = samples(tmp_path / "b.usda", scales=[50.0])
    assert late.time_codes.tolist() == [50.0]
    assert_same_world(late)


@pytest.mark.parametrize("once", [0.0, 1000.0])
def test_a_key_alone_in_gltf(tmp_path: Path, once: float) -> None:
    times = 10.0 + np.arange(20) / 24.0
    file = moving_arm(times)
    file.curve(3, "translation", np.array([once]), np.array([[1.0, 2.0, 3.0]]))
    clip = read_clip(file.write(tmp_path / "a.glb"))
    assert (len(clip), clip.fps, clip.start) == (20, 24.0, 10.0)
    assert clip.translations[:, 3].tolist() == [[100.0, 200.0, 300.0]] * 20


def test_a_key_alone_in_fbx(tmp_path: Path) -> None:
    """Where the span of the take says nothing and keys decide."""
    times = [(i / 25.0, float(i)) for i in range(10, 31)]
    nodes = [
        Node("Hips", -1, vectors={"Lcl Translation": (0.0, 10.0, 0.0)},
             keys={("Lcl Rotation", "X"): times}),
        Node("Spine", 0, keys={("Lcl Translation", "Y"): [(-40.0, 10.0)]}),
        Node("Head", 1, keys={("Lcl Translation", "Y"): [(900.0, 10.0)]}),
    ]  # fmt: skip
    settings = {"TimeMode": 10}  # 25 frames a second
    path = write_fbx(tmp_path / "a.fbx", nodes, takes={"Take": (0.0, 0.0)}, settings=settings)
    clip = fbx.read_clip(path)
    assert clip.time_codes.tolist() == [float(i) for i in range(10, 31)]
    nodes[0] = Node("Hips")
    path = write_fbx(tmp_path / "b.fbx", nodes, takes={"Take": (0.0, 0.0)}, settings=settings)
    assert fbx.read_clip(path).time_codes.tolist() == [-1000.0]


def test_the_rate_that_fbx_keys_mean(tmp_path: Path) -> None:
    """Of a file that does not say it: with gaps between keys, and at the rates of video."""
    for fps in (24.0, 30000 / 1001, 60.0):
        for frames in (range(40), (0, 1, 2, 20, 39)):
            keys = {("Lcl Rotation", "X"): [(i / fps, float(i)) for i in frames]}
            path = write_fbx(
                tmp_path / "a.fbx", [Node("Hips", keys=keys)], takes={"Take": (0.0, 39 / fps)},
                settings={"TimeMode": 0},
            )  # fmt: skip
            clip = fbx.read_clip(path)
            assert (clip.fps, len(clip)) == (fps, 40)
            assert "guessed-fps" in {problem.code for problem in clip.problems}
