"""Bind pose of a character from its skins' inverse bind matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.gltf.accessors import read_rows
from usdhand.formats.gltf.characters import GltfCharacter, GltfSkin
from usdhand.formats.gltf.document import Document
from usdhand.formats.gltf.nodes import Tree
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import affine, orientation
from usdhand.problems import Problem

SAME_LENGTH = 0.05  # relative difference of bones of one skeleton in two poses
SAME_PLACE = 1e-3  # of the character's size: two skins agree on a joint
SMALLEST = 1e-12  # determinant of a matrix that can be inverted


def bind_matrices(
    document: Document, tree: Tree, character: GltfCharacter, parents: NDArray[np.intp]
) -> tuple[Array, tuple[Problem, ...]]:
    """Joint-to-world matrices (joints, 4, 4) of the bind pose in file units, without scale.

    Joints of no skin stand to the joint above them as in the default pose of the nodes, which
    is used as the bind pose where there is no skin or where skins contradict each other.
    """
    default = _without_scale(tree.world[list(character.nodes)])
    place = {node: joint for joint, node in enumerate(character.nodes)}
    found: dict[int, Array] = {}
    problems = []
    holder = int(tree.parents[character.nodes[0]])
    size = float(np.ptp(default[:, :3, 3], axis=0).max()) or 1.0
    for skin in sorted(character.skins, key=lambda skin: -len(skin.joints)):
        where = skin.element.where
        bind = _in_world(document, tree, skin, holder)
        if bind is None:
            absent = skin.element.get("inverseBindMatrices") is None
            message = (
                "there are no inverse bind matrices: the default pose is used as the bind pose"
                if absent
                else "the inverse bind matrices are not a pose of these bones; they are not used"
            )
            problems.append(Problem("missing-bind", message, where))
            continue
        apart = [
            joint
            for joint, own in bind.items()
            if place[joint] in found
            and np.abs(own[:3, 3] - found[place[joint]][:3, 3]).max() > SAME_PLACE * size
        ]
        if apart:
            message = (
                f"two skins bind the joint {tree.name(apart[0])!r} at different places: the "
                "default pose of the nodes is used as the bind pose"
            )
            return default, (*problems, Problem("bind-disagrees", message, where))
        for joint, own in bind.items():
            found.setdefault(place[joint], own)
    result = default.copy()
    for joint, parent in enumerate(parents):  # parents come first
        if joint in found:
            result[joint] = found[joint]
        elif parent >= 0:
            result[joint] = result[parent] @ np.linalg.inv(default[parent]) @ default[joint]
    return result, tuple(problems)


def _in_world(
    document: Document, tree: Tree, skin: GltfSkin, holder: int
) -> dict[int, Array] | None:
    """World matrix of each joint of a skin in its bind pose; None where that cannot be told.

    ``holder`` is the node above the character.
    """
    accessors = document.lists["accessors"]
    index = skin.element.reference("inverseBindMatrices", len(accessors))
    if index is None:
        return None
    rows = read_rows(document, accessors[index], "MAT4", least=len(skin.joints))
    inverse = rows[: len(skin.joints)].reshape(-1, 4, 4).swapaxes(1, 2)
    if (np.abs(np.linalg.det(inverse[:, :3, :3])) < SMALLEST).any():
        return None
    inverse[:, 3] = [0.0, 0.0, 0.0, 1.0]
    bind = np.linalg.inv(inverse)
    joints = list(skin.joints)
    above = _joints_above(tree, skin)
    posed = tree.world[joints]
    # The matrices lead from the space of the mesh, which may be the world's, or that of the node
    # above the joints, or of the mesh; if none of them fits, the first joint is where its node is.
    spaces = [np.eye(4), *(tree.world[node] for node in (holder, *skin.wearing) if node >= 0)]
    first = int(np.flatnonzero(above < 0)[0])
    fitting = [bound for s in spaces if _fits(bound := s @ bind, posed, above)]
    if fitting:
        best = min(fitting, key=lambda bound: _distance(bound, posed))
    else:
        best = posed[first] @ inverse[first] @ bind
        if not _fits(best, posed, above):
            return None
    return dict(zip(joints, _without_scale(best), strict=True))


def _joints_above(tree: Tree, skin: GltfSkin) -> NDArray[np.intp]:
    """Place in the skin of the next joint above each joint, -1 if there is none."""
    place = {joint: i for i, joint in enumerate(skin.joints)}
    lines = (tree.above(joint) for joint in skin.joints)
    nearest = (next((node for node in reversed(line) if node in place), -1) for line in lines)
    return np.array([place.get(node, -1) for node in nearest], dtype=np.intp)


def _bones(matrices: Array, above: NDArray[np.intp]) -> Array:
    """Vectors to the joints from those above them; between roots, from the first of them."""
    roots = np.flatnonzero(above < 0)
    start = np.where(above < 0, roots[0], above)
    return np.asarray(matrices[:, :3, 3] - matrices[start, :3, 3])


def _fits(bound: Array, posed: Array, above: NDArray[np.intp]) -> bool:
    """Whether bones are as long as in another pose, mostly."""
    if not np.isfinite(bound).all():
        return False
    a, b = (np.linalg.norm(_bones(m, above), axis=1) for m in (bound, posed))
    there = b > 1e-9
    if not there.any():
        return True
    return bool(np.median(np.abs(a[there] / b[there] - 1.0)) < SAME_LENGTH)


def _distance(bound: Array, posed: Array) -> float:
    """Mean distance of the joints from another pose."""
    apart = np.linalg.norm(bound[:, :3, 3] - posed[:, :3, 3], axis=1).mean()
    return float(f"{apart:.5g}")  # rounded, so that of equals the first one wins


def _without_scale(matrices: Array) -> Array:
    return affine(orientation(matrices[:, :3, :3]), matrices[:, :3, 3])
