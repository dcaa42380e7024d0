"""What the ufbx library says of one FBX file, as JSON and numbers on standard output.

usage: python -I -S worker.py '{"library": FOLDER_OF_UFBX, "path": FILE.fbx, "sample": true,
    "animation": NAME or null, "fps": what a file does not say or null, "memory": BYTES,
    "rates": [SLOWEST, FASTEST] that a file may mean}'

Runs in a process of its own, because a damaged file can crash a C library, and because the
bindings (0.0.5) count references wrongly: an element that is asked for twice is freed while it is
in use. So every element that is asked for is held for good, nothing is collected, and the process
ends without tidying up. Only ufbx and the standard library are imported here.
"""

from __future__ import annotations

import array
import contextlib
import gc
import importlib
import json
import os
import sys
from collections.abc import Iterable
from itertools import pairwise
from statistics import median
from typing import Any

MAX_FRAMES = 200_000  # nearly an hour at 60 fps
BLANK_FACTOR = 10.0  # a take that lasts this many times longer than its keys is not meant
ALIVE: list[list[Any]] = []


def held(items: Iterable[Any]) -> list[Any]:
    """Elements of a ufbx list, never to be freed."""
    found = list(items)
    ALIVE.append(found)
    return found


def main(request: dict[str, Any]) -> None:
    """Describe a file; sample the chosen animation, or the only one that has keys.

    Without a frame rate it is not sampled: the key times of its longest curve are told instead.
    """
    _limit(request["memory"])
    sys.path.append(request["library"])
    ufbx: Any = importlib.import_module("ufbx")
    try:
        scene = _load(ufbx, request["path"])
    except ufbx.UnknownError:
        return _answer({"error": "its contents are damaged"})
    except (ufbx.UfbxError, ValueError) as error:
        return _answer({"error": str(error)})
    nodes, stacks = held(scene.nodes), held(scene.anim_stacks)
    header = _header(scene, nodes, stacks, request["rates"])
    keys = [stack.pop("keys") for stack in header["stacks"]]
    name = request["animation"]
    keyed = [i for i, stack in enumerate(header["stacks"]) if stack["moved"]]
    wanted = [i for i in keyed if name is None or name == header["stacks"][i]["name"]]
    if len(wanted) != 1 or not request["sample"]:
        return _answer(header)
    [chosen] = wanted
    stack = header["stacks"][chosen]
    fps = header["fps"] or request["fps"]
    if fps is None:
        return _answer(header | {"keys": keys[chosen]})
    first, count, by_keys = _frames(stack, fps)
    if not 0 < count <= MAX_FRAMES:
        return _answer({"error": f"the keys span {count} frames; at most {MAX_FRAMES} are read"})
    header["sampled"] = {"stack": chosen, "fps": fps, "first": first, "count": count}
    header["sampled"]["by_keys"] = by_keys
    times = [(first + frame) / fps for frame in range(count)]
    moved = [nodes[i] for i in stack["moved"]]
    return _answer(header, _samples(ufbx.evaluate_transform, stacks[chosen].anim, moved, times))


def _load(ufbx: Any, path: str) -> Any:
    with open(path, "rb") as file:  # noqa: PTH123  (pathlib takes time to import)
        data = file.read()
    return ufbx.load_memory(
        data,
        file_format=ufbx.FileFormat.FBX,
        ignore_embedded=True,
        skip_skin_vertices=True,
        skip_mesh_parts=True,
    )


def _header(
    scene: Any, nodes: list[Any], stacks: list[Any], rates: tuple[float, float]
) -> dict[str, Any]:
    """Everything but the samples; ``fps`` is None where the file does not say."""
    index = {node.element_id: i for i, node in enumerate(nodes)}
    settings = scene.settings
    fps, said = settings.frames_per_second, settings.time_mode.name != "DEFAULT"
    return {
        "version": scene.metadata.version,
        "unit_meters": settings.unit_meters,
        "axes": [int(axis) for axis in settings.axes],
        "fps": fps if said and rates[0] <= fps <= rates[1] else None,
        "nodes": [_node(node, index) for node in nodes],
        "stacks": [_stack(stack, index) for stack in stacks],
        **_bind(scene, index),
    }


def _limit(memory: int) -> None:
    """Let a damaged file not take all memory, where the system knows limits."""
    try:
        import resource
    except ImportError:
        return
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    with contextlib.suppress(ValueError, OSError):  # macOS knows the limit but not how to set it
        if hard == resource.RLIM_INFINITY or memory < hard:
            resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _samples(evaluate: Any, anim: Any, nodes: list[Any], times: list[float]) -> array.array[float]:
    """Translation, rotation and scale of each node at each time: 10 numbers."""
    values = array.array("d")
    for time in times:
        for node in nodes:
            place, turn, size = evaluate(anim, node, time)
            values.extend((*place, *turn, *size))
    return values


def _node(node: Any, index: dict[int, int]) -> dict[str, Any]:
    parent, scale_node = node.parent, node.inherit_scale_node
    place, turn, size = node.local_transform
    return {
        "name": node.name,
        "parent": -1 if parent is None else index[parent.element_id],
        "kind": node.attrib_type.name,
        "inherit": node.inherit_mode.name,
        "scale_node": -1 if scale_node is None else index[scale_node.element_id],
        "local": (*place, *turn, *size),
    }


def _stack(stack: Any, index: dict[int, int]) -> dict[str, Any]:
    """Nodes that have keys, and when: of the curves on anything but their visibility.

    A curve of one key is constant: it tells the span only where there are no others.
    """
    moved: set[int] = set()
    spans: list[tuple[float, float]] = []
    still: list[tuple[float, float]] = []
    longest = None
    for layer in held(stack.layers):
        for prop in held(layer.anim_props):
            node = index.get(prop.element.element_id)
            if node is None or prop.prop_name.startswith("Visibility"):
                continue
            for curve in prop.anim_value.curves:
                if curve is None or not len(curve.keyframes):
                    continue
                moved.add(node)
                several = len(curve.keyframes) > 1
                (spans if several else still).append((curve.min_time, curve.max_time))
                if longest is None or len(curve.keyframes) > len(longest.keyframes):
                    longest = curve
    spans = spans or still[:1] or [(float("inf"), -float("inf"))]
    keys = [] if longest is None else [key.time for key in held(longest.keyframes)]
    steps = [b - a for a, b in pairwise(keys)]
    return {
        "name": stack.name,
        "begin": stack.time_begin,
        "end": stack.time_end,
        "first": min(first for first, _ in spans),
        "last": max(last for _, last in spans),
        "keys": keys,
        "spacing": median(steps) if steps else 0.0,  # usual distance of two keys, seconds
        "moved": sorted(moved),
    }


def _frames(stack: dict[str, Any], fps: float) -> tuple[float, int, bool]:
    """Start in frames, number of frames, and whether the keys decide.

    They do where the take's own span is empty, off the keys, or far longer than them.
    """
    begin, end, first, last = (stack[k] for k in ("begin", "end", "first", "last"))
    by_keys = not (begin < end and begin <= last and end >= first) or (
        end - begin > BLANK_FACTOR * max(last - first, 1.0)
    )
    if by_keys:
        begin, end = first, last
    start = float(round(begin * fps))
    if abs(start - begin * fps) > 1e-3:
        start = begin * fps
    frames = end * fps - start
    return start, int(frames + 1e-3) + 1 if frames < 1e12 else sys.maxsize, by_keys


def _bind(scene: Any, index: dict[int, int]) -> dict[str, Any]:
    """World matrices of the bind pose, by node: of skin clusters and of pose objects."""
    clusters: dict[int, list[Any]] = {}
    for cluster in held(scene.skin_clusters):
        if cluster.bone_node is not None:
            clusters.setdefault(index[cluster.bone_node.element_id], _flat(cluster.bind_to_world))
    posed: dict[int, list[Any]] = {}
    for pose in held(scene.poses):
        for bone in held(pose.bone_poses) if pose.is_bind_pose else ():
            posed.setdefault(index[bone.bone_node.element_id], _flat(bone.bone_to_world))
    return {"clusters": list(clusters.items()), "poses": list(posed.items())}


def _flat(matrix: Any) -> list[float]:
    return [number for column in matrix for number in column]


def _answer(header: dict[str, Any], values: array.array[float] | None = None) -> None:
    out = sys.stdout.buffer
    out.write(json.dumps(header).encode() + b"\n")
    out.write(b"" if values is None else values.tobytes())
    out.flush()


if __name__ == "__main__":
    gc.disable()
    main(json.loads(sys.argv[1]))
    os._exit(0)
