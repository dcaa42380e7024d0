"""Damaged glTF files: an error that says where, or a clip that is whole; nothing else."""

from __future__ import annotations

import contextlib
import copy
import json
import resource
import struct
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cost import at_most
from builders.gltf_files import GltfFile, arm, glb, moving_arm, turns
from test_gltf_vrm import vrm1

from usdhand.errors import InputError, UsageError
from usdhand.formats.gltf.read import animation_names, read_character, read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics

TIMES = np.arange(6) / 30.0
SECONDS = 5.0  # of the processor, for one small file
MEGABYTES = 1500


def everything() -> GltfFile:
    """A file with a bit of all that is read."""
    file = GltfFile()
    file.animation("a")
    armature = file.node("Armature", matrix=np.diag([0.01, 0.01, 0.01, 1.0]).ravel().tolist())
    nodes = arm(file, armature)
    shared = file.accessor(TIMES)
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
    "deep": (deep, "stands below 500 others"),
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
    "text": (put("accessors", 0, "count", value="6"), r"accessors\[0\]\.count is no whole number"),
    "no list": (put("nodes", value={}), "nodes is no JSON list"),
    "no object": (put("nodes", 3, value=[]), r"nodes\[3\] is no JSON object"),
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
    "no rotation": (put("nodes", 1, "rotation", value=[0, 0, 0, 0]), r"rotation has no length"),
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
        put("accessors", 10, "sparse", "indices", "componentType", value=5126), "no unsigned",
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
        (0, 0.01, r"accessors\[0\] has key times that go back, at key 2 \(0\.01 s\)"),
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
    assert_refused(file.write(tmp_path / "take.glb"), r"quaternion of no length at key 2")


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
    assert_refused(file.write(tmp_path / "take.glb"), "frames of 401 joints cannot be meant")


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
        ("data:application/octet-stream;base64,A!B", r"buffers\[0\] has a uri that is no base64"),
        ("data:application/octet-stream;base64,AAAA", r"buffers\[0\] has 3 bytes, not the"),
        ("data:", "data uri without a comma"),
        ("https://example.org/x.bin", "which is no file beside it"),
        ("/etc/passwd", "which is no file beside it"),
        ("../../../../../../../../dev/zero", "is missing"),
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
        (b"", "is no glTF: Expecting value at line 1:1"),
        (b"glTF", "ends at byte 4, within the header"),
        (whole[:-50], r"ends at byte \d+, but its header \(byte 8\) says"),
        (whole[:4] + b"\1\0\0\0" + whole[8:], r"version 1 \(byte 4\)"),
        (longer, "the chunk at byte 12 has 1000000000 bytes"),
        (whole[:16] + b"BIN\0" + whole[20:], r"the first chunk \(byte 12\) is no JSON"),
        (glb(b'{"asset": }', b""), "Expecting value at byte 30"),
        (glb(b'{"asset": "\xff"}', b""), "no text at byte 31"),
        (glb(b"[" * 100_000, b""), "nested too deeply"),
        (glb(b'{"nodes": ' + b"[" * 100_000, b""), "nested too deeply"),
        (glb(b"[]", b""), "its JSON is no object"),
        (glb(b'{"a": ' + b"9" * 10_000 + b"}", b""), "nested too deeply or has endless numbers"),
        (b'{\n "asset": 1,,\n}', "at line 2:13 of its JSON"),
        (b"\x89PNG\r\n", "no text at byte 0"),
    ):
        path.write_bytes(data)
        assert_refused(path, message)
    assert_refused(tmp_path / "gone.glb", "cannot be read")


# -- any damage at all --------------------------------------------------------------------------

NASTY: tuple[Any, ...] = (
    *(-1, 0, 1, 2, 5, 6, 7, 100, 65535, 2**31, 2**32, 2**63, 10**30, 10**400),
    *(0.5, 6.0, -0.0, 1e-320, 1e9, 1e39, 1e308, float("nan"), float("inf")),
    *(None, True, False, "", "x", "VEC3", "STEP", "rotation", "a/b", "\ud800", "\0\n", "n" * 3000),
    *([], [0], [[]], {}, {"node": 0}, [0] * 16, [1e8] * 4, [1, 2, 3]),
)


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Keys that lead to each value of a JSON document."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    return [at, *(place for key, child in items for place in places(child, (*at, key)))]


def mutated_json(document: dict[str, Any], random: np.random.Generator) -> dict[str, Any]:
    result = copy.deepcopy(document)
    for _ in range(random.integers(1, 4)):
        found = places(result)[1:]
        if not found:
            break
        *above, last = found[random.integers(len(found))]
        holder: Any = result
        for key in above:
            holder = holder[key]
        kind = random.integers(6)
        if kind == 0:
            del holder[last]
        elif kind == 1 and isinstance(holder, list):
            holder += [copy.deepcopy(holder[last])] * int(random.integers(1, 50))
        elif kind == 2 and isinstance(holder[last], (int, float)):
            holder[last] = holder[last] * int(random.integers(-2, 1000)) + 1
        else:
            holder[last] = copy.deepcopy(NASTY[random.integers(len(NASTY))])
    return result


def mutated_bytes(data: bytes, random: np.random.Generator) -> bytes:
    result = bytearray(data)
    for _ in range(random.integers(1, 5)):
        at = int(random.integers(len(result) + 1))
        kind = random.integers(5)
        if kind == 0:
            result[at : at + 1] = random.bytes(1)
        elif kind == 1:
            result[at : at + int(random.integers(1, 40))] = b""
        elif kind == 2:
            result[at:at] = random.bytes(int(random.integers(1, 40)))
        elif kind == 3 and at + 4 <= len(result):
            value = random.choice([np.nan, np.inf, -1.0, 0.0, 1e30, -3e38, 1e-40])
            struct.pack_into("<f", result, at // 4 * 4, value)
        elif kind == 4 and random.random() < 0.2:
            del result[at:]
    return bytes(result)


def assert_whole(clip: Clip) -> None:
    frames, joints = len(clip), len(clip.skeleton)
    assert clip.rotations.shape == (frames, joints, 4)
    assert clip.translations.shape == clip.scales.shape == (frames, joints, 3)
    assert np.abs(np.linalg.norm(clip.rotations, axis=-1) - 1.0).max() < 1e-6
    for values in (clip.translations, clip.scales, clip.skeleton.bind, clip.skeleton.rest):
        assert np.isfinite(values).all()
    assert np.isfinite(clip.times).all()
    assert len(set(clip.skeleton.joints)) == joints
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        pose = forward_kinematics(clip)
    assert np.isfinite(pose.positions).all()
    for text in (*clip.skeleton.joints, *clip.skeleton.aliases, *map(str, clip.problems)):
        text.encode()


def survives(path: Path) -> bool:
    """Whether a file could be read; if not, it was refused in words, soon."""
    read = False
    with at_most(SECONDS), warnings.catch_warnings():
        warnings.simplefilter("error")
        for use in (read_clip, read_character, first_of_all):
            with contextlib.suppress(InputError, UsageError):
                assert_whole(use(path))
                read = True
    return read


def first_of_all(path: Path) -> Clip:
    """The first animation, whatever its name is."""
    return read_clip(path, Reading(animation=next(iter(animation_names(path)), None)))


def fuzz(count: int, seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    file = everything()
    whole = file.write(tmp_path / "whole.glb").read_bytes()
    text = file.write(tmp_path / "whole.gltf").read_bytes()
    document = json.loads(text)
    read = 0
    for i in range(count):
        path = tmp_path / ("take.glb" if i % 2 else "take.gltf")
        kind = i % 6
        if kind == 0:
            path.write_text(json.dumps(mutated_json(document, random)))
        elif kind in (1, 3):
            changed = mutated_json(file.json, random)
            data = mutated_bytes(bytes(file.data), random) if kind == 3 else bytes(file.data)
            changed.setdefault("buffers", [{"byteLength": len(data)}])
            path.write_bytes(glb(json.dumps(changed).encode(), data))
        elif kind == 5:
            data = mutated_bytes(bytes(file.data), random)
            shorter = dict(file.json) | {"buffers": [{"byteLength": len(data)}]}
            path.write_bytes(glb(json.dumps(shorter).encode(), data))
        else:
            path.write_bytes(mutated_bytes(text if i % 2 == 0 and kind == 2 else whole, random))
        kept = path.read_bytes()
        try:
            read += survives(path)
        except BaseException:
            (tmp_path / f"failed{path.suffix}").write_bytes(kept)
            raise
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    assert peak < MEGABYTES
    # Some damage does no harm, most does: else the mutations would test nothing.
    assert 0.02 * count < read < 0.9 * count


def test_any_damage(tmp_path: Path) -> None:
    fuzz(700, 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
def test_much_damage(seed: int, tmp_path: Path) -> None:
    fuzz(8_000, seed, tmp_path)
