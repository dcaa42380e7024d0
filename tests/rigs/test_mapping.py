"""Hands are found by the names of every known rig, or refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from builders.cost import function_calls
from builders.rigs import (
    HAND,
    METACARPALS,
    TIPS,
    Joint,
    Parents,
    build,
    found_joints,
    from_points,
    known_rigs,
    same_joints,
)
from conftest import SHARED
from hypothesis import given
from hypothesis import strategies as st

from usdhand.anatomy.hand import FINGERS, SIDES, Side
from usdhand.errors import HandNotFoundError
from usdhand.rigs.conventions import load_conventions
from usdhand.rigs.mapping import map_character

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


@pytest.mark.parametrize("missing", FINGERS)
@pytest.mark.parametrize("rig", UNSIDED)
def test_names_without_a_side_and_a_finger_fewer(rig: str, missing: str) -> None:
    named: dict[Joint, str] = {
        ("right", role): n for (_, role), n in RIGS[rig].items() if not role.startswith(missing)
    }
    skeleton, expected = build(named)
    same_joints(map_character(skeleton), expected)


@pytest.mark.parametrize("rig", UNSIDED)
def test_side_from_words_around(rig: str) -> None:
    # The hand is a left one, whatever the word above it says.
    named: dict[Joint, str] = {("left", role): n for (_, role), n in RIGS[rig].items()}
    named[None, "hips"] = "RightHandRoot"
    skeleton, _ = build(named)
    found = map_character(skeleton)
    assert tuple(found.hands) == ("left",)
    assert "left and right by the hand's shape, against the names" in found.contradictions[0]
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


def test_cmu_is_refused() -> None:
    names = "Hips Chest LeftShoulder LeftArm LeftForeArm LeftHand LeftFingerBase LeftHandIndex1"
    joints = ["/".join(names.split()[: i + 1]) for i in range(8)]
    joints.append(joints[5] + "/LThumb")
    with pytest.raises(HandNotFoundError, match="LeftHandIndex1") as error:
        map_character(from_points(joints, np.arange(27.0).reshape(9, 3)))
    assert error.value.exit_code == 4
    assert "--map FILE" in str(error.value)


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
    """About a millisecond for 91 joints, and no more than in proportion for more."""
    named = {**RIGS["unreal"], (None, "spine"): "spine_01"}
    calls = []
    for count in (40, 320):
        extra: dict[str, Joint] = {f"helper{i}": (None, "head") for i in range(count)}
        skeleton, _ = build(named, extra=extra)
        map_character(skeleton)  # tables of names are made once
        calls.append(function_calls(partial(map_character, skeleton)) / len(skeleton))
    assert calls[0] < 200
    assert calls[1] < calls[0]


# --- the shared table of conventions -------------------------------------------------------------

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
