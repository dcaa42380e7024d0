"""Names that a file gives its joints besides their own, such as the humanoid bones of VRM."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from builders.rigs import HAND, METACARPALS, TIPS, Joint, build, found_joints, known_rigs, nonsense

from usdhand.anatomy.hand import SIDES
from usdhand.errors import HandNotFoundError
from usdhand.motion.skeleton import Skeleton
from usdhand.rigs.conventions import load_conventions
from usdhand.rigs.mapping import map_character

RIGS = known_rigs()
THUMB = ("ThumbCMC", "ThumbMCP", "ThumbIP")
# Subsets of a thumb's bones; a lone ThumbIP has one name in both versions.
THUMBS = [THUMB, THUMB[:2], THUMB[1:], (THUMB[0], THUMB[2]), THUMB[:1], THUMB[1:2], THUMB[2:], ()]


def aliased(
    named: Mapping[Joint, str], aliases: Mapping[Joint, str], pose: str = "T"
) -> tuple[Skeleton, dict[Joint, int]]:
    """A skeleton of ``named`` joints some of which have ``aliases``."""
    skeleton, at = build(named, pose=pose)
    names = [""] * len(skeleton)
    for joint, alias in aliases.items():
        if joint in at:
            names[at[joint]] = alias
    return replace(skeleton, aliases=tuple(names)), at


def humanoid(version: str, thumb: tuple[str, ...] = THUMB) -> dict[Joint, str]:
    """Bone names of VRM 0 or 1, only some of the thumbs'."""
    return {j: n for j, n in RIGS[version].items() if j[1] not in THUMB or j[1] in thumb}


@pytest.mark.parametrize("version", ["vrm0", "vrm1"])
@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("thumb", THUMBS, ids=lambda t: "+".join(t) or "none")
def test_thumbs_of_both_versions(version: str, pose: str, thumb: tuple[str, ...]) -> None:
    bones = humanoid(version, thumb)
    skeleton, at = aliased(nonsense((*METACARPALS, *TIPS)), bones, pose)
    found = map_character(skeleton)
    joints = found_joints(found)
    if thumb not in ((), THUMB[2:]):
        assert found.convention == version
    assert {joint: joints[joint] for joint in bones} == {joint: at[joint] for joint in bones}
    # What has no alias is found by shape or hierarchy, or not at all, but never another joint.
    assert all(at[joint] == i for joint, i in joints.items())


@pytest.mark.parametrize("version", ["vrm0", "vrm1"])
def test_the_place_of_a_thumb_is_noted(version: str) -> None:
    skeleton, _ = aliased(
        nonsense(), humanoid(version, THUMB[1:] if version == "vrm1" else THUMB[::2])
    )
    notes = map_character(skeleton).notes
    assert f"names are read as those of {version}, by the position of the thumb" in notes


def test_a_joint_between_two_named_ones() -> None:
    skeleton, at = aliased(nonsense(), humanoid("vrm0", THUMB[::2]))
    found = map_character(skeleton)
    assert found.hands["left"].joints["ThumbMCP"] == at["left", "ThumbMCP"]
    assert any("left ThumbMCP by hierarchy" in note for note in found.notes)


def test_aliases_win_over_names() -> None:
    # The avatar's bones bear the names of the other hand.
    names = RIGS["vroid"]
    crossed = {
        (side, role): names["right" if side == "left" else "left", role] if side else name
        for (side, role), name in names.items()
    }
    skeleton, at = aliased(crossed, RIGS["vrm1"])
    found = map_character(skeleton)
    assert found.convention == "vrm1"
    assert found_joints(found) == {j: i for j, i in at.items() if j in RIGS["vrm1"]}
    bare = map_character(replace(skeleton, aliases=()))
    assert bare.convention == "vroid"
    assert bare.hands["left"].wrist == at["left", "wrist"]
    assert any("against the names" in note for note in bare.contradictions)


def test_tips_are_found_beside_aliases() -> None:
    named = RIGS["vroid"] | {
        (s, d): RIGS["vroid"][s, d.replace("Tip", "DIP")] + "_end" for s in SIDES for d in TIPS[1:]
    }
    skeleton, at = aliased(named, RIGS["vrm1"])
    tips = map_character(skeleton).hands["left"].tips
    assert tips == {d[:-3]: at["left", d] for d in TIPS[1:]}


@pytest.mark.parametrize("hidden", [False, True])
def test_body_bones_without_finger_bones(hidden: bool) -> None:
    # Finger bones are optional in VRM: hands come from names or shape, the rest from the aliases.
    named = nonsense((*METACARPALS, *TIPS)) if hidden else RIGS["vroid"]
    bones = {j: n for j, n in RIGS["vrm1"].items() if j[1] not in HAND}
    skeleton, at = aliased(named, bones)
    found = map_character(skeleton)
    assert found.convention == ("geometry" if hidden else "vroid")
    assert found_joints(found) == {j: i for j, i in at.items() if j in RIGS["vrm1"]}


def test_body_bones_win_over_hierarchy() -> None:
    skeleton, at = aliased(nonsense(), {(None, "spine"): "chest", (None, "chest"): "unknown"})
    assert map_character(skeleton).chest == at[None, "spine"]


def test_an_aliased_wrist_tells_the_side() -> None:
    # By shape it is a left hand.
    named = {
        j: n for j, n in nonsense().items() if j[0] == "left" and j[1] not in ("thigh", "shin")
    }
    skeleton, _ = aliased(named, {("left", "wrist"): "rightHand"})
    assert tuple(map_character(skeleton).hands) == ("right",)


def test_joints_named_by_the_user_win_over_aliases(tmp_path: Path) -> None:
    named = nonsense()
    path = tmp_path / "map.toml"
    path.write_text(f'[left]\nThumbIP = "{named["left", "ThumbTip"]}"\n', "utf-8")
    skeleton, at = aliased(named, RIGS["vrm1"])
    found = map_character(skeleton, load_conventions(path))
    assert found.hands["left"].joints["ThumbIP"] == at["left", "ThumbTip"]
    assert found.hands["right"].joints["ThumbIP"] == at["right", "ThumbIP"]


def test_aliases_of_no_hand_change_no_refusal() -> None:
    named = {j: n for j, n in nonsense().items() if j[1] not in (*HAND, *METACARPALS, *TIPS)}
    skeleton, _ = aliased(named, RIGS["vrm0"])
    with pytest.raises(HandNotFoundError, match="no hand found"):
        map_character(skeleton)
