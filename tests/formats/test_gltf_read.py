"""glTF files read: joints, poses, curves, times, and what a file leaves open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.gltf_agreement import TOLERANCE_CM, assert_agrees, read
from builders.gltf_files import GltfFile, arm, moving_arm, turns
from conftest import shared_data
from oracles.gltf import Oracle

from usdhand.errors import InputError, UsageError
from usdhand.formats.gltf.read import animation_names, read_character, read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

TIMES = np.arange(9) / 30.0


# -- real files ---------------------------------------------------------------------------------


@pytest.mark.real_data
@pytest.mark.parametrize("side", ["left", "right"])
def test_real_hands(side: str) -> None:
    path = shared_data("gltf", "webxr-generic-hand", f"{side}.glb")
    clip = read_character(path)
    assert len(clip.skeleton) == 25
    assert "index-finger-phalanx-distal" in clip.skeleton.names
    assert clip.origin.skeleton_path == "" == clip.origin.animation_path
    assert_agrees(path, clip, animation=None)
    with pytest.raises(InputError, match="holds no animation"):
        read_clip(path)


# -- the oracle ---------------------------------------------------------------------------------


@pytest.mark.parametrize("interpolation", [None, "LINEAR", "STEP", "CUBICSPLINE"])
@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_interpolations(interpolation: str | None, suffix: str, tmp_path: Path) -> None:
    file = GltfFile()
    file.animation()
    nodes = arm(file)
    # The last joint has a key at every frame, the others have keys of their own.
    values = np.repeat(turns(9, 1), 3 if interpolation == "CUBICSPLINE" else 1, axis=0)
    file.curve(nodes[-1], "rotation", TIMES, values, interpolation)
    random = np.random.default_rng(5)
    for i, node in enumerate(nodes[:-1]):
        keys = np.array([0.0, 3.0, 4.0, 8.0]) / 30.0
        q, t = turns(4, 10 + i), random.normal(0.0, 0.2, (4, 3))
        if interpolation == "CUBICSPLINE":
            q = np.stack([random.normal(size=(4, 4)), q, random.normal(size=(4, 4))], 1)
            t = np.stack([random.normal(size=(4, 3)), t, random.normal(size=(4, 3))], 1)
        file.curve(node, "rotation", keys, q.reshape(-1, 4), interpolation)
        file.curve(node, "translation", keys, t.reshape(-1, 3), interpolation)
    clip = read(file, tmp_path, suffix)
    assert len(clip) == 9
    assert clip.fps == 30.0
    later = 1e-6 if interpolation == "STEP" else 0.0
    assert_agrees(tmp_path / f"take{suffix}", clip, later=later)


def test_stored_in_every_way(tmp_path: Path) -> None:
    file = GltfFile()
    file.animation()
    nodes = arm(file)
    times = file.accessor(TIMES, stride=8)
    for node, component in zip(nodes, ("i1", "i2", "f4"), strict=False):
        more = {} if component == "f4" else {"normalized": True}
        file.curve(node, "rotation", times, file.accessor(turns(9, 1), component, **more))
    unsigned = np.abs(turns(9, 3))
    file.curve(nodes[3], "rotation", times, file.accessor(unsigned, "u1", normalized=True))
    strided = file.accessor(turns(9, 4), "u2", stride=12, offset=4, normalized=True)
    file.curve(nodes[4], "rotation", times, strided)
    sparse = {
        "count": 3,
        "indices": {"bufferView": file.view(bytes([0, 4, 8])), "componentType": 5121},
        "values": {"bufferView": file.view((np.arange(9) / 90).astype("<f4").tobytes())},
    }
    zeros = {"componentType": 5126, "count": 9, "type": "VEC3", "sparse": sparse}
    file.curve(nodes[4], "translation", times, file.add("accessors", zeros))
    dense = file.accessor(np.full((9, 3), 0.1), sparse=sparse)
    file.curve(nodes[5], "translation", times, dense)
    clip = read(file, tmp_path)
    assert clip.translations[4, 4] == pytest.approx(np.array([30, 40, 50]) / 9)
    assert clip.translations[5, 5] == pytest.approx([10, 10, 10])
    assert_agrees(tmp_path / "take.glb", clip)


def test_above_and_between_the_joints(tmp_path: Path) -> None:
    file = GltfFile()
    file.animation()
    half = float(np.sqrt(0.5))
    stage = file.node("Stage", translation=[1, 2, 3])
    matrix = np.eye(4)
    matrix[:3, :3] = 0.01 * rot.to_matrix(turns(2, 7)[1])
    matrix[:3, 3] = [0.5, 0, 0]
    armature = file.node("Armature", stage, matrix=matrix.T.ravel().tolist())
    nodes = arm(file, armature)
    for node in nodes:
        file.json["nodes"][node]["translation"] = [10.0, 20.0, -5.0]
    between = file.node("Twist", nodes[-1], rotation=[half, 0, 0, half], translation=[0, 5, 0])
    last = file.node("LeftIndex3", between, translation=[0, 3, 0])
    file.node("LeftIndex3_end", last, translation=[0, 2, 0])
    file.node("Ring", last, mesh=0)
    file.json["meshes"] = [{"primitives": []}]
    file.skin([*nodes, last])
    file.curve(stage, "rotation", TIMES, turns(9, 8))
    file.curve(stage, "translation", TIMES, np.random.default_rng(1).normal(size=(9, 3)))
    for i, node in enumerate(nodes):
        file.curve(node, "rotation", TIMES, turns(9, i))
    clip = read(file, tmp_path)
    assert clip.skeleton.joints[0] == "Hips"
    assert clip.skeleton.names[-3:] == ("Twist", "LeftIndex3", "LeftIndex3_end")
    assert "missing-bind" in [p.code for p in clip.problems]
    assert (clip.scales == 1.0).all()
    assert_agrees(tmp_path / "take.glb", clip)


def test_scales(tmp_path: Path) -> None:
    """A constant even scale of a joint is longer bones; one that moves stays a scale."""
    file = moving_arm(TIMES)
    hips, arm_, hand = 0, 2, 3
    file.json["nodes"][hips]["scale"] = [0.5, 0.5, 0.5]
    clip = read(file, tmp_path)
    assert (clip.scales == 1.0).all()
    assert np.linalg.norm(clip.translations[0, 1]) == pytest.approx(
        50 * np.linalg.norm(file.json["nodes"][1]["translation"])
    )
    assert_agrees(tmp_path / "take.glb", clip)
    file.curve(hand, "scale", TIMES, np.linspace(1.0, 2.0, 27).reshape(9, 3))
    file.json["nodes"][arm_]["scale"] = [3, 3, 3]
    clip = read(file, tmp_path)
    assert clip.scales[8, 3] == pytest.approx([2.0 - 2 / 26, 2.0 - 1 / 26, 2.0])
    pose = forward_kinematics(clip)
    oracle = Oracle(tmp_path / "take.glb")
    for joint in range(6):  # children of the uneven scale are sheared: positions only
        place = 100 * oracle.world(joint, 0, clip.times[8])[:3, 3]
        assert np.abs(pose.positions[8, joint] - place).max() < TOLERANCE_CM


def test_odd_scales_above_are_said(tmp_path: Path) -> None:
    for scale, code in (([1, 1, 2], "non-uniform-scale"), ([-1, 1, 1], "mirrored")):
        file = GltfFile()
        file.animation()
        nodes = arm(file, file.node("Up", scale=scale))
        file.curve(nodes[0], "rotation", TIMES, turns(9, 1))
        assert code in [p.code for p in read(file, tmp_path).problems]
    file.json["nodes"][0]["scale"] = [0, 1, 1]
    with pytest.raises(InputError, match="is below a zero scale"):
        read(file, tmp_path)


# -- bind and rest ------------------------------------------------------------------------------


def skinned(bend: float, space: np.ndarray, above: np.ndarray) -> tuple[GltfFile, np.ndarray]:
    """A chain whose nodes are bent from its bind pose; ``space`` leads from world to mesh."""
    file = GltfFile()
    armature = file.node("Armature", matrix=above.T.ravel().tolist())
    nodes, bind = [], []
    world = above.copy()
    turn = rot.from_axis_angle(np.array([0.0, 0.0, 1.0]), bend)
    for i in range(5):
        parent = nodes[-1] if nodes else armature
        nodes.append(file.node(f"j{i}", parent, translation=[0, 10, 0], rotation=turn.tolist()))
        local = np.eye(4)
        local[:3, 3] = [0, 10, 0]
        world = world @ local
        bind.append(world.copy())
    placed = np.array(bind)
    file.json["meshes"] = [{"primitives": []}]
    skin = file.skin(nodes, space @ placed)
    file.node("Body", mesh=0, skin=skin)
    return file, placed


UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("case", ["world", "armature", "z up armature"])
@pytest.mark.parametrize("bend", [0.0, 0.5])
def test_bind_pose_in_any_space(case: str, bend: float, tmp_path: Path) -> None:
    above = np.diag([0.01, 0.01, 0.01, 1.0])
    if case == "z up armature":
        above = UPRIGHT @ above
    space = np.eye(4) if case == "world" else np.linalg.inv(above)
    file, bind = skinned(bend, space, above)
    clip = read_character(file.write(tmp_path / "body.glb"))
    skeleton = clip.skeleton
    assert skeleton.bind_positions == pytest.approx(100 * bind[:, :3, 3], abs=1e-4)
    turned = np.tile(above[:3, :3] / 0.01, (5, 1, 1))
    assert skeleton.bind_rotations == pytest.approx(turned, abs=1e-5)
    assert len(clip) == 1
    assert forward_kinematics(clip).positions[0] == pytest.approx(skeleton.bind_positions)
    local = np.eye(4)
    local[:3, :3] = rot.to_matrix(rot.from_axis_angle(np.array([0.0, 0.0, 1.0]), bend))
    local[:3, 3] = [0, 10, 0]  # ten units of a hundredth of a metre
    assert skeleton.rest[1] == pytest.approx(local, abs=1e-5)


def test_skins_that_disagree(tmp_path: Path) -> None:
    file, bind = skinned(0.3, np.eye(4), np.eye(4))
    elsewhere = bind.copy()
    elsewhere[3:, 0, 3] += 5.0
    file.skin([1, 2, 3, 4, 5], elsewhere)
    clip = read_character(file.write(tmp_path / "body.glb"))
    assert "bind-disagrees" in [p.code for p in clip.problems]
    assert clip.skeleton.bind[0] == pytest.approx(clip.skeleton.rest[0])


# -- names and choices --------------------------------------------------------------------------


def test_names(tmp_path: Path) -> None:
    file = GltfFile()
    file.animation()
    root = file.node("a/b")
    twins = [file.node(name, root) for name in ("x", "x", "x_2", None)]
    file.curve(root, "rotation", TIMES, turns(9, 0))
    for node in twins:
        file.curve(node, "rotation", TIMES, turns(9, 0))
    joints = read(file, tmp_path).skeleton.joints
    assert joints == ("a_b", "a_b/x", "a_b/x_2", "a_b/x_2_2", "a_b/node_4")


def two_people(names: tuple[str, str] = ("Ann", "Bob")) -> GltfFile:
    file = GltfFile()
    file.animation("walk")
    file.animation("walk")
    for i, name in enumerate(names):
        nodes = arm(file, file.node(name))
        file.skin(nodes)
        file.curve(nodes[1], "rotation", TIMES, turns(9, i), animation=i)
    return file


def test_several_of_everything(tmp_path: Path) -> None:
    file = two_people()
    file.animation("blink")  # moves no node
    path = file.write(tmp_path / "take.glb")
    assert animation_names(path) == ("walk", "walk_2")
    with pytest.raises(UsageError, match=r"2 skeletons: 'Ann', 'Bob'\. Choose one with --skel"):
        read_clip(path)
    with pytest.raises(UsageError, match="2 skeletons"):
        read_character(path)
    with pytest.raises(UsageError, match="no skeleton 'Cy', only 'Ann', 'Bob'"):
        read_clip(path, Reading(skel="Cy"))
    with pytest.raises(UsageError, match=r"2 animations: 'walk', 'walk_2'.*--animation NAME"):
        read_clip(path, Reading(skel="Ann"))
    with pytest.raises(UsageError, match="no animation 'run'"):
        read_clip(path, Reading(skel="Ann", animation="run"))
    with pytest.raises(InputError, match="'walk' moves none of the 6 joints of 'Bob'"):
        read_clip(path, Reading(skel="Bob", animation="walk"))
    clip = read_clip(path, Reading(skel="Bob", animation="walk_2"))
    origin = clip.origin
    assert (origin.skeleton_path, origin.animation_path) == ("Bob", "walk_2")
    again = read_clip(path, Reading(skel=origin.skeleton_path, animation=origin.animation_path))
    assert (again.rotations == clip.rotations).all()


def test_twins_can_be_chosen(tmp_path: Path) -> None:
    path = two_people(("Rig", "Rig")).write(tmp_path / "take.glb")
    with pytest.raises(UsageError, match="2 skeletons: 'skeleton_0', 'skeleton_1'"):
        read_character(path)
    assert len(read_character(path, Reading(skel="skeleton_1")).skeleton) == 6


def test_skins_of_one_character(tmp_path: Path) -> None:
    """A body, hair below the head, a glove, and a boot that the body has no joint for: one."""
    file = GltfFile()
    root = file.node("Armature")
    body = arm(file, root)
    hair = [file.node("hair1", body[1])]
    hair.append(file.node("hair2", hair[0]))
    toe = file.node("toe", file.node("foot", body[0]))
    for joints in (body[:4], hair, body[3:], [toe]):
        file.skin(joints)
    clip = read_character(file.write(tmp_path / "hero.glb"))
    wanted = {"Hips", "Spine", "LeftArm", "LeftHand", "LeftIndex1", "LeftIndex2"}
    assert set(clip.skeleton.names) == wanted | {"hair1", "hair2", "foot", "toe"}
    assert clip.origin.skeleton_path == ""


def test_skins_that_name_one_root(tmp_path: Path) -> None:
    """Two gloves below hips that no skin uses."""
    file = GltfFile()
    hips = file.node("Hips")
    gloves = [arm(file, hips, [f"{side}{i}" for i in range(3)]) for side in "LR"]
    for joints in gloves:
        file.skin(joints)
    path = file.write(tmp_path / "gloves.glb")
    with pytest.raises(UsageError, match="2 skeletons: 'L0', 'R0'"):
        read_character(path)
    for skin in file.json["skins"]:
        skin["skeleton"] = hips
    clip = read_character(file.write(path))
    assert clip.skeleton.names == ("L0", "L1", "L2", "R0", "R1", "R2")


def test_joints_of_several_trees(tmp_path: Path) -> None:
    """Against the specification, but nothing is lost: each tree gets a root joint."""
    file = GltfFile()
    file.animation()
    left, right = arm(file, file.node("Left")), arm(file, file.node("Right"))
    file.skin([*left[1:], *right[1:]])
    file.curve(left[2], "rotation", TIMES, turns(9, 1))
    file.node("Camera", camera=0)
    clip = read(file, tmp_path)
    assert list(np.flatnonzero(clip.skeleton.parents < 0)) == [0, 5]
    assert clip.skeleton.joints[5] == "Spine_2"
    pose, oracle = forward_kinematics(clip), Oracle(tmp_path / "take.glb")
    for joint, node in enumerate([*left[1:], *right[1:]]):
        place = 100 * oracle.world(node, 0, clip.times[4])[:3, 3]
        assert np.abs(pose.positions[4, joint] - place).max() < TOLERANCE_CM


def test_units_and_axes_by_hand(tmp_path: Path) -> None:
    file = moving_arm(TIMES)
    plain = forward_kinematics(read(file, tmp_path)).positions
    clip = read(file, tmp_path, cm_per_unit=1.0, up="Z")
    turned = plain[..., [0, 2, 1]] * [0.01, 0.01, -0.01]
    assert forward_kinematics(clip).positions == pytest.approx(turned)
    assert (clip.origin.cm_per_unit, clip.origin.up_axis) == (1.0, "Z")
    still = read_character(tmp_path / "take.glb", Reading(cm_per_unit=1.0, up="Z"))
    assert still.skeleton.bind == pytest.approx(clip.skeleton.bind)


# -- other files --------------------------------------------------------------------------------


def test_a_buffer_in_a_file_beside(tmp_path: Path) -> None:
    file = moving_arm(TIMES)
    path = file.write(tmp_path / "take.gltf", uri="my%20data/take.bin")
    with pytest.raises(InputError, match=r"my data/take\.bin is missing"):
        read_clip(path)
    (tmp_path / "my data").mkdir()
    (tmp_path / "my data" / "take.bin").write_bytes(file.data[:-4])
    with pytest.raises(InputError, match=r"buffers\[0\] has \d+ bytes, not the \d+"):
        read_clip(path)
    (tmp_path / "my data" / "take.bin").write_bytes(file.data)
    assert_agrees_with_glb(read_clip(path), file, tmp_path)


def test_percent_encoded_data(tmp_path: Path) -> None:
    file = moving_arm(TIMES)
    text = "".join(f"%{byte:02x}" for byte in file.data)
    path = file.write(tmp_path / "take.gltf", uri=f"data:application/gltf-buffer,{text}")
    assert_agrees_with_glb(read_clip(path), file, tmp_path)


def assert_agrees_with_glb(clip: Clip, file: GltfFile, tmp_path: Path) -> None:
    other = read_clip(file.write(tmp_path / "other.glb"))
    assert (clip.rotations == other.rotations).all()
    assert (clip.translations == other.translations).all()


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    file = moving_arm(TIMES)
    file.curve(2, "rotation", 0, 1)
    pointer = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/x"}}}
    file.json["animations"][0]["channels"].append({"sampler": 0, "target": pointer})
    codes = [p.code for p in read(file, tmp_path).problems]
    assert codes == ["double-channel", "unsupported-channel"]
