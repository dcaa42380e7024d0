"""Damaged glTF files: an error that says where, or a clip that is whole; nothing else."""

from __future__ import annotations

import contextlib
import copy
import json
import resource
import struct
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cost import at_most
from builders.gltf_files import everything, glb

from usdhand.errors import InputError, UsageError
from usdhand.formats.gltf.read import animation_names, read_character, read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics

SECONDS = 5.0  # of the processor, for one small file
MEGABYTES = 1500


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


def fuzz_apart(count: int, seed: int, folder: Path) -> None:
    """In a process of its own: the memory is that of reading, not of the tests before."""
    start = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import fuzz; "
    call = f"from pathlib import Path; fuzz({count}, {seed}, Path({str(folder)!r}))"
    done = subprocess.run([sys.executable, "-c", start + call], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_any_damage(tmp_path: Path) -> None:
    fuzz_apart(700, 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
def test_much_damage(seed: int, tmp_path: Path) -> None:
    fuzz_apart(8_000, seed, tmp_path)
