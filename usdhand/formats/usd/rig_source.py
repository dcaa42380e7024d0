"""The clip that a rig file was made from, and whether it has changed since."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdSkel

from usdhand.errors import UsdHandError
from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.motion_crate import own_crate
from usdhand.formats.usd.read import clip_from_character
from usdhand.formats.usd.stage import Character, find_character
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import compose_trs

SAME = 1e-5  # of the largest number in joint matrices: what differs less is the same motion


@dataclass(frozen=True)
class RigSource:
    """The file below a rig.

    Attributes
    ----------
    rig : the layer that has the rig
    path : the file that this layer is over
    skeleton : path of the skeleton in both
    digest : SHA-256 of the file when the rig was made
    """

    rig: Path
    path: Path
    skeleton: str
    digest: str

    def change(self, ignored: Collection[str]) -> str | None:
        """Say what of the file has changed since, None if nothing has.

        Parameters
        ----------
        ignored : joints that the rig moves itself
        """
        other_file = file_hash(self.path) != self.digest
        try:
            then, now = (find_character(p, self.skeleton) for p in (self.rig, self.path))
            moved = _first_difference(then, now, ignored)
        except UsdHandError as error:
            return f"{self.path}, which the rig was made from, has changed and is not used: {error}"
        if moved is not None:
            return (
                f"{self.path}, which the rig was made from, has changed: {moved}. The motion of "
                "the body is the old one; --refresh takes the new one"
            )
        if other_file:
            return (
                f"{self.path}, which the rig was made from, has changed; the motion of the body "
                "is the same"
            )
        return None


def rig_source(prim: Usd.Prim) -> RigSource | None:
    """Return what a rig was made from; None where the file itself does not refer to it.

    That is so in files that were flattened, and for clips of other formats.
    """
    attribute = prim.GetAttribute("usdhand:sourceHash")
    stack = attribute.GetPropertyStack(Usd.TimeCode.Default()) if attribute else []
    if not stack or not isinstance(stack[0].default, str):
        return None
    spec, layer = stack[0], stack[0].layer
    relationship = spec.owner.relationships.get("usdhand:skeleton")
    targets = relationship.targetPathList.explicitItems if relationship else []
    if not layer.realPath or not len(layer.subLayerPaths) or not targets:
        return None
    below = Sdf.Layer.FindRelativeToLayer(layer, layer.subLayerPaths[-1])  # below its own motion
    if not below or not below.realPath or Path(below.realPath) == own_crate(Path(layer.realPath)):
        return None
    return RigSource(Path(layer.realPath), Path(below.realPath), str(targets[0]), spec.default)


def _first_difference(then: Character, now: Character, ignored: Collection[str]) -> str | None:
    """Say in which joint and where two characters move differently, but for some joints."""
    if (then.animation is None) != (now.animation is None):
        return "its animation"
    joints = [str(j) for j in UsdSkel.Skeleton(now.skeleton).GetJointsAttr().Get() or ()]
    old = [str(j) for j in UsdSkel.Skeleton(then.skeleton).GetJointsAttr().Get() or ()]
    if missing := [joint for joint in joints if joint not in old]:
        return f"it has the joint '{missing[0]}'"
    if then.animation is None or now.animation is None:
        return None
    queries = [_query(character) for character in (then, now)]
    times = [_times(query) for query in queries]
    if len(times[0]) and len(times[1]) and not np.allclose(times[0][[0, -1]], times[1][[0, -1]]):
        return f"its motion is at time codes {times[1][0]:g} to {times[1][-1]:g}"
    if len(times[0]) == 0 < len(times[1]):
        return "it moves"
    compared = [i for i, joint in enumerate(joints) if joint not in ignored]
    places = [old.index(joints[i]) for i in compared]
    for time, a, b in _poses(then, now, queries, times[1].tolist() or [0.0]):
        off = np.abs(a[places] - b[compared]).max(axis=(1, 2), initial=0.0)
        if len(off) and off.max() > SAME * max(1.0, float(np.abs(b[compared]).max())):
            return (
                f"'{joints[compared[int(off.argmax())]]}' moves differently at time code {time:g}"
            )
    return None


def _poses(
    then: Character,
    now: Character,
    queries: Sequence[UsdSkel.SkeletonQuery],
    times: Sequence[float],
) -> Iterator[tuple[float, Array, Array]]:
    """Joint-to-parent matrices (joints, 4, 4) of two characters at each time.

    UsdSkel has none for a skeleton without a rest pose; ours are compared then.
    """
    if all(query.ComputeJointLocalTransforms(times[0]) for query in queries):
        for time in times:
            a, b = (np.array(query.ComputeJointLocalTransforms(time)) for query in queries)
            yield time, a, b
        return
    clips = [clip_from_character(character) for character in (then, now)]
    for frame in range(min(map(len, clips))):
        a, b = (
            compose_trs(c.translations[frame], c.rotations[frame], c.scales[frame]) for c in clips
        )
        yield float(clips[1].time_codes[frame]), a, b


def _times(skeleton: UsdSkel.SkeletonQuery) -> Array:
    query = skeleton.GetAnimQuery()
    return np.array(query.GetJointTransformTimeSamples() if query else [], dtype=np.float64)


def _query(character: Character) -> UsdSkel.SkeletonQuery:
    cache = UsdSkel.Cache()
    root = UsdSkel.Root.Find(character.skeleton)
    if root:
        cache.Populate(root, Usd.TraverseInstanceProxies())
    return cache.GetSkelQuery(UsdSkel.Skeleton(character.skeleton))
