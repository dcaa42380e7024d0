"""glTF files with faults that have a name: the error says where."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cost import at_most
from builders.gltf_files import GltfFile, everything, glb, moving_arm, turns

from usdhand.errors import InputError
from usdhand.formats.gltf.read import animation_names, read_clip
from usdhand.formats.reading import Reading

TIMES = np.arange(6) / 30.0
SECONDS = 5.0  # of the processor, for one small file


# -- faults that have a name --------------------------------------------------------------------


def put(*keys: Any, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        holder: Any = document
        for key in keys[:-1]:
            holder = holder[key]
        holder[keys[-1]] = value

    return change


def deep(document: dict[str, Any]) -> None:
    start = len(document["nodes"])
    document["nodes"] += [{"children": [start + i + 1]} for i in range(3000)] + [{}]


FAULTS = {
    "missing node": (put("nodes", 1, "children", value=[99]), r"nodes\[1\]\.children\[0\] is 99"),
    "negative node": (put("nodes", 1, "children", value=[-1]), r"children\[0\] is -1"),
    "cycle": (put("nodes", 6, "children", value=[1]), r"nodes\[\d\] has node \d as a child"),
    "loop": (put("nodes", 0, "children", value=[0]), r"has node|below itself"),
    "deep": (deep, "is below 500 others"),
    "huge count": (put("accessors", 0, "count", value=10**12), r"accessors\[0\] has a count of"),
    "endless count": (put("accessors", 0, "count", value=10**400), r"accessors\[0\] has a count"),
    "negative count": (put("accessors", 0, "count", value=-6), r"accessors\[0\]\.count is -6"),
    "no count": (put("accessors", 0, "count", value=None), r"accessors\[0\] has no 'count'"),
    "far offset": (put("accessors", 1, "byteOffset", value=10**9), r"accessors\[1\] needs 1000000"),
    "view too long": (
        put("bufferViews", 0, "byteLength", value=10**9), r"bufferViews\[0\] ends at byte 1000000",
    ),
    "view before": (put("bufferViews", 0, "byteOffset", value=-4), r"byteOffset is -4"),
    "no such view": (put("accessors", 0, "bufferView", value=99), r"accessors\[0\]\.bufferView is"),
    "no such buffer": (put("bufferViews", 0, "buffer", value=7), r"bufferViews\[0\]\.buffer is 7"),
    "stride": (put("bufferViews", 0, "byteStride", value=1), r"byteStride of 1, less than the 4"),
    "type": (put("accessors", 1, "type", value="VEC3"), r"type 'VEC3', not VEC4"),
    "component": (put("accessors", 0, "componentType", value=7), "componentType is 7, which"),
    "text": (
        put("accessors", 0, "count", value="6"), r"accessors\[0\]\.count is not a whole number"
    ),
    "no list": (put("nodes", value={}), "nodes is not a JSON list"),
    "no object": (put("nodes", 3, value=[]), r"nodes\[3\] is not a JSON object"),
    "too few rows": (put("accessors", 1, "count", value=5), "has 5 rows for 6 keys"),
    "no such accessor": (
        put("animations", 0, "samplers", 0, "input", value=77), r"samplers\[0\]\.input is 77",
    ),
    "no such sampler": (
        put("animations", 0, "channels", 0, "sampler", value=77), r"channels\[0\]\.sampler is 77",
    ),
    "interpolation": (
        put("animations", 0, "samplers", 0, "interpolation", value="EASE"), "interpolation 'EASE'",
    ),
    "no rotation": (put("nodes", 1, "rotation", value=[0, 0, 0, 0]), r"rotation has length zero"),
    "three numbers": (put("nodes", 1, "rotation", value=[0, 0, 0]), r"has 3 numbers, not 4"),
    "huge number": (put("nodes", 1, "translation", value=[1e300, 0, 0]), r"translation\[0\] is 1e"),
    "endless number": (put("nodes", 1, "scale", value=[10**400, 0, 0]), r"scale\[0\] is huge"),
    "not a number": (put("nodes", 1, "scale", value=[float("nan"), 1, 1]), r"holds NaN, which is"),
    "no joints": (put("skins", 0, "joints", value=[]), r"skins\[0\]\.joints is empty"),
    "joint twice": (put("skins", 0, "joints", value=[1, 1]), "lists a joint twice"),
    "too many skins": (
        lambda d: d["skins"].extend([d["skins"][0]] * 600), "more than 500 skins",
    ),
    "bind rows": (put("accessors", -1, "count", value=2), "has a count of 2, not 6"),
    "packed": (
        put("bufferViews", 0, "extensions", value={"EXT_meshopt_compression": {}}),
        r"bufferViews\[0\] is compressed with EXT_meshopt_compression, which is not read",
    ),
    "old": (put("asset", "version", value="1.0"), "is glTF 1.0"),
    "sparse row": (
        put("accessors", 10, "sparse", "indices", "componentType", value=5126), "not unsigned",
    ),
    "sparse count": (put("accessors", 10, "sparse", "count", value=10**9), r"sparse replaces more"),
    "cameras only": (
        lambda d: [d.pop(k) for k in ("skins", "animations", "extensions")] + [d["nodes"].pop()],
        "no character",
    ),
    "animation of others": (
        lambda d: [c["target"].update(node=7) for c in d["animations"][0]["channels"]],
        "moves none of the 6 joints",
    ),
}  # fmt: skip


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_named(name: str, suffix: str, tmp_path: Path) -> None:
    change, message = FAULTS[name]
    file = everything()
    change(file.json)
    assert_refused(file.write(tmp_path / f"take{suffix}"), message)


def assert_refused(path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_clip(path)
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def numbers_changed(at: int, value: float) -> GltfFile:
    file = everything()
    view = file.json["bufferViews"][file.json["accessors"][at]["bufferView"]]
    struct.pack_into("<f", file.data, view["byteOffset"] + 8, value)
    return file


@pytest.mark.parametrize(
    ("accessor", "value", "message"),
    [
        (0, 0.01, r"accessors\[0\] has key times that decrease, at key 2 \(0\.01 s\)"),
        (0, np.nan, r"accessors\[0\] holds nan in row 2"),
        (0, np.inf, r"accessors\[0\] holds inf in row 2"),
        (1, np.nan, r"accessors\[1\] holds nan in row 0"),
        (1, 3e38, r"accessors\[1\] holds 3e\+38 in row 0"),
    ],
)
def test_numbers_that_are_none(accessor: int, value: float, message: str, tmp_path: Path) -> None:
    assert_refused(numbers_changed(accessor, value).write(tmp_path / "take.glb"), message)


def test_a_quaternion_of_no_length(tmp_path: Path) -> None:
    file = everything()
    view = file.json["bufferViews"][1]
    file.data[view["byteOffset"] + 32 : view["byteOffset"] + 48] = bytes(16)
    assert_refused(file.write(tmp_path / "take.glb"), r"quaternion of length zero at key 2")


def test_keys_far_apart(tmp_path: Path) -> None:
    path = moving_arm(np.array([0.0, 0.0333, 1e8])).write(tmp_path / "take.glb")
    assert_refused(path, "would make more than 1000000 frames")


def test_more_frames_than_memory(tmp_path: Path) -> None:
    file = GltfFile()
    file.animation()
    nodes = [file.node("root")]
    nodes += [file.node(f"n{i}", nodes[0]) for i in range(400)]
    shared, still = file.accessor([0.0, 10_000.0]), file.accessor(turns(2, 1))
    for node in nodes:
        file.curve(node, "rotation", shared, still)
    assert_refused(file.write(tmp_path / "take.glb"), "frames of 401 joints are not plausible")


def test_overlapping_accessors(tmp_path: Path) -> None:
    """A thousand curves of the same bytes, each with an accessor of its own."""
    file = GltfFile()
    file.animation()
    root = file.node("root")
    count = 50_000
    shared = file.accessor(np.arange(count) / 30.0)
    turned = file.accessor(np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
    for i in range(1000):
        again = file.add("accessors", dict(file.json["accessors"][turned]))
        file.curve(file.node(f"n{i}", root), "rotation", shared, again)
    message = "need more numbers than the file has bytes"
    assert_refused(file.write(tmp_path / "take.glb"), message)


def test_many_of_one_name(tmp_path: Path) -> None:
    file = GltfFile()
    root = file.node("root")
    shared, turned = file.accessor(TIMES), file.accessor(turns(6, 1))
    for i in range(600):
        file.animation("same")
        file.curve(file.node("same", root), "rotation", shared, turned, animation=i)
    path = file.write(tmp_path / "take.glb")
    with at_most(SECONDS):
        assert animation_names(path)[-1] == "same_600"
        clip = read_clip(path, Reading(animation="same_7"))
        assert len(set(clip.skeleton.joints)) == 600


def test_buffers_that_are_none(tmp_path: Path) -> None:
    path = tmp_path / "take.gltf"
    for uri, message in (
        ("data:application/octet-stream;base64,A!B", r"buffers\[0\] has a uri that is not base64"),
        ("data:application/octet-stream;base64,AAAA", r"buffers\[0\] has 3 bytes, not the"),
        ("data:", "data uri without a comma"),
        ("https://example.org/x.bin", "which is not a file beside it"),
        ("/etc/passwd", "which is not a file beside it"),
        ("../../../../../../../../dev/zero", "which is not a file beside it"),
        ("sub/../../take.bin", "which is not a file beside it"),
        ("%2Fetc%2Fpasswd", "which is not a file beside it"),
        ("%2e%2e/take.bin", "which is not a file beside it"),
        ("..%5Ctake.bin", "which is not a file beside it"),
        ("C%3A%5Ctake.bin", "which is not a file beside it"),
        ("gone.bin", "gone.bin is missing"),
        ("a\0b", "cannot be read|is missing"),
        ("x" * 5000, "cannot be read|is missing"),
    ):
        assert_refused(everything().write(path, uri=uri), message)
    (tmp_path / "gone.bin").mkdir()
    assert_refused(everything().write(path, uri="gone.bin"), "gone.bin is missing")
    file = everything()
    file.json["buffers"] = []
    assert_refused(file.write(tmp_path / "take.glb"), r"bufferViews\[\d+\]\.buffer is 0")


def test_containers_that_are_none(tmp_path: Path) -> None:
    whole = everything().write(tmp_path / "whole.glb").read_bytes()
    path = tmp_path / "take.glb"
    longer = whole[:12] + struct.pack("<I", 10**9) + whole[16:]
    for data, message in (
        (b"", "is not glTF: Expecting value at line 1:1"),
        (b"glTF", "ends at byte 4, within the header"),
        (whole[:-50], r"ends at byte \d+, but its header \(byte 8\) says"),
        (whole[:4] + b"\1\0\0\0" + whole[8:], r"version 1 \(byte 4\)"),
        (longer, "the chunk at byte 12 has 1000000000 bytes"),
        (whole[:16] + b"BIN\0" + whole[20:], r"the first chunk \(byte 12\) is not JSON"),
        (glb(b'{"asset": }', b""), "Expecting value at byte 30"),
        (glb(b'{"asset": "\xff"}', b""), "no text at byte 31"),
        (glb(b"[" * 100_000, b""), "nested too deeply"),
        (glb(b'{"nodes": ' + b"[" * 100_000, b""), "nested too deeply"),
        (glb(b"[]", b""), "its JSON is not an object"),
        (glb(b'{"a": ' + b"9" * 10_000 + b"}", b""), "has numbers that are too long"),
        (b'{\n "asset": 1,,\n}', "at line 2:13 of its JSON"),
        (b"\x89PNG\r\n", "no text at byte 0"),
    ):
        path.write_bytes(data)
        assert_refused(path, message)
    assert_refused(tmp_path / "gone.glb", "cannot be read")
