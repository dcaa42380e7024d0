"""`usdhand fill` and `usdhand evaluate`: what comes out, and what people give instead."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.made import BODY, FULL, SAMPLES
from conftest import shared_data
from pxr import Usd, UsdSkel

import usdhand
from usdhand.evaluate.reconstruction import HandError
from usdhand.fill.settings import PAPER, FillSettings
from usdhand.formats.usd.library import read_library, write_library
from usdhand.motion.rotations import Array
from usdhand.verbs.evaluate import measure_library
from usdhand.verbs.library import build_library

OPEN: list[Usd.Stage] = []  # prims live as long as their stage


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


def test_a_library_smaller_than_k_is_noted(tmp_path: Path) -> None:
    library = tmp_path / "l.usdc"
    run("library", "build", SAMPLES / "gestures" / "ok_01.usdc", "-o", library, "-q")
    arguments = ("fill", BODY, "--library", library, "-o", tmp_path / "o.usda", "--force")
    text = run(*arguments, "--k", 100).output
    assert "has only" in text
    assert "the 100 candidates" in text
    assert "has only" not in run(*arguments, "--k", 4).output


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
