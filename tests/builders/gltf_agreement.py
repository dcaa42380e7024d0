"""glTF files that are read, beside the plain evaluation of the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from builders.gltf_files import GltfFile
from oracles.gltf import Oracle

from usdhand.formats.gltf.read import read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

TOLERANCE_CM = 1e-3  # 0.01 mm


def assert_agrees(
    path: Path, clip: Clip, animation: int | None = 0, stride: int = 1, later: float = 0.0
) -> None:
    """Every joint stands and is turned as the plain evaluation says.

    ``later`` than the clip's times, seconds: keys in single precision may come after a frame.
    """
    oracle = Oracle(path)
    node = {oracle.name(i): i for i in range(len(oracle.gltf.nodes))}
    pose = forward_kinematics(clip)
    for frame in range(0, len(clip), stride):
        for joint, name in enumerate(clip.skeleton.names):
            world = oracle.world(node[name], animation, clip.times[frame] + later)
            assert np.abs(pose.positions[frame, joint] - 100.0 * world[:3, 3]).max() < TOLERANCE_CM
            linear = world[:3, :3] / np.linalg.norm(world[:3, :3], axis=0)
            own = rot.to_matrix(pose.rotations[frame, joint])
            assert np.abs(own - linear).max() < 1e-5, name


def read(file: GltfFile, tmp_path: Path, suffix: str = ".glb", **options: Any) -> Clip:
    return read_clip(file.write(tmp_path / f"take{suffix}"), Reading(**options))
