"""A clip written as glTF: an armature with its animation, without a mesh.

A skin that no mesh wears is enough: importers make bones of its joints (Blender an armature,
three.js ``Bone`` objects, Godot a skeleton), and nodes without a skin would become empties.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.formats.gltf.document import BINARY_CHUNK, JSON_CHUNK, MAGIC
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.plausible import LARGEST
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import decompose_trs
from usdhand.problems import Problem, counted
from usdhand.version import __version__

METRES = 0.01  # of a centimetre
# A joint that moves less is written once: 0.001 mm, and as much of a turn.
STILL_CM, STILL_TURN, STILL_SCALE = 1e-4, 1e-7, 1e-6
WORST_TIME = 0.02  # frames: how far single precision may move a key

FLOAT = 5126
INVERSE_BIND, MOTION = 0, 1  # buffer views
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def write_clip(clip: Clip, path: Path) -> tuple[Problem, ...]:
    """Write a clip to a .glb file, or to a .gltf file that holds its numbers itself.

    Joints get their names in the file that the clip was read from; lengths are metres, as glTF
    wants. What does not move is written once.

    Returns
    -------
    tuple of Problem
        what the format could not keep.

    Raises
    ------
    InputError
        if the clip holds what is no number.
    """
    for values in (clip.rotations, clip.translations, clip.scales, clip.skeleton.bind):
        if not np.isfinite(values).all():
            name = clip.origin.path or clip.name
            raise InputError(f"{name}: the motion has values that are not numbers.")
    times, problems = _times(clip)
    numbers = _Numbers()
    rest = _rest(clip.skeleton)
    inverse_bind = numbers.add(_inverse_bind(clip), INVERSE_BIND)
    animation = _animation(clip, times, rest, numbers)
    joints = range(1, len(clip.skeleton) + 1)
    name = clip.name or "Armature"
    document = {
        "asset": {"version": "2.0", "generator": f"usdhand {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": _nodes(clip.skeleton, name, rest),
        "skins": [
            {
                "name": name,
                "skeleton": 0,
                "joints": list(joints),
                "inverseBindMatrices": inverse_bind,
            }
        ],
        "animations": [animation],
        "accessors": numbers.accessors,
        "bufferViews": numbers.views,
        "buffers": [{"byteLength": len(numbers.data)}],
    }
    data = bytes(numbers.data)
    if path.suffix.lower() == ".gltf":
        text = base64.b64encode(data).decode()
        document["buffers"] = [
            {"byteLength": len(data), "uri": f"data:application/octet-stream;base64,{text}"}
        ]
        path.write_bytes(_json(document))
    else:
        path.write_bytes(_glb(_json(document), data))
    return (*problems, *_left_out(clip))


def _left_out(clip: Clip) -> Iterator[Problem]:
    if clip.shears:
        joint = clip.skeleton.joints[min(clip.shears)]
        message = f"glTF has no shear: that of {counted(len(clip.shears), 'joint')} is left out"
        yield Problem("sheared", message, joint)


@dataclass(frozen=True, eq=False)
class _Numbers:
    """The buffer as it grows, the views of its two parts, and the accessors into them."""

    data: bytearray = field(default_factory=bytearray)
    views: list[dict[str, int]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)

    def add(self, rows: NDArray[Any], view: int, bounds: bool = False) -> int:
        """Add rows (count, components) to the last view or a new one; return their accessor."""
        single = np.ascontiguousarray(rows, dtype="<f4")
        if view == len(self.views):
            self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": 0})
        holder = self.views[view]
        accessor: dict[str, Any] = {
            "bufferView": view,
            "byteOffset": holder["byteLength"],
            "componentType": FLOAT,
            "count": len(single),
            "type": TYPES[single.shape[1]],
        }
        if bounds:  # glTF wants those of key times
            accessor |= {"min": single.min(axis=0).tolist(), "max": single.max(axis=0).tolist()}
        self.data.extend(single.tobytes())
        holder["byteLength"] += single.nbytes
        self.accessors.append(accessor)
        return len(self.accessors) - 1


@dataclass(frozen=True, eq=False)
class _Rest:
    """Local rest transforms (joints, n); lengths in cm."""

    rotation: Array
    translation: Array
    scale: Array


def _rest(skeleton: Skeleton) -> _Rest:
    translation, rotation, scale = decompose_trs(skeleton.rest)
    return _Rest(rotation, translation, scale)


def _inverse_bind(clip: Clip) -> Array:
    """Inverse bind matrices (joints, 16) in metres, column by column.

    Raises
    ------
    InputError
        if a bind transform has no inverse in single precision.
    """
    bind = clip.skeleton.bind.copy()
    bind[:, :3, 3] *= METRES
    inverse = np.full_like(bind, np.nan)
    for joint, matrix in enumerate(bind):
        try:
            inverse[joint] = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            continue
    inverse[:, 3] = [0.0, 0.0, 0.0, 1.0]
    flat = np.flatnonzero(~(np.abs(inverse) <= LARGEST).all(axis=(1, 2)))
    if len(flat):
        raise InputError(
            f"{clip.origin.path or clip.name}: joint {clip.skeleton.joints[flat[0]]} has a bind "
            "transform without a usable inverse, which glTF needs. Give the joint a size above 0."
        )
    return np.asarray(inverse.swapaxes(1, 2).reshape(-1, 16))


def _times(clip: Clip) -> tuple[Array, tuple[Problem, ...]]:
    """Key times (frames,) as glTF can hold them: not negative, in single precision."""
    frames = np.arange(len(clip)) / clip.fps
    times = clip.start + frames
    if times[0] >= 0 and _survive(times, clip.fps):
        return times, ()
    reason = "be negative" if times[0] < 0 else "be exact that late"
    message = f"the clip starts at {clip.start:g} s; glTF times cannot {reason}: written from 0 s"
    problems = [Problem("start-time", message, clip.name)]
    if not _survive(frames, clip.fps):
        message = "the clip is too long for the precision of glTF times: frames are uneven"
        problems.append(Problem("uneven-times", message, clip.name))
    return frames, tuple(problems)


def _survive(times: Array, fps: float) -> bool:
    return bool(np.abs(times.astype(np.float32) - times).max() * fps < WORST_TIME)


def _nodes(skeleton: Skeleton, name: str, rest: _Rest) -> list[dict[str, Any]]:
    """An armature node, and below it a node for each joint."""
    roots = [j + 1 for j, parent in enumerate(skeleton.parents) if parent < 0]
    nodes: list[dict[str, Any]] = [{"name": name, "children": roots}]
    names = skeleton.originals or skeleton.names
    translations = (rest.translation * METRES).tolist()
    rotations, scales = rest.rotation.tolist(), rest.scale
    for joint, own in enumerate(names):
        node: dict[str, Any] = {"name": own}
        if below := skeleton.children[joint]:
            node["children"] = [child + 1 for child in below]
        node |= {"translation": translations[joint], "rotation": rotations[joint]}
        if np.abs(scales[joint] - 1.0).max() > STILL_SCALE:
            node["scale"] = scales[joint].tolist()
        nodes.append(node)
    return nodes


def _animation(clip: Clip, times: Array, rest: _Rest, numbers: _Numbers) -> dict[str, Any]:
    every = numbers.add(times[:, None], MOTION, bounds=True)
    once = numbers.add(times[:1, None], MOTION, bounds=True)
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []

    def channel(joint: int, path: str, values: Array, moves: bool) -> None:
        keys = values if moves else values[:1]
        samplers.append({"input": every if moves else once, "output": numbers.add(keys, MOTION)})
        target = {"node": joint + 1, "path": path}
        channels.append({"sampler": len(samplers) - 1, "target": target})

    # One curve has a key at every frame, so that the frame rate and the length are kept.
    turning = _moving(clip.rotations, STILL_TURN)
    turning[clip.skeleton.order[0]] = True
    moving, growing = _moving(clip.translations, STILL_CM), _moving(clip.scales, STILL_SCALE)
    for joint in range(len(clip.skeleton)):
        channel(joint, "rotation", rot.make_continuous(clip.rotations[:, joint]), turning[joint])
        t, s = clip.translations[:, joint], clip.scales[:, joint]
        if moving[joint] or np.abs(t[0] - rest.translation[joint]).max() > STILL_CM:
            channel(joint, "translation", t * METRES, moving[joint])
        if growing[joint] or np.abs(s[0] - rest.scale[joint]).max() > STILL_SCALE:
            channel(joint, "scale", s, growing[joint])
    return {"name": clip.name or "Motion", "samplers": samplers, "channels": channels}


def _moving(values: Array, still: float) -> NDArray[np.bool_]:
    """Which joints (joints,) have values (frames, joints, n) that change."""
    if values.strides[0] == 0:  # a view of one row for all frames
        return np.zeros(values.shape[1], dtype=bool)
    return np.asarray(np.ptp(values, axis=0).max(axis=1) > still)


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


def _glb(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    length = 12 + 8 + len(text) + 8 + len(data)
    return b"".join(
        [
            MAGIC,
            struct.pack("<II", 2, length),
            struct.pack("<II", len(text), JSON_CHUNK),
            text,
            struct.pack("<II", len(data), BINARY_CHUNK),
            data,
        ]
    )
