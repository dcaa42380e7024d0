"""VRM avatars and VRM animations: joints with any names, bones that the file declares."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.gltf_files import GltfFile, from_skeleton, turns, vrm1
from builders.rigs import build

from usdhand.errors import InputError
from usdhand.formats.gltf.read import read_character, read_clip
from usdhand.motion import Clip
from usdhand.rigs import map_character

FINGERS = ("Index", "Middle", "Ring", "Little")
VRM0_THUMB = ("Proximal", "Intermediate", "Distal")
VRM1_THUMB = ("Metacarpal", "Proximal", "Distal")
ARM = {"clavicle": "Shoulder", "shoulder": "UpperArm", "elbow": "LowerArm", "wrist": "Hand"}
TIMES = np.arange(5) / 30.0


def bone_names(thumb: tuple[str, ...]) -> dict[Any, str]:
    """Joint of a rig -> humanoid bone."""
    bones: dict[Any, str] = {
        (None, role): role for role in ("hips", "spine", "chest", "neck", "head")
    }
    for side in ("left", "right"):
        for role, name in ARM.items():
            bones[side, role] = side + name
        for role, name in zip(("ThumbCMC", "ThumbMCP", "ThumbIP"), thumb, strict=True):
            bones[side, role] = f"{side}Thumb{name}"
        for finger in FINGERS:
            ours = "Pinky" if finger == "Little" else finger
            for role, name in zip(("MCP", "PIP", "DIP"), VRM0_THUMB, strict=True):
                bones[side, ours + role] = f"{side}{finger}{name}"
    return bones


def avatar(thumb: tuple[str, ...]) -> tuple[GltfFile, dict[int, str], dict[str, Any]]:
    """A humanoid whose nodes have names that tell nothing; node -> bone, and bone -> joint."""
    bones = bone_names(thumb)
    skeleton, joints = build(bones)
    file = from_skeleton(skeleton, [f"n{i}" for i in range(len(skeleton))])
    by_node = {joint + 1: bones[role] for role, joint in joints.items()}
    return file, by_node, {bones[role]: role for role in joints}


def with_skins(file: GltfFile, bones: dict[int, str]) -> GltfFile:
    """Three skins over the same hierarchy, as avatars have them: body, face, hair."""
    named = {bone: node for node, bone in bones.items()}
    hair = [file.node("hair_01", named["head"])]
    hair.append(file.node("hair_02", hair[0]))
    body = [node for node, bone in bones.items() if "Thumb" not in bone]
    for joints in (body, [named["neck"], named["head"]], hair):
        bind = np.array([world(file, node) for node in joints])
        file.skin(joints, bind)
    return file


def world(file: GltfFile, node: int) -> np.ndarray:
    matrix = np.eye(4)
    while True:
        matrix[:3, 3] += file.json["nodes"][node].get("translation", [0, 0, 0])
        above = [i for i, n in enumerate(file.json["nodes"]) if node in n.get("children", [])]
        if not above:
            return matrix
        [node] = above


def vrm0(bones: dict[int, str]) -> dict[str, Any]:
    listed = [{"bone": bone, "node": node} for node, bone in bones.items()]
    return {"VRM": {"humanoid": {"humanBones": [*listed, {"bone": "jaw", "node": -1}]}}}


def aliases_by_name(clip: Clip) -> dict[str, str]:
    skeleton = clip.skeleton
    assert len(skeleton.aliases) == len(skeleton)
    return {n: a for n, a in zip(skeleton.names, skeleton.aliases, strict=True) if a}


def assert_hands(clip: Clip, roles: dict[str, Any]) -> None:
    """The hands are found by the aliases, the thumb as its version names it."""
    found = map_character(clip.skeleton).hands
    named = {
        (side, role): clip.skeleton.aliases[joint]
        for side, hand in found.items()
        for role, joint in hand.joints.items()
    }
    assert len(named) == 30
    assert {named[key]: key for key in named}.items() <= roles.items()


@pytest.mark.parametrize("version", [0, 1])
def test_avatars(version: int, tmp_path: Path) -> None:
    file, bones, roles = avatar(VRM1_THUMB if version else VRM0_THUMB)
    with_skins(file, bones)
    file.json["extensions"] = vrm1(bones) if version else vrm0(bones)
    clip = read_character(file.write(tmp_path / "hero.vrm"))
    assert aliases_by_name(clip) == {f"n{node - 1}": bone for node, bone in bones.items()}
    assert clip.origin.skeleton_path == ""
    assert {"hair_01", "hair_02"} < set(clip.skeleton.names)
    [note] = clip.problems
    assert note.message == f"{len(bones)} joints are named as bones of a VRM {version} humanoid"
    assert_hands(clip, roles)
    wrist = clip.skeleton.aliases.index("leftHand")
    assert clip.skeleton.bind_positions[wrist] == pytest.approx([71, 146, 0], abs=1e-4)


def test_an_animation_has_bones_without_a_skin(tmp_path: Path) -> None:
    file, bones, roles = avatar(VRM1_THUMB)
    file.json["extensions"] = vrm1(bones, "VRMC_vrm_animation")
    file.animation()
    expression = file.node("happy", 0)
    file.curve(expression, "translation", TIMES, np.ones((5, 3)))
    for node in bones:
        file.curve(node, "rotation", TIMES, turns(5, node))
    hips = next(node for node, bone in bones.items() if bone == "hips")
    file.curve(hips, "translation", TIMES, np.linspace(0, 1.4, 15).reshape(5, 3))
    clip = read_clip(file.write(tmp_path / "wave.vrma"))
    assert len(clip) == 5
    assert "happy" not in clip.skeleton.names
    assert aliases_by_name(clip) == {f"n{node - 1}": bone for node, bone in bones.items()}
    assert clip.translations[4, clip.skeleton.aliases.index("hips")] == pytest.approx(
        [120, 130, 140]
    )
    assert_hands(clip, roles)


def test_a_bone_of_no_node(tmp_path: Path) -> None:
    file, _, _ = avatar(VRM0_THUMB)
    file.json["extensions"] = vrm1({999: "hips"})
    path = file.write(tmp_path / "hero.vrm")
    with pytest.raises(InputError, match=r"VRMC_vrm\.humanoid\.humanBones\.hips\.node is 999"):
        read_character(path)
    file.json["extensions"] = {"VRM": {"humanoid": {"humanBones": [{"bone": "hips", "node": -2}]}}}
    with pytest.raises(InputError, match=r"humanBones\[0\]\.node is -2"):
        read_character(file.write(path))


def test_a_file_without_bones_has_no_aliases(tmp_path: Path) -> None:
    file, bones, _ = avatar(VRM0_THUMB)
    with_skins(file, bones)
    assert read_character(file.write(tmp_path / "hero.glb")).skeleton.aliases == ()
