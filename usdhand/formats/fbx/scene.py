"""An FBX file as arrays: its nodes, takes, bind pose and one take's local transforms."""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.motion.rotations import Array
from usdhand.motion.timing import FASTEST_FPS, SLOWEST_FPS, find_timing

WORKER = Path(__file__).with_name("worker.py")
TIME_LIMIT = 300.0  # seconds for one file
MEMORY_LIMIT = 2 << 30  # bytes, and as much again as ten times the file


@dataclass(frozen=True, eq=False)
class Transforms:
    """Local transforms of nodes: of one moment or of frames, which is the leading axis.

    ``translations`` (frames, nodes, 3) in the file's units, ``rotations`` (frames, nodes, 4) xyzw,
    ``scales`` (frames, nodes, 3).
    """

    translations: Array
    rotations: Array
    scales: Array

    def __len__(self) -> int:
        return len(self.translations)


@dataclass(frozen=True, eq=False)
class AnimationStack:
    """An animation stack: its name, nodes with keys, and times in seconds as the file has them."""

    name: str
    moved: frozenset[int]
    begin: float
    end: float
    first_key: float
    last_key: float
    key_spacing: float


@dataclass(frozen=True, eq=False)
class Sampled:
    """One take at each frame.

    ``first`` is the time of the first frame, in frames; ``by_keys`` tells that the first and last
    key decided about the span, since that of the take cannot be meant.
    """

    take: AnimationStack
    fps: float
    first: float
    by_keys: bool
    transforms: Transforms


@dataclass(frozen=True, eq=False)
class Scene:
    """Nodes, parents before children, and what is said about them.

    Attributes
    ----------
    names, kinds : of the nodes; the first one is the scene itself
    parents : (nodes,) index of the parent, -1 for the scene
    inherit : how each node takes over its parent's scale, as ufbx names it
    scale_nodes : (nodes,) whose scale a node takes over that does so by components, or -1
    rest : transforms of one frame, the nodes' own defaults
    bind : world matrices (4, 4) of the bind pose, by node, for column vectors
    axes : (3, 3) turns the file's axes to X right, Y up, Z to the front
    says_axes : whether the file says them
    fps : frames a second, None if the file does not say
    version : of the format, 7400 for 7.4
    """

    path: Path
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    parents: NDArray[np.intp]
    inherit: tuple[str, ...]
    scale_nodes: NDArray[np.intp]
    rest: Transforms
    bind: dict[int, Array]
    skinned: frozenset[int]
    takes: tuple[AnimationStack, ...]
    sampled: Sampled | None
    cm_per_unit: float
    axes: Array
    says_axes: bool
    fps: float | None
    version: int


def load_scene(path: Path, animation: str | None = None, *, sample: bool = True) -> Scene:
    """Read a file; with ``sample``, sample the animation of this name, or the only one with keys.

    Raises
    ------
    InputError
        if the library for FBX is missing, or the file cannot be read.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file.")
    if not path.stat().st_size:
        raise InputError(f"{path}: the file is empty.")
    request = {
        "library": str(library_folder(path)),
        "path": str(path.resolve()),
        "sample": sample,
        "animation": animation,
        "fps": None,
        "rates": [SLOWEST_FPS, FASTEST_FPS],
        "memory": MEMORY_LIMIT + 10 * path.stat().st_size,
    }
    said, numbers = _ask(request, path)
    if "keys" in said:
        request["fps"] = find_timing([np.array(said["keys"])]).fps
        said, numbers = _ask(request, path)
    return _scene(path, said, numbers)


def library_folder(path: Path) -> Path:
    """Folder that the ufbx bindings are installed in; InputError where they are not."""
    spec = importlib.util.find_spec("ufbx")
    folder = None if spec is None or spec.origin is None else Path(spec.origin).parent
    if folder is None:
        raise InputError(
            f"{path}: FBX files are read with the package ufbx: pip install 'usdhand[convert]'"
        )
    if not any(folder.glob("_native*")):  # pyufbx calls its package ufbx too and has no animation
        raise InputError(
            f"{path}: {folder} is not the package ufbx that reads animation: "
            "pip uninstall pyufbx, then pip install --force-reinstall 'usdhand[convert]'"
        )
    return folder.parent


def _ask(request: dict[str, Any], path: Path) -> tuple[dict[str, Any], Array]:
    """What the worker says of a file, and the numbers of what it sampled."""
    header, _, numbers = _run(request, path).partition(b"\n")
    said: dict[str, Any] = json.loads(header)
    if "error" in said:
        raise InputError(f"{path}: cannot be read as FBX ({said['error']}).")
    return said, np.frombuffer(numbers)


def _run(request: dict[str, Any], path: Path) -> bytes:
    damaged = f"{path}: cannot be read as FBX"
    command = [sys.executable, "-I", "-S", str(WORKER), json.dumps(request)]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=TIME_LIMIT,
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{damaged} (reading took more than {TIME_LIMIT:g} s).") from None
    if done.returncode < 0:
        raise InputError(f"{damaged} (the library stopped with signal {-done.returncode}).")
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise InputError(f"{damaged} ({lines[-1] if lines else 'the library stopped'}).")
    return done.stdout


def _scene(path: Path, said: dict[str, Any], numbers: Array) -> Scene:
    nodes = said["nodes"]
    rest = _transforms(np.array([n["local"] for n in nodes], dtype=np.float64)[None])
    takes = tuple(_take(stack) for stack in said["stacks"])
    bind = {i: _matrix(m) for i, m in (*said["poses"], *said["clusters"])}
    axes = _axes(said["axes"])
    if not _finite(rest):
        raise InputError(f"{path}: the transforms of its nodes have values that are not numbers.")
    return Scene(
        path=path,
        names=tuple(n["name"] for n in nodes),
        kinds=tuple(n["kind"] for n in nodes),
        parents=np.array([n["parent"] for n in nodes], dtype=np.intp),
        inherit=tuple(n["inherit"] for n in nodes),
        scale_nodes=np.array([n["scale_node"] for n in nodes], dtype=np.intp),
        rest=rest,
        bind={i: m for i, m in bind.items() if _usable(m)},
        skinned=frozenset(i for i, _ in said["clusters"]),
        takes=takes,
        sampled=_sampled(path, said, takes, rest, numbers),
        cm_per_unit=100.0 * said["unit_meters"],
        axes=np.eye(3) if axes is None else axes,
        says_axes=axes is not None,
        fps=said["fps"],
        version=said["version"],
    )


def _take(stack: dict[str, Any]) -> AnimationStack:
    return AnimationStack(
        name=stack["name"],
        moved=frozenset(stack["moved"]),
        begin=stack["begin"],
        end=stack["end"],
        first_key=stack["first"],
        last_key=stack["last"],
        key_spacing=stack["spacing"],
    )


def _sampled(
    path: Path,
    said: dict[str, Any],
    takes: tuple[AnimationStack, ...],
    rest: Transforms,
    numbers: Array,
) -> Sampled | None:
    if "sampled" not in said:
        return None
    sampled = said["sampled"]
    take = takes[sampled["stack"]]
    moved, frames = sorted(take.moved), sampled["count"]
    found = numbers.reshape(frames, len(moved), 10)
    values = np.concatenate([rest.translations, rest.rotations, rest.scales], axis=-1)
    values = np.repeat(values, frames, axis=0)
    values[:, moved] = found
    transforms = _transforms(values)
    if not _finite(transforms):
        raise InputError(f"{path}: values that are not numbers in the animation '{take.name}'.")
    return Sampled(take, sampled["fps"], sampled["first"], sampled["by_keys"], transforms)


def _transforms(values: Array) -> Transforms:
    """Of (frames, nodes, 10) numbers."""
    return Transforms(values[..., :3], values[..., 3:7], values[..., 7:])


def _finite(transforms: Transforms) -> bool:
    """Whether all numbers are of a size that can be worked with, and the rotations rotate."""
    parts = (transforms.translations, transforms.rotations, transforms.scales)
    lengths = np.linalg.norm(transforms.rotations, axis=-1)
    return all(bool((np.abs(part) < 1e12).all()) for part in parts) and bool((lengths > 0.5).all())


def _matrix(columns: list[float]) -> Array:
    matrix = np.eye(4)
    matrix[:3] = np.reshape(columns, (4, 3)).T
    return matrix


def _usable(matrix: Array) -> bool:
    return bool((np.abs(matrix) < 1e12).all()) and abs(float(np.linalg.det(matrix))) > 1e-12


def _axes(axes: list[int]) -> Array | None:
    """Rows are the file's right, up and front axes; None if they are no three axes."""
    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        if axis < 6:
            turn[row, axis // 2] = -1.0 if axis % 2 else 1.0
    return turn if math.isclose(abs(np.linalg.det(turn)), 1.0) else None
