"""Small glTF files for tests, built as exporters build them."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from usdhand.motion import Skeleton
from usdhand.motion import rotations as rot

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass
class GltfFile:
    """A glTF document as it is built up."""

    json: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}})
    data: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, value: dict[str, Any]) -> int:
        self.json.setdefault(kind, []).append(value)
        return len(self.json[kind]) - 1

    def node(self, name: str | None, parent: int | None = None, **more: Any) -> int:
        node = self.add("nodes", ({} if name is None else {"name": name}) | more)
        if parent is not None:
            self.json["nodes"][parent].setdefault("children", []).append(node)
        return node

    def view(self, raw: bytes, **more: Any) -> int:
        self.data.extend(b"\0" * (-len(self.data) % 4))
        start = len(self.data)
        self.data.extend(raw)
        return self.add(
            "bufferViews",
            {"buffer": 0, "byteOffset": start, "byteLength": len(raw)} | more,
        )

    def accessor(
        self, rows: Any, component: str = "f4", stride: int = 0, offset: int = 0, **more: Any
    ) -> int:
        values = np.asarray(rows, float).reshape(len(rows), -1)
        if more.get("normalized"):
            values = np.round(values * np.iinfo(component).max)
        packed = values.astype(f"<{component}")
        size = packed[0].nbytes
        step = stride or size
        raw = bytearray(offset + step * (len(packed) - 1) + size)
        for i, row in enumerate(packed):
            raw[offset + i * step : offset + i * step + size] = row.tobytes()
        view = self.view(bytes(raw), **({"byteStride": stride} if stride else {}))
        return self.add(
            "accessors",
            {
                "bufferView": view,
                "byteOffset": offset,
                "componentType": COMPONENTS[component],
                "count": len(packed),
                "type": TYPES[packed.shape[1]],
            }
            | more,
        )

    def animation(self, name: str | None = None) -> int:
        named = {} if name is None else {"name": name}
        return self.add("animations", {"samplers": [], "channels": []} | named)

    def curve(
        self,
        node: int,
        path: str,
        times: Any,
        values: Any,
        interpolation: str | None = None,
        animation: int = 0,
    ) -> None:
        """``times`` and ``values``: rows, or the number of an accessor."""
        inputs = times if isinstance(times, int) else self.accessor(times)
        outputs = values if isinstance(values, int) else self.accessor(values)
        sampler = {"input": inputs, "output": outputs}
        sampler |= {"interpolation": interpolation} if interpolation else {}
        target = self.json["animations"][animation]
        target["samplers"].append(sampler)
        target["channels"].append(
            {"sampler": len(target["samplers"]) - 1, "target": {"node": node, "path": path}}
        )

    def skin(self, joints: Sequence[int], bind: Any = None, **more: Any) -> int:
        """``bind``: (joints, 4, 4) bind matrices in the space of the mesh."""
        skin: dict[str, Any] = {"joints": list(joints)} | more
        if bind is not None:
            inverse = np.linalg.inv(bind).swapaxes(1, 2).reshape(len(bind), 16)
            skin["inverseBindMatrices"] = self.accessor(inverse)
        return self.add("skins", skin)

    def write(self, path: Path, uri: str | None = None) -> Path:
        """Write .glb, or .gltf with its buffer inside; with a ``uri``, the buffer is left out."""
        document = dict(self.json)
        data = bytes(self.data)
        if path.suffix != ".gltf":
            document.setdefault("buffers", [{"byteLength": len(data)}])
            path.write_bytes(glb(json.dumps(document).encode(), data))
            return path
        text = base64.b64encode(data).decode()
        uri = uri or f"data:application/octet-stream;base64,{text}"
        document["buffers"] = [{"byteLength": len(data), "uri": uri}]
        path.write_text(json.dumps(document))
        return path


def glb(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def turns(count: int, seed: int) -> np.ndarray:
    """Rotations (count, 4) that wander smoothly."""
    random = np.random.default_rng(seed)
    angles = np.cumsum(random.normal(0.0, 0.2, (count, 3)), axis=0)
    length = np.linalg.norm(angles, axis=1, keepdims=True)
    return rot.from_axis_angle(angles / length, length[:, 0])


def arm(file: GltfFile, above: int | None = None, names: Sequence[str] = ()) -> list[int]:
    """Hips, an arm and three fingers' first joints, with turned rest poses; metres."""
    names = names or ("Hips", "Spine", "LeftArm", "LeftHand", "LeftIndex1", "LeftIndex2")
    nodes: list[int] = []
    for i, name in enumerate(names):
        parent = nodes[-1] if nodes else above
        rotation = turns(2, 50 + i)[1].tolist()
        nodes.append(
            file.node(name, parent, translation=[0.1, 0.2 + 0.01 * i, -0.05], rotation=rotation)
        )
    return nodes


def moving_arm(times: Any, **more: Any) -> GltfFile:
    """An arm without a skin, every joint turned at ``times``."""
    file = GltfFile()
    file.animation("wave")
    shared = file.accessor(times)
    for i, node in enumerate(arm(file)):
        file.curve(node, "rotation", shared, turns(len(times), i), **more)
    return file


def from_skeleton(skeleton: Skeleton, names: Sequence[str] | None = None) -> GltfFile:
    """The nodes of a skeleton in cm: node 0 above, joint j as node j + 1."""
    file = GltfFile()
    file.node("Root")
    rest = skeleton.rest
    for joint, name in enumerate(names or skeleton.names):
        matrix = rest[joint].copy()
        matrix[:3, 3] *= 0.01
        file.node(name, translation=matrix[:3, 3].tolist())
    for joint, parent in enumerate(skeleton.parents):
        file.json["nodes"][int(parent) + 1].setdefault("children", []).append(joint + 1)
    return file


def vrm1(bones: dict[int, str], name: str = "VRMC_vrm") -> dict[str, Any]:
    return {name: {"humanoid": {"humanBones": {b: {"node": n} for n, b in bones.items()}}}}


def everything() -> GltfFile:
    """A file with a bit of all that is read."""
    file = GltfFile()
    file.animation("a")
    armature = file.node("Armature", matrix=np.diag([0.01, 0.01, 0.01, 1.0]).ravel().tolist())
    nodes = arm(file, armature)
    shared = file.accessor(np.arange(6) / 30.0)
    for i, node in enumerate(nodes):
        file.curve(node, "rotation", shared, turns(6, i), ["LINEAR", "STEP"][i % 2])
    spline = np.random.default_rng(1).normal(size=(18, 3))
    file.curve(nodes[0], "translation", shared, spline, "CUBICSPLINE")
    file.curve(nodes[2], "scale", shared, 1.0 + 0.1 * np.abs(spline[:6]))
    packed = file.accessor(turns(6, 9), "i2", stride=12, normalized=True)
    file.curve(armature, "rotation", shared, packed)
    sparse = {
        "count": 2,
        "indices": {"bufferView": file.view(bytes([0, 4])), "componentType": 5121},
        "values": {"bufferView": file.view(np.arange(6.0).astype("<f4").tobytes())},
    }
    zeros = {"componentType": 5126, "count": 6, "type": "VEC3", "sparse": sparse}
    file.curve(nodes[4], "translation", shared, file.add("accessors", zeros))
    file.json["meshes"] = [{"primitives": []}]
    bind = np.tile(np.eye(4), (6, 1, 1))
    bind[:, 1, 3] = range(6)
    file.node("Body", mesh=0, skin=file.skin(nodes, bind, name="Body", skeleton=armature))
    file.skin(nodes[3:], name="Glove")
    file.json["extensions"] = vrm1({nodes[0]: "hips", nodes[3]: "leftHand"})
    return file
