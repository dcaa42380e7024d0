"""`usdhand fill` and `usdhand evaluate`: what comes out, and what people give instead."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import frames_of
from conftest import REPOSITORY, shared_data
from pxr import Sdf, Usd, UsdSkel

import usdhand
from usdhand.anatomy import SIDES
from usdhand.errors import InputError, UsageError
from usdhand.evaluate.reconstruction import HandError
from usdhand.fill.library import MotionLibrary
from usdhand.fill.limits import channel_limits
from usdhand.fill.settings import PAPER, FillSettings
from usdhand.formats.usd.library import read_library, write_library
from usdhand.motion import Clip
from usdhand.motion.resample import resample
from usdhand.motion.rotations import Array
from usdhand.verbs.evaluate import measure_library
from usdhand.verbs.fill import fill_fingers
from usdhand.verbs.library import build_library

OPEN: list[Usd.Stage] = []  # prims live as long as their stage
SAMPLES = REPOSITORY / "samples"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
FULL = SAMPLES / "conversations" / "talk_01_full.usdc"


@pytest.fixture(scope="session")
def library(gestures_library: Path) -> MotionLibrary:
    return read_library(gestures_library)


@pytest.fixture(scope="session")
def body() -> Clip:
    return usdhand.read_clip(BODY)


def part_of(clip: Clip, frames: slice, fps: float | None = None) -> Clip:
    cut = frames_of(clip, frames)
    return cut if fps is None else resample(cut, fps)


def animation(path: Path) -> UsdSkel.Animation:
    """The animation that a file's skeleton is bound to."""
    stage = Usd.Stage.Open(str(path))
    OPEN.append(stage)
    [prim] = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    return UsdSkel.Animation(UsdSkel.BindingAPI(prim).GetInheritedAnimationSource())


def skel_rotations(path: Path, variant: str | None = None) -> Array:
    """What UsdSkel says that an animation's joints do, in the first half of the clip."""
    stage = Usd.Stage.Open(str(path))
    [prim] = [p for p in stage.Traverse() if p.GetName() == "HandMotion"]
    stage.SetEditTarget(stage.GetSessionLayer())  # the file's layer is shared by all stages
    if variant:
        prim.GetVariantSets().SetSelection("fingers", variant)
    query = UsdSkel.Cache().GetAnimQuery(UsdSkel.Animation(prim))
    return np.array([np.array(query.ComputeJointLocalTransforms(t)) for t in range(60, 300, 20)])


def test_body_is_untouched_and_report_is_whole(gestures_library: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "talk.usda", tmp_path / "r.json"
    run("fill", BODY, "--library", gestures_library, "-o", out, "--report", report)
    before, after = animation(BODY), animation(out)
    places = [list(after.GetJointsAttr().Get()).index(j) for j in before.GetJointsAttr().Get()]
    times = before.GetRotationsAttr().GetTimeSamples()
    assert after.GetRotationsAttr().GetTimeSamples() == times
    for time in times:  # in the body's file, fingers are not animated
        for one, other in (
            (before.GetRotationsAttr(), after.GetRotationsAttr()),
            (before.GetTranslationsAttr(), after.GetTranslationsAttr()),
        ):
            assert np.array_equal(np.array(one.Get(time)), np.array(other.Get(time))[places])
    clip = usdhand.read_clip(out)
    for frames in usdhand.find_hands(clip).frames.values():
        assert np.ptp(clip.rotations[:, frames.joints], axis=0).max() > 0.1
    data = json.loads(report.read_text())
    assert data["schema"] == "usdhand.fill/1"
    assert len(data["inputs"]) == 2
    assert {"hands", "alternatives", "kept", "without", "left_out"} <= set(data)
    for side in ("left", "right"):
        segments = data["hands"][side]["segments"]
        assert segments[0]["start"] == 0
        assert segments[-1]["end"] == pytest.approx(clip.duration, abs=0.04)
        for a, b in itertools.pairwise(segments):
            assert a["end"] == b["start"]
        for s in segments:
            assert {"clip", "clip_start", "clip_end", "cost", "transition_cost"} <= set(s)
            assert 1 <= len(s["candidates"]) <= 5
            assert s["clip"] in {c["clip"] for c in s["candidates"]}
        seams = data["hands"][side]["seams"]
        assert seams["max_acceleration_deg_s2"] < 2 * seams["max_acceleration_captured_deg_s2"]
    run("check", out)


def test_alternatives_are_variants(gestures_library: Path, tmp_path: Path) -> None:
    out = tmp_path / "talk.usda"
    arguments = ("fill", BODY, "--library", gestures_library, "--alternatives", 3)
    data = json.loads(run(*arguments, "-o", out, "--json").stdout)
    assert data["settings"]["alternatives"] == 3
    assert data["settings"]["segmentation"]["longest"] == 0.5
    assert {"maps", "flatten", "pool", "replace", "add_fingers"} <= set(data["settings"])
    costs = [a["cost"] for a in data["alternatives"]]
    assert len(costs) == 3
    assert costs == sorted(costs)
    stage = Usd.Stage.Open(str(out))
    [prim] = [p for p in stage.Traverse() if p.GetName() == "HandMotion"]
    chosen = prim.GetVariantSets().GetVariantSet("fingers")
    assert chosen.GetVariantNames() == ["choice_1", "choice_2", "choice_3"]
    assert chosen.GetVariantSelection() == "choice_1"
    spec = stage.GetRootLayer().GetPrimAtPath(prim.GetPath())
    assert not list(spec.properties)  # a local opinion would win over the variants
    motions = [skel_rotations(out, f"choice_{i}") for i in (1, 2, 3)]
    assert np.array_equal(motions[0], skel_rotations(out))
    assert np.abs(motions[0] - motions[1]).max() > 0.01
    assert np.abs(motions[1] - motions[2]).max() > 0.01
    for number, one in enumerate(data["alternatives"], 1):
        assert set(one["hands"]) == {"left", "right"}
        for side, hand in one["hands"].items():
            assert [s["clip"] for s in hand["segments"]] == one["clips"][side]
            assert {"start", "end", "clip_start", "clip_end", "cost"} <= set(hand["segments"][0])
            assert hand["seams"]["max_acceleration_deg_s2"] > 0
        pieces = [(s["clip"], s["clip_start"]) for s in one["hands"]["left"]["segments"]]
        best = [(s["clip"], s["clip_start"]) for s in data["hands"]["left"]["segments"]]
        assert (pieces == best) == (number == 1)


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_one_file_keeps_the_alternatives(
    gestures_library: Path, tmp_path: Path, suffix: str
) -> None:
    over, flat = tmp_path / "over.usdc", tmp_path / "deep" / f"flat{suffix}"
    flat.parent.mkdir()
    arguments = ("fill", BODY, "--library", gestures_library, "--alternatives", 2, "--side", "left")
    run(*arguments, "-o", over)
    run(*arguments, "-o", flat, "--flatten")
    moved = flat.rename(tmp_path / f"moved{suffix}")
    stage = Usd.Stage.Open(str(moved))
    files = {Path(layer.realPath).name for layer in stage.GetUsedLayers() if layer.realPath}
    assert not files & {"talk_01_body.usdc", "ada.usdc", "over.usdc"}
    [prim] = [p for p in stage.Traverse() if p.GetName() == "HandMotion"]
    chosen = prim.GetVariantSets().GetVariantSet("fingers")
    assert chosen.GetVariantNames() == ["choice_1", "choice_2"]
    assert chosen.GetVariantSelection() == "choice_1"
    assert np.array_equal(skel_rotations(moved), skel_rotations(over))
    for name in ("choice_1", "choice_2"):
        assert np.array_equal(skel_rotations(moved, name), skel_rotations(over, name))
    assert np.abs(skel_rotations(moved, "choice_2") - skel_rotations(moved)).max() > 0.01
    assert animation(moved).GetPrim().GetPath() == prim.GetPath()
    run("check", moved)


def test_limits_hold_and_results_repeat(body: Clip, library: MotionLibrary) -> None:
    filled = fill_fingers(body, library)
    again = fill_fingers(body, library)
    assert np.array_equal(filled.clips[0].rotations, again.clips[0].rotations)
    hands = usdhand.find_hands(body)
    for part in filled.parts:
        joints = [hands.frames[s].names for s in part.part]
        low, high = channel_limits(library, part.part, joints)
        curves = part.alternatives[0].curves
        own = [
            np.concatenate([c.hands[s].curves_of(j) for c in library.clips])
            for s, j in zip(part.part, joints, strict=True)
        ]
        assert np.array_equal(low, np.concatenate([values.min(axis=0) for values in own]))
        assert (curves >= low - 1e-9).all()
        assert (curves <= high + 1e-9).all()


def test_the_clip_itself_is_not_used(
    library: MotionLibrary, gestures_library: Path, tmp_path: Path
) -> None:
    copy = SAMPLES / "gestures" / "ok_01.usdc"
    text = run("fill", copy, "--library", gestures_library, "-o", tmp_path / "a.usda", "--replace")
    assert "not used, since it is the same performance: ok_01" in text.output
    clip = usdhand.read_clip(copy)
    filled = fill_fingers(replace(clip, name="other"), library, replace_motion=True)
    assert filled.left_out == ("ok_01",)  # by content
    only = replace(library, clips=tuple(c for c in library.clips if c.name == "ok_01"))
    with pytest.raises(InputError, match="contains only"):
        fill_fingers(clip, only, replace_motion=True)


def test_moving_hands_are_kept_unless_told(library: MotionLibrary) -> None:
    full = usdhand.read_clip(FULL)
    with pytest.raises(UsageError, match="already move"):
        fill_fingers(full, library)
    hands = usdhand.find_hands(full)
    rotations = full.rotations.copy()
    still = hands.frames["left"].joints
    rotations[:, still] = rotations[:1, still]
    filled = fill_fingers(full.with_rotations(rotations), library)
    assert filled.kept == ("right",)
    assert [p.part for p in filled.parts] == [("left",)]
    right = hands.frames["right"].joints
    np.testing.assert_allclose(
        np.abs((filled.clips[0].rotations[:, right] * full.rotations[:, right]).sum(-1)), 1.0
    )


@pytest.mark.parametrize("fps", [5.0, 12.0, 24.0, 25.0, 59.94, 120.0])
def test_other_frame_rates(body: Clip, library: MotionLibrary, fps: float) -> None:
    clip = part_of(body, slice(0, 120), fps)
    filled = fill_fingers(clip, library)
    assert len(filled.clips[0]) == len(clip)
    for part in filled.parts:
        assert part.alternatives[0].curves.shape[0] == len(clip)
        assert np.isfinite(part.alternatives[0].curves).all()


@pytest.mark.parametrize(("frames", "fps"), [(2, 120.0), (2, 30.0), (3, 30.0)])
def test_very_short_bodies_are_filled_and_it_is_said(
    body: Clip, library: MotionLibrary, frames: int, fps: float
) -> None:
    clip = replace(part_of(body, slice(40, 40 + frames)), fps=fps)
    filled = fill_fingers(clip, library)
    [choice] = filled.parts[0].alternatives[0].choices
    assert choice.candidates[choice.chosen].stretch != 1.0
    with pytest.raises(InputError, match="single frame"):
        fill_fingers(part_of(body, slice(0, 1)), library)


def test_a_segment_without_candidates_does_not_fail_the_body(
    tmp_path: Path, library: MotionLibrary
) -> None:
    clips = []
    for clip in library.clips[:8]:
        hands = {}
        for side, hand in clip.hands.items():
            last = len(hand.arm.wrist) - 1
            hands[side] = replace(hand, segments=((0, last),))
        clips.append(replace(clip, hands=hands))
    write_library(replace(library, clips=tuple(clips)), tmp_path / "long.usdc")
    out = tmp_path / "a.usda"
    text = run("fill", BODY, "--library", tmp_path / "long.usdc", "-o", out).output
    assert "no segment of similar length" in text
    data = json.loads(
        run(
            "fill", BODY, "--library", tmp_path / "long.usdc", "-o", out, "--force", "--json"
        ).stdout
    )
    assert max(s["stretched"] for s in data["hands"]["left"]["segments"]) > 1


def test_libraries_of_one_side(body: Clip, library: MotionLibrary) -> None:
    right = tuple(replace(c, hands={"right": c.hands["right"]}) for c in library.clips)
    filled = fill_fingers(body, replace(library, clips=right))
    assert filled.without == ("left",)
    assert [p.part for p in filled.parts] == [("right",)]
    with pytest.raises(InputError, match="left"):
        fill_fingers(body, replace(library, clips=right), sides=("left",))
    halves = [
        replace(c, hands={s: c.hands[s]})
        for c, s in zip(library.clips, ("left", "right") * 32, strict=True)
    ]
    with pytest.raises(InputError, match="without --couple"):
        fill_fingers(body, replace(library, clips=tuple(halves)), FillSettings(couple=True))
    coupled = fill_fingers(body, library, FillSettings(couple=True))
    assert [p.part for p in coupled.parts] == [("left", "right")]
    with pytest.raises(InputError, match="empty"):
        fill_fingers(body, replace(library, clips=()))


def test_more_candidates_than_there_are(body: Clip, library: MotionLibrary) -> None:
    """Of one clip all segments are candidates everywhere: that is enough for two results."""
    few = replace(library, clips=library.clips[:1])
    filled = fill_fingers(body, few, FillSettings(k=1000, alternatives=2))
    one, other = filled.clips
    assert np.abs(one.rotations - other.rotations).max() > 0.01


def test_a_library_smaller_than_k_is_noted(tmp_path: Path) -> None:
    library = tmp_path / "l.usdc"
    run("library", "build", SAMPLES / "gestures" / "ok_01.usdc", "-o", library, "-q")
    arguments = ("fill", BODY, "--library", library, "-o", tmp_path / "o.usda", "--force")
    text = run(*arguments, "--k", 100).output
    assert "has only" in text
    assert "the 100 candidates" in text
    assert "has only" not in run(*arguments, "--k", 4).output


def without_joints(library: MotionLibrary, gone: tuple[str, ...]) -> MotionLibrary:
    """A library of rigs that lack some hand joints."""
    clips = []
    for clip in library.clips:
        hands = {}
        for side, hand in clip.hands.items():
            names = tuple(j for j in hand.joints if j not in gone)
            hands[side] = replace(hand, joints=names, fingers=hand.curves_of(names))
        clips.append(replace(clip, hands=hands))
    return replace(library, clips=tuple(clips))


def test_joints_that_no_library_clip_has_are_kept(
    body: Clip, library: MotionLibrary, tmp_path: Path
) -> None:
    gone = ("ThumbIP", "PinkyDIP")
    few = without_joints(library, gone)
    filled = fill_fingers(body, few)
    assert filled.missing == {"left": gone, "right": gone}
    frames = usdhand.find_hands(body).frames
    kept = [
        int(j) for f in frames.values() for n, j in zip(f.names, f.joints, strict=True) if n in gone
    ]
    assert np.array_equal(filled.clips[0].rotations[:, kept], body.rotations[:, kept])
    assert set(filled.changed) == {int(j) for f in frames.values() for j in f.joints} - set(kept)
    assert np.ptp(filled.clips[0].rotations[:, list(filled.changed)], axis=0).max() > 0.1
    path = tmp_path / "few.usdc"
    write_library(few, path)
    out = tmp_path / "o.usda"
    text = run("fill", BODY, "--library", path, "-o", out).output
    assert "no clip of the library has ThumbIP, PinkyDIP of the left hand" in text
    take = usdhand.read_clip(SAMPLES / "gestures" / "ok_01.usdc")
    errors, left = measure_library(few, SAMPLES, FillSettings(), takes=[take])
    assert not left
    assert all(np.isfinite(e.degrees) for e in errors)


def test_one_clip_of_a_richer_rig_does_not_switch_off_the_others(
    body: Clip, library: MotionLibrary, tmp_path: Path
) -> None:
    gone = ("PinkyPIP", "PinkyDIP")
    few = without_joints(library, gone)
    mixed = replace(few, clips=(*few.clips[:-1], library.clips[-1]))
    path, out = tmp_path / "mixed.usdc", tmp_path / "o.usda"
    write_library(mixed, path)
    text = run("fill", BODY, "--library", path, "-o", out).output
    data = json.loads(
        run("fill", BODY, "--library", path, "-n", "-o", tmp_path / "n.usda", "--json").stdout
    )
    name = library.clips[-1].name
    assert f"only 1 clip of the library ({name}) has PinkyPIP, PinkyDIP of the left hand" in text
    assert len({s["clip"] for s in data["hands"]["right"]["segments"]}) > 10
    assert data["missing"] == {"left": list(gone), "right": list(gone)}
    assert data["set_aside"] == {}
    rich = replace(few, clips=(few.clips[0], *library.clips[1:]))  # one poorer clip is set aside
    filled = fill_fingers(body, rich)
    assert filled.missing == {}
    assert filled.set_aside == dict.fromkeys(SIDES, (library.clips[0].name,))
    write_library(rich, path, force=True)
    text = run("fill", BODY, "--library", path, "-n", "-o", tmp_path / "n.usda").output
    assert "left hand: 1 clip of the library set aside for lack of joints" in text
    assert library.clips[0].name in text


def test_both_hands_as_one_have_figures_of_their_own(
    gestures_library: Path, tmp_path: Path
) -> None:
    out = tmp_path / "o.usda"
    data = json.loads(
        run("fill", BODY, "--library", gestures_library, "-o", out, "--couple", "--json").stdout
    )
    left, right = (data["hands"][s]["seams"] for s in ("left", "right"))
    assert left["times_s"] == right["times_s"]
    assert left["max_acceleration_deg_s2"] != right["max_acceleration_deg_s2"]


def test_a_body_without_motion(body: Clip, library: MotionLibrary) -> None:
    still = body.with_rotations(np.repeat(body.rotations[:1], len(body), axis=0))
    filled = fill_fingers(still, library)
    made = filled.clips[0].rotations
    assert np.isfinite(made).all()
    assert filled.still == SIDES
    assert np.array_equal(made, np.repeat(made[:1], len(made), axis=0))
    assert not np.array_equal(made[0], body.rotations[0])  # a pose of the library, not the body's
    assert fill_fingers(body, library).still == ()


def damaged(source: Path, target: Path, joint: str, value: float) -> Path:
    """A clip in one file, one of whose joints is far away from the twentieth frame on."""
    layer = Usd.Stage.Open(str(source)).Flatten()
    stage = Usd.Stage.Open(layer)
    [prim] = [p for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    source_prim = UsdSkel.BindingAPI(prim).GetInheritedAnimationSource()
    anim = UsdSkel.Animation(source_prim)
    place = [str(j).split("/")[-1] for j in anim.GetJointsAttr().Get()].index(joint)
    attribute = anim.GetTranslationsAttr()
    time = (attribute.GetTimeSamples() or [Usd.TimeCode.Default()])[-1]
    values = list(attribute.Get(time))
    values[place] = (value, 0.0, 0.0)
    attribute.Set(values, time)
    layer.Export(str(target))
    return target


@pytest.mark.parametrize("value", [1e30, 1e12])
@pytest.mark.parametrize("joint", ["Hips", "LeftForeArm"])
def test_clips_of_absurd_size_are_refused(tmp_path: Path, value: float, joint: str) -> None:
    gestures = SAMPLES / "gestures"
    bad = damaged(gestures / "ok_01.usdc", tmp_path / "bad_01.usdc", joint, value)
    library, out = tmp_path / "l.usdc", tmp_path / "o.usda"
    text = run("library", "build", bad, gestures / "ok_02.usdc", "-o", library).output
    assert "left out: bad_01.usdc: joint " in text
    assert f"{joint} is {value:.3g} cm from its parent" in text
    assert [c.name for c in read_library(library).clips] == ["ok_02"]
    run("fill", BODY, "--library", library, "-o", out, "-q")
    body = damaged(BODY, tmp_path / "body.usdc", joint, value)
    text = run("fill", body, "--library", library, "-o", tmp_path / "n.usda", code=3).output
    assert f"{body}: joint " in text
    assert f"{joint} is {value:.3g} cm from its parent" in text


def test_takes_with_still_fingers_are_no_truth(gestures_library: Path) -> None:
    result = run("evaluate", gestures_library, "--takes", BODY, "--takes", FULL, "--json")
    data = json.loads(result.stdout)
    assert {take["take"] for take in data["takes"]} == {FULL.stem}
    [left] = data["left_out"]
    assert left["path"] == BODY.stem
    assert "left and right fingers do not move" in left["reason"]
    run("evaluate", gestures_library, "--takes", BODY, code=3)


@pytest.mark.parametrize("wrong", ["nothing", "clip", "body is library"])
def test_wrong_inputs_are_refused(gestures_library: Path, tmp_path: Path, wrong: str) -> None:
    body, given = BODY, gestures_library
    if wrong == "nothing":
        given = tmp_path / "none.usdc"
    elif wrong == "clip":
        given = BODY
    else:
        body = gestures_library
    out = tmp_path / "a.usda"
    code = 2 if wrong == "body is library" else 3
    text = run("fill", body, "--library", given, "-o", out, code=code).output
    if wrong == "body is library":
        assert "is a motion library" in text
    assert "Traceback" not in text
    assert not out.exists()


def test_paper_preset(body: Clip, library: MotionLibrary) -> None:
    part = part_of(body, slice(0, 200))
    filled = fill_fingers(part, library, PAPER)
    fingers = list(filled.changed)
    made, ours = (f.clips[0].rotations for f in (filled, fill_fingers(part, library)))
    assert np.isfinite(made).all()
    assert np.ptp(made[:, fingers], axis=0).max() > 0.1
    assert np.abs(made - ours)[:, fingers].max() > 0.1
    assert np.array_equal(np.delete(made, fingers, 1), np.delete(part.rotations, fingers, 1))


@pytest.mark.slow
def test_evaluate_on_the_samples(gestures_library: Path) -> None:
    def errors(preset: str) -> dict[str, dict[str, dict[str, float]]]:
        text = run("evaluate", gestures_library, "--preset", preset, "--json").stdout
        data = json.loads(text)
        share = {m["name"]: m["share"] for m in data["label_agreement"]["metrics"]}
        both = share["P + 0.5 R"]
        assert both > max(share["wrist position (P)"], share["wrist rotation (R)"])
        return dict(data["reconstruction"])

    ours, paper = errors("default"), errors("paper")
    for side, methods in ours.items():
        fill = methods["fill"]["degrees"]
        assert fill < paper[side]["fill"]["degrees"]
        for other in ("mean pose", "random", "rest pose"):
            assert fill < methods[other]["degrees"]


@pytest.mark.slow
@pytest.mark.real_data
def test_held_out_real_takes() -> None:
    """Every third take, which no setting was chosen on, filled from all others."""
    files = sorted(shared_data("studiogalt", "full").glob("*.usdc"))
    library = build_library(files, Path("library.usdc").absolute()).library
    takes = [usdhand.read_clip(f) for f in files[2::3]]

    def error(settings: FillSettings, method: str, side: str) -> float:
        key = (settings.metric, settings.pool)
        if key not in measured:
            measured[key] = measure_library(library, Path(), settings, takes=takes)[0]
        own = [e for e in measured[key] if e.side == side and e.method == method]
        return float(np.average([e.degrees for e in own], weights=[e.frames for e in own]))

    measured: dict[tuple[str, int], list[HandError]] = {}
    for side in ("left", "right"):
        ours = error(FillSettings(), "fill", side)
        print(side, ours, error(PAPER, "fill", side), error(FillSettings(), "mean pose", side))
        assert ours < 0.9 * error(PAPER, "fill", side)
        assert ours < error(FillSettings(), "mean pose", side)


def test_a_body_that_starts_late_is_filled_in_its_own_time(
    gestures_library: Path, tmp_path: Path
) -> None:
    """Time codes from 1001 on, as shots have them."""
    shifted, out = tmp_path / "late.usda", tmp_path / "out.usda"
    layer = Sdf.Layer.CreateNew(str(shifted))
    source = Usd.Stage.Open(str(BODY))
    layer.subLayerPaths.append(str(BODY))
    layer.subLayerOffsets[0] = Sdf.LayerOffset(1000.0)
    layer.timeCodesPerSecond = layer.framesPerSecond = source.GetTimeCodesPerSecond()
    layer.startTimeCode = source.GetStartTimeCode() + 1000
    layer.endTimeCode = source.GetEndTimeCode() + 1000
    layer.defaultPrim = source.GetRootLayer().defaultPrim
    layer.pseudoRoot.SetInfo("upAxis", "Y")
    layer.pseudoRoot.SetInfo("metersPerUnit", 0.01)
    layer.Save()
    arguments = ("--library", gestures_library, "--side", "left", "--json")
    late = json.loads(run("fill", shifted, "-o", out, *arguments).stdout)
    usual = json.loads(run("fill", BODY, "-o", tmp_path / "usual.usda", *arguments).stdout)
    assert late["hands"] == usual["hands"]  # seconds from the first frame
    one, other = usdhand.read_clip(out), usdhand.read_clip(tmp_path / "usual.usda")
    assert one.time_codes[0] == 1001.0
    assert one.time_codes[-1] == other.time_codes[-1] + 1000
    assert np.array_equal(one.rotations, other.rotations)


def test_threads_make_no_difference(body: Clip, library: MotionLibrary) -> None:
    """Nor do shards of the library, merged by (cost, id)."""
    from usdhand.fill import candidates
    from usdhand.fill.method import space_for
    from usdhand.search import PackedSegments, merge, pack, prepare, search

    clip = part_of(body, slice(0, 240))
    results = []
    for threads in (1, 2, 2):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(candidates, "search", partial(search, threads=threads))
            results.append(fill_fingers(clip, library).clips[0].rotations)
    assert all(np.array_equal(results[0], other) for other in results[1:])

    def in_shards(_: object, asked: PackedSegments, k: int, **more: Any) -> Any:
        space = space_for(library, (current[0],), FillSettings())
        whole = space.packed
        parts = []
        for chosen in (range(0, len(whole), 2), range(1, len(whole), 2)):
            rows = list(chosen)
            shard = pack([whole[i] for i in rows], whole.ids[rows], whole.groups[rows])
            parts.append(search(prepare(shard), asked, k=k, **more))
        return merge(*parts, k)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "search", in_shards)
        for side in SIDES:
            current = [side]
            one = fill_fingers(clip, library, sides=(side,)).clips[0].rotations
            joints = usdhand.find_hands(clip).frames[side].joints
            assert np.array_equal(one[:, joints], results[0][:, joints])


def test_people_of_other_build_gesture_alike(library: MotionLibrary) -> None:
    """Ben's arms, by another rig in other units and axes, lie near those of ada's same gestures."""
    from usdhand.fill.candidates import find_candidates, part_rows, part_segments
    from usdhand.fill.method import space_for

    ben = build_library(
        sorted((SAMPLES / "gestures_ben").glob("*.usdc")), Path("ben.usdc").absolute()
    ).library
    space = space_for(library, ("right",), FillSettings())
    alike: list[bool] = []
    for clip in ben.clips:
        if "right" not in clip.hands:
            continue
        arms = [clip.hands["right"].arm]
        rows = part_rows(arms, space.metric)
        queries = [rows[a : b + 1] for a, b in part_segments(arms, space.segmentation)]
        for found in find_candidates(queries, space, 5):
            alike += [library.clips[space.clips[c.segment]].label == clip.label for c in found]
    assert np.mean(alike) > 0.4  # 0.125 by chance; rest poses are the same for all gestures


def test_the_truth_in_the_library_comes_back(
    library: MotionLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the guard, a take that is in the library is its own nearest, neither late nor early.

    What is left is what joining and smoothing change.
    """
    from usdhand.fill import method

    monkeypatch.setattr(method, "same_motion", lambda *_: [])
    clip = usdhand.read_clip(SAMPLES / "gestures" / "wipe_01.usdc")
    filled = fill_fingers(clip, library, FillSettings(k=1, pool=0), replace_motion=True)
    used = {
        library.clips[p.space.clips[c.candidates[c.chosen].segment]].name
        for p in filled.parts
        for c in p.alternatives[0].choices
    }
    assert used == {"wipe_01"}
    hands = usdhand.find_hands(clip)
    truth, found = hands.encode(clip).values, hands.encode(filled.clips[0]).values
    assert np.sqrt(np.mean((truth - found) ** 2)) < 0.3


def test_evaluate_has_the_known_answer(tmp_path: Path) -> None:
    """Two gestures, each twice: the other take of a gesture is the nearest, and fills it exactly.

    The second take is the first under another name and hash.
    """
    from usdhand.fill import method

    library = tmp_path / "l.usdc"
    clips = [SAMPLES / "gestures" / f"{name}_01.usdc" for name in ("ok", "wipe")]
    run("library", "build", *clips, "-o", library, "-q")
    motions = read_library(library)
    twins = tuple(
        replace(c, name=c.name.replace("_01", "_02"), content_hash="") for c in motions.clips
    )
    write_library(replace(motions, clips=(*motions.clips, *twins)), library, force=True)
    broken = tmp_path / "broken.usda"
    broken.write_text("#usda 1.0\n")
    with pytest.MonkeyPatch.context() as patch:
        # by content only, else the twins would be left out as well
        patch.setattr(
            method,
            "same_motion",
            lambda library, _, content: [
                i for i, c in enumerate(library.clips) if c.content_hash == content
            ],
        )
        result = run(
            "evaluate", library, "--k", 1, "--takes", clips[0], "--takes", broken, "--json"
        )
    data = json.loads(result.stdout)
    assert [left["path"] for left in data["left_out"]] == [str(broken)]
    labels = data["label_agreement"]
    assert labels["labels"] == ["ok", "wipe"]
    assert all(m["share"] == 1.0 for m in labels["metrics"])
    assert labels["confusion"] == [[1.0, 0.0], [0.0, 1.0]]
    for methods in data["reconstruction"].values():
        assert methods["fill"]["degrees"] < 0.5
        assert methods["best candidate"]["degrees"] < 0.2
        assert methods["fill"]["fingertip_mm"] < 1.0
        assert methods["rest pose"]["degrees"] > 5
    assert data["settings"]["fill"]["k"] == 1
