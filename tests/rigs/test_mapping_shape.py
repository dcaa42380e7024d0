"""Hands of unknown names are found by hierarchy and bind pose, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from builders.rigs import (
    HAND,
    METACARPALS,
    TIPS,
    Joint,
    Parents,
    build,
    found_joints,
    from_points,
    nonsense,
    same_joints,
)
from hypothesis import given
from hypothesis import strategies as st

from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES, Side, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.rigs.body import body_of
from usdhand.rigs.mapping import map_character


@pytest.mark.parametrize("drop", [(), TIPS, METACARPALS, (*TIPS, *METACARPALS)])
@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("curl", [0.0, 4.0, 12.0, 30.0, 70.0])
def test_unknown_names(pose: str, curl: float, drop: tuple[str, ...]) -> None:
    skeleton, expected = build(nonsense(drop), pose=pose, curl=curl)
    found = map_character(skeleton)
    assert found.convention == "geometry"
    same_joints(found, expected)


@given(
    st.integers(0, 10_000),
    st.sampled_from(["T", "A"]),
    st.sampled_from([(), TIPS, METACARPALS, (*TIPS, *METACARPALS)]),
)
def test_unknown_names_of_hands_of_all_shapes(seed: int, pose: str, drop: tuple[str, ...]) -> None:
    # Every joint somewhere within 3 mm of its place, the character of any size.
    skeleton, expected = build(nonsense(drop), pose=pose)
    random = np.random.default_rng(seed)
    points = skeleton.bind_positions + random.uniform(-0.3, 0.3, (len(skeleton), 3))
    size = random.uniform(0.05, 20.0)
    same_joints(map_character(from_points(list(skeleton.joints), size * points)), expected)


def test_unknown_names_with_twist_joints_in_the_arm() -> None:
    skeleton, expected = build(nonsense())
    renamed, points = [], list(skeleton.bind_positions)
    elbow, wrist = (skeleton.joints[expected["left", r]] for r in ("elbow", "wrist"))
    for joint in skeleton.joints:
        renamed.append(joint.replace(wrist, f"{elbow}/twist/{wrist.rsplit('/', 1)[1]}"))
    renamed.append(f"{elbow}/twist")
    points.append((points[expected["left", "elbow"]] + points[expected["left", "wrist"]]) / 2)
    same_joints(map_character(from_points(renamed, np.array(points))), expected)


def test_unknown_names_of_a_character_that_looks_elsewhere() -> None:
    skeleton, expected = build(nonsense())
    for degrees in (90, 180, 237):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turned = skeleton.bind_positions @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        same_joints(map_character(from_points(list(skeleton.joints), turned)), expected)


def test_unknown_names_in_inches_and_lying_down() -> None:
    skeleton, expected = build(nonsense())
    points = skeleton.bind_positions[:, [0, 2, 1]] * [1, 1, -1] / 2.54
    same_joints(map_character(from_points(list(skeleton.joints), points)), expected)


def test_unknown_names_with_the_thumb_beside_the_wrist() -> None:
    def move(parents: Parents) -> None:
        for side in SIDES:
            parents[side, "ThumbCMC"] = (side, "elbow")

    skeleton, expected = build(nonsense(), move=move)
    same_joints(map_character(skeleton), expected)


def test_unknown_names_with_one_joint_for_all_fingers() -> None:
    def move(parents: Parents) -> None:
        for side in SIDES:
            for finger in FINGERS:
                parents[side, finger + "MCP"] = (side, "MiddleMetacarpal")

    others = tuple(m for m in METACARPALS if m != "MiddleMetacarpal")
    skeleton, expected = build(nonsense(others), move=move)
    found = map_character(skeleton)
    assert found.hands["left"].wrist == expected["left", "wrist"]
    assert found.hands["left"].metacarpals == {}
    assert found.hands["right"].joints == {r: expected["right", r] for r in HAND}


def test_a_place_that_is_refused_is_noted() -> None:
    skeleton, expected = build(nonsense())
    points = skeleton.bind_positions.copy()
    for thumb, finger in (("CMC", "MCP"), ("MCP", "PIP"), ("IP", "DIP"), ("Tip", "Tip")):
        beside = points[expected["right", "Index" + finger]]
        points[expected["right", "Thumb" + thumb]] = beside + np.array([0.0, -1.0, 0.0])
    found = map_character(from_points(list(skeleton.joints), points))
    assert tuple(found.hands) == ("left",)
    assert any("only a left hand was found (below" in note for note in found.notes)


def test_unknown_names_with_odd_parents() -> None:
    # As in BEAT: the little finger under Ring, the thumb under Index.
    def move(parents: Parents) -> None:
        for side in SIDES:
            parents[side, "ThumbCMC"] = (side, "IndexMetacarpal")
            parents[side, "PinkyMetacarpal"] = (side, "RingMetacarpal")

    skeleton, expected = build(nonsense(), move=move)
    found = map_character(skeleton)
    digits = {j: i for j, i in expected.items() if j[1] in HAND}
    assert {j: i for j, i in found_joints(found).items() if j[1] in HAND} == digits


def test_unknown_names_with_tips_left_at_the_origin() -> None:
    skeleton, expected = build(nonsense())
    points = skeleton.bind_positions.copy()
    points[[i for j, i in expected.items() if j[1] in TIPS]] = 0.0
    same_joints(map_character(from_points(list(skeleton.joints), points)), expected)


@pytest.mark.parametrize("side", SIDES)
def test_one_unknown_hand(side: Side) -> None:
    named = {j: n for j, n in nonsense().items() if j[0] == side and j[1][0].isupper()}
    skeleton, expected = build({**named, (side, "wrist"): "root"})
    found = map_character(skeleton)
    same_joints(found, expected)
    assert any("only a" in note for note in found.notes)


def test_words_tell_the_side_of_unknown_names() -> None:
    named = {j: f"{n}_{j[0] or 'c'}" for j, n in nonsense().items()}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    assert "left and right by names and the feet" in " ".join(found.evidence)


def test_words_do_not_tell_the_side_of_a_mirrored_body() -> None:
    named = {j: f"{n}_{j[0] or 'c'}" for j, n in nonsense().items()}
    skeleton, expected = build(named)
    mirrored = from_points(list(skeleton.joints), skeleton.bind_positions * [-1, 1, 1])
    found = map_character(mirrored)
    assert found.hands["left"].wrist == expected["right", "wrist"]
    assert "left and right by the feet" in found.contradictions[0]


def test_three_fingers_of_unknown_names() -> None:
    gone = tuple("Pinky" + j for j in ("Metacarpal", "MCP", "PIP", "DIP", "Tip"))
    skeleton, expected = build(nonsense(gone))
    found = map_character(skeleton)
    same_joints(found, expected)
    assert any("from the thumb outwards" in note for note in found.notes)


def gone(*digits: str) -> tuple[str, ...]:
    """All roles of some digits."""
    return tuple(d + j for d in digits for j in ("Metacarpal", *digit_joints(d), "Tip"))


@pytest.mark.parametrize("digits", [("Index",), ("Middle",), ("Ring",), ("Ring", "Pinky")])
def test_fingers_that_cannot_be_told_are_refused(digits: tuple[str, ...]) -> None:
    skeleton, _ = build(nonsense(gone(*digits)))
    with pytest.raises(HandNotFoundError, match=r"it is unknown which|neither end"):
        map_character(skeleton)


@pytest.mark.parametrize("joint", ["ThumbCMC", "ThumbMCP"])
def test_a_thumb_of_two_joints_is_refused(joint: str) -> None:
    # It could be a CMC and an MCP or an MCP and an IP.
    skeleton, _ = build(nonsense((joint, *TIPS, *METACARPALS)))
    with pytest.raises(HandNotFoundError, match="thumb"):
        map_character(skeleton)


def test_a_short_chain_beside_the_wrist_is_no_finger() -> None:
    named = nonsense((*TIPS, *METACARPALS))
    extra: dict[str, Joint] = {f"elbow_{s}": (s, "elbow") for s in SIDES}
    skeleton, expected = build(named, extra=extra)
    joints = [*skeleton.joints]
    points = [*skeleton.bind_positions]
    for side in SIDES:
        root = next(j for j in joints if j.endswith(f"elbow_{side}"))
        joints.append(f"{root}/elbow_end_{side[0]}x")
        points.append(points[joints.index(root)] + np.array([0.0, 0.0, -4.0]))
    same_joints(map_character(from_points(joints, np.array(points))), expected)


def test_arms_that_hang_from_the_neck() -> None:
    # As in 3ds Max Biped: the clavicles are children of the neck, and lie below it.
    def move(parents: Parents) -> None:
        for side in SIDES:
            parents[side, "clavicle"] = (None, "neck")

    skeleton, expected = build(nonsense(), move=move)
    same_joints(map_character(skeleton), expected)


def test_a_heel_does_not_say_what_is_in_front() -> None:
    # Legs that end in a short joint behind the ankle, as where feet hang from IK controls.
    skeleton, expected = build(nonsense(("toe_end",)))
    points = skeleton.bind_positions.copy()
    wrists = [expected[side, "wrist"] for side in SIDES]
    assert body_of(skeleton, points, wrists).facing is not None
    for side in SIDES:
        points[expected[side, "toe"]] = points[expected[side, "foot"]] + [0.0, 0.5, -2.0]
    assert body_of(skeleton, points, wrists).facing is None
    same_joints(map_character(from_points(list(skeleton.joints), points)), expected)


def test_what_ends_near_the_hips_is_no_leg() -> None:
    skeleton, expected = build(nonsense(("thigh", "shin", "foot", "toe", "toe_end")))
    joints, points = list(skeleton.joints), list(skeleton.bind_positions)
    for x in (-12.0, 12.0):
        path = joints[expected[None, "hips"]]
        for step in range(3):
            path += f"/pouch{x:.0f}{step}".replace("-", "m")
            joints.append(path)
            points.append(np.array([x, 93.0 + step, 4.0 + 2 * step]))
    del expected[None, "hips"]
    same_joints(map_character(from_points(joints, np.array(points))), expected)


def test_a_thumb_behind_the_hand_speaks_for_no_side() -> None:
    # The knuckles' arch says left, the thumb right.
    named = {j: n for j, n in nonsense().items() if j[0] == "left" and j[1][0].isupper()}
    skeleton, expected = build({**named, ("left", "wrist"): "root"}, curl=0.0)
    points = skeleton.bind_positions.copy()
    for finger in ("Middle", "Ring"):
        points[expected["left", finger + "MCP"], 1] += 0.5
    same_joints(map_character(from_points(list(skeleton.joints), points)), expected)
    thumb = [expected["left", "Thumb" + j] for j in ("MCP", "IP", "Tip")]
    points[thumb, 1] = points[expected["left", "wrist"], 1] + [2.0, 3.0, 4.0]
    with pytest.raises(HandNotFoundError, match="neither names nor shape"):
        map_character(from_points(list(skeleton.joints), points))


def test_a_word_above_a_hand_must_not_contradict_its_shape() -> None:
    named = {j: n for j, n in nonsense().items() if j[0] == "left" and j[1][0].isupper()}
    for word in ("left", "right"):
        skeleton, expected = build({**named, ("left", "wrist"): f"{word}Glove"})
        if word == "left":
            same_joints(map_character(skeleton), expected)
        else:
            with pytest.raises(HandNotFoundError, match="shape and names disagree"):
                map_character(skeleton)


def test_a_word_above_a_flat_hand_tells_its_side() -> None:
    named = {j: n for j, n in nonsense().items() if j[0] == "left" and j[1][0].isupper()}
    skeleton, expected = build({**named, ("left", "wrist"): "LeftGlove"})
    flat = from_points(list(skeleton.joints), skeleton.bind_positions * [1, 0, 1])
    same_joints(map_character(flat), expected)


def test_toes_are_no_fingers() -> None:
    skeleton, expected = build(nonsense())
    joints, points = list(skeleton.joints), list(skeleton.bind_positions)
    for side in SIDES:
        foot = expected[side, "toe"]
        for i in range(4):
            path, place = joints[foot], points[foot]
            for bone in range(3):
                path += f"/t{i}{bone}"
                joints.append(path)
                points.append(place + np.array([(i - 1.5) * 1.5, 0, 1.5 + 1.5 * bone]))
    found = map_character(from_points(joints, np.array(points)))
    hands = {j: i for j, i in expected.items() if j[1] in HAND}
    assert {j: i for j, i in found_joints(found).items() if j[1] in HAND} == hands


# --- refusal -------------------------------------------------------------------------------------


def test_body_without_fingers_is_refused() -> None:
    named = {j: n for j, n in nonsense().items() if not j[1].startswith(DIGITS)}
    skeleton, _ = build(named)
    with pytest.raises(HandNotFoundError, match="no joint chain looks like a hand"):
        map_character(skeleton)


def test_digits_without_a_thumb_are_refused() -> None:
    gone = tuple("Thumb" + j for j in ("CMC", "MCP", "IP", "Tip"))
    skeleton, _ = build(nonsense(gone))
    with pytest.raises(HandNotFoundError, match="thumb"):
        map_character(skeleton)


def test_nothing_to_tell_left_from_right_is_refused() -> None:
    # No legs, flat hands, and thumbs that point to the sides.
    gone = ("thigh", "shin", "foot", "toe", "toe_end")
    skeleton, expected = build(nonsense(gone), curl=0.0)
    points = skeleton.bind_positions.copy()
    for (side, role), joint in expected.items():
        if side and role in (*HAND, *METACARPALS, *TIPS):
            wrist, sign = points[expected[side, "wrist"]], 1 if side == "left" else -1
            along, _, across = (points[joint] - wrist) * [sign, 1, 1]
            points[joint] = wrist + np.array([sign * across, -along, 0])
    with pytest.raises(HandNotFoundError, match="nothing tells left from right"):
        map_character(from_points(list(skeleton.joints), points))


def test_no_joints_at_all() -> None:
    with pytest.raises(HandNotFoundError):
        map_character(from_points(["root"], np.zeros((1, 3))))


def test_no_usable_bind_pose() -> None:
    skeleton, expected = build(nonsense())
    nowhere = from_points(list(skeleton.joints), skeleton.bind_positions * 0)
    with pytest.raises(HandNotFoundError):
        map_character(nowhere)
    by_rest = type(skeleton)(skeleton.joints, skeleton.parents, nowhere.bind, skeleton.rest)
    same_joints(map_character(by_rest), expected)
