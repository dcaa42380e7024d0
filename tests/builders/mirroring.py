"""Characters that move as before, with part of the skeleton below a mirroring joint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Usd, UsdSkel, Vt


def mirror_below(source: Path, target: Path, top: str, signs: Sequence[float]) -> Path:
    """A copy in which a joint has these signs as scale, as rigs have that were made by mirroring.

    Every joint stays where it is: the axes of ``top`` (a path or name) and of all below it are
    mirrored, and what hangs below counts in mirrored axes.
    """
    layer = Usd.Stage.Open(str(source)).Flatten()
    stage = Usd.Stage.Open(layer)
    [skeleton] = [UsdSkel.Skeleton(p) for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)]
    joints = [str(j) for j in skeleton.GetJointsAttr().Get()]
    [at] = [i for i, j in enumerate(joints) if top in (j, j.rsplit("/", 1)[-1])]
    below = [i for i, j in enumerate(joints) if j.startswith(joints[at] + "/")]
    flip = np.diag([*signs, 1.0])
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        matrices = np.array(attribute.Get())  # row vectors
        world = attribute.GetName() == "bindTransforms"
        matrices[[at, *below]] = flip @ matrices[[at, *below]]
        if not world:
            matrices[below] = matrices[below] @ flip
        attribute.Set(Vt.Matrix4dArray.FromNumpy(matrices))
    animation = UsdSkel.Animation(UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource())
    listed = [str(j) for j in animation.GetJointsAttr().Get()]
    moved = [i for i, j in enumerate(listed) if j.startswith(joints[at] + "/")]
    # Seen through a mirror a rotation has its axis mirrored, and turns the other way.
    turned = np.array([*signs, 1.0]) * np.array([np.prod(signs)] * 3 + [1.0])
    for attribute, convert, dtype, change in (
        (animation.GetRotationsAttr(), Vt.QuatfArray.FromNumpy, np.float32, turned),
        (animation.GetTranslationsAttr(), Vt.Vec3fArray.FromNumpy, np.float32, np.array(signs)),
    ):
        for time in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]:
            values = np.array(attribute.Get(time))
            values[moved] *= change
            attribute.Set(convert(np.ascontiguousarray(values, dtype)), time)
    scales = np.ones((len(listed), 3), np.float16)
    scales[listed.index(joints[at])] = signs
    animation.GetPrim().RemoveProperty("scales")
    animation.CreateScalesAttr().Set(Vt.Vec3hArray.FromNumpy(scales))
    layer.Export(str(target))
    return target
