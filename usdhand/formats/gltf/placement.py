"""Joints brought from their file's space to Y-up centimetres, with what stands above them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.above import scale_problems
from usdhand.formats.gltf.curves import Curves, evaluate
from usdhand.formats.gltf.document import LARGEST
from usdhand.formats.gltf.nodes import Tree
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.timing import Timing
from usdhand.motion.transforms import compose_trs, mean_scale, nearest_rotation, with_even_signs
from usdhand.problems import Problem

UNEVEN_SCALE = 2e-6  # relative: what rounding leaves of scales that are meant to be even


@dataclass(frozen=True, eq=False)
class Space:
    """What a file measures in: centimetres of a unit, and the rotation (3, 3) to Y up."""

    unit: float
    axes: Array


@dataclass(frozen=True, eq=False)
class JointSpace:
    """What brings local transforms into Y-up centimetres.

    Attributes
    ----------
    lengths : (joints,) centimetres of one unit of each joint's parent space
    folded : (joints,) scales that are part of ``lengths``, 1 where a joint keeps its scale
    rotations, translations : root joint -> what stands above it, (frames or 1, 3, 3) and
        (frames or 1, 3) in cm
    """

    lengths: Array
    folded: Array
    rotations: dict[int, Array]
    translations: dict[int, Array]


@dataclass(frozen=True, eq=False)
class Motion:
    """Curves and the frames to read them at; without curves, one frame of the default pose."""

    curves: Curves
    timing: Timing | None = None

    @property
    def count(self) -> int:
        """Number of frames."""
        return 1 if self.timing is None else self.timing.count


def sampled(tree: Tree, nodes: list[int], motion: Motion) -> tuple[Array, Array, Array]:
    """Local rotations, translations and scales (frames, nodes, n) in file units.

    What does not move is a view of one row for all frames.
    """
    curves, timing = motion.curves, motion.timing

    def values(path: str, default: Array) -> Array:
        rows = default[nodes]
        moved = [(place, node) for place, node in enumerate(nodes) if (node, path) in curves]
        if timing is None or not moved:
            return np.broadcast_to(rows, (motion.count, *rows.shape))
        result = np.empty((timing.count, *rows.shape))
        result[:] = rows
        for place, node in moved:
            curve = curves[node, path]
            result[:, place] = evaluate(curve, timing.frames(curve.times), timing.count, path)
        return result

    return (
        values("rotation", tree.rotations),
        values("translation", tree.translations),
        values("scale", tree.scales),
    )


def find_placement(
    tree: Tree,
    nodes: list[int],
    parents: NDArray[np.intp],
    scales: Array,
    motion: Motion,
    space: Space,
) -> tuple[JointSpace, tuple[Problem, ...]]:
    """Find what stands above joints with local ``scales`` (frames, joints, 3).

    Raises
    ------
    InputError
        if a zero scale stands there, or scales multiply to what cannot be meant.
    """
    folded = _even_scales(scales)
    lengths, growth = np.ones(len(nodes)), np.ones(len(nodes))
    kept = np.where(folded == 1.0, np.abs(_steady(scales)).max(axis=(0, 2)), 1.0)
    rotations: dict[int, Array] = {}
    translations: dict[int, Array] = {}
    problems: dict[str, Problem] = {}  # by code
    chains: dict[int, Array] = {}  # roots mostly share what stands above them
    for joint, parent in enumerate(parents):
        if parent >= 0:
            lengths[joint] = lengths[parent] * folded[parent]
            growth[joint] = growth[parent] * kept[parent]
        else:
            top = int(tree.parents[nodes[joint]])
            if top not in chains:
                chains[top] = _chain(tree, nodes[joint], motion)
                odd = scale_problems(chains[top][:, :3, :3], tree.name(top)) if top >= 0 else ()
                problems |= {problem.code: problem for problem in odd}
            above = chains[top]
            if "zero-scale" in problems:
                tree.elements[nodes[joint]].refuse("is below a zero scale")
            lengths[joint] = float(mean_scale(above[0, :3, :3])) * space.unit
            rotations[joint] = space.axes @ nearest_rotation(above[:, :3, :3])
            translations[joint] = above[:, :3, 3] @ space.axes.T * space.unit
        if not lengths[joint] * growth[joint] <= LARGEST:
            tree.elements[nodes[joint]].refuse("is below a scale that is too large")
    return JointSpace(lengths, folded, rotations, translations), tuple(problems.values())


def placed(
    q: Array, t: Array, s: Array, parents: NDArray[np.intp], placement: JointSpace
) -> tuple[Array, Array, Array]:
    """Rotations, translations in cm and scales of joints, from those of the file."""
    t = t * placement.lengths[:, None]
    q = q if q.flags.writeable else q.copy()
    for joint in map(int, np.flatnonzero(parents < 0)):
        turn = rot.from_matrix(placement.rotations[joint])
        t[:, joint] = rot.rotate(turn, t[:, joint]) + placement.translations[joint]
        q[:, joint] = rot.make_continuous(rot.multiply(turn, q[:, joint]))
    ones = np.broadcast_to(np.ones(s.shape[1:]), s.shape)
    even = np.abs(_steady(s) - placement.folded[:, None]).max(axis=(0, 2)) <= (
        UNEVEN_SCALE * placement.folded
    )
    q, s = with_even_signs(q, ones if even.all() else np.where(even[:, None], 1.0, s))
    return q, t, s


def _chain(tree: Tree, joint: int, motion: Motion) -> Array:
    """World matrices (frames or 1, 4, 4) of what stands above a joint, file units."""
    above = list(tree.above(joint))
    if not any(node in above for node, _ in motion.curves):
        return tree.world[above[-1]][None] if above else np.eye(4)[None]
    q, t, s = sampled(tree, above, motion)
    result = np.eye(4)[None]
    for place in range(len(above)):
        result = result @ compose_trs(t[:, place], q[:, place], s[:, place])
    if not (np.abs(result) <= LARGEST).all():
        tree.elements[joint].refuse("is beyond any plausible distance or scale")
    return np.asarray(result)


def _even_scales(s: Array) -> Array:
    """Scales (joints,) that are the same on all axes at all times, 1 for other joints.

    Such a scale does the same as longer bones below the joint, and shorter numbers are what other
    programs and methods expect.
    """
    first = s[0].mean(axis=1)
    even = np.abs(_steady(s) - first[:, None]).max(axis=(0, 2)) <= UNEVEN_SCALE * np.abs(first)
    return np.where(even & (first > 1e-9), first, 1.0)


def _steady(values: Array) -> Array:
    """Return the same values, one row where they are one row for all frames."""
    return values[:1] if values.strides[0] == 0 else values
