"""Humanoid bones of VRM avatars and VRM animations: which node is which bone."""

from __future__ import annotations

from dataclasses import dataclass, field

from usdhand.formats.gltf.document import Document, Element


@dataclass(frozen=True)
class Humanoid:
    """Bone names of nodes, as the file's own version spells them.

    VRM 0 and 1 name the thumb differently: ``leftThumbProximal`` is the first thumb bone of VRM 0
    (then Intermediate, Distal), but the second one of VRM 1 and VRMA (Metacarpal before it).

    Attributes
    ----------
    version : "VRM 0", "VRM 1" or "VRM animation"; "" for a file that is none of them
    bones : node -> name
    """

    version: str = ""
    bones: dict[int, str] = field(default_factory=dict)


def read_humanoid(document: Document) -> Humanoid:
    """Read the humanoid of a file, an empty one where it has none.

    Raises
    ------
    InputError
        if it names nodes that there are not.
    """
    extensions = document.json.get("extensions")
    if extensions is None:
        return Humanoid()
    for version, name in (
        ("VRM 1", "VRMC_vrm"),
        ("VRM animation", "VRMC_vrm_animation"),
        ("VRM 0", "VRM"),
    ):
        bones = extensions.find(name, "humanoid", "humanBones")
        if bones is not None:
            named = _listed(bones) if version == "VRM 0" else list(bones.members())
            return Humanoid(version, _by_node(document, named))
    return Humanoid()


def _listed(bones: Element) -> list[tuple[str, Element]]:
    return [(bone.text("bone"), bone) for bone in bones.elements()]


def _by_node(document: Document, named: list[tuple[str, Element]]) -> dict[int, str]:
    count = len(document.lists["nodes"])
    found: dict[int, str] = {}
    for name, bone in named:
        node = bone.get("node")
        # Exporters of VRM 0 write -1 for a bone that the avatar does not have.
        if name and node is not None and node.value != -1:
            found.setdefault(node.whole(0, count), name.encode("utf-8", "replace").decode())
    return found
