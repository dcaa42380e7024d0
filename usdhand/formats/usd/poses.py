"""Rest and bind pose of a skeleton, repaired where exporters leave them out or in other space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pxr import UsdSkel

from usdhand.formats.guess import stands
from usdhand.formats.usd.stage import Character
from usdhand.formats.usd.world import World
from usdhand.motion import Skeleton
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import affine, local_matrices, unit
from usdhand.problems import Problem, counted, listed

MISPLACED_BIND_CM = 1.0


@dataclass(frozen=True, eq=False)
class AuthoredPoses:
    """Rest and bind matrices as the file has them (column vectors, cm), None where unusable."""

    rest: Array | None
    bind: Array | None

    def neutral_locals(self, parents: NDArray[np.intp]) -> Array:
        """Joint-to-parent matrices where an animation says nothing: rest, as USD defines it."""
        return self.rest if self.rest is not None else self.bind_locals(parents)

    def bind_locals(self, parents: NDArray[np.intp]) -> Array:
        """Joint-to-parent matrices of the bind pose, of the rest pose where there is no bind."""
        if self.bind is not None:
            return local_matrices(self.bind, parents)
        if self.rest is not None:
            return self.rest
        return np.broadcast_to(np.eye(4), (len(parents), 4, 4))


def authored_poses(
    character: Character, joints: int, scale: float
) -> tuple[AuthoredPoses, tuple[Problem, ...]]:
    """Read the poses of a skeleton; what is missing comes back as problems."""
    skeleton = UsdSkel.Skeleton(character.skeleton)
    rest = _matrices(skeleton.GetRestTransformsAttr().Get(), joints, scale)
    bind = _matrices(skeleton.GetBindTransformsAttr().Get(), joints, scale)
    where = str(character.skeleton.GetPath())
    unusable = "transforms are missing or have the wrong number"
    problems = []
    if bind is None:
        problems.append(Problem("missing-bind", f"bind {unusable}", where))
    if rest is None:
        problems.append(Problem("missing-rest", f"rest {unusable}", where))
    return AuthoredPoses(rest, bind), tuple(problems)


def placed_skeleton(
    joints: tuple[str, ...],
    parents: NDArray[np.intp],
    poses: AuthoredPoses,
    world: World,
    first_frame: Array,
) -> tuple[Skeleton, tuple[Problem, ...]]:
    """Skeleton in Y-up centimetres.

    ``first_frame`` (joints, 4, 4), joint-to-parent and already placed in the world, stands in for
    a bind pose that is missing. It tells in which space the bind pose was written, where a body
    would stand in both or in none.
    """
    rest = poses.neutral_locals(parents).copy()
    roots = parents < 0
    rest[roots] = world.first @ rest[roots]
    skeleton = Skeleton(joints, parents, first_frame, rest)
    if poses.bind is None:
        local = rest if poses.rest is not None else first_frame
        return replace(skeleton, bind=skeleton.accumulated(local)), ()
    posed = skeleton.accumulated(first_frame)
    in_skeleton_space = world.first @ poses.bind
    in_world_space = affine(world.axes, np.zeros(3)) @ poses.bind
    # UsdSkel's documentation says world space, Blender writes skeleton space, Maya world space.
    # A body stands at its bind pose; where that does not tell, the first frame does.
    bind = max(
        (in_skeleton_space, in_world_space),
        key=lambda b: (
            stands(b[:, :3, 3], skeleton.names),
            _agreement(_bones(b, parents), posed, parents),
        ),
    )
    identity = np.abs(poses.bind - np.eye(4)).max(axis=(1, 2)) < 1e-6
    return _repair_unskinned(replace(skeleton, bind=bind), first_frame, posed, identity)


def _matrices(value: object, count: int, scale: float) -> Array | None:
    try:
        matrices = np.asarray(value if value is not None else [], dtype=np.float64)
    except (TypeError, ValueError):  # of another type
        return None
    if matrices.shape != (count, 4, 4) or not np.isfinite(matrices).all():
        return None
    if (np.abs(np.linalg.det(matrices[:, :3, :3])) < 1e-12).any():
        return None
    matrices = np.swapaxes(matrices, 1, 2).copy()
    matrices[:, :3, 3] *= scale
    return matrices


def _bones(matrices: Array, parents: NDArray[np.intp]) -> Array:
    children = np.flatnonzero(parents >= 0)
    bones = matrices[children, :3, 3] - matrices[parents[children], :3, 3]
    return unit(bones)


def _agreement(bones: Array, posed: Array, parents: NDArray[np.intp]) -> float:
    return float(np.sum(bones * _bones(posed, parents)))


def _repair_unskinned(
    skeleton: Skeleton, first_frame: Array, posed: Array, identity: NDArray[np.bool_]
) -> tuple[Skeleton, tuple[Problem, ...]]:
    """Place joints that no skin uses, for which Maya exports an identity bind transform."""
    bind = skeleton.bind.copy()
    repaired = []
    for j in skeleton.order:
        p = int(skeleton.parents[j])
        if p < 0 or not identity[j]:
            continue
        expected = np.linalg.norm(posed[j, :3, 3] - posed[p, :3, 3])
        actual = np.linalg.norm(bind[j, :3, 3] - bind[p, :3, 3])
        if abs(actual - expected) > MISPLACED_BIND_CM:
            bind[j] = bind[p] @ first_frame[j]
            repaired.append(skeleton.names[j])
    if not repaired:
        return skeleton, ()
    message = (
        f"{counted(len(repaired), 'joint has', 'joints have')} an identity bind transform (used "
        "by no skin) and placed by the first frame"
    )
    return replace(skeleton, bind=bind), (Problem("identity-bind", message, listed(repaired)),)
