"""Joints with negative scales, as rigs have that were made by mirroring, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.fbx_files import Node, positions, write_fbx
from builders.gltf_files import GltfFile, turns
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from usdhand import read_clip
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

SIGNS = [(-1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (-1.0, -1.0, 1.0), (-1.0, -1.0, -1.0)]
PLACES = np.array([[0.0, 0.9, 0.0], [0.1, 0.2, -0.05], [0.3, 0.02, 0.1], [0.2, -0.1, 0.04]])
JOINTS = ("Hips", "Hips/Arm", "Hips/Arm/Hand", "Hips/Arm/Hand/Finger")
MIRRORED = 1


def worlds(clip_turns: np.ndarray, signs: tuple[float, ...]) -> np.ndarray:
    """World matrices (joints, 4, 4) of a chain whose second joint has a scale."""
    world, found = np.eye(4), []
    for joint, (place, turn) in enumerate(zip(PLACES, clip_turns, strict=True)):
        local = np.eye(4)
        local[:3, :3] = Rotation.from_quat(turn).as_matrix()
        if joint == MIRRORED:
            local[:3, :3] *= signs
        local[:3, 3] = place
        world = world @ local
        found.append(world)
    return np.array(found)


def assert_right(clip: Clip, expected: np.ndarray) -> None:
    """Places are right, and the joints' axes are those of the bind pose, which this frame is."""
    pose, skeleton = forward_kinematics(clip), clip.skeleton
    assert_allclose(pose.positions[0], expected[:, :3, 3] * 100, atol=1e-3)
    assert_allclose(skeleton.bind_positions, expected[:, :3, 3] * 100, atol=1e-3)
    mirror = np.sign(np.linalg.det(expected[:, :3, :3]))[:, None, None]
    turned = rot.from_matrix(expected[:, :3, :3] * mirror)
    assert rot.angle_between(pose.rotations[0], turned).max() < 1e-3
    assert rot.angle_between(rot.from_matrix(skeleton.bind_rotations), turned).max() < 1e-3
    assert (np.sign(clip.scales) == np.sign(clip.scales[..., :1])).all()


@pytest.mark.parametrize("signs", SIGNS)
def test_gltf(tmp_path: Path, signs: tuple[float, ...]) -> None:
    file, times, q = GltfFile(), np.arange(10) / 30, np.stack([turns(10, i) for i in range(4)], 1)
    file.animation("wave")
    for joint, name in enumerate(JOINTS):
        size = {"scale": list(signs)} if joint == MIRRORED else {}
        parent = joint - 1 if joint else None
        place, turn = PLACES[joint].tolist(), q[0, joint].tolist()
        file.node(name.rsplit("/")[-1], parent, translation=place, rotation=turn, **size)
        file.curve(joint, "rotation", times, q[:, joint])
    assert_right(read_clip(file.write(tmp_path / "a.glb")), worlds(q[0], signs))


@pytest.mark.parametrize("signs", SIGNS)
def test_fbx(tmp_path: Path, signs: tuple[float, float, float]) -> None:
    angles = np.random.default_rng(1).uniform(-80, 80, (4, 3))
    nodes = []
    for joint, name in enumerate(JOINTS):
        vectors = {
            "Lcl Translation": tuple(PLACES[joint] * 100),
            "Lcl Rotation": tuple(angles[joint]),
        }
        if joint == MIRRORED:
            vectors["Lcl Scaling"] = signs
        keys = {
            ("Lcl Rotation", axis): [(0.0, angle), (1.0, 30.0)]
            for axis, angle in zip("XYZ", angles[joint], strict=True)
        }
        nodes.append(Node(name.rsplit("/")[-1], joint - 1, vectors=vectors, keys=keys))
    clip = read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert_allclose(forward_kinematics(clip).positions, positions(nodes, clip.times), atol=1e-3)
    q = Rotation.from_euler("xyz", angles, degrees=True).as_quat()
    assert_right(clip, worlds(q, signs))


@pytest.mark.parametrize("signs", SIGNS)
def test_usd(tmp_path: Path, signs: tuple[float, ...]) -> None:
    q = np.stack([turns(12, i) for i in range(4)], 1)
    path = stages.character(
        tmp_path / "a.usda",
        joints=JOINTS,
        rotations=q,
        translations=PLACES[None] * 100,
        scales=np.where(np.arange(4)[:, None] == MIRRORED, signs, 1.0)[None],
    )
    stage = stages.edited(path)
    expected = worlds(q[0], signs)
    bind = np.swapaxes(expected, 1, 2).copy()
    bind[:, 3, :3] *= 100
    skeleton = stage.GetPrimAtPath(stages.SKELETON)
    skeleton.GetAttribute("bindTransforms").Set(stages.matrices(bind))
    stage.Save()
    assert_right(read_clip(path), expected)
