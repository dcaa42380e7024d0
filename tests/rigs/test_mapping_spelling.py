"""Names as other formats and exporters spell them, and the traps in what rigs call their joints."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

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
    known_rigs,
    nonsense,
    same_joints,
)
from conftest import shared_data

from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.formats.files import read_character
from usdhand.rigs.conventions import load_conventions
from usdhand.rigs.mapping import map_character

RIGS = known_rigs()
SIDED = [name for name, named in RIGS.items() if ("right", "wrist") in named]


def legal(name: str) -> str:
    """A name with all that USD and others do not take turned into underscores."""
    return re.sub(r"[^A-Za-z0-9]", "_", name)


def maya_escaped(name: str) -> str:
    """Maya's way to write any character into an FBX."""
    return re.sub(r"[^A-Za-z0-9_]", lambda m: f"FBXASC{ord(m[0]):03d}", name)


SPELLINGS: dict[str, Callable[[str], str]] = {
    "MotionBuilder": lambda n: f"Character1:{n}",
    "FBX model": lambda n: f"Model::{n}",
    "Blender path": lambda n: f"Armature|{n}",
    "Blender path, legal": lambda n: legal(f"Armature|{n}"),
    "Blender copy": lambda n: f"{n}.001",
    "Blender copy, legal": lambda n: legal(f"{n}.001"),
    "Blender deform, legal": lambda n: legal(f"DEF-{n}"),
    "other Mixamo": lambda n: "mixamorig9:" + n.split(":")[-1],
    "no prefix": lambda n: n.split(":")[-1],
    "Maya": maya_escaped,
    "Maya namespace": lambda n: maya_escaped(f"ns:{n}"),
    "single underscores": lambda n: re.sub("_+", "_", legal(n)),
    "underscore before": lambda n: f"_{n}",
    "lower case": str.lower,
}


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("rig", SIDED)
def test_other_spellings_of_known_rigs(rig: str, spelling: str) -> None:
    original, _ = build(RIGS[rig])
    skeleton, expected = build({j: SPELLINGS[spelling](n) for j, n in RIGS[rig].items()})
    found = map_character(skeleton)
    same_joints(found, expected)
    assert found_joints(found) == found_joints(map_character(original))


@pytest.mark.parametrize("rig", SIDED)
def test_running_numbers_behind_all_names(rig: str) -> None:
    named = {j: f"{n}_{i:02d}" for i, (j, n) in enumerate(RIGS[rig].items())}
    skeleton, expected = build(named)
    same_joints(map_character(skeleton), expected)


@pytest.mark.parametrize("rig", SIDED)
def test_end_sites_of_bvh(rig: str) -> None:
    """Every leaf has a child ``<leaf>_End``: a tip behind a last phalanx, else nothing."""
    plain, expected = build({j: n for j, n in RIGS[rig].items() if j[1] not in TIPS})
    leaves = [i for i, below in enumerate(plain.children) if not below]
    joints = [*plain.joints, *(f"{plain.joints[i]}/{plain.names[i]}_End" for i in leaves)]
    points = np.concatenate([plain.bind_positions, plain.bind_positions[leaves] + [1.5, 0, 0]])
    for n, leaf in enumerate(leaves):
        for side in SIDES:
            for digit in DIGITS:
                if expected.get((side, digit + digit_joints(digit)[-1])) == leaf:
                    expected[side, digit + "Tip"] = len(plain) + n
    same_joints(map_character(from_points(joints, points)), expected)


# --- the table's notes ---------------------------------------------------------------------------


@pytest.mark.parametrize("rig", ["mixamo", "humanik", "zeroeggs", "beat", "advanced_skeleton"])
def test_a_fourth_segment_is_the_tip(rig: str) -> None:
    skeleton, expected = build(RIGS[rig])
    hands = map_character(skeleton).hands
    assert set(hands) == set(SIDES)
    for side, hand in hands.items():
        assert hand.tips == {d: expected[side, d + "Tip"] for d in DIGITS}
        assert all(skeleton.names[j][-2:] != "4" for j in hand.joints.values())


def beat_parents(parents: Parents) -> None:
    for side in SIDES:
        parents[side, "ThumbCMC"] = (side, "IndexMetacarpal")
        parents[side, "PinkyMetacarpal"] = (side, "RingMetacarpal")


def test_beat_hangs_the_little_finger_under_ring_and_the_thumb_under_index() -> None:
    skeleton, expected = build(RIGS["beat"], move=beat_parents)
    little, ring = expected["left", "PinkyMetacarpal"], expected["left", "RingMetacarpal"]
    assert skeleton.parents[little] == ring
    found = map_character(skeleton)
    assert found.convention == "beat"
    same_joints(found, expected)
    assert "Middle" not in found.hands["left"].metacarpals


def test_a_thumb_alone_is_no_hand() -> None:
    """As in CMU's files: one thumb joint, one finger joint, of which nothing can be made."""
    arms = ("clavicle", "shoulder", "elbow", "wrist")
    named = {j: n for j, n in RIGS["humanik"].items() if j[0] is None or j[1] in arms}
    for side, word, letter in (("left", "Left", "L"), ("right", "Right", "R")):
        named[side, "MiddleMetacarpal"] = f"{word}FingerBase"  # type: ignore[index]
        named[side, "MiddleMCP"] = f"{word}HandIndex1"  # type: ignore[index]
        named[side, "ThumbCMC"] = f"{letter}Thumb"  # type: ignore[index]
    skeleton, _ = build(named)
    with pytest.raises(HandNotFoundError, match=r"seen: .*LThumb.*--map FILE"):
        map_character(skeleton)


@pytest.mark.parametrize("rig", ["smplx"])
def test_digits_in_any_order(rig: str) -> None:
    skeleton, expected = build(RIGS[rig])
    last = [i for j, i in expected.items() if j[1].startswith(("Ring", "Thumb"))]
    order = [i for i in range(len(skeleton)) if i not in last] + last
    moved = from_points([skeleton.joints[i] for i in order], skeleton.bind_positions[order])
    same_joints(map_character(moved), {j: order.index(i) for j, i in expected.items()})


@pytest.mark.parametrize("above", [False, True], ids=["beside", "above"])
def test_the_palm_of_openxr_is_no_finger(above: bool) -> None:
    named: dict[Joint, str] = {("left", r): n for (_, r), n in RIGS["openxr"].items()}
    palm = "XR_HAND_JOINT_PALM_EXT"
    skeleton, expected = build(named, extra={palm: ("left", "wrist")})
    if above:
        joints = [palm, *(f"{palm}/{path}" for path in skeleton.joints[:-1])]
        order = [len(skeleton) - 1, *range(len(skeleton) - 1)]
        skeleton = from_points(joints, skeleton.bind_positions[order])
        expected = {joint: i + 1 for joint, i in expected.items()}
    same_joints(map_character(skeleton), expected)


def test_the_hand_of_xsens_is_above_the_wrist() -> None:
    arm: dict[Joint, str] = {(s, "elbow"): f"{s.title()}Hand" for s in SIDES}
    arm |= {(s, "shoulder"): f"{s.title()}ForeArm" for s in SIDES}
    arm |= {(s, "clavicle"): f"{s.title()}UpperArm" for s in SIDES}
    skeleton, expected = build(RIGS["xsens_mvn"] | arm)
    left = map_character(skeleton).hands["left"]
    assert left.wrist == expected["left", "wrist"]
    # Names here are one joint off; the elbow is where the arm bends, whatever it is called.
    assert left.elbow == expected["left", "elbow"]
    assert left.shoulder == expected["left", "shoulder"]


@pytest.mark.parametrize("prefix", ["Bip01", "Bip001", "Bip02"])
def test_all_numbers_of_bipeds(prefix: str) -> None:
    named = {j: n.replace("Bip01", prefix) for j, n in RIGS["biped"].items()}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    assert found.convention == "biped"
    same_joints(found, expected)


def test_the_aux_joints_of_steamvr_are_no_part_of_the_fingers() -> None:
    extra: dict[str, Joint] = {
        f"finger_{d.lower()}_{s[0]}_aux": (s, "wrist") for s in SIDES for d in DIGITS
    }
    skeleton, expected = build(RIGS["steamvr"], extra=extra)
    same_joints(map_character(skeleton), expected)


def test_the_epic_template_of_mgear_has_unreal_names() -> None:
    named = {j: f"{n}_jnt" for j, n in RIGS["unreal"].items()}
    skeleton, expected = build(named)
    found = map_character(skeleton)
    assert found.convention == "unreal"
    same_joints(found, expected)


def middle_names() -> dict[Joint, str]:
    """A rig in which the middle phalanx of the middle finger is ``middle_middle``."""
    named: dict[Joint, str] = {(s, "wrist"): f"{s}_palm_bone" for s in SIDES}
    for side in SIDES:
        for digit in DIGITS:
            for joint, word in zip(
                digit_joints(digit), ("proximal", "middle", "distal"), strict=True
            ):
                named[side, digit + joint] = f"{side}_{digit.lower()}_{word}"
    return named | {
        j: f"b{i}" for i, j in enumerate(nonsense((*HAND, *TIPS, *METACARPALS, "wrist")))
    }


def test_middle_is_a_finger_and_a_phalanx(tmp_path: Path) -> None:
    skeleton, expected = build(middle_names())
    same_joints(map_character(skeleton), expected)
    path = tmp_path / "map.toml"
    path.write_text(
        '[ours]\nside = ["left", "right"]\ndigit = ["index", "middle", "ring", "pinky"]\n'
        'wrist = "{side}_palm_bone"\n'
        'thumb = ["{side}_thumb_proximal", "{side}_thumb_middle", "{side}_thumb_distal"]\n'
        'finger = ["{side}_{digit}_proximal", "{side}_{digit}_middle", "{side}_{digit}_distal"]\n',
        "utf-8",
    )
    found = map_character(skeleton, load_conventions(path))
    assert found.convention == "ours"
    same_joints(found, expected)


def test_metacarpals_of_both_kinds_of_unreal_rigs() -> None:
    old = {j: n for j, n in RIGS["unreal"].items() if j[1] not in METACARPALS}
    for named in (RIGS["unreal"], old):
        skeleton, expected = build(named)
        found = map_character(skeleton)
        same_joints(found, expected)
        assert bool(found.hands["left"].metacarpals) == (named is not old)


# --- names that are not all known ----------------------------------------------------------------


@pytest.mark.parametrize("digit", DIGITS)
def test_a_digit_of_unknown_names_is_found_by_its_shape(digit: str) -> None:
    named = {
        j: f"Left{i}" if j[0] == "left" and j[1].startswith(digit) else n
        for i, (j, n) in enumerate(RIGS["humanik"].items())
    }
    skeleton, expected = build(named)
    found = map_character(skeleton)
    same_joints(found, expected)
    assert f"left {digit} by shape" in found.notes
    assert not any(note.startswith("right") for note in found.notes)


def test_shape_adds_nothing_to_names_that_it_contradicts() -> None:
    # Names say that the ring finger is the little one.
    swap = {"Ring": "Pinky", "Pinky": "Ring"}
    named = {
        j: f"x{i}" if j[1].startswith("Ring") else re.sub("Pinky", "Ring", n)
        for i, (j, n) in enumerate(RIGS["mixamo"].items())
    }
    skeleton, expected = build(named)
    hand = map_character(skeleton).hands["left"]
    assert hand.digits == ("Thumb", "Index", "Middle", "Ring")
    assert hand.joints["RingMCP"] == expected["left", swap["Ring"] + "MCP"]


@pytest.mark.real_data
@pytest.mark.parametrize("clip", ["walk", "crossarms"])
def test_a_real_rig_with_one_misnamed_finger(clip: str) -> None:
    skeleton = read_character(shared_data("fbx", "ozz", f"{clip}.fbx")).skeleton
    found = map_character(skeleton)
    assert not any(hand.missing for hand in found.hands.values())
    assert skeleton.names[found.hands["left"].joints["PinkyMCP"]] == "LeftHandRingPinky1"
    assert found.hands["left"].tips.keys() == set(DIGITS)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["jumping_jacks", "wave_hello"])
def test_real_bodies_without_fingers_are_refused(name: str) -> None:
    skeleton = read_character(shared_data("bvh", "animated-drawings", f"{name}.bvh")).skeleton
    with pytest.raises(HandNotFoundError, match=r"Thumb.*--map FILE"):
        map_character(skeleton)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("path", "convention"),
    [
        ("bvh/animated-drawings/jesse_dance.bvh", "humanik"),
        ("bvh/performs/Idle.bvh", "mixamo"),
        ("maya/HIK_Export.usda", "humanik"),
        ("studiogalt/full/SG_ASL_ABC_2023_2_3.usdc", "studio_galt_full"),
        ("studiogalt/mini/SG_ASL_ABC_2023_2_3.usdc", "studio_galt_mini"),
        ("studiogalt/fbx/SG_ASL_ABC_2023-2-3_No_Mesh_Full.fbx", "studio_galt_full"),
        ("studiogalt/fbx/SG_ASL_ABC_2023-2-3_No_Mesh_Mini.fbx", "studio_galt_mini"),
    ],
)
def test_real_rigs_are_known(path: str, convention: str) -> None:
    found = map_character(read_character(shared_data(*path.split("/"))).skeleton)
    assert found.convention == convention
    assert not any(hand.missing for hand in found.hands.values())
    for hand in found.hands.values():
        for finger in FINGERS:
            line = [hand.joints[finger + j] for j in digit_joints(finger)]
            assert all(a != b for a, b in pairwise(line))
    assert None not in (found.hips, found.chest, found.neck, found.head)


@pytest.mark.real_data
@pytest.mark.parametrize("side", SIDES)
def test_real_webxr_hands(side: str) -> None:
    skeleton = read_character(shared_data("gltf", "webxr-generic-hand", f"{side}.glb")).skeleton
    found = map_character(skeleton)
    assert found.convention == "webxr"
    assert tuple(found.hands) == (side,)
    assert not found.hands[side].missing  # type: ignore[index]
