"""Anatomical frames: the same hand has the same angles, however its rig was built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from builders.moving_hands import (
    Index,
    at_bind,
    frames_of,
    gesture,
    hand_map,
    moved,
    random_turns,
    skeleton,
)
from builders.rigs import METACARPALS, TIPS, Joint, Parents, Places, parents, places
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.anatomy.channels import Channels, all_channels, decode, encode
from usdhand.anatomy.fingertips import fingertips
from usdhand.anatomy.frames import hand_frames
from usdhand.anatomy.hand import FINGERS, HAND_JOINTS, SIDES, Side
from usdhand.errors import HandNotFoundError
from usdhand.motion import Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

FRAMES, SEED = 40, 5


@cache
def turns() -> dict[Joint, Array]:
    return random_turns(FRAMES, SEED)


def encoded(rig: Skeleton, index: Index, side: Side, above: Parents | None = None) -> Array:
    clip = moved(rig, index, turns(), above)
    return encode(clip, frames_of(rig, index, side)).values


# --- the same motion on other rigs ---------------------------------------------------------------


def without(*roles: str) -> Callable[[Parents], Parents]:
    """Leave joints out; what hangs below them moves up."""

    def change(above: Parents) -> Parents:
        kept = {}
        for joint in above:
            parent = above[joint]
            while parent is not None and parent[1] in roles:
                parent = above[parent]
            if joint[1] not in roles:
                kept[joint] = parent
        return kept

    return change


def thumb_on(role: str) -> Callable[[Parents], Parents]:
    """Hang the thumb off another joint of the arm."""

    def change(above: Parents) -> Parents:
        above = without("ThumbCarpal")(above)
        return above | {(side, "ThumbCMC"): (side, role) for side in SIDES}

    return change


def thumb_on_a_sibling(above: Parents) -> Parents:
    """A second wrist joint beside the first carries the thumb, as in real takes."""
    above = without("ThumbCarpal")(above)
    for side in SIDES:
        above[side, "wrist2"] = (side, "elbow")
        above[side, "ThumbCMC"] = (side, "wrist2")
    return above


def twists(above: Parents) -> Parents:
    """An extra joint in the middle of every bone of the fingers."""
    above = dict(above)
    for side in SIDES:
        for finger in FINGERS:
            for outer, inner in (("MCP", "PIP"), ("PIP", "DIP")):
                above[side, f"{finger}{outer}Twist"] = (side, finger + outer)
                above[side, finger + inner] = (side, f"{finger}{outer}Twist")
    return above


def with_extras(above: Parents) -> Places:
    at = places()
    for joint in above:
        side, role = joint
        if role == "wrist2":
            at[joint] = at[side, "wrist"]
        elif role.endswith("Twist"):
            outer, inner = role[:-5], role[:-8] + {"MCP": "PIP", "PIP": "DIP"}[role[-8:-5]]
            at[joint] = (at[side, outer] + at[side, inner]) / 2
    return at


CHANGES: dict[str, Callable[[Parents], Parents]] = {
    "as it is": dict,
    "no metacarpals": without(*METACARPALS, "ThumbCarpal"),
    "twist joints": twists,
    "thumb off the forearm": thumb_on("elbow"),
    "thumb off the shoulder": thumb_on("shoulder"),
    "thumb off the wrist's sibling": thumb_on_a_sibling,
}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("change", list(CHANGES))
@pytest.mark.parametrize("axes", [None, 1])
def test_rigs_of_one_hand_give_the_same_angles(side: Side, change: str, axes: int | None) -> None:
    above = CHANGES[change](parents())
    rig, index = skeleton(above, with_extras(above), axes)
    wanted = gesture(FRAMES, len(HAND_JOINTS), SEED)
    assert_allclose(encoded(rig, index, side, above), wanted, atol=1e-6)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_axes_and_rest_pose_do_not_matter(axes: int) -> None:
    rig, index = skeleton(axes=axes)
    for side in SIDES:
        assert_allclose(
            encoded(rig, index, side), gesture(FRAMES, len(HAND_JOINTS), SEED), atol=1e-6
        )


def posed(rig: Skeleton, index: Index, side: Side, angles: Array) -> Skeleton:
    """The same rig bound in another pose of one hand, of all its angles (45,)."""
    frames = frames_of(rig, index, side)
    clip = decode(Channels(all_channels(side, frames.names), angles[None]), at_bind(rig), frames)
    pose = forward_kinematics(clip)
    bind = rig.bind.copy()
    bind[:, :3, 3] = pose.positions[0]
    bind[:, :3, :3] = rot.to_matrix(pose.rotations[0])
    return replace(rig, bind=bind)


def flexion(names: tuple[str, ...], degrees: float) -> Array:
    """Angles (45,) of a hand with all joints but the thumb's CMC bent by the same angle."""
    return np.array(
        [
            degrees if n[-1] == ("z" if "Thumb" in n else "y") and "CMC" not in n else 0.0
            for n in names
        ]
    )


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("curl", [-10.0, 25.0, 50.0])
def test_a_curled_bind_pose_gives_the_same_angles(side: Side, curl: float) -> None:
    """Zero is a straight finger, not the bind pose."""
    rig, index = skeleton(axes=3)
    frames = frames_of(rig, index, side)
    clip = moved(rig, index, turns())
    now = encode(at_bind(rig), frames).values[0]
    bent = now + flexion(all_channels(side, frames.names), curl)
    other = posed(rig, index, side, bent)
    angles = encode(replace(clip, skeleton=other), frames_of(other, index, side))
    assert_allclose(angles.values, encode(clip, frames).values, atol=1e-6)


@pytest.mark.parametrize("axes", [None, 4])
def test_a_and_t_pose_give_the_same_angles(axes: int | None) -> None:
    """The arm's pose turns the hand as a whole: angles at the bind pose stay."""
    t, index = skeleton(at=places("T"), axes=axes)
    a, _ = skeleton(at=places("A"), axes=None if axes is None else axes + 1)
    for side in SIDES:
        at_t, at_a = (encode(at_bind(r), frames_of(r, index, side)).values for r in (t, a))
        assert_allclose(at_a, at_t, atol=1e-6)


def test_both_hands_have_the_same_angles_for_the_same_gesture() -> None:
    rig, index = skeleton(axes=9)
    left, right = (encoded(rig, index, side) for side in SIDES)
    assert np.ptp(left, axis=0).min() > 0.1
    assert_allclose(left, right, atol=1e-6)


# --- what the angles mean ------------------------------------------------------------------------


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("pose", ["A", "T"])
def test_flexion_brings_the_fingertip_to_the_palm(side: Side, pose: str) -> None:
    rig, index = skeleton(at=places(pose), axes=2)
    hand, frames = hand_map(index, side), frames_of(rig, index, side)
    names = all_channels(side, frames.names)
    for digit in range(5):
        for joint in range(3 * digit, 3 * digit + 3):
            if joint == 0:
                continue  # the CMC's flexion moves the thumb across the palm
            angles = np.zeros((5, 45))
            angles[:, 3 * joint + (2 if digit == 0 else 1)] = np.arange(5) * 15.0
            clip = decode(Channels(names, angles), at_bind(rig, 5), frames)
            tips = fingertips(clip, hand, frames)[:, digit]
            # A pronated thumb bends across the palm, to the side of the little finger.
            across = tips[:, 1] * (1 if side == "left" else -1)
            assert np.diff(across if digit == 0 else tips[:, 0]).min() > 0.05, frames.names[joint]


@pytest.mark.parametrize("side", SIDES)
def test_zero_is_a_straight_finger(side: Side) -> None:
    rig, index = skeleton(axes=7)
    frames = frames_of(rig, index, side)
    names = all_channels(side, frames.names)
    clip = decode(Channels(names, np.zeros((1, 45))), at_bind(rig), frames)
    pose = forward_kinematics(clip)
    for finger in FINGERS:
        line = ["wrist", *(finger + j for j in ("MCP", "PIP", "DIP", "Tip"))]
        points = np.array([pose.position(index[side, r])[0] for r in line])
        bones = np.diff(points, axis=0)
        bones /= np.linalg.norm(bones, axis=1, keepdims=True)
        assert_allclose(bones[1:], bones[:-1], atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_abduction_moves_a_finger_sideways_only(side: Side) -> None:
    rig, index = skeleton()
    hand, frames = hand_map(index, side), frames_of(rig, index, side)
    names = all_channels(side, frames.names)
    angles = np.zeros((2, 45))
    angles[1, names.index(("le" if side == "left" else "ri") + "IndexMCPx")] = 20.0
    tips = fingertips(decode(Channels(names, angles), at_bind(rig, 2), frames), hand, frames)
    moved_by = tips[1, 1] - tips[0, 1]
    assert abs(moved_by[0]) < 1e-9
    assert abs(moved_by[1]) > 2.0


# --- what is missing or cannot be decided --------------------------------------------------------


@pytest.mark.parametrize("side", SIDES)
def test_fewer_joints_leave_the_other_angles_as_they_are(side: Side) -> None:
    """No little finger, no last joints of the ring finger, no tips."""
    left_out = ("PinkyMCP", "PinkyPIP", "PinkyDIP", "PinkyTip", "RingDIP", *METACARPALS)
    above = without(*left_out)(parents())
    rig, index = skeleton(above, axes=1)
    whole, whole_index = skeleton(axes=1)
    frames = frames_of(rig, index, side)
    assert frames.names == tuple(n for n in HAND_JOINTS if n not in left_out)
    clip = moved(rig, index, turns())
    # The palm is narrower without the little finger, so its plane is a little another one.
    few = encode(clip, frames)
    full = encode(moved(whole, whole_index, turns()), frames_of(whole, whole_index, side))
    names = [n for n in few.names if "Index" in n or "Middle" in n]
    assert_allclose(few.select(names).values, full.select(names).values, atol=0.5)
    again = decode(few, clip, frames)
    assert rot.angle_between(again.rotations, clip.rotations).max() < 1e-6


def broken(change: Callable[[Places], None]) -> None:
    at = places()
    change(at)
    rig, index = skeleton(at=at)
    hand_frames(rig, hand_map(index, "left"))


def all_on_one_spot(at: Places) -> None:
    at.update({j: np.zeros(3) for j in at})


def one_bone_without_length(at: Places) -> None:
    at["left", "IndexPIP"] = at["left", "IndexMCP"]


def knuckles_on_one_line(at: Places) -> None:
    wrist = at["left", "wrist"]
    for i, finger in enumerate(FINGERS):
        at["left", finger + "MCP"] = wrist + np.array([6.0 + i, 0.0, 0.0])


def a_knuckle_on_the_wrist(at: Places) -> None:
    for side in SIDES:
        at[side, "RingMCP"] = at[side, "wrist"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (all_on_one_spot, "bind"),
        (one_bone_without_length, "IndexMCP"),
        (knuckles_on_one_line, "one line"),
        (a_knuckle_on_the_wrist, "wrist' and the next one of its digit are at the same point"),
    ],
)
def test_a_bind_pose_without_directions_is_refused(
    change: Callable[[Places], None], words: str
) -> None:
    with pytest.raises(HandNotFoundError, match=words):
        broken(change)


def test_one_finger_is_not_enough_for_a_palm() -> None:
    others = [f + j for f in FINGERS[1:] for j in ("MCP", "PIP", "DIP")]
    above = without(*others, *METACARPALS, *TIPS)(parents())
    rig, index = skeleton(above)
    with pytest.raises(HandNotFoundError, match="two fingers"):
        frames_of(rig, index, "left")


def thumb_out_of_the_palm() -> Places:
    """A thumb that stands on the palm: b x n is no flexion axis."""
    at = places()
    for side in SIDES:
        for i, role in enumerate(("MCP", "IP", "Tip")):
            at[side, "Thumb" + role] = at[side, "ThumbCMC"] + np.array([0.0, -4.0, 0.0]) * (i + 1)
    return at


@pytest.mark.parametrize("side", SIDES)
def test_an_undecided_thumb_takes_its_axis_from_the_motion(side: Side) -> None:
    rig, index = skeleton(at=thumb_out_of_the_palm(), axes=6)
    hinge = np.array([0.8, 0.0, 0.6]) * (1 if side == "left" else -1)
    angle = np.radians(60 * np.sin(np.arange(50) / 6))
    turn = rot.from_axis_angle(np.tile(hinge, (50, 1)), angle)
    bend: dict[Joint, Array] = {(side, "ThumbMCP"): turn, (side, "ThumbIP"): turn}
    clip = moved(rig, index, bend)
    frames = frames_of(rig, index, side, clip)
    assert any("ThumbMCP" in n and "taken from its motion" in n for n in frames.notes)
    # Several clips decide together.
    both = frames_of(rig, index, side, at_bind(rig, 500), clip)
    assert_allclose(both.joint_frames, frames.joint_frames, atol=1e-3)
    angles = encode(clip, frames)
    pre = "le" if side == "left" else "ri"
    spread = dict(zip(angles.names, np.ptp(angles.values, axis=0), strict=True))
    assert spread[f"{pre}ThumbMCPz"] == pytest.approx(np.ptp(np.degrees(angle)), rel=0.01)
    assert spread[f"{pre}ThumbMCPx"] < 1.0
    assert spread[f"{pre}ThumbMCPy"] < 1.0


def test_an_undecided_thumb_that_does_not_move_says_so() -> None:
    rig, index = skeleton(at=thumb_out_of_the_palm())
    for clips in ((), (at_bind(rig, 10),)):
        frames = frames_of(rig, index, "left", *clips)
        assert any("taken from the bone before it" in n for n in frames.notes)


def test_a_decided_thumb_says_nothing() -> None:
    rig, index = skeleton()
    assert frames_of(rig, index, "right").notes == ()
