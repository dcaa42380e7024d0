"""What the function `fill_fingers` makes of usual and of odd bodies and libraries."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import frames_of
from builders.made import BODY, FULL, SAMPLES
from pxr import Sdf, Usd

import usdhand
from usdhand.anatomy import SIDES
from usdhand.errors import InputError, UsageError
from usdhand.fill.library import MotionLibrary
from usdhand.fill.limits import channel_limits
from usdhand.fill.settings import PAPER, FillSettings
from usdhand.formats.usd.library import write_library
from usdhand.motion import Clip
from usdhand.motion.resample import resample
from usdhand.verbs.evaluate import measure_library
from usdhand.verbs.fill import fill_fingers
from usdhand.verbs.library import build_library


def part_of(clip: Clip, frames: slice, fps: float | None = None) -> Clip:
    cut = frames_of(clip, frames)
    return cut if fps is None else resample(cut, fps)


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


def test_paper_preset(body: Clip, library: MotionLibrary) -> None:
    part = part_of(body, slice(0, 200))
    filled = fill_fingers(part, library, PAPER)
    fingers = list(filled.changed)
    made, ours = (f.clips[0].rotations for f in (filled, fill_fingers(part, library)))
    assert np.isfinite(made).all()
    assert np.ptp(made[:, fingers], axis=0).max() > 0.1
    assert np.abs(made - ours)[:, fingers].max() > 0.1
    assert np.array_equal(np.delete(made, fingers, 1), np.delete(part.rotations, fingers, 1))


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
