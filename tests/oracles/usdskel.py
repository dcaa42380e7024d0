"""UsdSkel's own answer to where joints are, as the oracle for our reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

TO_Y_UP = {"Y": np.eye(3), "Z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}


def joint_worlds(path: Path, skeleton: str, times: np.ndarray) -> np.ndarray:
    """World matrices (times, joints, 4, 4) for column vectors, in Y-up centimetres."""
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(skeleton)
    cache = UsdSkel.Cache()
    query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
    found = []
    for time in times:
        # Not ComputeJointWorldTransforms: for an instance it gives the prototype's place.
        above = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
        matrices = query.ComputeJointSkelTransforms(time)
        assert matrices is not None
        found.append(np.array(matrices) @ np.array(above))
    worlds = np.swapaxes(np.array(found), 2, 3)
    axes = np.eye(4)
    axes[:3, :3] = TO_Y_UP[UsdGeom.GetStageUpAxis(stage)]
    worlds = axes @ worlds
    worlds[..., :3, 3] *= 100.0 * UsdGeom.GetStageMetersPerUnit(stage)
    return worlds


def assert_same_world(clip: Clip, path: Path | None = None, *, turned: bool = True) -> None:
    """A clip's joints are where UsdSkel puts them, to 1e-4 cm and 1e-4 degrees."""
    assert clip.origin.path is not None
    worlds = joint_worlds(path or clip.origin.path, clip.origin.skeleton_path, clip.time_codes)
    pose = forward_kinematics(clip)
    error = np.abs(pose.positions - worlds[..., :3, 3])
    # UsdSkel counts in float32: a micrometre, or the last digits of what lies far away.
    far = np.linalg.norm(worlds[..., :3, 3], axis=-1, keepdims=True)
    assert (error <= 1e-4 + 5e-7 * far).all(), error.max()
    if turned:
        # What mirrors turns no joint: all three axes of a mirrored one are turned round.
        mirrored = np.sign(np.linalg.det(worlds[..., :3, :3]))
        u, _, vt = np.linalg.svd(worlds[..., :3, :3] * mirrored[..., None, None])
        assert rot.angle_between(pose.rotations, rot.from_matrix(u @ vt)).max() < 1e-4
