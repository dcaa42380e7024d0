"""Evaluation of glTF nodes from the specification, slow and obvious, over pygltflib.

Section 3.11 and appendix C of the glTF 2.0 specification; one node, one time, one number at a time.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest

pygltflib = pytest.importorskip("pygltflib", reason="no pygltflib: pip install 'usdhand[test]'")

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Oracle:
    def __init__(self, path: Path):
        self.gltf = pygltflib.GLTF2().load(str(path))
        self.rows: dict[int, list[tuple[float, ...]]] = {}

    def name(self, node: int) -> str:
        return self.gltf.nodes[node].name

    def world(self, node: int, animation: int | None, time: float) -> np.ndarray:
        """World matrix of a node at a time, metres."""
        matrix = self.local(node, animation, time)
        for i, other in enumerate(self.gltf.nodes):
            if node in (other.children or []):
                return self.world(i, animation, time) @ matrix
        return matrix

    def local(self, node: int, animation: int | None, time: float) -> np.ndarray:
        element = self.gltf.nodes[node]
        if element.matrix is not None:
            return np.array(element.matrix).reshape(4, 4).T
        trs = {
            "translation": element.translation or [0, 0, 0],
            "rotation": element.rotation or [0, 0, 0, 1],
            "scale": element.scale or [1, 1, 1],
        }
        if animation is not None:
            moved = self.gltf.animations[animation]
            for channel in moved.channels:
                if channel.target.node == node and channel.target.path in trs:
                    sampler = moved.samplers[channel.sampler]
                    turned = channel.target.path == "rotation"
                    trs[channel.target.path] = self.value(sampler, time, turned)
        x, y, z, w = np.array(trs["rotation"]) / np.linalg.norm(trs["rotation"])
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        matrix = np.eye(4)
        matrix[:3, :3] = rotation @ np.diag(trs["scale"])
        matrix[:3, 3] = trs["translation"]
        return matrix

    def value(self, sampler: object, time: float, turned: bool) -> list[float]:
        times = [row[0] for row in self.read(sampler.input)]
        values = [list(row) for row in self.read(sampler.output)]
        spline = sampler.interpolation == "CUBICSPLINE"
        keys = values[1::3] if spline else values
        if time <= times[0]:
            return keys[0]
        if time >= times[-1]:
            return keys[-1]
        k = max(i for i, t in enumerate(times) if t <= time)
        length = times[k + 1] - times[k]
        t = (time - times[k]) / length
        a, b = keys[k], keys[k + 1]
        if sampler.interpolation == "STEP":
            return a
        if spline:
            out, into = values[3 * k + 2], values[3 * (k + 1)]
            return [
                (2 * t**3 - 3 * t**2 + 1) * p
                + length * (t**3 - 2 * t**2 + t) * m
                + (-2 * t**3 + 3 * t**2) * q
                + length * (t**3 - t**2) * n
                for p, q, m, n in zip(a, b, out, into, strict=True)
            ]
        if not turned:
            return [p + (q - p) * t for p, q in zip(a, b, strict=True)]
        dot = sum(p * q for p, q in zip(a, b, strict=True))
        angle = math.acos(min(1.0, abs(dot)))
        if angle < 1e-6:
            return [p + (math.copysign(1.0, dot) * q - p) * t for p, q in zip(a, b, strict=True)]
        return [
            math.sin(angle * (1 - t)) / math.sin(angle) * p
            + math.copysign(1.0, dot) * math.sin(angle * t) / math.sin(angle) * q
            for p, q in zip(a, b, strict=True)
        ]

    def read(self, index: int) -> list[tuple[float, ...]]:
        if index not in self.rows:
            self.rows[index] = self._read(index)
        return self.rows[index]

    def _read(self, index: int) -> list[tuple[float, ...]]:
        accessor = self.gltf.accessors[index]
        width = WIDTHS[accessor.type]
        if accessor.bufferView is None:
            rows = [(0.0,) * width] * accessor.count
        else:
            rows = self._view(
                accessor.bufferView, accessor.byteOffset or 0, accessor.componentType,
                accessor.count, width,
            )  # fmt: skip
        if accessor.sparse:
            sparse = accessor.sparse
            places = self._view(
                sparse.indices.bufferView, sparse.indices.byteOffset or 0,
                sparse.indices.componentType, sparse.count, 1,
            )  # fmt: skip
            values = self._view(
                sparse.values.bufferView, sparse.values.byteOffset or 0,
                accessor.componentType, sparse.count, width,
            )  # fmt: skip
            for (place,), value in zip(places, values, strict=True):
                rows[place] = value
        if accessor.normalized:
            largest = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}[accessor.componentType]
            rows = [tuple(max(v / largest, -1.0) for v in row) for row in rows]
        return rows

    def _view(
        self, index: int, offset: int, component: int, count: int, width: int
    ) -> list[tuple[float, ...]]:
        view = self.gltf.bufferViews[index]
        buffer = self.gltf.buffers[view.buffer]
        data = self.gltf.get_data_from_buffer_uri(buffer.uri)
        form = f"<{width}{FORMATS[component]}"
        step = view.byteStride or struct.calcsize(form)
        start = (view.byteOffset or 0) + offset
        return [struct.unpack_from(form, data, start + i * step) for i in range(count)]
