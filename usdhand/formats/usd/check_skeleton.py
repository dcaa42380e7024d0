"""Rules for a skeleton: its joints, its poses, and what it stands under."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdSkel

from usdhand.formats.usd.names import illegal_names, legal_name, order_problems
from usdhand.formats.usd.poses import MISPLACED_BIND_CM
from usdhand.formats.usd.world import world_problems
from usdhand.motion import leaf_name, parents_from_paths
from usdhand.problems import Problem, Severity, counted, listed

# What may be wrong with a pose: it is not there, has another length, or no usable matrices.
POSE_PROBLEMS = {
    "bind": (
        Problem("missing-bind", "", severity="error"),
        Problem("bind-length", "", severity="error"),
        Problem("bad-bind", "", severity="error"),
    ),
    "rest": (
        Problem("missing-rest", "", severity="error"),
        Problem("rest-length", "", severity="error"),
        Problem("bad-rest", "", severity="error"),
    ),
}


def skeleton_findings(skeleton: Usd.Prim) -> Iterator[Problem]:
    """Everything that is wrong with a skeleton itself."""
    where = str(skeleton.GetPath())
    tokens = UsdSkel.Skeleton(skeleton).GetJointsAttr().Get()
    joints = [str(token) for token in tokens or ()]
    if not joints:
        yield Problem("no-joints", "the skeleton lists no joints", where, "error")
        return
    yield from _name_findings(joints, where)
    for problem in order_problems(joints, where):
        yield replace(problem, severity="error")
    yield from _pose_findings(skeleton, joints, where)
    for problem in world_problems(skeleton):
        severity: Severity = "error" if problem.code == "zero-scale" else "warning"
        yield replace(problem, severity=severity)


def _name_findings(joints: Sequence[str], where: str) -> Iterator[Problem]:
    illegal = illegal_names(joints)
    if illegal:
        renamed = [f"'{name}' to '{legal_name(name)}'" for name in illegal]
        yield Problem(
            "illegal-joint-name",
            f"{len(illegal)} joint names are not legal prim names: USD then sees no hierarchy and "
            f"Blender makes no bones. Rename {listed(renamed)}",
            where,
            "error",
        )
    double = [joint for joint, count in Counter(joints).items() if count > 1]
    if double:
        yield Problem("duplicate-joint", f"listed twice: {listed(double)}", where, "error")
    shared = [n for n, count in Counter(map(leaf_name, dict.fromkeys(joints))).items() if count > 1]
    if shared:
        yield Problem(
            "duplicate-joint-name",
            f"{len(shared)} names belong to several joints, which tools that drop the hierarchy "
            f"confuse: {listed(shared)}",
            where,
            "warning",
        )


def _pose_findings(skeleton: Usd.Prim, joints: Sequence[str], where: str) -> Iterator[Problem]:
    api = UsdSkel.Skeleton(skeleton)
    poses: dict[str, NDArray[np.float64]] = {}
    for name, attribute in (
        ("bind", api.GetBindTransformsAttr()),
        ("rest", api.GetRestTransformsAttr()),
    ):
        matrices = np.array(attribute.Get() or [], dtype=np.float64).reshape(-1, 4, 4)
        missing, other_length, bad = (replace(p, where=where) for p in POSE_PROBLEMS[name])
        if not len(matrices):
            message = f"there are no {name} transforms, without which UsdSkel and Blender cannot"
            yield replace(missing, message=f"{message} pose it")
        elif len(matrices) != len(joints):
            message = f"{len(matrices)} {name} transforms for {counted(len(joints), 'joint')}"
            yield replace(other_length, message=message)
        elif singular := [joints[int(j)] for j in np.flatnonzero(~_usable(matrices))]:
            are = counted(len(singular), f"{name} transform is", f"{name} transforms are")
            message = f"{are} singular or not numbers"
            yield replace(bad, message=f"{message}: {listed(singular)}")
        else:
            poses[name] = matrices
    if len(poses) == 2:
        cm = 100.0 * UsdGeom.GetStageMetersPerUnit(skeleton.GetStage()) * _scale_above(skeleton)
        offsets = _first_offsets(skeleton, joints, poses["rest"][:, 3, :3])
        unplaced = _unplaced(poses["bind"], offsets, parents_from_paths(joints), cm)
        if len(unplaced):
            yield Problem(
                "identity-bind",
                f"{counted(len(unplaced), 'joint has', 'joints have')} an identity bind transform "
                "(Maya writes that where "
                f"no skin uses a joint): {listed([leaf_name(joints[j]) for j in unplaced])}",
                where,
                "warning",
            )


def _usable(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    volume = np.linalg.det(np.where(finite[:, None, None], matrices, np.eye(4))[:, :3, :3])
    return np.asarray(finite & (np.abs(volume) > 1e-12))


def _unplaced(
    bind: NDArray[np.float64], offsets: NDArray[np.float64], parents: NDArray[np.intp], cm: float
) -> NDArray[np.intp]:
    """Joints with an identity bind transform whose bones have another length."""
    identity = np.abs(bind - np.eye(4)).max(axis=(1, 2)) < 1e-6
    at_bind = np.linalg.norm(bind[:, 3, :3] - bind[parents, 3, :3], axis=1)
    away = np.abs(at_bind - np.linalg.norm(offsets, axis=1)) * cm > MISPLACED_BIND_CM
    return np.flatnonzero(identity & (parents >= 0) & away)


def _first_offsets(
    skeleton: Usd.Prim, joints: Sequence[str], rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joint-to-parent translations of the first frame, since Maya spoils rest along with bind."""
    offsets = rest.copy()
    animation = UsdSkel.Animation(UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource())
    if animation:
        listed = [str(joint) for joint in animation.GetJointsAttr().Get() or ()]
        values = animation.GetTranslationsAttr().Get(Usd.TimeCode.EarliestTime()) or ()
        given = dict(zip(listed, values, strict=False))
        for j, joint in enumerate(joints):
            offsets[j] = given.get(joint, offsets[j])
    return offsets


def _scale_above(prim: Usd.Prim) -> float:
    matrix: Gf.Matrix4d = UsdGeom.XformCache().GetLocalToWorldTransform(prim)
    return float(np.cbrt(abs(matrix.GetDeterminant3())))
