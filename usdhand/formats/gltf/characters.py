"""Which nodes of a glTF file are the joints of a character."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from usdhand.errors import InputError, UsageError
from usdhand.formats.gltf.document import Document, Element, choices
from usdhand.formats.gltf.nodes import Tree
from usdhand.formats.gltf.vrm import Humanoid

MOST_JOINTS = 10_000
MOST_SKINS = 500
MOST_SKIN_JOINTS = 200_000  # of all skins together


@dataclass(frozen=True, eq=False)
class GltfSkin:
    """Joints of a skin.

    Attributes
    ----------
    top : lowest node that is above or equal to all joints, -1 for none
    wearing : some of the nodes whose meshes the skin moves
    """

    joints: tuple[int, ...]
    top: int
    wearing: tuple[int, ...]
    element: Element


@dataclass(frozen=True, eq=False)
class GltfCharacter:
    """Joints that move as one.

    Attributes
    ----------
    nodes : of the joints, parents first
    names : by which the character can be chosen; the first one is shown
    skins : those over these joints; none for bare animation
    alone : whether it is the only one in its file
    """

    nodes: tuple[int, ...]
    names: tuple[str, ...]
    skins: tuple[GltfSkin, ...]
    alone: bool = True


def find_character(
    document: Document, tree: Tree, humanoid: Humanoid, moving: set[int], skel: str | None
) -> GltfCharacter:
    """Choose the joints of one character.

    Skins that share a hierarchy are one character, as the clothes and hair of an avatar are. In a
    file without skins, the humanoid's bones or else the animated nodes are the joints.

    Parameters
    ----------
    moving : nodes that any animation moves
    skel : name of a skin, or of a node above its joints, where there are several characters

    Raises
    ------
    InputError
        if there is no character.
    UsageError
        if there are several and none is chosen.
    """
    skins = read_skins(document, tree)
    bones = set(humanoid.bones)
    if not skins:
        bones = bones or {node for node in moving if _may_be_joint(tree, node)}
        groups: list[list[GltfSkin]] = [[]] if bones else []
    else:
        groups = [skins] if bones else _together(tree, skins)
    if not groups:
        raise InputError(
            f"{document.path}: has no skin, no humanoid and no animated nodes: no character."
        )
    found = [
        _character(tree, bones | {j for skin in group for j in skin.joints}, group, moving)
        for group in groups
    ]
    return _chosen(document.path, found, skel)


def read_skins(document: Document, tree: Tree) -> list[GltfSkin]:
    """Read all skins."""
    found: list[GltfSkin] = []
    together = 0
    if len(document.lists["skins"]) > MOST_SKINS:
        document.json.refuse(f"has more than {MOST_SKINS} skins, which is not plausible")
    wearing: dict[int, tuple[int, ...]] = {}
    for node, wearer in enumerate(tree.elements):
        skin = wearer.reference("skin", len(document.lists["skins"]))
        if skin is not None and len(wearing.get(skin, ())) < 4:
            wearing[skin] = (*wearing.get(skin, ()), node)
    for i, element in enumerate(document.lists["skins"]):
        joints = element.need("joints")
        nodes = [joint.whole(0, len(tree)) for joint in joints.elements()]
        if not nodes:
            joints.refuse("is empty")
        if len(nodes) > MOST_JOINTS:
            joints.refuse(f"lists {len(nodes)} joints, more than {MOST_JOINTS}")
        if len(set(nodes)) < len(nodes):
            joints.refuse("lists a joint twice")
        if (together := together + len(nodes)) > MOST_SKIN_JOINTS:
            joints.refuse(f"and those before it list more than {MOST_SKIN_JOINTS} joints")
        found.append(GltfSkin(tuple(nodes), tree.common(nodes), wearing.get(i, ()), element))
    return found


def _together(tree: Tree, skins: list[GltfSkin]) -> list[list[GltfSkin]]:
    """Skins grouped by the hierarchy that they share, in the file's order."""
    group = list(range(len(skins)))
    holder: dict[int, int] = {}  # joint -> the first skin that has it
    for i, skin in enumerate(skins):
        for joint in skin.joints:
            group = _merged(group, i, holder.setdefault(joint, i))
    tops: dict[int, int] = {}
    roots: dict[int, int] = {}
    for i, skin in enumerate(skins):
        group = _merged(group, i, tops.setdefault(skin.top, i))
        # Parts of one body may share no joint, but name the same root.
        root = skin.element.reference("skeleton", len(tree))
        if root is not None:
            group = _merged(group, i, roots.setdefault(root, i))
        # A skin below a joint of another one, as hair is below the head of the body.
        line = [skin.top, *reversed(tree.above(skin.top))]
        above = next((node for node in line if node in holder and node not in skin.joints), None)
        if above is not None:
            group = _merged(group, i, holder[above])
    return [[skins[i] for i, g in enumerate(group) if g == name] for name in dict.fromkeys(group)]


def _merged(group: list[int], a: int, b: int) -> list[int]:
    if group[a] == group[b]:
        return group
    low, high = sorted((group[a], group[b]))
    return [low if g == high else g for g in group]


def _character(
    tree: Tree, wanted: set[int], skins: list[GltfSkin], moving: set[int]
) -> GltfCharacter:
    top = tree.common(sorted(wanted))
    within = tree.below(top) if top >= 0 else tree.order
    leading = set(wanted)  # joints, and nodes that lead to one
    for node in reversed(within):
        if node in leading and node != top and tree.parents[node] >= 0:
            leading.add(int(tree.parents[node]))
    joints: set[int] = set()
    for node in within:
        # Bones that no skin uses, mostly the ends of fingers, belong to the joint above them.
        shows = tree.elements[node].get("mesh") is not None and node not in moving
        end = int(tree.parents[node]) in joints and _may_be_joint(tree, node) and not shows
        if node in wanted or end or (node in leading and node != top):
            joints.add(node)
    if top < 0:
        for root in np.flatnonzero(tree.parents < 0):
            _drop_leading(tree, int(root), joints, wanted)
    nodes = tuple(node for node in within if node in joints)
    if len(nodes) > MOST_JOINTS:
        tree.elements[nodes[0]].refuse(f"is above {len(nodes)} joints, which is not plausible")
    named = [skin.element.text("name") for skin in skins]
    holders = (top, int(tree.parents[nodes[0]]), nodes[0])
    named += [tree.name(node) for node in holders if node >= 0]
    return GltfCharacter(nodes, tuple(dict.fromkeys(n for n in named if n)), tuple(skins))


def _drop_leading(tree: Tree, root: int, joints: set[int], wanted: set[int]) -> None:
    """Leave out what leads to the joints of one of several trees from above."""
    node = root
    while node in joints and node not in wanted:
        joints.discard(node)
        below = [child for child in tree.children[node] if child in joints]
        if len(below) != 1:
            return
        node = below[0]


def _may_be_joint(tree: Tree, node: int) -> bool:
    element = tree.elements[node]
    lights = element.find("extensions", "KHR_lights_punctual")
    return element.get("camera") is None and element.get("skin") is None and lights is None


def _chosen(path: Path, found: list[GltfCharacter], skel: str | None) -> GltfCharacter:
    labels = _labels(found)
    if skel is None:
        if len(found) == 1:
            return found[0]
        raise UsageError(
            f"{path}: has {len(found)} skeletons: {choices(labels)}. Choose one with --skel NAME."
        )
    fitting = [i for i, label in enumerate(labels) if label == skel]
    fitting = fitting or [i for i, c in enumerate(found) if skel in c.names]
    if len(fitting) != 1:
        raise UsageError(f"{path}: has no skeleton '{skel}', only {choices(labels)}.")
    [i] = fitting
    chosen = found[i]
    return GltfCharacter(chosen.nodes, (labels[i], *chosen.names), chosen.skins, len(found) == 1)


def _labels(found: list[GltfCharacter]) -> tuple[str, ...]:
    """A name for each character that no other has."""
    labels: list[str] = []
    for i, character in enumerate(found):
        own = (n for n in character.names if sum(n in c.names for c in found) == 1)
        labels.append(next(own, f"skeleton_{i}"))
    return tuple(labels)
