"""Small UsdSkel stages for tests: an arm with a hand, right in everything unless told otherwise."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand.motion import parents_from_paths
from usdhand.motion import rotations as rot

ARM = "Hips/Spine/LeftArm/LeftForeArm/LeftHand"
JOINTS = (
    "Hips",
    "Hips/Spine",
    "Hips/Spine/Head",
    "Hips/Spine/LeftArm",
    "Hips/Spine/LeftArm/LeftForeArm",
    ARM,
    f"{ARM}/LeftHandThumb1",
    f"{ARM}/LeftHandThumb1/LeftHandThumb2",
    f"{ARM}/LeftHandIndex1",
    f"{ARM}/LeftHandIndex1/LeftHandIndex2",
    f"{ARM}/LeftHandIndex1/LeftHandIndex2/LeftHandIndex3",
)
ROOT, SKELETON, ANIMATION = "/Hero", "/Hero/Skel", "/Hero/Anim"
TIMES = tuple(float(t) for t in range(1, 13))
ALL = ("rotations", "translations", "scales", "rest", "bind", "api", "binding")


def waves(times: Sequence[float], joints: int, seed: int = 1) -> np.ndarray:
    """Smooth unit quaternions (times, joints, 4) in float32, without sign flips."""
    random = np.random.default_rng(seed)
    t = np.asarray(times)[:, None, None] / 10.0
    speed, phase = random.uniform(0.5, 2.0, (2, joints, 3))
    return turned(0.6 * np.sin(speed * t + phase * 6.0))


def turned(vectors: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) in float32 of rotation vectors (..., 3)."""
    angle = np.linalg.norm(vectors, axis=-1)
    axis = vectors / np.maximum(angle, 1e-12)[..., None]
    return rot.from_axis_angle(axis, angle).astype(np.float32)


def offsets(joints: int, seed: int = 2) -> np.ndarray:
    """Joint-to-parent translations (joints, 3) of about the size of bones in cm."""
    return np.random.default_rng(seed).uniform(2.0, 20.0, (joints, 3)).astype(np.float32)


def rest_matrices(joints: Sequence[str], seed: int = 3) -> np.ndarray:
    """Rest transforms (joints, 4, 4) as USD writes them (row vectors)."""
    matrices = np.tile(np.eye(4), (len(joints), 1, 1))
    matrices[:, :3, :3] = np.swapaxes(rot.to_matrix(waves([0.0], len(joints), seed)[0]), 1, 2)
    matrices[:, 3, :3] = offsets(len(joints))
    return matrices


def bind_matrices(joints: Sequence[str]) -> np.ndarray:
    """Bind transforms (joints, 4, 4): the rest pose, accumulated."""
    matrices = rest_matrices(joints).copy()
    parents = parents_from_paths(joints)
    for j in sorted(range(len(joints)), key=lambda j: joints[j].count("/")):
        if parents[j] >= 0:
            matrices[j] = matrices[j] @ matrices[parents[j]]
    return matrices


def layer(
    path: Path,
    *,
    rate: float | None = 24.0,
    up: str | None = "Y",
    meters: float | None = 0.01,
    start: float | None = TIMES[0],
    end: float | None = TIMES[-1],
) -> Sdf.Layer:
    """An empty layer with stage metadata; None leaves a field out."""
    made = Sdf.Layer.CreateNew(str(path))
    if up is not None:
        made.pseudoRoot.SetInfo("upAxis", up)
    if meters is not None:
        made.pseudoRoot.SetInfo("metersPerUnit", meters)
    if rate is not None:
        made.timeCodesPerSecond = made.framesPerSecond = rate
    if start is not None:
        made.startTimeCode = start
    if end is not None:
        made.endTimeCode = end
    made.defaultPrim = ROOT[1:]
    return made


def character(
    path: Path,
    *,
    joints: Sequence[str] = JOINTS,
    animated: Sequence[str] | None = None,
    times: Sequence[float] = TIMES,
    rotations: np.ndarray | None = None,
    translations: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    without: Sequence[str] = (),
    **metadata: Any,
) -> Path:
    """Write an animated character.

    ``animated`` are the joints of the SkelAnimation, ``rotations`` etc. its values, a row a time or
    one row for all; ``without`` names what to leave out, of `ALL`.
    """
    made = layer(path, **metadata)
    stage = Usd.Stage.Open(made)
    add_character(
        stage,
        ROOT,
        joints=joints,
        animated=animated,
        times=times,
        rotations=rotations,
        translations=translations,
        scales=scales,
        without=without,
    )
    made.Save()
    return path


def add_character(
    stage: Usd.Stage,
    root: str,
    *,
    joints: Sequence[str] = JOINTS,
    animated: Sequence[str] | None = None,
    times: Sequence[float] = TIMES,
    rotations: np.ndarray | None = None,
    translations: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    without: Sequence[str] = (),
) -> UsdSkel.Skeleton:
    """Author a character below ``root`` on a stage; arguments as in `character`."""
    assert set(without) <= set(ALL)
    UsdSkel.Root.Define(stage, root)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{root}/Skel")
    skeleton.CreateJointsAttr(list(joints))
    if "rest" not in without:
        skeleton.CreateRestTransformsAttr(matrices(rest_matrices(joints)))
    if "bind" not in without:
        skeleton.CreateBindTransformsAttr(matrices(bind_matrices(joints)))
    animated = joints if animated is None else animated
    animation = UsdSkel.Animation.Define(stage, f"{root}/Anim")
    animation.CreateJointsAttr(list(animated))
    given = {
        "rotations": waves(times, len(animated)) if rotations is None else rotations,
        "translations": offsets(len(animated))[None] if translations is None else translations,
        "scales": np.ones((1, len(animated), 3)) if scales is None else scales,
    }
    for name, values in given.items():
        if name not in without:
            set_values(animation.GetPrim(), name, times, values)
    if "binding" not in without:
        bind(skeleton.GetPrim(), f"{root}/Anim", api="api" not in without)
    return skeleton


def set_values(prim: Usd.Prim, name: str, times: Sequence[float], values: np.ndarray) -> None:
    """Author a motion attribute: a row a time, or one row as the default value."""
    animation = UsdSkel.Animation(prim)
    attribute, convert = {
        "rotations": (animation.CreateRotationsAttr, Vt.QuatfArray.FromNumpy),
        "translations": (animation.CreateTranslationsAttr, Vt.Vec3fArray.FromNumpy),
        "scales": (animation.CreateScalesAttr, Vt.Vec3hArray.FromNumpy),
    }[name]
    dtype = np.float16 if name == "scales" else np.float32
    rows = [convert(np.ascontiguousarray(v, dtype=dtype)) for v in values]
    if len(rows) == 1 and (len(times) != 1 or name != "rotations"):
        attribute(rows[0])
        return
    for time, row in zip(times, rows, strict=True):
        attribute().Set(row, time)


def bind(prim: Usd.Prim, target: str, *, api: bool = True) -> None:
    """Bind an animation on a prim."""
    if api:
        UsdSkel.BindingAPI.Apply(prim)
    prim.CreateRelationship("skel:animationSource", custom=False).SetTargets([target])


def edited(path: Path) -> Usd.Stage:
    """The stage of a file, to be changed and saved with ``.Save()``."""
    return Usd.Stage.Open(str(path))


def relative(asset: Path, path: Path) -> str:
    """Where an asset is from a layer."""
    return "./" + Path(os.path.relpath(asset, path.parent)).as_posix()


def referencing(
    path: Path,
    asset: Path,
    *,
    prim: str = ROOT,
    how: str = "reference",
    offset: Sdf.LayerOffset | None = None,
    instanceable: bool = False,
    **metadata: Any,
) -> Path:
    """A layer that brings in the character of another by reference or payload."""
    made = layer(path, **metadata)
    stage = Usd.Stage.Open(made)
    holder = stage.DefinePrim(prim)
    arcs = holder.GetReferences() if how == "reference" else holder.GetPayloads()
    arc = Sdf.Reference if how == "reference" else Sdf.Payload
    item = arc(relative(asset, path), layerOffset=offset or Sdf.LayerOffset())
    (arcs.AddReference if how == "reference" else arcs.AddPayload)(item)
    if instanceable:
        holder.SetInstanceable(True)
    made.Save()
    return path


def sublayering(
    path: Path, *assets: Path, offset: Sdf.LayerOffset | None = None, **metadata: Any
) -> Path:
    """A layer over others, the strongest first."""
    made = layer(path, **metadata)
    made.subLayerPaths[:] = [relative(asset, path) for asset in assets]
    if offset is not None:
        for i in range(len(assets)):
            made.subLayerOffsets[i] = offset
    made.Save()
    return path


def place(
    stage: Usd.Stage,
    path: str = ROOT,
    *,
    translate: Sequence[float] | None = None,
    rotate: Sequence[float] | None = None,
    scale: Sequence[float] | None = None,
) -> UsdGeom.Xformable:
    """Give a prim translate, rotateXYZ (degrees) and scale, in this order."""
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(path))
    if translate is not None:
        xform.AddTranslateOp().Set(Gf.Vec3d(*translate))
    if rotate is not None:
        xform.AddRotateXYZOp().Set(Gf.Vec3f(*rotate))
    if scale is not None:
        xform.AddScaleOp().Set(Gf.Vec3f(*scale))
    return xform


def matrices(values: np.ndarray) -> Vt.Matrix4dArray:
    """A USD array of matrices (n, 4, 4)."""
    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float64))
