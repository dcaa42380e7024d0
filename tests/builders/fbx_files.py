"""Small ASCII FBX files written from a description, and a plain evaluation of the same.

Source of the evaluation: "Computing transformation matrices" and "Transformation data" in the
documentation of the FBX SDK.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

SECOND = 46186158000  # FBX ticks
ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
COMPONENTWISE, NORMAL, NO_PARENT_SCALE = 0, 1, 2  # FBX InheritType: RrSs, RSrs, Rrs
Vector = tuple[float, float, float]
Keys = Sequence[tuple[float, ...]]  # seconds, value and, for smooth curves, slope a second

KINDS = {
    "RotationOffset": "Vector3D",
    "RotationPivot": "Vector3D",
    "ScalingOffset": "Vector3D",
    "ScalingPivot": "Vector3D",
    "PreRotation": "Vector3D",
    "PostRotation": "Vector3D",
    "Lcl Translation": "Lcl Translation",
    "Lcl Rotation": "Lcl Rotation",
    "Lcl Scaling": "Lcl Scaling",
}


@dataclass(frozen=True)
class Node:
    """A node: its parent in the list (-1: the scene), vectors, keys by property and axis."""

    name: str
    parent: int = -1
    kind: str = "LimbNode"
    vectors: Mapping[str, Vector] = field(default_factory=dict)
    order: int = 0
    inherit: int = NORMAL
    keys: Mapping[tuple[str, str], Keys] = field(default_factory=dict)  # of the first take
    more_keys: Mapping[str, Mapping[tuple[str, str], Keys]] = field(default_factory=dict)

    def vector(self, name: str, time: float | None = None) -> np.ndarray:
        start = (1.0, 1.0, 1.0) if name == "Lcl Scaling" else (0.0, 0.0, 0.0)
        found = np.array(self.vectors.get(name, start), dtype=float)
        for i, axis in enumerate("XYZ" if time is not None else ""):
            if (name, axis) in self.keys:
                found[i] = _at(np.array(self.keys[name, axis]).T, time)
        return found


def write_fbx(
    path: Path,
    nodes: Sequence[Node],
    *,
    takes: Mapping[str, tuple[float, float]] | None = None,
    settings: Mapping[str, float] | None = None,
    bind: Mapping[int, np.ndarray] | None = None,
) -> Path:
    """Write nodes and their takes (name -> start and end in seconds)."""
    ids = itertools.count(1000)
    objects: list[str] = []
    links: list[str] = []
    models = [next(ids) for _ in nodes]
    for node, model in zip(nodes, models, strict=True):
        objects.append(_model(node, model))
        links.append(f'"OO",{model},{models[node.parent] if node.parent >= 0 else 0}')
        if node.kind != "Mesh":
            attribute = next(ids)
            flags = "Skeleton" if node.kind == "LimbNode" else node.kind
            objects.append(
                f'NodeAttribute: {attribute}, "NodeAttribute::", "{node.kind}" '
                f'{{\n TypeFlags: "{flags}"\n }}'
            )
            links.append(f'"OO",{attribute},{model}')
    for i, (take, span) in enumerate((takes or {"Take 001": (0.0, 1.0)}).items()):
        keyed = [
            (n.more_keys.get(take, {} if i else n.keys), m)
            for n, m in zip(nodes, models, strict=True)
        ]
        _animation(take, span, keyed, objects, links, ids)
    if bind:
        poses = "\n".join(
            f" PoseNode: {{\n Node: {models[i]}\n"
            f" Matrix: *16 {{\n a: {_joined(m.T.ravel())}\n }}\n }}"
            for i, m in bind.items()
        )
        objects.append(
            f'Pose: {next(ids)}, "Pose::Bind", "BindPose" {{\n Type: "BindPose"\n{poses}\n }}'
        )
    text = "; FBX 7.4.0 project file\nFBXHeaderExtension: {\n FBXVersion: 7400\n}\n"
    text += "GlobalSettings: {\n Properties70: {\n" + _settings(settings or {}) + " }\n}\n"
    text += "Objects: {\n" + "\n".join(objects) + "\n}\nConnections: {\n"
    text += "\n".join(f" C: {link}" for link in links) + "\n}\n"
    path.write_text(text, "utf-8")
    return path


def positions(nodes: Sequence[Node], times: Iterable[float]) -> np.ndarray:
    """World positions (frames, nodes, 3) in the file's units."""
    return np.array([[m[:3, 3] for m in _globals(nodes, time)] for time in times])


def _at(keys: np.ndarray, time: float) -> float:
    if len(keys) == 2:
        return float(np.interp(time, *keys))
    return float(CubicHermiteSpline(*keys)(time))


def _globals(nodes: Sequence[Node], time: float) -> list[np.ndarray]:
    """Global matrices, as CalculateGlobalTransform of the SDK's examples does."""
    world: list[np.ndarray] = []
    turns: list[np.ndarray] = []
    sizes: list[np.ndarray] = []
    for node in nodes:
        local = _local(node, time)
        above = world[node.parent] if node.parent >= 0 else np.eye(4)
        turn_above = turns[node.parent] if node.parent >= 0 else np.eye(3)
        size_above = np.linalg.inv(turn_above) @ above[:3, :3]
        turn, size = _turn(node, time), np.diag(node.vector("Lcl Scaling", time))
        if node.inherit == NORMAL:
            linear = turn_above @ size_above @ turn @ size
        elif node.inherit == COMPONENTWISE:
            linear = turn_above @ turn @ size_above @ size
        else:
            own = sizes[node.parent] if node.parent >= 0 else np.eye(3)
            linear = turn_above @ turn @ size_above @ np.linalg.inv(own) @ size
        matrix = np.eye(4)
        matrix[:3, :3] = linear
        matrix[:3, 3] = (above @ local)[:3, 3]
        world.append(matrix)
        turns.append(turn_above @ turn)
        sizes.append(size)
    return world


def _local(node: Node, time: float) -> np.ndarray:
    def move(name: str, sign: float = 1.0) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, 3] = sign * node.vector(name, time)
        return matrix

    def wide(linear: np.ndarray) -> np.ndarray:
        matrix = np.eye(4)
        matrix[:3, :3] = linear
        return matrix

    size = wide(np.diag(node.vector("Lcl Scaling", time)))
    return (
        move("Lcl Translation") @ move("RotationOffset") @ move("RotationPivot")
        @ wide(_turn(node, time)) @ move("RotationPivot", -1.0)
        @ move("ScalingOffset") @ move("ScalingPivot") @ size @ move("ScalingPivot", -1.0)
    )  # fmt: skip


def _turn(node: Node, time: float) -> np.ndarray:
    def euler(name: str, order: int) -> np.ndarray:
        axes = ORDERS[order]
        angles = node.vector(name, time)
        return Rotation.from_euler(
            axes, angles[["xyz".index(a) for a in axes]], degrees=True
        ).as_matrix()

    return euler("PreRotation", 0) @ euler("Lcl Rotation", node.order) @ euler("PostRotation", 0).T


def _model(node: Node, model: int) -> str:
    lines = [f' P: "{n}", "{KINDS[n]}", "", "A",{_joined(v)}' for n, v in node.vectors.items()]
    lines.append(' P: "RotationActive", "bool", "", "",1')
    lines.append(f' P: "RotationOrder", "enum", "", "",{node.order}')
    lines.append(f' P: "InheritType", "enum", "", "",{node.inherit}')
    body = "\n".join(lines)
    head = f'Model: {model}, "Model::{node.name}", "{node.kind}"'
    return f"{head} {{\n Properties70: {{\n{body}\n }}\n }}"


def _animation(
    take: str,
    span: tuple[float, float],
    keyed: Sequence[tuple[Mapping[tuple[str, str], Keys], int]],
    objects: list[str],
    links: list[str],
    ids: itertools.count[int],
) -> None:
    stack, layer = next(ids), next(ids)
    begin, end = (round(time * SECOND) for time in span)
    objects.append(
        f'AnimationStack: {stack}, "AnimStack::{take}", "" {{\n Properties70: {{\n'
        f' P: "LocalStart", "KTime", "Time", "",{begin}\n'
        f' P: "LocalStop", "KTime", "Time", "",{end}\n }}\n }}'
    )
    objects.append(f'AnimationLayer: {layer}, "AnimLayer::Base", "" {{\n }}')
    links.append(f'"OO",{layer},{stack}')
    for keys, model in keyed:
        for name in dict.fromkeys(prop for prop, _ in keys):
            value = next(ids)
            objects.append(f'AnimationCurveNode: {value}, "AnimCurveNode::{name[4]}", "" {{\n }}')
            links += [f'"OO",{value},{layer}', f'"OP",{value},{model}, "{name}"']
            for axis in "XYZ":
                if (name, axis) in keys:
                    curve = next(ids)
                    objects.append(_curve(curve, keys[name, axis]))
                    links.append(f'"OP",{curve},{value}, "d|{axis}"')


def _curve(curve: int, keys: Keys) -> str:
    smooth = len(keys[0]) == 3
    slopes = [key[2] if smooth else 0.0 for key in keys]
    tangents = np.array([[out, into, 0, 0] for out, into in pairwise((*slopes, 0.0))], np.float32)
    arrays = {
        "KeyTime": [round(key[0] * SECOND) for key in keys],
        "KeyValueFloat": [key[1] for key in keys],
        "KeyAttrFlags": [0x408 if smooth else 0x4] * len(keys),  # cubic by given tangents; linear
        "KeyAttrDataFloat": tangents.view(np.int32).ravel(),  # as ASCII files have them
        "KeyAttrRefCount": [1] * len(keys),
    }
    body = "".join(
        f" {name}: *{len(values)} {{\n a: {_joined(values)}\n }}\n"
        for name, values in arrays.items()
    )
    return f'AnimationCurve: {curve}, "AnimCurve::", "" {{\n KeyVer: 4008\n{body} }}'


def _settings(chosen: Mapping[str, float]) -> str:
    y_up = {"UpAxis": 1, "FrontAxis": 2, "CoordAxis": 0}
    values = {**y_up, "UpAxisSign": 1, "FrontAxisSign": 1, "CoordAxisSign": 1}
    values |= {"UnitScaleFactor": 1.0, "TimeMode": 6, **chosen}  # 6: 30 fps
    kinds = {True: '"double", "Number"', False: '"int", "Integer"'}
    return "".join(
        f' P: "{n}", {kinds[isinstance(v, float)]}, "",{v}\n'
        for n, v in values.items()
        if v is not None
    )


def _joined(numbers: Iterable[float]) -> str:
    return ",".join(f"{number:.17g}" for number in numbers)
