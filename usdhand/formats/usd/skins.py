"""Meshes that a skeleton moves, in its bind pose: for looking at, not for rendering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdSkel

from usdhand.formats.usd.poses import authored_poses
from usdhand.formats.usd.stage import Character
from usdhand.formats.usd.world import world_above
from usdhand.motion.rotations import Array

INFLUENCES = 4
PLAIN = (0.45, 0.40, 0.37)


@dataclass(frozen=True, eq=False)
class Skin:
    """A triangle mesh and the joints that move it.

    Attributes
    ----------
    points : (n, 3) in the space of the bind pose, cm
    triangles : (m, 3) indices of points, counter-clockwise from outside
    joints, weights : (n, 4) joints of the skeleton and their shares, the largest ones, summing to 1
    inverse_bind : (joints, 4, 4) from the space of the bind pose to each joint, column vectors, cm
    colour : linear red, green, blue
    """

    name: str
    points: Array
    triangles: NDArray[np.intp]
    joints: NDArray[np.intp]
    weights: Array
    inverse_bind: Array
    colour: tuple[float, float, float] = PLAIN


def read_skins(character: Character) -> tuple[tuple[Skin, ...], tuple[str, ...]]:
    """Skinned meshes of a character, and words about those that cannot be used."""
    count = len(UsdSkel.Skeleton(character.skeleton).GetJointsAttr().Get() or ())
    scale = world_above(character.skeleton).scale
    poses, _ = authored_poses(character, count, scale)
    queries = list(_queries(character))
    if poses.bind is None:
        why = "meshes are not shown, since the skeleton has no usable bind pose"
        return (), (why,) if queries else ()
    skins: list[Skin] = []
    notes: list[str] = []
    for query in queries:
        skin = _skin(query, poses.bind, scale)
        name = query.GetPrim().GetName()
        if skin is None:
            notes.append(
                f"the mesh {name} is not shown: its faces or weights do not match its points"
            )
        else:
            skins.append(skin)
    return tuple(skins), tuple(notes)


def _queries(character: Character) -> Iterator[UsdSkel.SkinningQuery]:
    """Visible skinned meshes bound to the skeleton."""
    root = UsdSkel.Root.Find(character.skeleton)
    if not root:
        return
    cache = UsdSkel.Cache()
    predicate = Usd.TraverseInstanceProxies()
    cache.Populate(root, predicate)
    for binding in cache.ComputeSkelBindings(root, predicate):
        if binding.GetSkeleton().GetPath() != character.skeleton.GetPath():
            continue
        for query in binding.GetSkinningTargets():
            prim = query.GetPrim()
            imageable = UsdGeom.Imageable(prim)
            shown = imageable.ComputeVisibility() != "invisible"
            shown &= imageable.ComputePurpose() in ("default", "render")
            if prim.IsA(UsdGeom.Mesh) and query.HasJointInfluences() and shown:
                yield query


def _skin(query: UsdSkel.SkinningQuery, bind: Array, scale: float) -> Skin | None:
    mesh = UsdGeom.Mesh(query.GetPrim())
    time = Usd.TimeCode.EarliestTime()
    points = np.asarray(mesh.GetPointsAttr().Get(time) or [], float).reshape(-1, 3)
    triangles = _triangles(mesh, time)
    influences = query.ComputeVaryingJointInfluences(len(points), time) if len(points) else None
    if triangles is None or triangles.max(initial=-1) >= len(points) or not influences:
        return None
    each = query.GetNumInfluencesPerComponent()
    joints = np.asarray(influences[0], np.intp).reshape(-1, each)
    weights = np.asarray(influences[1], float).reshape(-1, each)
    mapper = query.GetJointMapper()
    if mapper and not mapper.IsIdentity():
        order = np.asarray(mapper_indices(query), np.intp)
        joints = order[np.clip(joints, 0, len(order) - 1)]
    finite = np.isfinite(points).all() and np.isfinite(weights).all()
    if not finite or joints.min() < 0 or joints.max() >= len(bind):
        return None
    joints, weights = _largest(joints, weights)
    placed = np.asarray(query.GetGeomBindTransform(time), float)  # for row vectors
    points = (points @ placed[:3, :3] + placed[3, :3]) * scale
    if (mesh.GetOrientationAttr().Get() == "leftHanded") != (np.linalg.det(placed[:3, :3]) < 0):
        triangles = triangles[:, ::-1]
    colour = np.asarray(mesh.GetDisplayColorAttr().Get(time) or [PLAIN], float).mean(axis=0)
    return Skin(
        mesh.GetPrim().GetName(),
        points,
        triangles,
        joints,
        weights,
        np.asarray(np.linalg.inv(bind), float),
        (float(colour[0]), float(colour[1]), float(colour[2])),
    )


def mapper_indices(query: UsdSkel.SkinningQuery) -> list[int]:
    """Joints of the skeleton that a mesh with an order of its own counts."""
    prim = query.GetPrim()
    skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
    order = {str(joint): i for i, joint in enumerate(skeleton.GetJointsAttr().Get())}
    return [order.get(str(joint), -1) for joint in query.GetJointOrder()]


def _triangles(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> NDArray[np.intp] | None:
    """Faces as fans of triangles; None where counts and indices contradict each other."""
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.intp)
    corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.intp)
    if counts.sum() != len(corners) or (counts < 0).any() or (corners < 0).any():
        return None
    starts = np.cumsum(counts) - counts
    fans = np.maximum(counts - 2, 0)
    first = np.repeat(starts, fans)
    step = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    return np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)


def _largest(joints: NDArray[np.intp], weights: Array) -> tuple[NDArray[np.intp], Array]:
    """The four largest weights of each point, normalised."""
    short = max(INFLUENCES - weights.shape[1], 0)
    weights = np.pad(np.maximum(weights, 0.0), ((0, 0), (0, short)))
    joints = np.pad(joints, ((0, 0), (0, short)))
    keep = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    weights = np.take_along_axis(weights, keep, axis=1)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1.0), [1.0, 0.0, 0.0, 0.0])
    return np.take_along_axis(joints, keep, axis=1), weights
