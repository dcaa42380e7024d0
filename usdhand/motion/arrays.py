"""Arrays of a user's own, checked and brought to our axes and units, for clips made in memory.

Every message names the argument and the first frame and joint that it is about.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdhand.errors import InputError, UsageError
from usdhand.inputs import is_text
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import UNIT_TOLERANCE, Array
from usdhand.motion.skeleton import Skeleton, leaf_name, parents_from_paths
from usdhand.motion.transforms import affine, decompose_trs, local_matrices, to_y_up
from usdhand.problems import Problem
from usdhand.units import UpAxis, read_unit

Quaternions = Literal["xyzw", "wxyz"]

# Quaternions in the wrong order: read as said, the median joint is turned further from the bind
# pose than the first, and the other way nearer than the second. No body moves like that. Some
# frames tell as well as all.
TURNED_OVER_DEG, NEAR_BIND_DEG, LOOKED_AT = 120.0, 60.0, 500
# Frames a second, and centimetres a unit, that can be meant.
RATES, UNITS_CM = (1e-3, 1e5), (1e-6, 1e8)
# What is larger, in the unit of the arrays, is a mistake, and products of it may overflow.
LARGEST = 1e9
# The bones of a hand and of a giant reach so far from the root, those of a body at least this far;
# and one that is so many times deeper than high lies.
REACH_CM, BODY_CM, LYING = (5.0, 400.0), 80.0, 2.0


@dataclass(frozen=True, eq=False)
class ArrayRig:
    """A skeleton made of arrays, and how other arrays of the same joints are to be understood.

    Attributes
    ----------
    joints : paths, in the order of the arrays
    order : the joints of ``skeleton``, which has parents before their children
    skeleton : in centimetres and Y up
    cm : centimetres of a unit of the arrays
    turn : (3, 3) from the axes of the arrays to ours
    """

    joints: tuple[str, ...]
    order: NDArray[np.intp]
    skeleton: Skeleton
    cm: float
    turn: Array

    @classmethod
    def of(
        cls,
        joints: Sequence[str],
        parents: ArrayLike | None,
        bind: ArrayLike | None,
        rest: ArrayLike | None,
        units: str | float,
        up: str,
    ) -> ArrayRig:
        """Check what says how a skeleton is, and make it; see `usdhand.motion.Clip.from_arrays`."""
        cm, turn = _centimetres(units), _turn(up)
        paths, above = _tree(_names(joints), parents)
        if bind is None and rest is None:
            raise UsageError(
                "bind: give the bind pose (joint-to-world) or the rest pose (joint-to-parent): "
                "what a finger's flexion is is measured from it."
            )
        order = _parents_first(above)
        place = np.argsort(order)
        own = np.where(above[order] < 0, -1, place[above[order]])
        names = tuple(paths[joint] for joint in order)
        if rest is not None:
            local = _scaled(_matrices("rest", rest, paths)[order], cm)
            local[own < 0] = affine(turn, np.zeros(3)) @ local[own < 0]
        if bind is not None:
            world = affine(turn, np.zeros(3)) @ _scaled(_matrices("bind", bind, paths)[order], cm)
        else:
            world = Skeleton(names, own, local, local).accumulated(local)
        if rest is None:
            local = local_matrices(world, own)
        return cls(paths, order, Skeleton(names, own, world, local), cm, turn)

    def rotations(self, values: ArrayLike, quaternions: str) -> Array:
        """Return unit quaternions (frames, joints, 4) of the skeleton, xyzw and continuous.

        Raises
        ------
        UsageError
            if the shape is another one, or the order cannot be meant.
        InputError
            if a value is not finite, or a quaternion not of unit length.
        """
        if quaternions not in get_args(Quaternions):
            raise UsageError(f"quaternions: '{quaternions}' is not one of {_listed(Quaternions)}.")
        q = _array("rotations", values, "(frames, joints, 4)", (None, len(self.joints), 4))
        if not len(q):
            raise UsageError("rotations: there are no frames.")
        _check_finite("rotations", q, self.joints)
        length = np.linalg.norm(q, axis=-1)
        if (bad := _first(np.abs(length - 1.0) > UNIT_TOLERANCE)) is not None:
            raise InputError(
                f"rotations: {_at(bad, self.joints)}: the quaternion has the length "
                f"{length[bad]:.4g} instead of 1, so it is not a rotation."
            )
        q = q[:, self.order] / length[:, self.order, None]
        self._check_order(q, quaternions)
        return np.asarray(rot.make_continuous(self._turned(q, quaternions)), float)

    def translations(self, values: ArrayLike | None, frames: int) -> Array:
        """Return translations (frames, joints, 3) of the skeleton; those of its rest by default."""
        if values is None:
            still = decompose_trs(self.skeleton.rest)[0]
            return np.broadcast_to(still, (frames, *still.shape)).copy()
        moved = self.cm * self._vectors("translations", values, frames)[:, self.order]
        roots = self.skeleton.parents < 0
        moved[:, roots] = moved[:, roots] @ self.turn.T
        return moved

    def scales(self, values: ArrayLike | None, frames: int) -> Array:
        """Return scales (frames, joints, 3) of the skeleton; those of its rest by default."""
        if values is None:
            still = decompose_trs(self.skeleton.rest)[2]
            still = np.where(np.abs(still - 1.0) < 1e-6, 1.0, still)
            return np.broadcast_to(still, (frames, *still.shape))
        scales = self._vectors("scales", values, frames)
        if (bad := _first((scales == 0).any(axis=-1))) is not None:
            where = _at(bad, self.joints)
            raise InputError(f"scales: {where}: a scale of 0 is not possible.")
        return scales[:, self.order]

    def doubts(self) -> tuple[Problem, ...]:
        """Say it if no body has this size, or it lies at its bind pose: something may be wrong."""
        places, parents = self.skeleton.bind_positions, self.skeleton.parents
        ways = np.zeros(len(parents))
        for joint, parent in enumerate(parents):
            if parent >= 0:
                ways[joint] = ways[parent] + np.linalg.norm(places[joint] - places[parent])
        reach, found = float(ways.max()), []
        if not REACH_CM[0] <= reach <= REACH_CM[1]:
            message = f"the bones reach {reach:.3g} cm from the root: check the unit"
            found.append(Problem("odd-size", message))
        _, height, depth = np.ptp(places, axis=0)
        if BODY_CM <= reach <= REACH_CM[1] and depth > LYING * height:
            message = (
                f"at its bind pose the character is {height:.0f} cm high and {depth:.0f} cm deep: "
                "check the up axis"
            )
            found.append(Problem("odd-up-axis", message))
        return tuple(found)

    def _vectors(self, name: str, values: ArrayLike, frames: int) -> Array:
        """Vectors (frames, joints, 3) in the order and units of the arrays."""
        count = len(self.joints)
        shape = "(frames, joints, 3) or (joints, 3)"
        array = _array(name, values, shape, (frames, count, 3), (count, 3))
        array = np.broadcast_to(array, (frames, count, 3))
        _check_finite(name, array, self.joints)
        return array

    def _turned(self, q: Array, quaternions: str) -> Array:
        """Rotations in our axes, xyzw, of those in the order ``quaternions``."""
        roots = self.skeleton.parents < 0
        q = q.copy() if quaternions == "xyzw" else q[..., [1, 2, 3, 0]]
        q[:, roots] = rot.multiply(rot.from_matrix(self.turn), q[:, roots])
        return q

    def _check_order(self, q: Array, quaternions: str) -> None:
        """Refuse quaternions that make sense in the other order only."""
        some = q[:: max(1, len(q) // LOOKED_AT)]
        bind = decompose_trs(self.skeleton.bind_locals)[1]

        def away(order: str) -> float:
            return float(np.median(rot.angle_between(bind, self._turned(some, order))))

        other = "wxyz" if quaternions == "xyzw" else "xyzw"
        if away(quaternions) > TURNED_OVER_DEG and away(other) < NEAR_BIND_DEG:
            raise UsageError(
                f"quaternions: read as {quaternions}, the joints are {away(quaternions):.0f} "
                f"degrees from the bind pose in the median, read as {other} only "
                f"{away(other):.0f}: give quaternions='{other}'."
            )


def rate_of(fps: float) -> float:
    """Return frames a second.

    Raises
    ------
    UsageError
        if it is no positive number.
    """
    number = isinstance(fps, Real) and not isinstance(fps, bool)
    if not number or not RATES[0] <= fps <= RATES[1]:
        raise UsageError(
            f"fps: {fps!r} frames a second are not possible: give a number from {RATES[0]:g} to "
            f"{RATES[1]:g}."
        )
    return float(fps)


def _centimetres(units: str | float) -> float:
    try:
        cm = read_unit(str(units))
    except ValueError as error:
        raise UsageError(f"units: {error}") from error
    if not UNITS_CM[0] <= cm <= UNITS_CM[1]:
        raise UsageError(f"units: no unit of length has {cm:g} cm.")
    return cm


def _turn(up: str) -> Array:
    if up not in get_args(UpAxis):
        raise UsageError(f"up: '{up}' is not one of {_listed(UpAxis)}.")
    return to_y_up(up)


def _scaled(matrices: Array, cm: float) -> Array:
    result = matrices.copy()
    result[:, :3, 3] *= cm
    return result


def _parents_first(parents: NDArray[np.intp]) -> NDArray[np.intp]:
    """Order of joints with every parent before its children; theirs, where that is so already."""
    joints = np.arange(len(parents))
    if (parents < joints).all():
        return joints
    depths, above = np.zeros(len(parents), np.intp), parents
    while (above >= 0).any():
        depths += above >= 0
        above = np.where(above >= 0, parents[above], -1)
    return np.argsort(depths, kind="stable")


def _names(joints: Sequence[str]) -> list[str]:
    several = isinstance(joints, Iterable) and not isinstance(joints, str)
    names = list(joints) if several else []
    if not several or not all(isinstance(name, str) for name in names):
        raise UsageError("joints: give a list of names or paths.")
    if not names:
        raise UsageError("joints: there are none.")
    for number, name in enumerate(names):
        if not name or not leaf_name(name):
            raise UsageError(f"joints: number {number} has no name ({name!r}).")
        if not is_text(name):
            raise UsageError(f"joints: the name of number {number} is no text ({name!r}).")
    return names


def _tree(names: list[str], parents: ArrayLike | None) -> tuple[tuple[str, ...], NDArray[np.intp]]:
    """Paths of all joints, and their parents."""
    paths = any("/" in name for name in names)
    if parents is None:
        if not paths and len(names) > 1:
            raise UsageError("joints: names alone do not give the hierarchy: give parents=.")
        above = parents_from_paths(names)
    else:
        above = _checked_parents(names, parents)
        if paths and (bad := _first(np.not_equal(above, parents_from_paths(names)))) is not None:
            raise UsageError(f"parents: that of '{names[bad[0]]}' is not the one in its path.")
        if not paths:
            for joint in _parents_first(above).tolist():
                if above[joint] >= 0:
                    names[joint] = f"{names[above[joint]]}/{names[joint]}"
    if double := next((n for i, n in enumerate(names) if n in names[:i]), None):
        raise UsageError(f"joints: '{double}' is given twice.")
    return tuple(names), above


def _checked_parents(names: list[str], parents: ArrayLike) -> NDArray[np.intp]:
    given = _array("parents", parents, "(joints,)", (len(names),))
    whole = given == np.floor(given)
    inside = (given >= -1) & (given < len(names)) & (given != np.arange(len(names)))
    if (bad := _first(~(whole & inside))) is not None:
        raise UsageError(
            f"parents: {given[bad]:g} is not a possible parent of joint {bad[0]} "
            f"'{names[bad[0]]}': give the index of another joint, 0 to {len(names) - 1}, or -1 for "
            "a root."
        )
    above: NDArray[np.intp] = given.astype(np.intp)
    top = above
    for _ in names:  # whoever is not above a root by now never will be
        top = np.where(top >= 0, above[top], -1)
    if (bad := _first(top >= 0)) is not None:
        raise UsageError(f"parents: joint '{names[bad[0]]}' is its own ancestor.")
    return above


def _matrices(name: str, values: ArrayLike, joints: Sequence[str]) -> Array:
    """Matrices (joints, 4, 4) of such, or of positions (joints, 3)."""
    shape = "(joints, 4, 4) or (joints, 3)"
    array = _array(name, values, shape, (len(joints), 4, 4), (len(joints), 3))
    _check_finite(name, array, joints, tuple(range(1, array.ndim)))
    if array.ndim == 2:
        return affine(np.eye(3), array)
    if (bad := _first((np.abs(array[:, 3] - [0.0, 0.0, 0.0, 1.0]) > 1e-6).any(axis=1))) is not None:
        advice = ""
        if np.abs(array[:, :, 3] - [0.0, 0.0, 0.0, 1.0]).max() <= 1e-6:
            advice = " They seem to be for row vectors: transpose them."
        raise UsageError(
            f"{name}: {_at(bad, joints)}: the last row of a matrix for column vectors is "
            f"0, 0, 0, 1.{advice}"
        )
    if (bad := _first(np.abs(np.linalg.det(array[:, :3, :3])) < 1e-12)) is not None:
        raise InputError(f"{name}: {_at(bad, joints)}: the matrix has no inverse.")
    return array


def _array(name: str, values: Any, form: str, *shapes: tuple[int | None, ...]) -> Array:
    """Numbers of one of these shapes, in an array of their own; None fits any length."""
    try:
        if np.iscomplexobj(values):
            raise TypeError("its numbers are complex")
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise UsageError(f"{name}: this is not an array of numbers ({error}).") from error
    for shape in shapes:
        if len(shape) == array.ndim and all(
            want in (None, have) for want, have in zip(shape, array.shape, strict=True)
        ):
            return array
    wanted = " or ".join(str(tuple(n or "frames" for n in s)).replace("'", "") for s in shapes)
    raise UsageError(f"{name}: the shape is {array.shape}; it must be {form}, that is {wanted}.")


def _check_finite(
    name: str, values: Array, joints: Sequence[str], axis: int | tuple[int, ...] = -1
) -> None:
    """Refuse values (frames, joints, n) that no motion has; ``axis`` is that of one joint's."""
    if (bad := _first(~np.isfinite(values).all(axis=axis))) is not None:
        raise InputError(f"{name}: {_at(bad, joints)}: a value is not finite.")
    if (bad := _first((np.abs(values) > LARGEST).any(axis=axis))) is not None:
        raise InputError(f"{name}: {_at(bad, joints)}: a value is larger than {LARGEST:g}.")


def _first(bad: ArrayLike) -> tuple[int, ...] | None:
    """Where the first true value is; None where none is."""
    found = np.argwhere(bad)
    return tuple(found[0].tolist()) if len(found) else None


def _at(where: tuple[int, ...], joints: Sequence[str]) -> str:
    """Say a joint, or a frame and a joint."""
    frame = "".join(f"frame {number}, " for number in where[:-1])
    return f"{frame}joint '{joints[where[-1]]}'"


def _listed(kind: Any) -> str:
    return " and ".join(get_args(kind))
