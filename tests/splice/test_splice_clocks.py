"""Timing by clocks: claps, and the time codes of USD and FBX files; what is missing is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.clips import frames_of
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st
from pxr import Sdf

from usdhand import find_hands, read_clip, splice_hands, write_clip
from usdhand.errors import InputError, UsageError
from usdhand.formats.bvh.write import write_clip as write_bvh
from usdhand.motion import Clip
from usdhand.motion.timecode import clock_text, seconds_of
from usdhand.splice.clocks import clock_warp
from usdhand.splice.settings import Pin, SpliceSettings

FULL = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
BY_TIMECODE = SpliceSettings(align="timecode")


@pytest.fixture(scope="module")
def full() -> Clip:
    return read_clip(FULL)


@pytest.fixture(scope="module")
def gloves(full: Clip) -> Clip:
    """Fingers without motion of arms, that begin 2 s later and end 3 s earlier."""
    hands = find_hands(full)
    fingers = [j for f in hands.frames.values() for j in f.joints]
    rotations = np.repeat(full.rotations[:1], len(full), axis=0)
    rotations[:, fingers] = full.rotations[:, fingers]
    cut = frames_of(replace(full, rotations=rotations), slice(60, len(full) - 90))
    return replace(cut, name="gloves")


def finger_error(full: Clip, got: Clip, frames: slice) -> float:
    hands = find_hands(full)
    difference = hands.encode(got).values[frames] - hands.encode(full).values[frames]
    return float(np.sqrt(np.mean(difference**2)))


def test_one_clap_gives_the_timing_of_gloves(full: Clip, gloves: Clip) -> None:
    with pytest.raises(InputError, match=r"No hand moves in the hand clip gloves.*--clap BODY:HAN"):
        splice_hands(full, gloves)
    found = splice_hands(full, gloves, claps=["101:41"])
    assert finger_error(full, found.clip, slice(60, -90)) < 0.1
    codes = [p.code for p in found.problems]
    assert "clock" in codes
    assert codes.count("held-pose") == 2
    [note] = [p for p in found.problems if p.code == "clock"]
    assert note.message == "by the claps the hand clip begins 2.000 s after the body"


def test_two_claps_say_how_clocks_drift(full: Clip) -> None:
    slow = replace(full, fps=full.fps * 1.001)
    found = splice_hands(full, slow, claps=[Pin(2.0, 2.0 / 1.001), Pin(20.0, 20.0 / 1.001)])
    for alignment in found.hands.values():
        times, warp = alignment.warp.T
        assert np.allclose(warp, times / 1.001, atol=1e-9)
    with pytest.raises(UsageError, match="not the same two claps"):
        splice_hands(full, slow, claps=[Pin(2.0, 2.0), Pin(12.0, 14.0)])


@pytest.mark.parametrize(
    ("settings", "pins", "claps", "message"),
    [
        (None, ["1:1"], ["1:1"], "give no pins"),
        (BY_TIMECODE, ["1:1"], [], "give no pins"),
        (BY_TIMECODE, [], ["1:1"], "give one"),
        (None, [], ["left:1:1"], "give no side"),
        (None, [], ["1:9000"], "9000 is outside"),
    ],
)
def test_clocks_and_other_timing_do_not_go_together(
    full: Clip, settings: SpliceSettings, pins: list[str], claps: list[str], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        splice_hands(full, full, settings, pins=pins, claps=claps)


def test_motion_that_contradicts_a_clap_is_said(full: Clip) -> None:
    right = splice_hands(full, full, claps=["1:1"])
    assert [p.code for p in right.problems] == ["clock"]
    wrong = splice_hands(full, full, claps=["1:61"])
    [note] = [p for p in wrong.problems if p.code == "clock-contradicts"]
    assert "about 2.0 s earlier than the claps say" in note.message


def with_clock(clip: Clip, path: Path, start: float | None, text: str | None) -> Clip:
    """The clip in a file of which the stage starts at a time code, and says a clock."""
    write_clip(replace(clip, source=None), path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    if text is not None:
        layer.customLayerData = {"timecode": text}
    if start is None:
        layer.ClearStartTimeCode()
        layer.ClearEndTimeCode()
    layer.Save()
    return read_clip(path)


def test_time_codes_of_stages(full: Clip, gloves: Clip, tmp_path: Path) -> None:
    codes = replace(full.origin, first_time_code=108_000.0)
    body = with_clock(replace(full, origin=codes), tmp_path / "a.usda", 108_000.0, None)
    assert body.origin.clock == pytest.approx(3600.0)
    hand = with_clock(gloves, tmp_path / "b.usda", 1.0, "01:00:02:00")
    assert hand.origin.clock == pytest.approx(3602.0)
    found = splice_hands(body, hand, BY_TIMECODE)
    assert finger_error(full, found.clip, slice(60, -90)) < 0.1
    assert (
        found.problems[0].message == "by the time codes the hand clip begins 2.000 s after the body"
    )
    far = with_clock(gloves, tmp_path / "c.usda", 1.0, "02:00:02:00")
    with pytest.raises(InputError, match=r"do not overlap: .* 01:00:00\.000 to 01:00:22\.633"):
        splice_hands(body, far, BY_TIMECODE)
    none = with_clock(gloves, tmp_path / "d.usda", None, None)
    with pytest.raises(InputError, match=r"the hand clip carries no time code.*--clap BODY:HAND"):
        splice_hands(body, none, BY_TIMECODE)
    odd = with_clock(gloves, tmp_path / "e.usda", 1.0, "at noon")
    assert odd.origin.clock is None
    assert any("'at noon' is no time code" in str(p) for p in odd.problems)


def test_bvh_has_no_time_code(full: Clip, tmp_path: Path) -> None:
    write_bvh(full, tmp_path / "a.bvh")
    with pytest.raises(InputError, match="the body carries no time code"):
        splice_hands(read_clip(tmp_path / "a.bvh"), full, BY_TIMECODE)


@pytest.mark.parametrize(
    ("text", "fps", "seconds"),
    [
        ("01:00:00:00", 24.0, 3600.0),
        ("00:00:01:12", 24.0, 1.5),
        ("01:00:00:00", 30000 / 1001, 3603.6),
        ("01:00:00;00", 30000 / 1001, 107_892 * 1001 / 30000),
        ("00:01:00;02", 30000 / 1001, 1800 * 1001 / 30000),
        ("00:10:00;00", 60000 / 1001, 35_964 * 1001 / 60000),
    ],
)
def test_time_codes_as_clocks_show_them(text: str, fps: float, seconds: float) -> None:
    assert seconds_of(text, fps) == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("text", "fps"), [("1:2:3", 24.0), ("00:00:00:24", 24.0), ("00:00:00;00", 25.0), ("x", 30.0)]
)
def test_what_is_no_time_code(text: str, fps: float) -> None:
    with pytest.raises(ValueError, match=r"time code|drops"):
        seconds_of(text, fps)


@given(st.floats(0, 86_399))
def test_clocks_read_what_they_show(seconds: float) -> None:
    text = clock_text(seconds)
    hours, minutes, rest = text.split(":")
    assert 3600 * int(hours) + 60 * int(minutes) + float(rest) == pytest.approx(seconds, abs=6e-4)


@given(st.floats(-5, 5), st.floats(0.5, 20))
def test_clocks_run_as_fast_and_hold_at_the_ends(offset: float, end: float) -> None:
    times = np.arange(100) / 10.0
    warp = clock_warp(times, [Pin(1.0, 1.0 + offset)], end)
    assert np.allclose(warp, np.clip(times + offset, 0.0, end))
