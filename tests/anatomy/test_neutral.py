"""Hands that were bound in a gesture are measured as on the bind that their rig usually has."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.in_memory import sample
from builders.moving_hands import at_bind, hand_map, skeleton
from builders.rigs import places
from conftest import REPOSITORY
from numpy.testing import assert_allclose

from usdhand import find_hands, write_clip
from usdhand.anatomy.channels import Channels, Hands, all_channels, decode
from usdhand.anatomy.hand import SIDES, CharacterMap, Side
from usdhand.anatomy.neutral import Neutral, is_posed
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip
from usdhand.motion.kinematics import forward_kinematics
from usdhand.motion.transforms import compose_trs
from usdhand.verbs.clips import neutral_pose

FIST = {"MCPy": 70.0, "PIPy": 90.0, "DIPy": 40.0, "ThumbCMCz": 30.0, "ThumbMCPz": 40.0}
OPPOSED = {"ThumbCMCz": 55.0, "ThumbCMCx": 25.0, "MCPy": 8.0}
POINTING = {f"{f}{j}y": 60.0 for f in ("Middle", "Ring", "Pinky") for j in ("MCP",)}
GESTURES = {"fist": FIST, "opposed": OPPOSED, "pointing": POINTING}


def maps(index: Mapping[tuple[Side | None, str], int]) -> CharacterMap:
    return CharacterMap({side: hand_map(index, side) for side in SIDES}, "test")


def performed(wanted: Mapping[str, float], seed: int = 3) -> Clip:
    """Both hands start flat, as bound, make a gesture with its joints a little off, and go back."""
    rig, index = skeleton(axes=seed)
    clip = at_bind(rig, 60)
    blend = np.sin(np.linspace(0.0, np.pi, 60))[:, None]
    for side, frames in Hands.of(clip, maps(index)).frames.items():
        names = all_channels(side, frames.names)
        start = Hands.of(clip, maps(index), (side,)).encode(clip).select(names).values
        more = [next((v for end, v in wanted.items() if name.endswith(end)), 0.0) for name in names]
        noise = np.random.default_rng(seed).uniform(-3, 3, len(names))
        clip = decode(Channels(names, start + blend * (np.array(more) + noise)), clip, frames)
    return clip


def bound_at(clip: Clip, frame: int) -> Clip:
    """The same motion on the rig as if it had been bound in one of its frames."""
    pose = forward_kinematics(clip)
    bind = compose_trs(pose.positions[frame], pose.rotations[frame])
    return replace(clip, skeleton=replace(clip.skeleton, bind=bind))


@pytest.mark.parametrize("gesture", GESTURES)
@pytest.mark.parametrize("remedy", ["flat frame", "usual bind", "rest", "given"])
def test_channels_are_those_of_the_usual_bind(gesture: str, remedy: str) -> None:
    plain = performed(GESTURES[gesture])
    _, index = skeleton(axes=3)
    posed = bound_at(plain, 30)
    assert all(is_posed(posed.skeleton, hand_map(index, side)) for side in SIDES)
    others: list[Clip] = []
    given = None
    if remedy == "usual bind":
        others = [plain]
    if remedy == "given":
        given = Neutral.of_bind(plain.skeleton, "a file")
    if remedy in ("rest", "usual bind", "given"):  # no frame is flat
        plain, posed = (cut(clip, slice(25, 36)) for clip in (plain, posed))
    if remedy == "rest":
        locals_ = plain.skeleton.bind_locals
        plain, posed = (
            replace(c, skeleton=replace(c.skeleton, rest=locals_)) for c in (plain, posed)
        )
    true = Hands.of(plain, maps(index))
    found = Hands.of(posed, maps(index), SIDES, others, given)
    words = {"flat frame": "neutral from frame", "usual bind": "usual bind", "rest": "rest pose"}
    assert len(found.notes) == 2
    assert words.get(remedy, "neutral from a file") in found.notes[0]
    assert_allclose(found.encode(posed).values, true.encode(plain).values, atol=1e-4)


def cut(clip: Clip, frames: slice) -> Clip:
    return replace(
        clip,
        rotations=clip.rotations[frames],
        translations=clip.translations[frames],
        scales=clip.scales[frames],
    )


@pytest.mark.parametrize("gesture", GESTURES)
def test_a_gesture_without_a_remedy_is_said(gesture: str) -> None:
    _, index = skeleton(axes=3)
    posed = cut(bound_at(performed(GESTURES[gesture]), 30), slice(29, 32))
    turned = replace(posed.skeleton, rest=posed.skeleton.bind_locals)
    found = Hands.of(replace(posed, skeleton=turned), maps(index))
    assert ["no pose of this hand is neutral" in note for note in found.notes] == [True, True]
    assert found.pronation is not None
    assert "guess" in found.pronation.witness


@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("curl", [0.0, 8.0, 20.0, 30.0])
def test_ordinary_binds_are_no_gestures(pose: str, curl: float) -> None:
    rig, index = skeleton(at=places(pose, curl), axes=1)
    assert not any(is_posed(rig, hand_map(index, side)) for side in SIDES)
    assert Hands.of(at_bind(rig), maps(index)).notes == ()


def test_clips_of_one_posed_rig_share_their_frames() -> None:
    _, index = skeleton(axes=3)
    whole = bound_at(performed(FIST), 30)
    clips = [cut(whole, slice(20, 40)), whole, cut(whole, slice(0, 30))]
    found = [Hands.of(clip, maps(index), SIDES, clips) for clip in clips]
    for other in found[1:]:
        for side in SIDES:
            mine, theirs = found[0].frames[side], other.frames[side]
            assert_allclose(theirs.joint_frames, mine.joint_frames, atol=0)
            assert_allclose(theirs.reference_frames, mine.reference_frames, atol=0)


def test_a_neutral_file_is_named_on_the_command_line(tmp_path: Path) -> None:
    gestures = REPOSITORY / "samples" / "gestures"
    clip = sample("gestures/attention_01")
    fist = tmp_path / "fist.usdc"
    pose = forward_kinematics(clip)
    middle = len(clip) // 2
    bind = compose_trs(pose.positions[middle], pose.rotations[middle])
    posed = replace(
        clip,
        skeleton=replace(clip.skeleton, bind=bind, rest=clip.skeleton.bind_locals),
        source=None,
    )
    posed = replace(posed, skeleton=replace(posed.skeleton, rest=posed.skeleton.bind_locals))
    write_clip(cut(posed, slice(middle - 3, middle + 4)), fist)
    alone = json.loads(run("inspect", fist, "--json").stdout)["files"][0]
    assert any("no pose of this hand is neutral" in note for note in alone["notes"])
    neutral = ("--neutral", gestures / "ok_01.usdc")
    found = json.loads(run("inspect", fist, *neutral, "--json").stdout)["files"][0]
    assert any("neutral from ok_01.usdc" in note for note in found["notes"])
    ours = find_hands(cut(clip, slice(middle - 3, middle + 4))).encode(
        cut(clip, slice(middle - 3, middle + 4))
    )
    for row in found["channels"]:
        mean = ours.values[:, ours.names.index(row["name"])].mean()
        assert row["mean_deg"] == pytest.approx(mean, abs=0.05)
    wrong = run("inspect", gestures / "ok_01.usdc", "--neutral", fist, code=4)
    assert "bound in a gesture" in wrong.output


def test_a_neutral_pose_of_another_rig_is_said() -> None:
    ben = REPOSITORY / "samples" / "characters" / "ben.usdc"
    ada = sample("gestures/ok_01")
    other = replace(ada, skeleton=ada.skeleton)
    notes = Hands.of(other, find_hands(ada).character, SIDES, (), neutral_pose(ben)).notes
    assert ["of another rig" in note for note in notes] == [True, True]


def test_a_neutral_pose_that_lacks_joints_is_refused() -> None:
    ada = sample("gestures/ok_01")
    whole = Neutral.of_bind(ada.skeleton, "half.usdc")
    half = {name: turn for name, turn in whole.rotations.items() if "Ring" not in name}
    with pytest.raises(HandNotFoundError, match=r"half\.usdc has no joint 'LeftHandRing1'"):
        Hands.of(ada, find_hands(ada).character, neutral=Neutral(half, "half.usdc"))
