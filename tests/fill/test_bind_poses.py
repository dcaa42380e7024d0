"""Hands in the bind pose, and doubtful units: what a library does not take, and says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.in_memory import sample
from builders.long_clips import followed_by, long_clip, still_clip
from conftest import REPOSITORY

import usdhand
from usdhand.anatomy.at_bind import at_bind, moved_frames
from usdhand.fill.library import ARM_FPS, library_clip
from usdhand.fill.settings import Segmentation
from usdhand.motion import Clip

GESTURES = REPOSITORY / "samples" / "gestures"


def kept(clip: Clip) -> usdhand.LibraryClip:
    hands = usdhand.find_hands(clip)
    return library_clip(clip, hands, Segmentation(), path="", content_hash="")


def in_bind(clip: Clip, side: usdhand.Side) -> Clip:
    """The clip with the fingers of one hand in the bind pose."""
    still, hand = still_clip(1.0).rotations[0], usdhand.find_hands(clip).frames[side]
    rotations = clip.rotations.copy()
    rotations[:, hand.joints] = still[hand.joints]
    return clip.with_rotations(rotations)


def test_bind_poses_at_the_ends_are_not_used() -> None:
    clip = followed_by(still_clip(3.0), long_clip(10.0), still_clip(2.0))
    for side, frames in usdhand.find_hands(clip).frames.items():
        first, last = moved_frames(clip, frames) or (0, 0)
        assert first == pytest.approx(3.0 * clip.fps, abs=2)
        assert last == pytest.approx(13.0 * clip.fps, abs=2)
        assert at_bind(clip, frames)[: first - 1].all()
        hand = kept(clip).hands[side]
        assert hand.used is not None
        assert hand.segments[0][0] == hand.used[0] == pytest.approx(3.0 * ARM_FPS, abs=10)
        assert hand.segments[-1][1] == hand.used[1] == pytest.approx(13.0 * ARM_FPS, abs=10)
        assert all(a[1] == b[0] for a, b in zip(hand.segments, hand.segments[1:], strict=False))


def test_motion_that_never_is_in_the_bind_pose_is_used_whole() -> None:
    clip = sample("gestures/ok_01")
    assert [hand.used for hand in kept(clip).hands.values()] == [None, None]


def test_a_hand_that_stays_in_the_bind_pose_is_left_out() -> None:
    clip = in_bind(long_clip(10.0), "left")
    assert list(kept(clip).hands) == ["right"]


def test_fingers_turned_by_less_than_a_few_degrees_are_in_the_bind_pose() -> None:
    clip = long_clip(4.0)
    frames = usdhand.find_hands(clip).frames["right"]
    bind = still_clip(4.0).rotations
    for share, expected in ((0.001, True), (1.0, False)):
        mixed = clip.with_rotations(
            (1.0 - share) * bind + share * clip.rotations  # small turns: linear will do
        )
        unit = np.linalg.norm(mixed.rotations, axis=-1, keepdims=True)
        found = at_bind(mixed.with_rotations(mixed.rotations / unit), frames)
        assert found.all() if expected else not found.any()


def test_bind_poses_at_the_ends_do_not_count_as_errors() -> None:
    clip = followed_by(still_clip(3.0), long_clip(10.0), still_clip(2.0))
    takes = [replace(long_clip(20.0, seed=i), name=f"take{i}") for i in (1, 2)]
    library = usdhand.MotionLibrary(tuple(kept(take) for take in takes))
    errors, _ = usdhand.measure_library(library, ".", takes=[clip])
    frames = usdhand.find_hands(clip).frames
    for error in errors:
        first, last = moved_frames(clip, frames[error.side]) or (0, 0)
        assert error.frames == last - first + 1 < len(clip)
    rest = [error.degrees for error in errors if error.method == "rest pose"]
    encoded = usdhand.find_hands(clip).encode(clip).values
    assert len(rest) == 2
    assert min(rest) > 1.0
    assert np.abs(encoded[0] - encoded[-1]).max() < 1e-6


def test_a_build_says_which_hands_are_in_the_bind_pose(tmp_path: Path) -> None:
    ends = followed_by(still_clip(2.0), long_clip(6.0), still_clip(1.0))
    for name, clip in (("ends", ends), ("left", in_bind(long_clip(6.0), "left"))):
        usdhand.write_clip(replace(clip, source=None, fps=30.0), tmp_path / f"{name}.usdc")
    library = tmp_path / "l.usdc"
    text = run("library", "build", tmp_path, "-o", library).output
    assert "1 clip: the left and right hand starts or ends in the bind pose" in text
    assert "1 clip: the left hand stays in the bind pose" in text
    again = usdhand.read_library(library)
    built = {clip.name: clip for clip in again.clips}
    assert set(built["left"].hands) == {"right"}
    assert all(hand.used for hand in built["ends"].hands.values())
    # Segments of another length keep to the frames of use, without the clips.
    run("library", "build", tmp_path, "-o", library, "--longest", "1.5", "--shortest", "0.5")
    for hand in usdhand.read_library(library).clips[0].hands.values():
        assert hand.used is not None
        assert hand.used[0] == hand.segments[0][0]
        assert hand.segments[-1][1] == hand.used[1]


def bvh(name: str, folder: Path, factor: float) -> Path:
    """A gesture as BVH, in a unit of that many centimetres that the file does not tell."""
    out = folder / f"{name}.bvh"
    more = ("--scale", 1.0 / factor)
    run("convert", GESTURES / f"{name}.usdc", "-o", out, *more, "-q")
    return out


def test_doubtful_scales_are_not_mixed_with_sure_ones(tmp_path: Path) -> None:
    doubtful, library = bvh("ok_01", tmp_path, 10.0), tmp_path / "l.usdc"
    text = run("library", "build", doubtful, GESTURES / "wipe_01.usdc", "-o", library).output
    assert "left out: ok_01.bvh: its unit of length is doubtful" in text
    assert "--units" in text
    assert [clip.name for clip in usdhand.read_library(library).clips] == ["wipe_01"]
    # Alone there is nothing to mix with, and a later build still knows.
    alone = tmp_path / "alone.usdc"
    assert "give --units" in run("library", "build", doubtful, "-o", alone).output
    assert usdhand.read_library(alone).clips[0].doubt
    more = run("library", "build", doubtful, GESTURES / "wipe_01.usdc", "-o", alone).output
    assert "left out: ok_01.bvh" in more
    # Its advice works.
    sure = tmp_path / "sure.usdc"
    run("convert", doubtful, "-o", sure, "--units", "10", "-q")
    text = run(
        "library", "build", sure, GESTURES / "wipe_01.usdc", "-o", library, "--rebuild"
    ).output
    assert "left out" not in text


def test_a_build_tells_misleading_names(tmp_path: Path) -> None:
    clip = sample("gestures/ok_01")
    swap = {"Index": "Ring", "Ring": "Index"}
    names = []
    for path in clip.skeleton.joints:
        leaf = path
        for one in swap:
            if one in path:
                leaf = path.replace(one, swap[one])
                break
        names.append(leaf)
    skeleton = replace(clip.skeleton, joints=tuple(names))
    usdhand.write_clip(replace(clip, skeleton=skeleton, source=None), tmp_path / "odd.usdc")
    text = run("library", "build", tmp_path / "odd.usdc", "-o", tmp_path / "l.usdc").output
    assert "odd.usdc" in text
    assert (
        "misleading-name"
        in run(
            "library", "build", tmp_path / "odd.usdc", "-o", tmp_path / "m.usdc", "--json"
        ).stdout
    )


@pytest.mark.parametrize("suffix", [".usdc", ".glb"])
def test_positions_are_refused_where_they_say_nothing(suffix: str, tmp_path: Path) -> None:
    source = GESTURES / "ok_01.usdc"
    if suffix != ".usdc":
        source = tmp_path / f"ok{suffix}"
        run("convert", GESTURES / "ok_01.usdc", "-o", source, "-q")
    out = tmp_path / "o.usda"
    text = run("convert", source, "-o", out, "--positions", "add", code=2).output
    assert "--positions is for BVH files only" in text
    assert not out.exists()
