"""Names are a guess, geometry is the judge: names that mislead do not."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from builders.rigs import HAND, Joint, build, found_joints, known_rigs, parents
from hypothesis import given
from hypothesis import strategies as st

import usdhand
from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES
from usdhand.rigs.conventions import named_side, without_side
from usdhand.rigs.mapping import map_character

RIGS = known_rigs()
SIDE_WORDS = [
    ("Left", "Right"), ("L", "R"), ("l", "r"), ("Lf", "Rt"), ("lft", "rgt"), ("LEFT", "RIGHT"),
    ("Links", "Rechts"), ("gauche", "droite"), ("izquierda", "derecha"), ("左", "右"),
]  # fmt: skip
HUMANIK = {**RIGS["humanik"]}
ROLES = (*HAND, "clavicle", "shoulder", "elbow", "wrist")


def digits(joints: dict[Joint, int]) -> dict[Joint, int]:
    return {key: joint for key, joint in joints.items() if key[1] in HAND}


def numbered(first: int, digit_names: dict[str, int]) -> dict[Joint, str]:
    """A body with HumanIK's names whose phalanges are counted from ``first``."""
    named = {k: n for k, n in HUMANIK.items() if not any(d in k[1] for d in DIGITS)}
    for side in SIDES:
        for digit in DIGITS:
            inner = ["ThumbCMC", "ThumbMCP", "ThumbIP"] if digit == "Thumb" else [
                *([digit + "Metacarpal"] * digit_names.get(digit, 0)),
                *(digit + j for j in ("MCP", "PIP", "DIP")),
            ]  # fmt: skip
            for number, role in enumerate(inner, first):
                named[side, role] = f"{side.title()}Hand{digit}{number}"
    return named


@given(
    words=st.sampled_from(SIDE_WORDS),
    separator=st.sampled_from(["_", ".", "-", " ", ":", ""]),
    place=st.sampled_from(["first", "last", "middle"]),
    prefix=st.sampled_from(["", "m", "rig_", "Hero:"]),
)
def test_the_word_for_the_side_may_stand_anywhere(
    words: tuple[str, str], separator: str, place: str, prefix: str
) -> None:
    if separator == "" and not words[0].istitle():
        separator = "_"  # words that run together are no words
    plain = {"clavicle": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand"}
    named: dict[Joint, str] = {k: n for k, n in HUMANIK.items() if k[0] is None}
    for side, word in zip(SIDES, words, strict=True):
        for digit in DIGITS:
            joints = ("CMC", "MCP", "IP") if digit == "Thumb" else ("MCP", "PIP", "DIP")
            for number, joint in enumerate(joints, 1):
                parts = {"first": (word, f"Hand{digit}{number}"),
                         "last": (f"Hand{digit}{number}", word),
                         "middle": ("Hand", word, f"{digit}{number}")}[place]  # fmt: skip
                named[side, digit + joint] = prefix + separator.join(parts)
        for role, name in plain.items():
            parts = (name, word) if place != "first" else (word, name)
            named[side, role] = prefix + separator.join(parts)
    skeleton, expected = build(named)
    found = found_joints(map_character(skeleton))
    assert {k: j for k, j in found.items() if k[1] in ROLES} == {
        k: j for k, j in expected.items() if k[1] in ROLES
    }


@pytest.mark.parametrize(
    ("name", "side", "rest"),
    [
        ("HandLeft", "left", "hand"), ("hand_Lf", "left", "hand"), ("mHandThumb1Left", "left",
         "mhandthumb1"), ("RHand", "right", "hand"), ("Bein.Rechts", "right", "bein"),
        ("Belly", None, "belly"), ("LeftToRight", None, "lefttoright"), ("左手", "left", "手"),
        ("Light", None, "light"), ("rShldr", "right", "shldr"),
    ],
)  # fmt: skip
def test_words_for_sides(name: str, side: str | None, rest: str) -> None:
    assert without_side(name) == (side, rest)
    assert named_side(name) == side


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("metacarpals", [(), FINGERS, ("Index", "Pinky"), ("Middle", "Ring")])
def test_phalanges_are_counted_by_their_place(first: int, metacarpals: tuple[str, ...]) -> None:
    """From 0 or 1, with metacarpals counted among them for all fingers, for some, or for none."""
    skeleton, expected = build(numbered(first, dict.fromkeys(metacarpals, 1)))
    found = map_character(skeleton)
    assert digits(found_joints(found)) == digits(expected)
    for side in SIDES:
        assert set(found.hands[side].metacarpals) == set(metacarpals)
    shifted = first == 0 or bool(metacarpals)
    assert any("by the lengths of the hand" in note for note in found.notes) == shifted


def test_a_shoulder_that_is_a_clavicle() -> None:
    named = {
        **{k: n for k, n in HUMANIK.items() if k[1] not in ("clavicle", "shoulder")},
        **{(s, "clavicle"): f"{s[0].upper()}Shoulder" for s in SIDES},
        **{(s, "shoulder"): f"{s[0].upper()}UArm" for s in SIDES},
    }
    skeleton, expected = build(named)
    found = found_joints(map_character(skeleton))
    for side in SIDES:
        for role in ("clavicle", "shoulder", "elbow", "wrist"):
            assert found[side, role] == expected[side, role]


@pytest.mark.parametrize("seed", range(6))
def test_arm_and_trunk_do_not_depend_on_names(seed: int) -> None:
    """Any known rig's names, and names that say nothing, and any names of body joints swapped."""
    chance = random.Random(seed)
    rig = dict(RIGS[chance.choice(["humanik", "mixamo", "biped", "unreal", "vrm1"])])
    legs = ("thigh", "shin", "foot", "toe", "toe_end")
    rig |= {(s, r): f"{s}_{r}" for s in SIDES for r in legs}
    rig = {k: n for k, n in rig.items() if k in parents()}
    skeleton, expected = build(rig)
    plain, _ = build({k: f"joint{i}" for i, k in enumerate(rig)})
    arms = [(s, r) for s in SIDES for r in ("clavicle", "shoulder", "elbow")]
    body = [(None, r) for r in ("hips", "chest", "neck", "head")]
    one, other = found_joints(map_character(skeleton)), found_joints(map_character(plain))
    for key in (*arms, *body):
        assert one.get(key) == other.get(key), key
    assert digits(one) == digits(expected)


def test_fill_and_splice_measure_the_same_whatever_joints_are_called() -> None:
    from conftest import REPOSITORY

    from usdhand.fill.arm import arm_motion

    clip = usdhand.read_clip(REPOSITORY / "samples" / "gestures" / "ok_01.usdc")
    names = {n: f"j{i}" for i, n in enumerate(clip.skeleton.joints)}
    renamed = tuple(
        "/".join(f"j{clip.skeleton.names.index(part)}" for part in joint.split("/"))
        for joint in clip.skeleton.joints
    )
    assert len(set(renamed)) == len(names)
    other = replace(clip, skeleton=replace(clip.skeleton, joints=renamed))
    ours, theirs = usdhand.find_hands(clip), usdhand.find_hands(other)
    for side in SIDES:
        a, b = arm_motion(clip, ours, side), arm_motion(other, theirs, side)
        for field in vars(a):
            assert (getattr(a, field) == getattr(b, field)).all(), field


def test_what_the_user_names_is_not_overruled() -> None:
    skeleton, expected = build(HUMANIK)
    elbow = skeleton.names[expected["left", "shoulder"]]
    conventions = usdhand.load_conventions({"left": {"elbow": elbow}, "body": {"chest": "Hips"}})
    found = map_character(skeleton, conventions)
    assert found.hands["left"].elbow == expected["left", "shoulder"]
    assert found.chest == expected[None, "hips"]
    assert found.hands["right"].elbow == expected["right", "elbow"]


def test_one_hand_of_two_is_told() -> None:
    named = {k: n for k, n in HUMANIK.items() if k[0] != "right" or k[1] not in HAND}
    skeleton, _ = build(named)
    found = map_character(skeleton)
    assert list(found.hands) == ["left"]
    assert any("only a left hand" in note for note in found.notes)
