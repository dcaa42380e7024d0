"""Damaged BVH files are refused in words or read as something valid, quickly, and nothing else."""

from __future__ import annotations

import random
import re
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from builders.bvh_files import ARM, written
from builders.cost import at_most
from conftest import SHARED
from hypothesis import given, settings
from hypothesis import strategies as st

from usdhand.errors import InputError
from usdhand.formats.bvh.read import read_character, read_clip

SECONDS = 10.0  # of the processor, for any file here
WORDS = [
    *(b"{ } nan inf 1e999 -1e308 ROOT JOINT End Site OFFSET CHANNELS MOTION Frames: Frame".split()),
    *(b"# // _ / - + . e 0 1 6 99999999999999999999 1e9 -1 Xposition Zrotation Yscale".split()),
    *(b"\x00 \xff\xfe \xef\xbb\xbf \xc3\xa4 \n \r \t".split(b" ")),
]  # fmt: skip


def sources() -> list[bytes]:
    """The small file and, where they are, the real ones with their first frames."""
    found = [ARM.encode()]
    for path in sorted((SHARED / "data" / "bvh").rglob("*.bvh")):
        head, motion = path.read_bytes().split(b"MOTION", 1)
        lines = motion.splitlines()
        found.append(b"\n".join([head + b"MOTION", b"Frames: 3", *lines[2:6]]))
    return found


def mutated(data: bytes, rng: random.Random) -> bytes:
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        at = rng.randrange(len(data) + 1)
        kind = rng.randrange(6)
        if kind == 0:
            data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + data[at + rng.choice([1, 3, 40, 2000]) :]
        elif kind == 2:
            data = data[:at] + rng.choice(WORDS) + data[at:]
        elif kind == 3:
            data = data[:at] + data[at : at + rng.choice([4, 90, 3000])] + data[at:]
        elif kind == 4:
            word = rng.choice(WORDS)
            data = data[:at] + word + data[at + len(word) :]
        elif rng.random() < 0.2:
            data = data[:at]
    return data


def assert_read_or_refused(path: Path) -> bool:
    """Whether a file is read; if not, it must be refused with its line."""
    try:
        with at_most(SECONDS), warnings.catch_warnings():
            warnings.simplefilter("error")
            clip = read_clip(path)
            still = read_character(path)
    except InputError as error:
        clip, refused = None, str(error)
    if clip is None:
        assert re.search(r"take\.bvh(, line \d+|:| has no motion)", refused), refused
        return False
    for values in (clip.rotations, clip.translations, clip.skeleton.bind, still.translations):
        assert np.isfinite(values).all()
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0)
    assert len(set(clip.skeleton.joints)) == len(clip.skeleton)
    return True


def mutations(folder: Path, count: int, seed: int) -> None:
    rng, found = random.Random(seed), sources()
    results = [
        assert_read_or_refused(written(folder, mutated(rng.choice(found), rng)))
        for _ in range(count)
    ]
    assert 0 < sum(results) < count


def test_mutations(tmp_path: Path) -> None:
    mutations(tmp_path, 300, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 6))
def test_many_mutations(tmp_path: Path, seed: int) -> None:
    mutations(tmp_path, 5000, seed)


@given(st.lists(st.sampled_from([*WORDS, *ARM.encode().split(), b"\n"]), max_size=80))
@settings(max_examples=150)
def test_words_in_any_order(tmp_path_factory: pytest.TempPathFactory, words: list[bytes]) -> None:
    text = b"HIERARCHY ROOT a { OFFSET 0 0 0 " + b" ".join(words)
    assert_read_or_refused(written(tmp_path_factory.getbasetemp(), text))


@pytest.mark.parametrize(
    "text",
    [
        ARM.replace("Frames: 3", "Frames: 999999999999"),
        ARM.replace("CHANNELS 6", "CHANNELS 1000000000"),
        ARM.replace("Hips", "H" * 4_000_000),
        "HIERARCHY" + " " * 4_000_000,
        "HIERARCHY\n" + "# x\n" * 500_000,
        "HIERARCHY ROOT a " + "{" * 1_000_000,
        "HIERARCHY " + "ROOT a{OFFSET 0 0 0}" * 200_000,
        "HIERARCHY ROOT a{OFFSET 0 0 0 " + "JOINT a{OFFSET 0 1 0 " * 200_000,
        ARM + "\n" * 4_000_000,
        ARM + "1 " * 2_000_000,
        ARM.replace("0 91 0", "9" * 4_000_000),
    ],
    ids=lambda text: f"{text[:40]!r}",
)
def test_bombs_cost_little(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, text)
    tracemalloc.start()
    try:
        assert_read_or_refused(path)
        assert tracemalloc.get_traced_memory()[1] < 30 * len(text) + 50_000_000
    finally:
        tracemalloc.stop()
