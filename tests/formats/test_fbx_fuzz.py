"""Damaged FBX files: an error that says so or a sound clip, never a crash and never a hang."""

from __future__ import annotations

import random
import re
from pathlib import Path

import numpy as np
import pytest
from builders.cost import at_most
from builders.fbx_files import write_fbx
from conftest import shared_data
from test_fbx import random_chain

from usdhand.errors import InputError, UsageError
from usdhand.formats.fbx import read
from usdhand.motion import Clip, forward_kinematics

pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
SECONDS = 20.0  # of the processor, for one damaged file; they take a tenth of one
EXTREMES = (b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", bytes(4), b"\0\0\0\x80", b"\1\0\0\0")
NUMBERS = (b"-1", b"0", b"1e300", b"nan", b"99999999999", b"-9223372036854775808", b"x", b'"')


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Bytes changed, taken out, doubled or cut off, in one to twenty places."""
    found = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 5, 20])):
        near_start = rng.random() < 0.3
        at = rng.randrange(min(3000, len(found)) if near_start else len(found))
        size = rng.choice([1, 4, 8, 64, 1000])
        match rng.randrange(8):
            case 0:
                found[at] = rng.randrange(256)
            case 1:
                found[at] ^= 1 << rng.randrange(8)
            case 2:
                found[at : at + 4] = rng.choice(EXTREMES)
            case 3:
                found[at : at + size] = bytes(size)
            case 4:
                del found[at : at + size]
            case 5:
                found[at:at] = found[at : at + size]
            case 6 if rng.random() < 0.2:
                del found[at:]
            case _:
                found[at : at + 1] = rng.choice(NUMBERS)
        if not found:
            return b"x"
    return bytes(found)


def other_numbers(data: bytes, rng: random.Random) -> bytes:
    """An ASCII file with some of its numbers replaced: its form stays whole."""
    places = list(re.finditer(rb"(?<=[ ,*])-?\d[\d.e+-]*", data))
    found = data
    for place in sorted(rng.sample(places, rng.choice([1, 1, 2, 5])), key=lambda p: -p.start()):
        found = found[: place.start()] + rng.choice(NUMBERS[:6]) + found[place.end() :]
    return found


def assert_survived(path: Path) -> bool:
    """Read a file; return whether there was a clip."""
    with at_most(SECONDS):
        read_or_said = _read(path)
    if isinstance(read_or_said, str):
        assert str(path) in read_or_said
        assert "signal" not in read_or_said, "the library crashed"
        return False
    clip = read_or_said
    assert len(clip) == len(clip.rotations) == len(clip.translations) == len(clip.scales)
    assert np.isfinite(forward_kinematics(clip).positions).all()
    assert np.isfinite(clip.scales).all()
    assert np.isfinite(clip.skeleton.bind).all()
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0)
    return True


def _read(path: Path) -> Clip | str:
    try:
        return read.read_clip(path)
    except (InputError, UsageError) as error:
        return str(error)


def survivors(data: bytes, folder: Path, count: int, seed: int, ascii_only: bool = False) -> int:
    rng = random.Random(seed)
    path = folder / "damaged.fbx"
    kept = 0
    for _ in range(count):
        change = other_numbers if ascii_only and rng.random() < 0.7 else damaged
        path.write_bytes(change(data, rng))
        kept += assert_survived(path)
    return kept


def ascii_file(folder: Path) -> bytes:
    nodes = random_chain(0, pivots=True, scales=1, inherit=True)
    bind = {i: np.eye(4) for i in range(len(nodes))}
    return write_fbx(folder / "whole.fbx", nodes, bind=bind).read_bytes()


def test_damaged_ascii(tmp_path: Path) -> None:
    assert 0 < survivors(ascii_file(tmp_path), tmp_path, 25, 1, ascii_only=True) < 25


@pytest.mark.real_data
def test_damaged_binary(tmp_path: Path) -> None:
    data = shared_data("fbx", "ozz", "walk.fbx").read_bytes()
    assert 0 < survivors(data, tmp_path, 25, 2) < 25


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_much_damaged_ascii(tmp_path: Path, seed: int) -> None:
    assert survivors(ascii_file(tmp_path), tmp_path, 1500, 10 + seed, ascii_only=True)


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize(
    "parts",
    [("fbx", "ozz", "crossarms.fbx"), ("studiogalt", "fbx", "SG_ASL_5_2023-1-29_No_Mesh_Mini.fbx")],
    ids=lambda parts: parts[-1],
)
def test_much_damaged_binary(tmp_path: Path, parts: tuple[str, ...]) -> None:
    assert survivors(shared_data(*parts).read_bytes(), tmp_path, 1500, 20)
