"""A real DCC loads what we write: Blender, in a process that never imports usd-core."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from builders.blender import Y_UP, blender_python, turned
from conftest import REPOSITORY, shared_data

import usdhand
from usdhand.motion import forward_kinematics
from usdhand.motion import rotations as rot

pytestmark = pytest.mark.blender
TOLERANCE_DEG = 0.01


@dataclass(frozen=True)
class Loaded:
    names: list[str]
    rest: np.ndarray
    posed: np.ndarray
    properties: dict[str, object]


def load(path: Path, folder: Path, frames: list[float]) -> Loaded:
    target = folder / "blender.npz"
    script = REPOSITORY / "tests" / "blender" / "usd_dump.py"
    hidden = ("PYTHONPATH", "PXR_PLUGINPATH_NAME")
    environment = {k: v for k, v in os.environ.items() if k not in hidden}
    done = subprocess.run(
        [blender_python(), str(script), str(path), str(target), *map(str, frames)],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = np.load(target)
    return Loaded(
        list(data["names"]), data["rest"], data["posed"], json.loads(str(data["properties"]))
    )


def assert_same_motion(path: Path, folder: Path) -> Loaded:
    """Every bone's rotation away from its bind pose, in the world, is what we read."""
    clip = usdhand.read_clip(path)
    index = np.unique(np.linspace(0, len(clip) - 1, 6).astype(int))
    # Blender plays at 24 frames a second of the file's time codes unless told otherwise.
    loaded = load(path, folder, [float(t) for t in clip.time_codes[index]])
    joints = [clip.skeleton.find(name) for name in loaded.names]
    assert None not in joints
    assert len(joints) == len(clip.skeleton)
    pose = forward_kinematics(clip, [j for j in joints if j is not None])
    bind = clip.skeleton.bind_rotations[joints]
    ours = rot.to_matrix(pose.rotations[index]) @ np.swapaxes(bind, -1, -2)
    theirs = Y_UP @ turned(loaded.posed) @ np.swapaxes(turned(loaded.rest), -1, -2) @ Y_UP.T
    angle = rot.angle_between(rot.from_matrix(ours), rot.from_matrix(theirs))
    assert angle.max() < TOLERANCE_DEG
    assert np.ptp(theirs, axis=0).max() > 0.05, "nothing moves in Blender"
    return loaded


@pytest.mark.parametrize("name", ["gestures/ok_02", "gestures_ben/wipe_01"])
def test_samples_load(tmp_path: Path, name: str) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / f"{name}.usdc")
    [reduction] = usdhand.reduce_hands([clip])
    rig, motion = tmp_path / "rig.usda", tmp_path / "motion.usdc"
    usdhand.write_rig(reduction, rig)
    loaded = assert_same_motion(rig, tmp_path)
    for relation in reduction.rig.relations:
        prefix = f"HandRig/usdhand:channel:{relation.name}"
        assert loaded.properties[f"{prefix}:kind"] == relation.kind
        if relation.kind == "linear":
            assert loaded.properties[f"{prefix}:controller"] == relation.controllers[0]
            assert loaded.properties[f"{prefix}:slope"] == pytest.approx(relation.slopes[0])
            assert loaded.properties[f"{prefix}:offset"] == pytest.approx(relation.offset)
    usdhand.write_clip(usdhand.expand(rig), motion)
    assert_same_motion(motion, tmp_path)


def test_onto_another_character_loads(tmp_path: Path) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / "gestures" / "big_03.usdc")
    [reduction] = usdhand.reduce_hands([clip])
    usdhand.write_rig(reduction, tmp_path / "rig.usda")
    character = REPOSITORY / "samples" / "characters" / "ben.usdc"
    other = usdhand.expand_onto(tmp_path / "rig.usda", character)
    usdhand.write_clip(other, tmp_path / "ben.usdc", flatten=True)
    assert_same_motion(tmp_path / "ben.usdc", tmp_path)


@pytest.mark.real_data
def test_a_real_take_loads(tmp_path: Path) -> None:
    take = shared_data("studiogalt", "full", "SG_ASL_7_2023_1_29.usdc")
    [reduction] = usdhand.reduce_hands([usdhand.read_clip(take)])
    usdhand.write_rig(reduction, tmp_path / "rig.usda")
    assert_same_motion(tmp_path / "rig.usda", tmp_path)
