"""Hands are found on every known rig, on unknown ones by their shape, and else refused."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs import (
    HAND,
    METACARPALS,
    TIPS,
    Joint,
    Parents,
    build,
    from_points,
    known_rigs,
    parents,
)

from usdhand.anatomy.conventions import load_conventions
from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES, CharacterMap, Side
from usdhand.anatomy.mapping import map_character
from usdhand.errors import HandNotFoundError

RIGS = known_rigs()
SIDED = [name for name, named in RIGS.items() if ("right", "wrist") in named]
UNSIDED = [name for name in RIGS if name not in SIDED]
# These have exactly the names of HumanIK, so that nothing but the file's order decides.
SAME_NAMES = {"zeroeggs": "humanik", "perception_neuron": "humanik"}

Rename = Callable[[str], str]
RENAMES: dict[str, Rename] = {
    "plain": lambda n: n,
    "namespace": lambda n: f"ns:ns2:{n}",
    "prefix": lambda n: f"Fight_{n}",
    "suffix": lambda n: f"{n}_jnt",
    "prefix and suffix": lambda n: f"DEF-{n}.bone",
    "sanitised": lambda n: re.sub(r"\W", "_", n),
    "separators dropped": lambda n: re.sub(r"[\W]", "", n),
    "upper case": str.upper,
}


def found_joints(found: CharacterMap) -> dict[Joint, int]:
    """All joints of a map with the names of tests.rigs."""
    joints: dict[Joint, int | None] = {
        (None, role): getattr(found, role) for role in ("hips", "chest", "neck", "head")
    }
    for side, hand in found.hands.items():
        joints |= {
            (side, role): getattr(hand, role) for role in ("clavicle", "shoulder", "elbow", "wrist")
        }
        joints |= {(side, role): joint for role, joint in hand.joints.items()}
        joints |= {(side, d + "Metacarpal"): j for d, j in hand.metacarpals.items()}
        joints |= {(side, d + "Tip"): j for d, j in hand.tips.items()}
    return {key: joint for key, joint in joints.items() if joint is not None}


def nonsense(drop: tuple[str, ...] = ()) -> dict[Joint, str]:
    """Names that say nothing, for every joint but ``drop`` and the carpal bone."""
    kept = (j for j in parents() if j[1] not in (*drop, "ThumbCarpal"))
    return {joint: f"joint{i}" for i, joint in enumerate(kept)}


def same_joints(found: CharacterMap, expected: dict[Joint, int]) -> None:
    """Compare with everything that a map can hold."""
    body = ("spine", "thigh", "shin", "foot", "toe", "toe_end", "ThumbCarpal")
    assert found_joints(found) == {k: j for k, j in expected.items() if k[1] not in body}


# --- names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rename", RENAMES)
@pytest.mark.parametrize("rig", SIDED)
def test_known_rig(rig: str, rename: str) -> None:
    named = {joint: RENAMES[rename](name) for joint, name in RIGS[rig].items()}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    if rename == "plain":
        assert found.convention == SAME_NAMES.get(rig, rig)


@pytest.mark.parametrize("rig", SIDED)
def test_without_metacarpals_and_tips(rig: str) -> None:
    named = {j: n for j, n in RIGS[rig].items() if j[1] not in (*METACARPALS, *TIPS)}
    skeleton, expected = build(named)
    same_joints(map_character(skeleton), expected)


@pytest.mark.parametrize("rig", SIDED)
def test_helper_joints_are_passed_over(rig: str) -> None:
    named = RIGS[rig]
    helpers = [("wrist", "_twist"), ("IndexMCP", "_aux"), ("IndexDIP", "_helper")]
    extra = {named[s, r] + suffix: (s, r) for s in SIDES for r, suffix in helpers}
    skeleton, expected = build(named, extra=dict(extra))
    same_joints(map_character(skeleton), expected)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("rig", SIDED)
def test_one_hand_only(rig: str, side: Side) -> None:
    named = {j: n for j, n in RIGS[rig].items() if j[0] in (side, None)}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    assert tuple(found.hands) == (side,)
    assert {j: i for j, i in found_joints(found).items() if j[1] in HAND} == {
        j: i for j, i in expected.items() if j[1] in HAND
    }
    assert any(f"only a {side} hand" in note for note in found.notes)


@pytest.mark.parametrize("rig", SIDED)
def test_only_two_fingers(rig: str) -> None:
    kept = ("wrist", "IndexMCP", "IndexPIP", "MiddleMCP", "MiddlePIP")
    skeleton, expected = build({j: n for j, n in RIGS[rig].items() if j[1] in kept or not j[0]})
    found = map_character(skeleton)
    for side in SIDES:
        assert dict(found.hands[side].joints) == {r: expected[side, r] for r in kept[1:]}
        assert "ThumbCMC" in found.hands[side].missing


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("rig", UNSIDED)
def test_names_without_a_side(rig: str, side: Side) -> None:
    named: dict[Joint, str] = {(side, role): n for (_, role), n in RIGS[rig].items()}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    assert found.convention == rig
    same_joints(found, expected)
    assert any("side by shape" in note for note in found.notes)


@pytest.mark.parametrize("rig", UNSIDED)
def test_side_from_words_around(rig: str) -> None:
    # The hand is a left one: the word is believed, not the shape.
    named: dict[Joint, str] = {("left", role): n for (_, role), n in RIGS[rig].items()}
    named[None, "hips"] = "RightHandRoot"
    skeleton, _ = build(named)
    assert tuple(map_character(skeleton).hands) == ("right",)
    both: dict[Joint, str] = {
        (s, role): f"{s}_{n}" for s in SIDES for (_, role), n in RIGS[rig].items()
    }
    skeleton, expected = build(both)
    found = map_character(skeleton)
    for side in SIDES:
        assert found.hands[side].wrist == expected[side, "wrist"]
        assert found.hands[side].joints["RingDIP"] == expected[side, "RingDIP"]


@pytest.mark.parametrize("rig", UNSIDED)
def test_two_hands_with_the_same_names(rig: str) -> None:
    both: dict[Joint, str] = {(s, role): n for s in SIDES for (_, role), n in RIGS[rig].items()}
    both |= {(None, "hips"): "root", ("left", "shoulder"): "a", ("right", "shoulder"): "b"}
    skeleton, expected = build(both)
    found = map_character(skeleton)
    hand = {j: i for j, i in expected.items() if j[1] in HAND}
    assert {j: i for j, i in found_joints(found).items() if j[1] in HAND} == hand


def test_flat_hand_without_a_side_is_refused() -> None:
    named: dict[Joint, str] = {("left", role): n for (_, role), n in RIGS["webxr"].items()}
    skeleton, _ = build(named, curl=0.0)
    points = skeleton.bind_positions * [1, 0, 1]
    with pytest.raises(HandNotFoundError, match="neither names nor shape"):
        map_character(from_points(list(skeleton.joints), points))


def test_joints_without_a_hierarchy() -> None:
    # glTF hands list all joints beside each other.
    skeleton, expected = build(RIGS["webxr"])
    flat = from_points(list(skeleton.names), skeleton.bind_positions)
    same_joints(map_character(flat), expected)


def test_running_numbers_behind_names() -> None:
    named = {j: f"{n}_{i:03d}" for i, (j, n) in enumerate(RIGS["mixamo"].items())}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    assert found.convention == "mixamo"
    same_joints(found, expected)


def test_rigify_prefers_deforming_bones() -> None:
    deform = {j: "DEF-" + n for j, n in RIGS["rigify"].items()}
    skeleton, expected = build(deform)
    copies = [re.sub("DEF-", "ORG-", j) for j in skeleton.joints]
    copies += [re.sub("DEF-", "", j) for j in skeleton.joints]
    points = np.tile(skeleton.bind_positions, (3, 1))
    found = map_character(from_points([*copies, *skeleton.joints], points))
    assert found.hands["left"].wrist == expected["left", "wrist"] + len(copies)


def test_plain_names_win_over_prefixed_copies() -> None:
    skeleton, expected = build(RIGS["advanced_skeleton"])
    copies = ["/".join(f"FK{p}" for p in j.split("/")) for j in skeleton.joints]
    points = np.tile(skeleton.bind_positions, (2, 1))
    found = map_character(from_points([*skeleton.joints, *copies], points))
    same_joints(found, expected)


def test_two_characters_are_refused() -> None:
    skeleton, _ = build(RIGS["humanik"])
    joints = ["/".join(f"{ns}:{p}" for p in j.split("/")) for ns in "ab" for j in skeleton.joints]
    points = np.tile(skeleton.bind_positions, (2, 1))
    with pytest.raises(HandNotFoundError, match=r"two sets of joints.*a:.* and .*b:"):
        map_character(from_points(joints, points))


def test_duplicate_below_the_wrist_wins() -> None:
    skeleton, expected = build(RIGS["humanik"], extra={"LeftHandIndex1": (None, "head")})
    same_joints(map_character(skeleton), expected)


def test_duplicates_below_the_wrist_are_refused() -> None:
    skeleton, _ = build(RIGS["humanik"], extra={"LeftHandIndex1": ("left", "PinkyMCP")})
    with pytest.raises(HandNotFoundError) as error:
        map_character(skeleton)
    assert "left IndexMCP" in str(error.value)
    assert "LeftInHandIndex/LeftHandIndex1" in str(error.value)
    assert "LeftHandPinky1/LeftHandIndex1" in str(error.value)


def test_thumb_off_the_forearm() -> None:
    def move(parents: Parents) -> None:
        for side in SIDES:
            parents[side, "ThumbCMC"] = (side, "elbow")

    skeleton, expected = build(RIGS["studio_galt_mini"], move=move)
    same_joints(map_character(skeleton), expected)


def test_one_joint_for_all_fingers_is_no_metacarpal() -> None:
    def move(parents: Parents) -> None:
        for side in SIDES:
            parents[side, "MiddleMetacarpal"] = (side, "wrist")
            for finger in FINGERS:
                parents[side, finger + "MCP"] = (side, "MiddleMetacarpal")

    named = {j: n for j, n in RIGS["humanik"].items() if j[1] not in METACARPALS}
    base: dict[Joint, str] = {(s, "MiddleMetacarpal"): f"{s.title()}FingerBase" for s in SIDES}
    skeleton, expected = build(named | base, move=move)
    found = map_character(skeleton)
    assert found.hands["left"].metacarpals == {}
    assert found.hands["left"].wrist == expected["left", "wrist"]


def test_wrist_of_another_name_comes_from_the_hierarchy() -> None:
    named = RIGS["humanik"] | {("left", "wrist"): "Manus"}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    assert any("left wrist by hierarchy" in note for note in found.notes)


@pytest.mark.parametrize("carpal", [True, False])
def test_four_thumb_joints(carpal: bool) -> None:
    # thumb0 is a carpal bone, or it is the CMC and thumb3 the tip: bone lengths decide.
    roles = ("ThumbCarpal", "ThumbCMC", "ThumbMCP", "ThumbIP", "ThumbTip")
    named = {j: n for j, n in RIGS["talking_with_hands"].items() if j[1] not in roles}
    for i, role in enumerate(roles[:4] if carpal else roles[1:]):
        named |= {(s, role): f"b_{s[0]}_thumb{i}" for s in SIDES}
    skeleton, expected = build(named)
    same_joints(map_character(skeleton), expected)


def test_biped_with_two_segments_a_finger() -> None:
    last = tuple(f + "DIP" for f in FINGERS)
    named = {j: n for j, n in RIGS["biped"].items() if j[1] not in last}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    assert found.hands["left"].missing == last


def test_arms_of_unknown_names_come_from_the_hierarchy() -> None:
    arm = ("clavicle", "shoulder", "elbow")
    named = {
        j: "x" + str(i) if j[1] in arm else n for i, (j, n) in enumerate(RIGS["unreal"].items())
    }
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    assert any("left elbow by hierarchy" in note for note in found.notes)


# --- shape ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("drop", [(), TIPS, METACARPALS, (*TIPS, *METACARPALS)])
@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("curl", [0.0, 4.0, 12.0, 30.0])
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
    mirrored = from_points(list(skeleton.joints), skeleton.bind_positions * [-1, 1, 1])
    same_joints(map_character(mirrored), expected)


def test_three_fingers_of_unknown_names() -> None:
    gone = tuple("Pinky" + j for j in ("Metacarpal", "MCP", "PIP", "DIP", "Tip"))
    skeleton, expected = build(nonsense(gone))
    found = map_character(skeleton)
    same_joints(found, expected)
    assert any("from the thumb outwards" in note for note in found.notes)


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


def test_cmu_is_refused() -> None:
    names = "Hips Chest LeftShoulder LeftArm LeftForeArm LeftHand LeftFingerBase LeftHandIndex1"
    joints = ["/".join(names.split()[: i + 1]) for i in range(8)]
    joints.append(joints[5] + "/LThumb")
    with pytest.raises(HandNotFoundError, match="LeftHandIndex1") as error:
        map_character(from_points(joints, np.arange(27.0).reshape(9, 3)))
    assert error.value.exit_code == 4
    assert "--map FILE" in str(error.value)


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


NAMES = st.text("LlRr_:. 01Hhandindexthumb", min_size=1, max_size=6) | st.sampled_from(
    [n for rig in RIGS.values() for n in rig.values() if "/" not in n]
)


@given(st.lists(NAMES, min_size=1, max_size=40), st.data())
def test_any_names_give_a_map_or_a_refusal(names: list[str], data: st.DataObject) -> None:
    paths: list[str] = []
    for name in names:
        above = data.draw(st.sampled_from(["", *paths]))
        paths.append(f"{above}/{name}" if above else name)
    joints = list(dict.fromkeys(paths))
    seed = data.draw(st.integers(0, 9))
    points = np.random.default_rng(seed).normal(0, 10, (len(joints), 3))
    try:
        found = map_character(from_points(joints, points))
    except HandNotFoundError:
        return
    for hand in found.hands.values():
        used = [hand.wrist, *hand.joints.values()]
        assert len(set(used)) == len(used)
        assert len([d for d in hand.digits if d != "Thumb"]) >= 2


@given(st.permutations(range(70)))
def test_order_of_joints_does_not_matter(order: list[int]) -> None:
    skeleton, expected = build(RIGS["humanik"])
    order = [i for i in order if i < len(skeleton)]
    joints = [skeleton.joints[i] for i in order]
    shuffled = from_points(joints, skeleton.bind_positions[order])
    found = found_joints(map_character(shuffled))
    assert {j: joints[i] for j, i in found.items()} == {
        j: skeleton.joints[i] for j, i in expected.items() if j in found
    }


def test_fast_enough_for_inspect() -> None:
    named = {**RIGS["unreal"], (None, "spine"): "spine_01"}
    extra: dict[str, Joint] = {f"helper{i}": (None, "head") for i in range(40)}
    skeleton, _ = build(named, extra=extra)
    map_character(skeleton)
    took = []
    for _ in range(5):
        start = time.perf_counter()
        map_character(skeleton)
        took.append(time.perf_counter() - start)
    assert min(took) < 0.02


# --- the shared table of conventions -------------------------------------------------------------

SHARED = Path(os.environ.get("USDHAND_SHARED", Path(__file__).parents[2] / "shared"))
TABLE = SHARED / "hand-joint-conventions.json"


@pytest.mark.skipif(not TABLE.exists(), reason=f"no shared table of conventions at {TABLE}")
def test_agrees_with_the_shared_table() -> None:
    table = json.loads(TABLE.read_text("utf-8"))
    assert set(table) == {c.name for c in load_conventions().conventions}
    for rig, facts in table.items():
        if rig == "cmu_bvh":
            continue
        named = {r: n for (s, r), n in RIGS[rig].items() if s == "left"}
        digits = {"Thumb": facts["thumb"], **facts["fingers"]}
        for digit, joints in digits.items():
            inner = "CMC" if digit == "Thumb" else "Metacarpal"
            words = {
                "cmc": inner,
                "tip": "Tip",
                "mcp": "MCP",
                "pip": "PIP",
                "dip": "DIP",
                "ip": "IP",
            }
            for joint, name in joints.items():
                assert named.get(digit + words[joint]) == name, (rig, digit, joint)
        assert named["wrist"] == facts["wrist"]
