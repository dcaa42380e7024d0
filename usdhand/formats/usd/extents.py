"""How far a character reaches: the extents of its SkelRoot and Skeletons as they move."""

from __future__ import annotations

from collections.abc import Callable

from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand.formats.usd.damage import usd_diagnostics
from usdhand.formats.usd.stage import compose


def author_extents(layer: Sdf.Layer, path: Sdf.Path) -> None:
    """Put right the extents that a layer's stage has at a SkelRoot and Skeletons below it.

    They are what UsdSkel computes at each time of the motion. Where there is none, none is made:
    programs compute it then.
    """
    stage = _composed(layer)
    found = _root_and_skeletons(stage, path)
    if not found:
        return
    top, *skeletons = found
    root, cache = UsdSkel.Root(top), UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    times: set[float] = set()
    for prim in skeletons:
        query = cache.GetSkelQuery(UsdSkel.Skeleton(prim))
        if query and query.GetAnimQuery():
            times.update(query.GetAnimQuery().GetJointTransformTimeSamples())
    for prim in filter(_has_extent, found):
        box = _box_of_root(root, cache) if prim == top else _computed(prim)
        _author(layer, prim.GetPath(), sorted(times), box)


def withhold_extents(layer: Sdf.Layer, path: Sdf.Path) -> None:
    """Take back the extents of a SkelRoot and Skeletons below it whose motion is in variants.

    They are above the animation, so no variant of it can give them; programs compute them.
    """
    stage = _composed(layer)
    for prim in filter(_has_extent, _root_and_skeletons(stage, path)):
        spec = _extent(layer, prim.GetPath())
        spec.ClearInfo("timeSamples")
        spec.default = Sdf.ValueBlock()


def _composed(layer: Sdf.Layer) -> Usd.Stage:
    with usd_diagnostics():
        return compose(layer)


def _root_and_skeletons(stage: Usd.Stage, path: Sdf.Path) -> list[Usd.Prim]:
    top = stage.GetPrimAtPath(path)
    if not top or not UsdSkel.Root(top):
        return []
    below = Usd.PrimRange(top, Usd.TraverseInstanceProxies())
    return [top, *(prim for prim in below if prim.IsA(UsdSkel.Skeleton))]


def _has_extent(prim: Usd.Prim) -> bool:
    authored = UsdGeom.Boundable(prim).GetExtentAttr().HasAuthoredValue()
    return bool(authored) and not prim.IsInstanceProxy()


Box = Callable[[Usd.TimeCode], Vt.Vec3fArray]


def _box_of_root(root: UsdSkel.Root, cache: UsdSkel.Cache) -> Box:
    """Boxes around joints, and padding for their meshes: found once here, and each time by USD."""
    parts = []
    for binding in cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()):
        query = cache.GetSkelQuery(binding.GetSkeleton())
        if not query:
            continue
        rest = query.ComputeJointSkelTransforms(Usd.TimeCode.Default(), True)
        paddings = [
            target.ComputeExtentsPadding(rest, UsdGeom.Boundable(target.GetPrim()))
            for target in binding.GetSkinningTargets()
        ]
        parts.append((query, max(paddings, default=0.0)))
    if not parts:
        return _computed(root.GetPrim())

    def box(time: Usd.TimeCode) -> Vt.Vec3fArray:
        above = UsdGeom.XformCache(time)
        whole = Gf.Range3f()
        for query, padding in parts:
            matrix, _ = above.ComputeRelativeTransform(query.GetPrim(), root.GetPrim())
            joints = query.ComputeJointSkelTransforms(time)
            whole.UnionWith(UsdSkel.ComputeJointsExtent(joints, padding, matrix))
        return Vt.Vec3fArray([whole.GetMin(), whole.GetMax()])

    return box


def _computed(prim: Usd.Prim) -> Box:
    return lambda time: UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)


def _author(layer: Sdf.Layer, path: Sdf.Path, times: list[float], box: Box) -> None:
    spec = _extent(layer, path)
    boxes = {time: box(Usd.TimeCode(time)) for time in times}
    with Sdf.ChangeBlock():
        spec.ClearInfo("timeSamples")
        spec.default = boxes[times[0]] if times else box(Usd.TimeCode.Default())
        for time, values in boxes.items() if len(times) > 1 else ():
            layer.SetTimeSample(spec.path, time, values)


def _extent(layer: Sdf.Layer, path: Sdf.Path) -> Sdf.AttributeSpec:
    return layer.GetAttributeAtPath(path.AppendProperty("extent")) or Sdf.AttributeSpec(
        Sdf.CreatePrimInLayer(layer, path), "extent", Sdf.ValueTypeNames.Float3Array
    )
