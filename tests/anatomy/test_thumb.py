"""How far a rig's thumb is pronated, and that its channels do not depend on how it was built."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.copies import random_turns_of, reaxed, renamed
from builders.in_memory import sample
from builders.moving_hands import at_bind, hand_map, moved, random_turns, skeleton
from builders.rigs import places
from numpy.testing import assert_allclose

from usdhand import find_hands, load_conventions
from usdhand.anatomy.channels import Hands, encode
from usdhand.anatomy.frames import hand_frames
from usdhand.anatomy.hand import SIDES, CharacterMap, Side
from usdhand.anatomy.palm import Palm
from usdhand.anatomy.thumb import (
    NEUTRAL_PRONATION_DEG,
    Pronation,
    neutral_thumb,
    rolled,
    thumb_pronation,
)
from usdhand.errors import UsageError
from usdhand.motion import Clip
from usdhand.motion import rotations as rot

THUMB = ("ThumbCMC", "ThumbMCP", "ThumbIP")


@pytest.mark.parametrize("side", SIDES)
def test_the_neutral_thumb_is_pronated_as_anatomy_has_it(side: Side) -> None:
    rig, index = skeleton()
    palm = Palm.of(rig, hand_map(index, side))
    frame = rolled(neutral_thumb(palm), NEUTRAL_PRONATION_DEG, side)
    seen = np.stack([palm.normal, palm.radial, palm.forward]) @ frame
    abduction, flexion, bone = seen.T
    sign = 1.0 if side == "right" else -1.0
    assert_allclose(bone, [0.40, 0.60, 0.70], atol=0.01)
    assert_allclose(sign * flexion, [0.89, -0.05, -0.46], atol=0.01)
    assert_allclose(abduction, [0.24, -0.80, 0.55], atol=0.01)


def test_flat_and_pronated_rigs_have_the_same_channels() -> None:
    """One anatomical motion; on the flat rig it starts from a thumb rolled by 80 degrees."""
    rig, index = skeleton(axes=4)
    turns = random_turns(40, 3)
    pronated, flat = Pronation(-80.0, "test"), Pronation(0.0, "test")
    clip = moved(rig, index, turns)
    for side in SIDES:
        hand = hand_map(index, side)
        frames = hand_frames(rig, hand, pronation=pronated)
        others = hand_frames(rig, hand, pronation=flat)
        rolled_turns = dict(turns)
        for name in THUMB:
            bind = rig.bind_rotations[hand.joints[name]]
            n = frames.names.index(name)
            own, other = (bind @ rot.to_matrix(f.joint_frames[n]) for f in (frames, others))
            roll = rot.from_matrix(own @ other.T)
            rolled_turns[side, name] = rot.multiply(turns[side, name], roll)
        flat_clip = moved(rig, index, rolled_turns)
        assert_allclose(encode(flat_clip, others).values, encode(clip, frames).values, atol=1e-6)


@pytest.mark.parametrize("name", ["gestures/ok_01", "gestures_ben/wipe_01"])
@pytest.mark.parametrize("how", ["renamed", "re-axed", "re-rolled", "all alike", "all"])
def test_copies_of_a_rig_have_the_same_channels(name: str, how: str) -> None:
    clip = sample(name)
    other, count = clip, len(clip.skeleton)
    if how in ("re-axed", "all"):
        other = reaxed(other, random_turns_of(clip.skeleton, 5))
    if how == "all alike":
        other = reaxed(other, np.tile(random_turns_of(clip.skeleton, 6)[0], (count, 1)))
    if how == "re-rolled":
        axis = np.array([1.0, 0.0, 0.0] if "ben" not in name else [0.0, 1.0, 0.0])
        rolls = np.random.default_rng(7).uniform(-np.pi, np.pi, count)
        other = reaxed(other, rot.from_axis_angle(np.tile(axis, (count, 1)), rolls))
    if how in ("renamed", "all"):
        other = renamed(other)
    mine, theirs = find_hands(clip), find_hands(other)
    ours = mine.encode(clip)
    assert_allclose(theirs.encode(other).select(ours.names).values, ours.values, atol=0.01)


def hinged(side_axis: float, frames: int = 40, twist: float = 0.0) -> Clip:
    """Both thumbs bend about hinges that are turned by so many degrees from flat ones."""
    rig, index = skeleton(axes=8)
    turns = {}
    angle = np.radians(20.0 + 20.0 * np.sin(np.arange(frames) / 5.0))
    other = np.radians(twist * np.cos(np.arange(frames) / 3.0))
    for side in SIDES:
        flat = hand_frames(rig, hand_map(index, side), pronation=Pronation(side_axis, "test"))
        so_far = np.tile(rot.IDENTITY, (frames, 1))
        for n in (1, 2):
            bind = rig.bind_rotations[flat.joints[n]] @ rot.to_matrix(flat.joint_frames[n])
            bend = rot.from_axis_angle(np.tile(bind[:, 1], (frames, 1)), angle)
            roll = rot.from_axis_angle(np.tile(bind[:, 2], (frames, 1)), other)
            so_far = rot.multiply(so_far, rot.multiply(bend, roll))
            turns[side, THUMB[n]] = so_far
    return moved(rig, index, turns)


def decided(clip: Clip, named: float | None = None, *more: Clip) -> Pronation:
    _, index = skeleton()
    hands = [hand_map(index, side) for side in SIDES]
    return thumb_pronation(clip.skeleton, hands, [clip, *more], named)


@pytest.mark.parametrize(("hinge", "degrees"), [(0, 0), (-25, 0), (15, 0), (-70, -80), (-95, -80)])
def test_hinges_tell_a_pronation(hinge: float, degrees: float) -> None:
    found = decided(hinged(hinge))
    assert found == Pronation(degrees, "motion about one hinge")
    # Names of rigs that are otherwise do not change it, and it is said.
    contradicted = decided(hinged(hinge), -80.0 - degrees)
    assert contradicted.degrees == degrees
    assert "rigs with such names have" in contradicted.witness


def test_motion_of_many_axes_yields_to_the_names() -> None:
    clip = hinged(0.0, twist=7.0)
    assert decided(clip) == Pronation(0.0, "motion of the IP")
    named = decided(clip, -80.0)
    assert named == Pronation(-80.0, "the convention of the joint names")


def test_a_rig_that_nothing_tells_of_is_pronated() -> None:
    rig, _ = skeleton(axes=9)
    found = decided(at_bind(rig, 5))
    assert found.degrees == -80.0
    assert "most rigs" in found.witness
    straight = places(curl=0.0)
    for side in SIDES:
        a, b = straight[side, "ThumbCMC"], straight[side, "ThumbMCP"]
        straight[side, "ThumbIP"], straight[side, "ThumbTip"] = 2 * b - a, 3 * b - 2 * a
    zero, _ = skeleton(at=straight, axes=9)
    assert decided(at_bind(zero, 5)) == Pronation(0.0, "a bind pose with all digits straight")


@pytest.mark.parametrize(("roll", "degrees"), [(-80.0, -80.0), (-55.0, -80.0), (-20.0, 0.0)])
def test_the_rigs_own_axes_tell_a_pronation(roll: float, degrees: float) -> None:
    plain, index = skeleton()
    bind = plain.bind.copy()
    for side in SIDES:
        frames = hand_frames(plain, hand_map(index, side), pronation=Pronation(roll, "test"))
        for n, joint in enumerate(frames.joints):
            bind[joint, :3, :3] = rot.to_matrix(frames.joint_frames[n])
    rig = replace(plain, bind=bind)
    for named in (None, degrees):
        assert decided(at_bind(rig), named) == Pronation(degrees, "the rig's own axes")
    said = decided(at_bind(rig), -80.0 - degrees)
    assert said.degrees == degrees
    assert said.witness.startswith("the rig's own axes; rigs with such names")


def test_axes_that_programs_give_do_not_outweigh_names() -> None:
    """Orienting all joints in one plane makes them look flat, which says nothing."""
    plain, index = skeleton()
    bind = plain.bind.copy()
    for side in SIDES:
        frames = hand_frames(plain, hand_map(index, side), pronation=Pronation(2.0, "test"))
        for n, joint in enumerate(frames.joints):
            bind[joint, :3, :3] = rot.to_matrix(frames.joint_frames[n])
    clip = at_bind(replace(plain, bind=bind))
    assert decided(clip, -80.0) == Pronation(-80.0, "the convention of the joint names")


def test_both_hands_and_every_side_alone_share_one_pronation() -> None:
    clip = sample("gestures/ok_01")
    for side in SIDES:
        [frames] = find_hands(clip, sides=(side,)).frames.values()
        assert_allclose(frames.joint_frames, find_hands(clip).frames[side].joint_frames)


def test_clips_of_one_skeleton_share_their_frames_exactly() -> None:
    rig, index = skeleton(axes=8)
    clips = [hinged(0.0), at_bind(rig, 30), hinged(-80.0, 80)]
    maps = CharacterMap({side: hand_map(index, side) for side in SIDES}, "test")
    found = [Hands.of(clip, maps, SIDES, clips) for clip in clips]
    for other in found[1:]:
        for side in SIDES:
            mine, theirs = found[0].frames[side], other.frames[side]
            assert_allclose(theirs.joint_frames, mine.joint_frames, atol=0)
            assert_allclose(theirs.reference_frames, mine.reference_frames, atol=0)


def test_a_convention_of_ones_own_has_a_pronation() -> None:
    table = {"ours": {"like": "humanik", "prefix": ["our_"], "pronation": -30}}
    [ours] = [c for c in load_conventions(table).conventions if c.name == "ours"]
    assert ours.pronation == -30.0
    for wrong in (True, "flat", 100):
        with pytest.raises(UsageError, match="pronation: must be a number of degrees"):
            load_conventions({"ours": {"like": "humanik", "pronation": wrong}})
