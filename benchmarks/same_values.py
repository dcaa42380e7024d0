"""What differs between two files of the same kind, value by value; for same_results.py.

Knows USD (every value of every spec at every time sample), JSON, glTF, BVH, pages of `preview` and
text, and nothing of usdhand, so that it judges any two versions.
"""

from __future__ import annotations

import base64
import json
import math
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf

NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?!\w)")
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# The version of a file's writer, and how well its numbers could be packed, are no results.
NO_RESULTS = {"usdhand": str, "version": str, "generator": str, "bytes": int}


@dataclass(frozen=True)
class Difference:
    """One value that is not what it was.

    ``size`` is the largest absolute difference of numbers, NaN where it is none of numbers.
    """

    place: str
    what: str  # "changed", "missing" or "new"
    size: float = math.nan
    detail: str = ""


def file_differences(before: Path, after: Path) -> Iterator[Difference]:
    """What differs between two files, judged by what their kind of file means."""
    a, b = before.read_bytes(), after.read_bytes()
    if a == b:
        return
    suffix = before.suffix.lower()
    if suffix == ".usdz":
        yield from _package_differences(before, after)
    elif suffix in (".usda", ".usdc", ".usd"):
        yield from layer_differences(before, after)
    elif suffix in (".gltf", ".glb"):
        yield from _gltf_differences(_gltf(before), _gltf(after))
    elif suffix == ".json":
        yield from tree_differences(json.loads(a), json.loads(b))
    elif suffix == ".html":
        yield from tree_differences(_page_data(a), _page_data(b))
    elif suffix in (".bvh", ".svg", ".txt", ".csv", ".toml"):
        yield from text_differences(a.decode(), b.decode())
    else:
        yield Difference("", "changed", detail=f"{len(a)} -> {len(b)} bytes")


def text_differences(before: str, after: str, place: str = "") -> Iterator[Difference]:
    """What differs between two texts; where only numbers do, by how much."""
    if before == after:
        return
    a, b = ([float(n) for n in NUMBER.findall(text)] for text in (before, after))
    if NUMBER.sub("#", before) == NUMBER.sub("#", after) and a != b:
        yield Difference(place, "changed", float(np.max(np.abs(np.subtract(a, b)))), "numbers")
        return
    lines, others = before.splitlines(), after.splitlines()
    count = f"{len(lines)} -> {len(others)} lines"
    if sorted(filter(None, lines)) == sorted(filter(None, others)):
        order = "the same lines in another order" if len(lines) == len(others) else "empty ones"
        yield Difference(place, "changed", detail=f"{count}, {order}")
        return
    gone = [line for line in lines if line not in others] or ["(nothing)"]
    come = [line for line in others if line not in lines] or ["(nothing)"]
    shown = f"{gone[0][:200]!r} -> {come[0][:200]!r}"
    yield Difference(place, "changed", detail=f"{count}, first: {shown}")


def tree_differences(before: Any, after: Any, place: str = "") -> Iterator[Difference]:
    """What differs between two JSON values."""
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for key in [*before, *(k for k in after if k not in before)]:
            inner = f"{place}.{key}" if place else str(key)
            kind = NO_RESULTS.get(key)
            if kind and all(isinstance(tree.get(key), kind) for tree in (before, after)):
                continue
            if key not in after:
                yield Difference(inner, "missing", detail=_short(before[key]))
            elif key not in before:
                yield Difference(inner, "new", detail=_short(after[key]))
            else:
                yield from tree_differences(before[key], after[key], inner)
    elif isinstance(before, list) and isinstance(after, list) and not _numbers(before, after):
        if len(before) != len(after):
            detail = f"{len(before)} -> {len(after)} entries"
            yield Difference(place, "changed", detail=detail)
        for x, y in zip(before, after, strict=False):
            yield from tree_differences(x, y, f"{place}[]")
    else:
        yield from value_differences(before, after, place)


def value_differences(before: Any, after: Any, place: str) -> Iterator[Difference]:
    """What differs between two values that have no parts with names: numbers, arrays, text."""
    if type(before) is type(after) and _equal(before, after):
        return
    if isinstance(before, dict) and isinstance(after, dict):
        yield from tree_differences(before, after, place)
        return
    if isinstance(before, str) and isinstance(after, str) and ("\n" in before or " " in before):
        yield from text_differences(before, after, place)
        return
    a, b = _array(before), _array(after)
    if a is None or b is None or a.shape != b.shape or type(before) is not type(after):
        shape = "" if a is None or b is None else f", shapes {a.shape} -> {b.shape}"
        yield Difference(place, "changed", detail=f"{_short(before)} -> {_short(after)}{shape}")
        return
    both = np.isnan(a) & np.isnan(b) | (a == b)
    if both.all():
        return
    size = float(np.max(np.where(both, 0.0, np.abs(a - b))))
    turned = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0.0, -b, b) if a.ndim else b
    if "Quat" in type(before).__name__ and np.abs(a - turned).max() < 0.01 * size:
        rest = np.abs(a - turned).max()
        yield Difference(place, "changed", size, f"signs of quaternions, else by up to {rest:.2g}")
    else:
        yield Difference(place, "changed", size, f"{np.sum(~both)} of {a.size} numbers")


def layer_differences(before: Path, after: Path) -> Iterator[Difference]:
    """What differs between two USD layers: specs, their fields, values at all time samples."""
    a, b = (Sdf.Layer.OpenAsAnonymous(str(path)) for path in (before, after))
    theirs, ours = _paths(a), _paths(b)
    known, here = set(theirs), set(ours)
    yield from (Difference(str(path), "missing") for path in theirs if path not in here)
    yield from (Difference(str(path), "changed", detail="a new spec") for path in ours
                if path not in known)  # fmt: skip
    if [p for p in theirs if p in here] != [p for p in ours if p in known]:
        yield Difference("/", "changed", detail="specs in another order")
    for path in theirs:
        if path in here:
            yield from _spec_differences(a, b, path)


def _paths(layer: Sdf.Layer) -> list[Sdf.Path]:
    found: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, found.append)
    return found[::-1]


def _spec_differences(a: Sdf.Layer, b: Sdf.Layer, path: Sdf.Path) -> Iterator[Difference]:
    specs = a.GetObjectAtPath(path), b.GetObjectAtPath(path)
    if specs[0] is None or specs[1] is None:  # targets of relationships: their owner lists them
        return
    fields = [set(spec.ListInfoKeys()) - {"timeSamples"} for spec in specs]
    for field in sorted(fields[0] | fields[1]):
        place = f"{path} {field}"
        if field not in fields[1]:
            yield Difference(place, "missing", detail=_short(_info(a, specs[0], field)))
        elif field not in fields[0]:
            yield Difference(place, "changed", detail=f"new: {_short(_info(b, specs[1], field))}")
        else:
            pairs = zip((a, b), specs, strict=True)
            yield from value_differences(*(_info(*pair, field) for pair in pairs), place)
    times = [list(layer.ListTimeSamplesForPath(path)) for layer in (a, b)]
    if times[0] != times[1]:
        yield from value_differences(*times, f"{path} times of samples")
    for time in sorted(set(times[0]) & set(times[1])):
        values = [layer.QueryTimeSample(path, time) for layer in (a, b)]
        yield from value_differences(*values, f"{path} at samples")


def _info(layer: Sdf.Layer, spec: Sdf.Spec, field: str) -> Any:
    if field == "subLayerOffsets":  # which Python cannot have as it is
        return [[offset.offset, offset.scale] for offset in layer.subLayerOffsets]
    return spec.GetInfo(field)


def _package_differences(before: Path, after: Path) -> Iterator[Difference]:
    with (
        tempfile.TemporaryDirectory() as folder,
        zipfile.ZipFile(before) as a,
        zipfile.ZipFile(after) as b,
    ):
        yield from value_differences(a.namelist(), b.namelist(), "files in the package")
        for name in a.namelist():
            if name in b.namelist():
                pair = (a.extract(name, f"{folder}/a"), b.extract(name, f"{folder}/b"))
                for found in file_differences(*map(Path, pair)):
                    place = f"{name} {found.place}"
                    yield Difference(place, found.what, found.size, found.detail)


def _gltf(path: Path) -> tuple[dict[str, Any], list[bytes]]:
    """Document and buffers of a .glb or .gltf file."""
    raw = path.read_bytes()
    chunk = b""
    if raw[:4] == b"glTF":
        length = struct.unpack("<I", raw[12:16])[0]
        chunk, raw = raw[28 + length :], raw[20 : 20 + length]
    document = json.loads(raw)
    buffers = []
    for buffer in document.get("buffers", []):
        uri = buffer.get("uri")
        if uri is None:
            buffers.append(chunk)
        elif uri.startswith("data:"):
            buffers.append(base64.b64decode(uri.partition(",")[2]))
        else:
            buffers.append((path.parent / uri).read_bytes())
    return document, buffers


def _gltf_differences(a: Any, b: Any) -> Iterator[Difference]:
    """Documents without where their numbers stand, and the numbers of all accessors."""
    yield from tree_differences(*({k: v for k, v in d.items() if k not in ("buffers",)}
                                  for d, _ in (a, b)))  # fmt: skip
    counts = [len(document.get("accessors", [])) for document, _ in (a, b)]
    for i in range(min(counts)):
        yield from value_differences(_accessor(*a, i), _accessor(*b, i), f"accessor {i}")


def _accessor(document: dict[str, Any], buffers: list[bytes], index: int) -> list[Any]:
    accessor = document["accessors"][index]
    if "bufferView" not in accessor:
        return []
    view = document["bufferViews"][accessor["bufferView"]]
    kind = np.dtype(COMPONENTS[accessor["componentType"]])
    row = kind.itemsize * WIDTHS[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    step = view.get("byteStride", row)
    raw = buffers[view["buffer"]]
    rows = [raw[start + i * step :][:row] for i in range(accessor["count"])]
    return list(np.frombuffer(b"".join(rows), kind).astype(float).tolist())


def _page_data(page: bytes) -> Any:
    """The data in a page of preview, its packed arrays as numbers."""
    found = re.search(rb'id="page-data">(.*?)</script>', page, re.S)
    if found is None:
        return {"no data": page.decode()}
    document = json.loads(found[1])
    for holder in _holders(document):
        raw, start = zlib.decompress(base64.b64decode(holder["data"])), 0
        for array in holder["arrays"]:
            rows, columns, size = array["rows"], array["columns"], int(array["kind"][1])
            end = start + rows * columns * size
            planes = np.frombuffer(raw[start:end], "u1").reshape(size, columns, rows)
            steps = sum(plane.astype(f"u{size}") << (8 * k) for k, plane in enumerate(planes))
            whole = np.cumsum(steps, axis=1, dtype=f"u{size}").view(array["kind"])
            array["values"] = (array["middle"] + array["step"] * whole.T.astype(float)).tolist()
            start = end
        holder["data"] = raw[start:].hex()
    return document


def _holders(tree: Any) -> list[dict[str, Any]]:
    """Packs of arrays, wherever they stand."""
    if isinstance(tree, list):
        return [found for value in tree for found in _holders(value)]
    if not isinstance(tree, dict):
        return []
    if {"arrays", "data"} <= tree.keys():
        return [tree]
    return [found for value in tree.values() for found in _holders(value)]


def _numbers(*values: list[Any]) -> bool:
    return all(_array(value) is not None for value in values)


def _array(value: Any) -> np.ndarray | None:
    """A value as float64 numbers, None if it is none of numbers."""
    if isinstance(value, (str, bytes, bool)) or value is None:
        return None
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        return None
    return array.astype(float) if array.dtype.kind in "iuf" else None


def _equal(a: Any, b: Any) -> bool:
    same: Callable[[Any], Any] = np.all
    try:
        return bool(same(a == b))
    except (TypeError, ValueError):
        return False


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
