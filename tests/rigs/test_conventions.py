"""The packaged conventions and users' map files: what is read, what wins, what is refused."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

import pytest
from builders.rigs import Joint, build, known_rigs

from usdhand.anatomy.hand import HAND_JOINTS, SIDES
from usdhand.errors import HandNotFoundError, UsageError
from usdhand.rigs.conventions import (
    METACARPALS,
    Convention,
    Conventions,
    load_conventions,
    name_key,
    named_side,
)
from usdhand.rigs.mapping import map_character

RIGS = known_rigs()


def by_name(conventions: Conventions) -> dict[str, Convention]:
    return {c.name: c for c in conventions.conventions}


def written(folder: Path, text: str, name: str = "map.toml") -> Path:
    path = folder / name
    path.write_text(text, "utf-8")
    return path


# --- packaged ------------------------------------------------------------------------------------


def test_there_are_33_conventions_in_the_order_of_the_file() -> None:
    found = load_conventions().conventions
    text = resources.files("usdhand.rigs").joinpath("conventions.toml").read_text("utf-8")
    assert [c.name for c in found] == list(tomllib.loads(text))
    assert len(found) == 33
    assert not any(c.own for c in found)


@pytest.mark.parametrize("rig", RIGS)
def test_every_spelled_out_name_is_in_the_table(rig: str) -> None:
    convention = by_name(load_conventions())[rig]
    prefixes = {"", *map(name_key, convention.prefixes)}
    for (side, role), name in RIGS[rig].items():
        if side is None:
            names = convention.body[role]
        elif None in convention.hands:
            names = convention.hands[None][role]
        else:
            names = convention.hands[side][role]
        assert name_key(name) in {p + name_key(n) for p in prefixes for n in names}


@pytest.mark.parametrize("convention", load_conventions().conventions, ids=lambda c: c.name)
def test_no_name_stands_for_two_joints(convention: Convention) -> None:
    seen: dict[str, tuple[object, str]] = {}
    assert set(convention.hand_keys) in ({None}, set(SIDES))
    for side, roles in convention.hand_keys.items():
        assert set(HAND_JOINTS) <= set(roles)
        for role, keys in roles.items():
            for key in keys:
                assert seen.setdefault(key, (side, role)) == (side, role), key


def test_all_ways_to_write_a_name_are_one() -> None:
    spelled = ("hand.L", "hand_L", "HandL", "hand l", "handFBXASC046L", "hand|L", "_hand-L")
    assert {name_key(n) for n in spelled} == {"handl"}


@pytest.mark.parametrize(
    ("joint", "side"),
    [
        ("Hand_L", "left"),
        ("leftHand", "left"),
        ("mixamorig:RightHand", "right"),
        ("R_Arm/finger_01", "right"),
        ("Armature/LeftHand/right_finger", "right"),
        ("l_r_bridge", None),
        ("Belly/Rump", None),
        ("hand", None),
    ],
)
def test_words_for_sides(joint: str, side: str | None) -> None:
    assert named_side(joint) == side


# --- users' files --------------------------------------------------------------------------------

STUDIO = """
[studio]
about = "our rigs"
side = ["lf", "rt"]
digit = ["idx", "mid", "rng", "pky"]
wrist = "{side}_mitt"
thumb = ["{side}_thb_a", "{side}_thb_b", "{side}_thb_c"]
finger = ["{side}_{digit}_a", "{side}_{digit}_b", "{side}_{digit}_c"]
hips = ["cog", "root"]
"""


def studio_names() -> dict[Joint, str]:
    words = {"Thumb": "thb", "Index": "idx", "Middle": "mid", "Ring": "rng", "Pinky": "pky"}
    named: dict[Joint, str] = {(None, "hips"): "cog"}
    for side, s in zip(SIDES, ("lf", "rt"), strict=True):
        named[side, "wrist"] = f"{s}_mitt"
        for i, role in enumerate(HAND_JOINTS):
            word = next(w for digit, w in words.items() if role.startswith(digit))
            named[side, role] = f"{s}_{word}_{'abc'[i % 3]}"
    return named


def test_a_users_convention(tmp_path: Path) -> None:
    conventions = load_conventions(written(tmp_path, STUDIO))
    assert conventions.conventions[0].name == "studio"
    assert conventions.conventions[0].own
    assert len(conventions.conventions) == 34
    skeleton, expected = build(studio_names())
    found = map_character(skeleton, conventions)
    assert found.convention == "studio"
    assert found.hips == expected[None, "hips"]
    for side in SIDES:
        assert dict(found.hands[side].joints) == {r: expected[side, r] for r in HAND_JOINTS}


def test_a_users_convention_wins(tmp_path: Path) -> None:
    # Half as many joints of a rig as HumanIK knows, and yet it is what the user wants.
    text = '[mine]\nlike = "humanik"\nthumb = ["{side}X1", "{side}X2", "{side}X3"]\n'
    skeleton, _ = build(RIGS["humanik"])
    found = map_character(skeleton, load_conventions(written(tmp_path, text)))
    assert found.convention == "mine"
    assert "left Thumb by shape" in found.notes


def test_a_users_table_replaces_one_of_the_same_name(tmp_path: Path) -> None:
    text = STUDIO.replace("[studio]", "[unreal]")
    found = load_conventions(written(tmp_path, text))
    assert len(found.conventions) == 33
    assert by_name(found)["unreal"].hands["left"]["wrist"] == ("lf_mitt",)
    assert by_name(load_conventions())["unreal"].hands["left"]["wrist"] == ("hand_l",)


def test_a_later_file_wins(tmp_path: Path) -> None:
    first = written(tmp_path, STUDIO, "a.toml")
    second = written(tmp_path, STUDIO.replace("mitt", "paw"), "b.toml")
    found = load_conventions(first, second).conventions
    assert [c.name for c in found[:2]] == ["studio", "humanik"]
    assert found[0].hands["right"]["wrist"] == ("rt_paw",)


def test_single_joints_override_the_shorthand(tmp_path: Path) -> None:
    text = STUDIO + 'RingMetacarpal = "{s}_ringbase"\nThumbCMC = "{side}_thb_0"\n'
    left = by_name(load_conventions(written(tmp_path, text)))["studio"].hands["left"]
    assert left["RingMetacarpal"] == ("l_ringbase",)
    assert left["ThumbCMC"] == ("lf_thb_0",)
    assert set(METACARPALS.values()) & set(left) == {"RingMetacarpal"}


def explicit_table(side: str, named: dict[str, str]) -> str:
    return f"[{side}]\n" + "".join(f'{role} = "{name}"\n' for role, name in named.items())


def test_joints_named_one_by_one(tmp_path: Path) -> None:
    named: dict[Joint, str] = {j: f"bone{i}" for i, j in enumerate(studio_names())}
    skeleton, expected = build(named, curl=0.0)
    text = "".join(
        explicit_table(side, {r: n for (s, r), n in named.items() if s == side}) for side in SIDES
    )
    text += explicit_table("body", {"hips": named[None, "hips"]})
    found = map_character(skeleton, load_conventions(written(tmp_path, text)))
    assert found.hips == expected[None, "hips"]
    for side in SIDES:
        assert found.hands[side].wrist == expected[side, "wrist"]
        assert dict(found.hands[side].joints) == {r: expected[side, r] for r in HAND_JOINTS}


def test_what_was_not_found_beside_named_joints_is_noted(tmp_path: Path) -> None:
    # A hand without a thumb and of unknown names is refused, but not if its joints are named.
    named: dict[Joint, str] = {
        j: f"bone{i}"
        for i, j in enumerate(studio_names())
        if j[0] == "left" and not j[1].startswith("Thumb")
    }
    skeleton, expected = build(named)
    text = explicit_table("left", {role: name for (_, role), name in named.items()})
    found = map_character(skeleton, load_conventions(written(tmp_path, text)))
    assert found.hands["left"].joints["PinkyDIP"] == expected["left", "PinkyDIP"]
    assert found.convention == "map file"
    assert any("beyond the map file: " in note for note in found.notes)


def test_named_joints_win_over_the_convention(tmp_path: Path) -> None:
    skeleton, expected = build(RIGS["humanik"], extra={"MyThumb": ("left", "wrist")})
    text = '[left]\nThumbCMC = "MyThumb"\nelbow = "LeftArm"\nRingTip = "LeftHandRing3"\n'
    found = map_character(skeleton, load_conventions(written(tmp_path, text)))
    left = found.hands["left"]
    assert left.joints["ThumbCMC"] == skeleton.find("MyThumb")
    assert left.elbow == expected["left", "shoulder"]
    assert left.tips["Ring"] == expected["left", "RingDIP"]
    assert left.joints["IndexMCP"] == expected["left", "IndexMCP"]
    assert found.convention == "humanik"
    assert "joints taken from the map file" in found.notes


def test_a_named_joint_that_is_not_there(tmp_path: Path) -> None:
    skeleton, _ = build(RIGS["humanik"])
    conventions = load_conventions(written(tmp_path, '[left]\nThumbCMC = "Daumen"\n'))
    with pytest.raises(HandNotFoundError, match=r"\[left\] ThumbCMC: 'Daumen' is not in"):
        map_character(skeleton, conventions)


def test_a_named_joint_that_is_there_twice(tmp_path: Path) -> None:
    skeleton, _ = build(RIGS["humanik"], extra={"LeftHandThumb1": (None, "head")})
    conventions = load_conventions(written(tmp_path, '[left]\nThumbCMC = "LeftHandThumb1"\n'))
    with pytest.raises(HandNotFoundError, match="2 joints: give a path"):
        map_character(skeleton, conventions)


def test_too_few_named_joints_for_a_hand(tmp_path: Path) -> None:
    named = {j: n for j, n in RIGS["humanik"].items() if j[0] != "right"}
    skeleton, _ = build(named)
    conventions = load_conventions(written(tmp_path, '[right]\nwrist = "Head"\n'))
    with pytest.raises(HandNotFoundError, match="names no complete hand"):
        map_character(skeleton, conventions)


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[studio", "TOML"),
        ('wrist = "Hand"', "wrist"),
        ('[studio]\nwirst = "Hand"', "wirst"),
        ("[studio]\nwrist = 3", "wrist"),
        ("[studio]\nwrist = []", "wrist"),
        ('[studio]\nthumb = ["a", "b"]', "thumb"),
        ('[studio]\ndigit = ["a", "b", "c"]', "digit"),
        ('[studio]\nside = "Left"', "side"),
        ('[studio]\nlike = "nobody"', "nobody"),
        ('[a]\nlike = "b"\n[b]\nlike = "a"', "like"),
        ('[left]\nIndexXYZ = "Hand"', "IndexXYZ"),
        ('[right]\nIndexMCP = ["Hand"]', "IndexMCP"),
        ('[body]\nwrist = "Hand"', "wrist"),
    ],
)
def test_malformed_files_name_file_and_key(tmp_path: Path, text: str, key: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(UsageError) as error:
        load_conventions(path)
    assert str(path) in str(error.value)
    assert key in str(error.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nothing\.toml"):
        load_conventions(tmp_path / "nothing.toml")
