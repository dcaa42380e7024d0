"""Where UsdSkel puts the joints and skinned points of files, by whatever USD runs this.

    python benchmarks/usd_poses.py OUT.npz FILE...

Needs numpy and ``pxr`` alone (or Blender's, as ``bpy``), from version 24.3 on. Arrays are named
``FILE|SKELETON|TIME`` (joints, 4, 4), ``FILE|SKELETON`` (names of joints) and
``FILE|MESH|TIME`` (points, 3), all in the world.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

if "--blender" in sys.argv:  # it brings its own USD
    import bpy

    packages = Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python*/site-packages")
    sys.path.extend(map(str, packages))
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

MOST_TIMES = 7


def main() -> int:
    """Evaluate files and keep all arrays in one file."""
    target, *files = [a for a in sys.argv[1:] if a != "--blender"]
    found = {
        f"{Path(file).name}|{key}": value
        for file in files
        for key, value in poses(Path(file)).items()
    }
    np.savez(target, **found)
    return 0


def poses(path: Path, times: dict[str, list[float]] | None = None) -> dict[str, np.ndarray]:
    """Arrays of one file; ``times`` of skeletons are those of their own motion if not given."""
    stage = Usd.Stage.Open(str(path))
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    prims = [prim for prim in everything if prim.IsA(UsdSkel.Skeleton)]
    found: dict[str, np.ndarray] = {}
    for prim in prims:
        cache, root = UsdSkel.Cache(), UsdSkel.Root.Find(prim)
        if root:
            cache.Populate(root, Usd.TraverseInstanceProxies())
        query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
        if not query:
            continue
        name = str(prim.GetPath())
        found[name] = np.array([str(joint) for joint in query.GetJointOrder()])
        given = (times or {}).get(name)
        for time in motion_times(query) if given is None else given:
            found.update(_at(time, prim, query, cache, root))
    return found


def motion_times(query: UsdSkel.SkeletonQuery) -> list[float]:
    """Some times of a skeleton's motion, the first and the last among them."""
    animation = query.GetAnimQuery()
    all_times = list(animation.GetJointTransformTimeSamples()) if animation else []
    chosen = np.linspace(0, len(all_times) - 1, min(MOST_TIMES, len(all_times)))
    return [float(all_times[int(i)]) for i in chosen] or [0.0]


def _at(
    time: float,
    prim: Usd.Prim,
    query: UsdSkel.SkeletonQuery,
    cache: UsdSkel.Cache,
    root: UsdSkel.Root,
) -> Iterator[tuple[str, np.ndarray]]:
    # Not ComputeJointWorldTransforms: for an instance it gives the prototype's place.
    above = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
    joints = query.ComputeJointSkelTransforms(time)
    if not joints:
        return
    yield f"{prim.GetPath()}|{time:g}", np.array(joints) @ np.array(above)
    skinning = query.ComputeSkinningTransforms(time)
    bindings = cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()) if root else []
    for target in _targets(bindings, prim) if skinning else ():
        points = UsdGeom.PointBased(target.GetPrim()).GetPointsAttr().Get(time)
        if not points or not target.HasJointInfluences():
            continue
        moved = Vt.Vec3fArray(points)
        if target.ComputeSkinnedPoints(skinning, moved, time):
            placed = [above.Transform(Gf.Vec3d(point)) for point in moved]
            yield f"{target.GetPrim().GetPath()}|{time:g}", np.array(placed)


def _targets(
    bindings: Sequence[UsdSkel.Binding], prim: Usd.Prim
) -> Iterator[UsdSkel.SkinningQuery]:
    for binding in bindings:
        if binding.GetSkeleton().GetPrim() == prim:
            for target in binding.GetSkinningTargets():
                if target.GetPrim().IsA(UsdGeom.PointBased):
                    yield target


if __name__ == "__main__":
    sys.exit(main())
