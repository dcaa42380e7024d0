"""Animation channels: read, checked and evaluated at the frames of a clip."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from usdhand.errors import InputError, UsageError
from usdhand.formats.gltf.accessors import read_rows
from usdhand.formats.gltf.document import Document, Element, choices, unused
from usdhand.formats.gltf.nodes import SHORTEST
from usdhand.formats.suffixes import CHOOSE_ANIMATION
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.problems import Problem

KINDS = {"rotation": "VEC4", "translation": "VEC3", "scale": "VEC3"}
LEAST_NUMBERS = 1_000_000  # that any file may hold: sparse accessors need no bytes
BLOCK = 4096  # frames worked on at a time


@dataclass(frozen=True, eq=False)
class KeyCurve:
    """Keys of one property of a node.

    Attributes
    ----------
    times : (keys,) seconds, ascending
    values : (keys, n), or (keys, 3, n) for splines: tangent in, value, tangent out
    interpolation : "LINEAR", "STEP" or "CUBICSPLINE"
    """

    times: Array
    values: Array
    interpolation: str
    where: str


Curves = dict[tuple[int, str], KeyCurve]  # (node, property)


def moved_nodes(document: Document) -> dict[int, set[int]]:
    """Nodes that each animation moves; only for animations that move any."""
    count = len(document.lists["nodes"])
    found = {}
    for i, animation in enumerate(document.lists["animations"]):
        targets = (channel.get("target") for channel in animation.items("channels"))
        nodes = {
            node
            for target in targets
            if target is not None and target.text("path") in KINDS
            if (node := target.reference("node", count)) is not None
        }
        if nodes:
            found[i] = nodes
    return found


def names_of(document: Document, moving: Iterable[int]) -> dict[int, str]:
    """Names of some animations, each one unique."""
    taken: dict[str, int] = {}
    animations = document.lists["animations"]
    return {i: unused(animations[i].text("name") or f"animation_{i}", taken) for i in moving}


def choose(path: Path, names: dict[int, str], animation: str | None) -> int:
    """Return the animation of a name, the only one without.

    Raises
    ------
    InputError
        if there is none at all.
    UsageError
        if there are several and none is chosen, or none has that name.
    """
    if not names:
        raise InputError(f"{path}: holds no animation of any node.")
    labels = choices(names.values())
    if animation is None:
        if len(names) > 1:
            raise UsageError(f"{path}: has {len(names)} animations: {labels}. {CHOOSE_ANIMATION}")
        return next(iter(names))
    for i, name in names.items():
        if name == animation:
            return i
    raise UsageError(f"{path}: has no animation '{animation}', only {labels}.")


def read_curves(
    document: Document, animation: Element, nodes: set[int]
) -> tuple[Curves, tuple[Problem, ...]]:
    """Read the curves of some nodes.

    Raises
    ------
    InputError
        if one of them cannot be read.
    """
    curves: Curves = {}
    problems: dict[str, Problem] = {}
    rows: dict[tuple[int, str], Array] = {}  # accessors are shared by many curves
    samplers = animation.items("samplers")
    for channel in animation.items("channels"):
        target = channel.need("target")
        path = target.text("path")
        node = target.reference("node", len(document.lists["nodes"]))
        if path == "pointer" and "pointer" not in problems:
            message = "channels of KHR_animation_pointer are not read"
            problems["pointer"] = Problem("unsupported-channel", message, channel.where)
        if path not in KINDS or node is None or node not in nodes:
            continue
        if (node, path) in curves:
            message = f"a second curve for the {path} of the same node is not read"
            problems.setdefault("double", Problem("double-channel", message, channel.where))
            continue
        sampler = samplers[channel.need("sampler").whole(0, len(samplers))]
        curves[node, path] = _curve(document, sampler, path, rows)
    return curves, tuple(problems.values())


def evaluate(curve: KeyCurve, keys: Array, frames: int, path: str) -> Array:
    """Values (frames, n) of a curve at the frames 0, 1, ..., constant beyond its keys.

    Parameters
    ----------
    keys : (keys,) frame numbers of the curve's keys, whole where they are meant to be
    """
    turned = path == "rotation"
    values = curve.values[:, 1] if curve.interpolation == "CUBICSPLINE" else curve.values
    if len(keys) == 1 or np.array_equal(keys, np.arange(frames)):
        found = values
    else:
        blocks = [
            _between(
                curve, values, keys, np.arange(float(start), min(start + BLOCK, frames)), turned
            )
            for start in range(0, frames, BLOCK)
        ]
        found = np.concatenate(blocks)
    if not turned:
        return found
    length = np.linalg.norm(found, axis=1, keepdims=True)
    if length.min() < SHORTEST:
        raise InputError(f"{curve.where} passes through a quaternion of length zero.")
    return rot.make_continuous(found / length)


def _between(curve: KeyCurve, values: Array, keys: Array, frames: Array, turned: bool) -> Array:
    low = np.clip(np.searchsorted(keys, frames, side="right") - 1, 0, len(keys) - 2)
    gap = keys[low + 1] - keys[low]
    t = np.clip((frames - keys[low]) / np.where(gap > 0, gap, 1.0), 0.0, 1.0)
    if curve.interpolation == "STEP":
        return values[np.where(t < 1.0, low, low + 1)]
    a, b = values[low], values[low + 1]
    if curve.interpolation == "LINEAR":
        return rot.slerp(a, b, t) if turned else a + (b - a) * t[:, None]
    t = t[:, None]
    seconds = (curve.times[low + 1] - curve.times[low])[:, None]
    out, into = curve.values[low, 2], curve.values[low + 1, 0]
    # Hermite spline, tangents are a second's change: appendix C.5 of the glTF specification.
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * a
        + seconds * (t**3 - 2 * t**2 + t) * out
        + (3 * t**2 - 2 * t**3) * b
        + seconds * (t**3 - t**2) * into
    )


def _curve(
    document: Document, sampler: Element, path: str, rows: dict[tuple[int, str], Array]
) -> KeyCurve:
    accessors = document.lists["accessors"]

    def read(key: str, kind: str) -> tuple[Array, Element]:
        index = sampler.need(key).whole(0, len(accessors))
        if (index, kind) not in rows:
            rows[index, kind] = read_rows(document, accessors[index], kind)
            # Accessors may overlap, and a small file could hold endless ones.
            held = LEAST_NUMBERS + sum(map(len, document.loaded.values()))
            if sum(values.size for values in rows.values()) > held:
                sampler.refuse("and those before it need more numbers than the file has bytes")
        return rows[index, kind], accessors[index]

    interpolation = sampler.text("interpolation") or "LINEAR"
    if interpolation not in ("LINEAR", "STEP", "CUBICSPLINE"):
        sampler.refuse(f"has the unknown interpolation {interpolation[:20]!r}")
    found, element = read("input", "SCALAR")
    times = found[:, 0]
    if (np.diff(times) < 0).any():
        key = int(np.argmax(np.diff(times) < 0)) + 1
        element.refuse(f"has key times that decrease, at key {key} ({times[key]:g} s)")
    values, element = read("output", KINDS[path])
    each = 3 if interpolation == "CUBICSPLINE" else 1
    if len(values) != each * len(times):
        element.refuse(f"has {len(values)} rows for {len(times)} keys of {interpolation}")
    if interpolation == "CUBICSPLINE":
        values = values.reshape(len(times), 3, -1)
    main = values[:, 1] if values.ndim == 3 else values
    if path == "rotation":
        short = np.linalg.norm(main, axis=1) < SHORTEST
        if short.any():
            element.refuse(f"holds a quaternion of length zero at key {int(np.argmax(short))}")
        if interpolation == "LINEAR":
            values = rot.normalize(values)
    return KeyCurve(times, values, interpolation, f"{document.path}: {sampler.where}")
