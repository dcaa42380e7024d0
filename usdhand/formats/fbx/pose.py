"""From the nodes of an FBX scene to joints in Y-up centimetres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdhand.formats.fbx.scene import Scene, Transforms
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import (
    affine,
    compose_trs,
    mean_scale,
    nearest_rotation,
    orientation,
    with_even_signs,
)
from usdhand.problems import Problem

SAME_SCALE = 1e-5  # scales this close to one are rounding
SHEAR = 1e-3  # of a joint's axes, that no scale of joints can represent
MIRROR: Array = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class NodePoses:
    """World transforms of nodes in the file's own axes and units, over frames.

    ``linear`` and ``unscaled`` (frames, 3, 3), the latter without the node's own scale;
    ``positions`` (frames, 3) and ``scales`` (frames, 3) that children may take over.
    """

    linear: dict[int, Array]
    unscaled: dict[int, Array]
    positions: dict[int, Array]
    scales: dict[int, Array]


def right_handed(scene: Scene, axes: Array) -> Scene:
    """The scene with these axes; mirrored, if they are left-handed."""
    if np.linalg.det(axes) > 0:
        return replace(scene, axes=axes)
    flip = affine(MIRROR, np.zeros(3))
    sampled = scene.sampled
    if sampled is not None:
        sampled = replace(sampled, transforms=_mirrored(sampled.transforms))
    return replace(
        scene,
        axes=axes @ MIRROR,
        rest=_mirrored(scene.rest),
        sampled=sampled,
        bind={node: flip @ matrix @ flip for node, matrix in scene.bind.items()},
    )


def world_transforms(scene: Scene, transforms: Transforms, nodes: Iterable[int]) -> NodePoses:
    """Compose the transforms of ``nodes`` and all above them, by each node's way to inherit.

    Source: the description of ``ufbx_inherit_mode`` in ufbx.h.
    """
    world = NodePoses({}, {}, {}, {})
    frames = len(transforms)
    one, origin = np.ones((frames, 3)), np.zeros((frames, 3))
    identity = np.broadcast_to(np.eye(3), (frames, 3, 3))
    for node in sorted(_with_ancestors(scene, nodes)):
        place = transforms.translations[:, node]
        turn = rot.to_matrix(rot.normalize(transforms.rotations[:, node]))
        scale = transforms.scales[:, node]
        above = int(scene.parents[node])
        base = world.linear.get(above, identity)
        if scene.inherit[node] != "NORMAL":
            base = world.unscaled.get(above, identity)
            place = place * world.scales.get(above, one)
            scale = scale * world.scales.get(int(scene.scale_nodes[node]), one)
        moved = np.einsum("tij,tj->ti", base, place)
        world.positions[node] = world.positions.get(above, origin) + moved
        world.unscaled[node] = base @ turn
        world.linear[node] = world.unscaled[node] * scale[:, None, :]
        world.scales[node] = scale
    return world


def joint_locals(
    scene: Scene, nodes: Sequence[int], transforms: Transforms
) -> tuple[Transforms, tuple[Problem, ...]]:
    """Joint-to-parent transforms of a skeleton in Y-up centimetres, over the same frames.

    What stands above the roots becomes part of them: its size goes into the translations of all
    joints. Positions by forward kinematics are exact however scales are inherited; of the joints'
    axes, only shear is lost, and told of.
    """
    world = world_transforms(scene, transforms, nodes)
    axes, unit = scene.axes, scene.cm_per_unit
    rotations = rot.normalize(transforms.rotations[:, list(nodes)])
    translations, scales = np.empty((2, *rotations.shape[:2], 3))
    linear: dict[int, Array] = {}  # of each joint as forward kinematics makes it
    sizes: dict[int, float] = {}
    worst, sheared = SHEAR, -1
    for i, node in enumerate(nodes):
        above = int(scene.parents[node])
        if above in linear:
            sizes[node] = sizes[above]
            inverse = _inverse(linear[above])
            place = world.positions[node] - world.positions[above]
        else:
            sizes[node] = float(mean_scale(world.linear[above][0])) if above >= 0 else 1.0
            sizes[node] = sizes[node] or 1.0  # of what is flat anyway
            inverse = np.eye(3)
            place = world.positions[node]
            if above >= 0:
                turned = rot.from_matrix(nearest_rotation(axes @ world.linear[above]))
                rotations[:, i] = rot.multiply(turned, rotations[:, i])
        translations[:, i] = (inverse @ axes @ place[..., None])[..., 0] * unit
        turn = rot.to_matrix(rotations[:, i])
        own = np.swapaxes(turn, -1, -2) @ inverse @ axes @ world.linear[node] / sizes[node]
        scale = np.diagonal(own, axis1=-2, axis2=-1)
        skew = float(np.abs(own - scale[:, None, :] * np.eye(3)).max())
        if skew > worst:
            worst, sheared = skew, node
        scales[:, i] = np.where(np.abs(scale - 1.0) < SAME_SCALE, 1.0, scale)
        turn = turn * scales[:, i, None, :]
        linear[node] = linear[above] @ turn if above in linear else turn
    rotations, scales = with_even_signs(rotations, scales)
    return Transforms(translations, rotations, scales), _shear_problem(scene, sheared)


def bind_matrices(scene: Scene, nodes: Sequence[int], rest: Transforms) -> Array:
    """Joint-to-world matrices (joints, 4, 4) of the bind pose, Y-up centimetres.

    Joints that neither a skin nor a pose places hang on their parents as at ``rest``; where there
    is nothing to hang on, all stand as at rest.
    """
    world = world_transforms(scene, scene.rest, nodes)
    local = compose_trs(rest.translations[0], rest.rotations[0])
    bind = dict[int, Array]()
    bound = set[int]()
    for i, node in enumerate(nodes):
        above = int(scene.parents[node])
        matrix = affine(world.linear[node][0], world.positions[node][0])
        if node in scene.bind or above in bound:
            bound.add(node)
        if node in bound and node not in scene.bind:
            bind[node] = bind[above] @ local[i]
        else:
            bind[node] = _placed(scene, scene.bind.get(node, matrix))
    return np.stack([bind[node] for node in nodes])


def _placed(scene: Scene, matrix: Array) -> Array:
    """A world matrix of the file, without scale, in Y-up centimetres."""
    return affine(
        orientation(scene.axes @ matrix[:3, :3]), scene.axes @ matrix[:3, 3] * scene.cm_per_unit
    )


def _mirrored(transforms: Transforms) -> Transforms:
    return Transforms(
        transforms.translations * np.diag(MIRROR),
        transforms.rotations * np.array([1.0, -1.0, -1.0, 1.0]),
        transforms.scales,
    )


def _with_ancestors(scene: Scene, nodes: Iterable[int]) -> set[int]:
    found = set[int]()
    for node in nodes:
        while node >= 0 and node not in found:
            found.add(node)
            node = int(scene.parents[node])
    return found


def _inverse(linear: Array) -> Array:
    """Inverse matrices; of those that flatten everything, the nearest thing to one."""
    if np.abs(np.linalg.det(linear)).min() > 1e-18:
        return np.asarray(np.linalg.inv(linear))
    return np.asarray(np.linalg.pinv(linear))


def _shear_problem(scene: Scene, node: int) -> tuple[Problem, ...]:
    if node < 0:
        return ()
    message = "non-uniform scales shear the axes of joints: positions are kept, shear is ignored"
    return (Problem("sheared", message, scene.names[node]),)
