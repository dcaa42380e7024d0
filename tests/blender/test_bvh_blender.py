"""Blender reads the BVH files that we write as we do, and the real ones as we do."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from builders.blender import Y_UP, blender_python, turned
from builders.real_takes import BVH_TAKES, USD_TAKES
from conftest import REPOSITORY, shared_data

import usdhand
from usdhand.formats.bvh.read import read_clip
from usdhand.formats.bvh.write import write_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

pytestmark = pytest.mark.blender
TOLERANCE_DEG, TOLERANCE_CM = 0.02, 0.01


def assert_blender_agrees(clip: Clip, file: Path, folder: Path, cm_per_unit: float = 1.0) -> None:
    """Blender has the joints of a clip at its places and, away from rest, its rotations."""
    frames = np.unique(np.linspace(0, len(clip) - 1, 8).astype(int))
    target = folder / "blender.npz"
    hidden = ("PYTHONPATH", "PXR_PLUGINPATH_NAME")
    done = subprocess.run(
        [blender_python(), str(REPOSITORY / "tests" / "blender" / "bvh_dump.py"), str(file),
         str(target),
         *map(str, frames)],
        capture_output=True, text=True, check=False,
        env={k: v for k, v in os.environ.items() if k not in hidden},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = np.load(target)
    joints = [clip.skeleton.find(str(name)) for name in theirs["names"]]
    assert None not in joints
    ends = {j for j in range(len(clip.skeleton)) if not clip.skeleton.children[j]}
    assert set(range(len(clip.skeleton))) - set(joints) <= ends
    pose = forward_kinematics(clip, joints)
    places = theirs["posed"][..., :3, 3] @ Y_UP.T * cm_per_unit
    assert np.abs(places - pose.positions[frames]).max() < TOLERANCE_CM
    bind = clip.skeleton.bind_rotations[joints]
    ours = rot.to_matrix(pose.rotations[frames]) @ np.swapaxes(bind, -1, -2)
    away = turned(theirs["posed"]) @ np.swapaxes(turned(theirs["rest"]), -1, -2)
    away = Y_UP @ away @ Y_UP.T
    angle = rot.angle_between(rot.from_matrix(ours), rot.from_matrix(away))
    assert angle.max() < TOLERANCE_DEG
    assert np.ptp(away, axis=0).max() > 0.05, "nothing moves in Blender"


@pytest.mark.parametrize("name", ["gestures/ok_02", "gestures_ben/wipe_01"])
def test_samples_agree(tmp_path: Path, name: str) -> None:
    clip = usdhand.read_clip(REPOSITORY / "samples" / f"{name}.usdc")
    write_clip(clip, tmp_path / "out.bvh")
    assert_blender_agrees(clip, tmp_path / "out.bvh", tmp_path)


@pytest.mark.real_data
@pytest.mark.parametrize("name", USD_TAKES)
def test_real_takes_agree(tmp_path: Path, name: str) -> None:
    clip = usdhand.read_clip(shared_data(*name.split("/")))
    write_clip(clip, tmp_path / "out.bvh")
    assert_blender_agrees(clip, tmp_path / "out.bvh", tmp_path)


@pytest.mark.real_data
@pytest.mark.parametrize("name", BVH_TAKES)
def test_real_files_are_read_as_blender_does(tmp_path: Path, name: str) -> None:
    path = shared_data(*name.split("/"))
    clip = read_clip(path, Reading(up="Y"))
    cm = clip.origin.cm_per_unit
    # Blender's rest pose is the one of all channels zero, which need not be our bind pose.
    eye = np.tile(np.eye(4), (len(clip.skeleton), 1, 1))
    eye[:, :3, 3] = clip.skeleton.bind[:, :3, 3]
    zero = type(clip.skeleton)(clip.skeleton.joints, clip.skeleton.parents, eye, eye)
    at_zero = type(clip)(
        zero, clip.rotations, clip.translations, clip.scales, clip.fps, origin=clip.origin
    )
    assert_blender_agrees(at_zero, path, tmp_path, cm)
