"""Rules for the animation of a skeleton: its binding, its joints, every sample of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdSkel

from usdhand.formats.usd.bindings import binding_prim, unapplied_bindings
from usdhand.formats.usd.curves import Tracks, type_problems
from usdhand.motion import leaf_name
from usdhand.motion.rotations import UNIT_TOLERANCE
from usdhand.problems import Problem, listed

TIME_TOLERANCE = 1e-6  # time codes


def animation_findings(skeleton: Usd.Prim) -> Iterator[Problem]:
    """Everything that is wrong with the animation that a skeleton is bound to."""
    yield from _binding_findings(skeleton)
    source = UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource()
    if not source or not source.IsA(UsdSkel.Animation):
        return
    yield from _joint_findings(skeleton, source)
    yield from _time_findings(source)
    yield from _value_findings(source)
    listed_joints = UsdSkel.Animation(source).GetJointsAttr().Get() or ()
    tracks = Tracks.of(UsdSkel.Animation(source), len(listed_joints))
    for problem in type_problems(tracks, str(source.GetPath())):
        yield replace(problem, severity="error")


def _binding_findings(skeleton: Usd.Prim) -> Iterator[Problem]:
    owner = binding_prim(skeleton)
    targets = UsdSkel.BindingAPI(owner).GetAnimationSourceRel().GetTargets()
    where = str(owner.GetPath())
    unapplied = list(unapplied_bindings(skeleton))
    yield from unapplied
    if not targets and not unapplied:
        yield Problem("no-animation", "no animation is bound to the skeleton", where, "warning")
    elif targets and not (bound := skeleton.GetStage().GetPrimAtPath(targets[0])):
        message = f"{targets[0]} is bound, but does not exist"
        yield Problem("no-such-animation", message, where, "error")
    elif targets and not bound.IsA(UsdSkel.Animation):
        message = f"{targets[0]} is bound, but is not a SkelAnimation"
        yield Problem("no-such-animation", message, where, "error")
    prim = owner.GetParent()
    while prim and not prim.IsPseudoRoot():
        overruled = UsdSkel.BindingAPI(prim).GetAnimationSourceRel()
        in_force = prim.HasAPI(UsdSkel.BindingAPI)
        if in_force and overruled and overruled.GetTargets() not in ([], targets):
            yield Problem(
                "lost-binding",
                f"binds {overruled.GetTargets()[0]}, but the binding on {where} below has "
                "priority: override it there",
                str(prim.GetPath()),
                "warning",
            )
        prim = prim.GetParent()


def _joint_findings(skeleton: Usd.Prim, source: Usd.Prim) -> Iterator[Problem]:
    where = str(source.GetPath())
    known = {str(joint) for joint in UsdSkel.Skeleton(skeleton).GetJointsAttr().Get() or ()}
    animated = [str(joint) for joint in UsdSkel.Animation(source).GetJointsAttr().Get() or ()]
    unknown = [joint for joint in animated if joint not in known]
    if len(unknown) == len(animated):
        yield Problem(
            "no-joints-animated",
            f"it animates no joint of {skeleton.GetPath()}; it lists {listed(animated) or 'none'}",
            where,
            "error",
        )
    elif unknown:
        yield Problem(
            "unknown-joints",
            f"{len(unknown)} animated joints are not in {skeleton.GetPath()}: {listed(unknown)}",
            where,
            "warning",
        )


def _time_findings(source: Usd.Prim) -> Iterator[Problem]:
    stage, where = source.GetStage(), str(source.GetPath())
    times = UsdSkel.Animation(source).GetRotationsAttr().GetTimeSamples()
    if not times:
        yield Problem(
            "static-rotations",
            "the rotations have no time samples: Blender shows the rest pose",
            where,
            "warning",
        )
        return
    start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    root = stage.GetRootLayer()
    if not (root.HasStartTimeCode() and root.HasEndTimeCode()):
        yield Problem(
            "no-time-range",
            f"the stage has no start or end; the animation has {times[0]:g} to {times[-1]:g}",
            root.identifier,
            "warning",
        )
    elif times[0] < start - TIME_TOLERANCE or times[-1] > end + TIME_TOLERANCE:
        yield Problem(
            "time-range",
            f"the stage plays {start:g} to {end:g}, the animation has {times[0]:g} to "
            f"{times[-1]:g}",
            where,
            "warning",
        )


@dataclass(frozen=True, eq=False)
class SampledAttribute:
    """All samples of a motion attribute: a row a time, or the default value and no times."""

    path: str
    joints: list[str]
    times: list[float]
    rows: list[Any]

    def at(self, rows: Iterable[int]) -> str:
        """Where in time these rows are, in words."""
        rows = list(rows)
        first = f"time code {self.times[rows[0]]:g}" if self.times else "the default value"
        return f"at {first}" + (f" and {len(rows) - 1} more" if len(rows) > 1 else "")


def _value_findings(source: Usd.Prim) -> Iterator[Problem]:
    animation = UsdSkel.Animation(source)
    joints = [leaf_name(str(joint)) for joint in animation.GetJointsAttr().Get() or ()]
    where = str(source.GetPath())
    so = "without all three of rotations, translations and scales UsdSkel shows the rest pose"
    for attribute, missing in (
        (
            animation.GetRotationsAttr(),
            Problem("missing-rotations", f"there are no rotations: {so}", where, "error"),
        ),
        (
            animation.GetTranslationsAttr(),
            Problem("missing-translations", f"there are no translations: {so}", where, "error"),
        ),
        (
            animation.GetScalesAttr(),
            Problem("missing-scales", f"there are no scales: {so}", where, "error"),
        ),
    ):
        if not attribute.HasAuthoredValue():
            yield missing
            continue
        times = attribute.GetTimeSamples()
        query = Usd.AttributeQuery(attribute)
        rows = [query.Get(time) for time in times] or [query.Get()]
        yield from _track_findings(SampledAttribute(str(attribute.GetPath()), joints, times, rows))


def _track_findings(track: SampledAttribute) -> Iterator[Problem]:
    blocked = [i for i, row in enumerate(track.rows) if row is None]
    if blocked:
        yield Problem("blocked-sample", f"blocked {track.at(blocked)}", track.path, "error")
    count = len(track.joints)
    wrong = [i for i, row in enumerate(track.rows) if row is not None and len(row) != count]
    if wrong:
        message = f"{len(track.rows[wrong[0]])} values for {count} joints {track.at(wrong)}"
        yield Problem("array-length", message, track.path, "error")
    whole = [i for i, row in enumerate(track.rows) if row is not None and len(row) == count]
    if not whole or not count:
        return
    values = np.array([track.rows[i] for i in whole], dtype=np.float64)
    for rule, bad in _number_rules(values, track.path):
        if bad.any():
            names = [track.joints[int(j)] for j in np.flatnonzero(bad.any(axis=0))]
            frames = [whole[int(i)] for i in np.flatnonzero(bad.any(axis=1))]
            yield replace(rule, message=f"{rule.message}: {listed(names)} {track.at(frames)}")


def _number_rules(
    values: NDArray[np.float64], where: str
) -> Iterator[tuple[Problem, NDArray[np.bool_]]]:
    """The problem of each rule, with the (samples, joints) that break it."""
    finite = np.all(np.isfinite(values), axis=2)
    yield Problem("not-a-number", "not a number", where, "error"), ~finite
    if values.shape[2] != 4:
        return
    norms = np.linalg.norm(values, axis=2)
    zero = norms < UNIT_TOLERANCE
    yield Problem("zero-quaternion", "zero-length quaternion", where, "error"), zero
    long = ~zero & (np.abs(norms - 1.0) > UNIT_TOLERANCE)
    message = "the length of a quaternion is not one"
    yield Problem("non-unit-quaternion", message, where, "error"), long
    flips = np.zeros(norms.shape, dtype=bool)
    flips[1:] = np.einsum("tji,tji->tj", values[1:], values[:-1]) < 0
    message = (
        "quaternions change sign between neighbours; tools that interpolate the four numbers turn "
        "the long way"
    )
    yield Problem("sign-flip", message, where), flips
