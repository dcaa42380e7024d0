"""The exact search, against brute force in float64."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
from builders.cost import processor_seconds
from conftest import shared_data
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import warp as oracle

from usdhand.errors import InputError, UsageError
from usdhand.search import PackedSegments, SearchIndex, merge, pack, prepare, search


def motion(rng: np.random.Generator, frames: int, width: int) -> np.ndarray:
    """Band-limited features: a few slow waves."""
    time = np.arange(frames)[:, None, None] / 60
    speed, phase = rng.uniform(0.2, 2, (2, width, 4))
    size = rng.normal(0, 8, (width, 4)) / speed
    return (size * np.sin(2 * np.pi * speed * time + 6 * phase)).sum(axis=2) + rng.normal(
        0, 9, width
    )


def motions(seed: int, count: int, width: int, shortest: int = 20, longest: int = 60) -> list:
    rng = np.random.default_rng(seed)
    return [
        motion(rng, int(frames), width).astype(np.float32)
        for frames in rng.integers(shortest, longest + 1, count)
    ]


def check(library, queries, k=5, ids=None, groups=None, exclude=None, max_ratio=1.5) -> None:
    """Search with and without pruning, with one and two threads, whole and in shards."""
    packed = pack(library, ids, groups)
    asked = pack(queries)
    expected = oracle.search(library, packed.ids, packed.groups, queries, k, max_ratio, exclude)
    index = prepare(packed, threads=2)
    found = search(index, asked, k, max_ratio, exclude, threads=1)
    for number, answer in enumerate(expected):
        assert found.ids[number, : len(answer)].tolist() == [name for _, name in answer]
        assert np.allclose(found.costs[number, : len(answer)], [c for c, _ in answer], rtol=1e-9)
        assert (found.ids[number, len(answer) :] == -1).all()
        assert np.isinf(found.costs[number, len(answer) :]).all()
    for threads, prune in ((2, True), (2, True), (1, False)):
        same(found, search(index, asked, k, max_ratio, exclude, threads, prune))
    cut = len(library) // 3
    first = pack(library[:cut], packed.ids[:cut], packed.groups[:cut])
    second = pack(library[cut:], packed.ids[cut:], packed.groups[cut:])
    parts = [search(prepare(part), asked, k, max_ratio, exclude) for part in (second, first)]
    same(found, merge(*parts, k))


def same(first, second) -> None:
    assert np.array_equal(first.ids, second.ids)
    assert np.array_equal(first.costs, second.costs)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 10**6),
    st.integers(1, 60),
    st.integers(1, 9),
    st.integers(1, 8),
    st.integers(1, 25),
    st.sampled_from([1.0, 1.25, 1.5, 2.0, 4.0]),
)
def test_noise(seed: int, count: int, width: int, k: int, longest: int, max_ratio: float) -> None:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, longest + 1, count)
    library = [rng.normal(size=(m, width)).astype(np.float32) for m in sizes]
    queries = [
        rng.normal(size=(n, width)).astype(np.float32) for n in rng.integers(1, longest + 1, 3)
    ]
    check(library, queries, k, max_ratio=max_ratio)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 60), st.integers(1, 40))
def test_duplicates_and_ties_fall_by_id(seed: int, count: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    different = [rng.integers(-2, 3, (m, 2)).astype(np.float32) for m in rng.integers(4, 9, 5)]
    library = [different[i] for i in rng.integers(0, 5, count)]
    ids = rng.permutation(10 * count)[:count]
    check(library, different, k, ids)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 50))
def test_excluded_groups(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    library = motions(seed, count, 3, 10, 16)
    groups = rng.integers(0, 4, count)
    exclude = np.array([[-1, -1], [0, -1], [2, 3]])
    check(library, motions(seed + 1, 3, 3, 10, 16), 4, groups=groups, exclude=exclude)


def test_groups_left_out_of_all_queries() -> None:
    library, groups = motions(21, 60, 3), [number % 20 for number in range(60)]
    left = np.arange(0, 20, 3)
    queries = motions(22, 4, 3)
    check(library, queries, groups=groups, exclude=np.tile(left, (4, 1)))
    index, asked = prepare(pack(library, groups=groups)), pack(queries)
    for prune in (True, False):
        same(
            search(index, asked, exclude=left, prune=prune),
            search(index, asked, exclude=np.tile(left, (4, 1)), prune=prune),
        )
    assert (search(index, asked, exclude=[]).ids == search(index, asked).ids).all()


def test_leaving_groups_out_is_one_pass() -> None:
    """Not one over all candidates for each group."""
    index = prepare(pack(motions(23, 20_000, 3, 20, 30), groups=np.arange(20_000)))
    queries = pack(motions(24, 60, 3, 22, 28))

    def seconds(groups: int) -> float:
        begun = processor_seconds()
        search(index, queries, exclude=np.arange(groups))
        return processor_seconds() - begun

    seconds(1)
    assert seconds(4000) < 10 * max(seconds(10), 0.1)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=8)
def test_queries_that_repeat_have_the_same_answer(seed: int) -> None:
    """As the cuts of a hold do; other groups left out make another question."""
    rng = np.random.default_rng(seed)
    kinds = motions(seed % 1000, 3, 2, 20, 24)
    chosen = np.repeat(rng.integers(0, 3, 6), rng.integers(1, 4, 6))
    exclude = np.repeat(rng.integers(-1, 3, 6), rng.integers(1, 4, 6))[: len(chosen)]
    exclude = np.concatenate([exclude, np.full(len(chosen) - len(exclude), -1)])
    groups = [number % 3 for number in range(12)]
    library = motions(seed % 1000 + 1, 12, 2, 20, 24)
    check(library, [kinds[i] for i in chosen], groups=groups, exclude=exclude[:, None])


@pytest.mark.parametrize("width", [1, 4, 5, 12, 40])
def test_band_limited_segments(width: int) -> None:
    check(motions(width, 300, width), motions(width + 100, 2, width))


def test_far_from_the_origin_and_with_outliers() -> None:
    library = motions(1, 80, 6)
    shifted = [segment + np.float32(3000) for segment in library]
    shifted[3] = shifted[3] * np.float32(1e4)
    shifted[5][7, 2] = -1e8
    check(shifted, [segment + np.float32(3000.5) for segment in library[:3]])


def test_near_ties_beyond_what_codes_and_float32_can_tell() -> None:
    rng = np.random.default_rng(5)
    base = motion(rng, 30, 3)
    library = [base + rng.normal(0, 1e-6, base.shape) for _ in range(70)]
    library = [segment.astype(np.float32) for segment in library] + motions(6, 30, 3)
    check(library, [base.astype(np.float32), library[9]])


def test_a_still_library() -> None:
    check([np.ones((m, 3), np.float32) for m in (20, 20, 25, 30)], [np.ones((22, 3), np.float32)])


def test_larger_library_in_every_way_of_pruning() -> None:
    """Enough candidates for several rounds and chunks; unpruned search as the oracle."""
    index = prepare(pack(motions(11, 6000, 6, 20, 40)))
    queries = pack(motions(12, 40, 6, 20, 40))
    for k in (1, 5, 100):
        same(search(index, queries, k), search(index, queries, k, prune=False))


@pytest.mark.real_data
def test_real_wrists() -> None:
    library, groups = real_segments(4)
    exclude = np.array([[group] for group in groups[::97]])
    check(library, library[::97], groups=groups, exclude=exclude)


def real_segments(takes: int) -> tuple[list[np.ndarray], list[int]]:
    """Right wrist relative to the root: position in cm and rotation matrix in degrees."""
    from usdhand.formats.usd.read import read_clip
    from usdhand.motion import forward_kinematics
    from usdhand.motion.rotations import to_matrix
    from usdhand.motion.skeleton import leaf_name

    rng = np.random.default_rng(0)
    segments: list[np.ndarray] = []
    groups: list[int] = []
    for take, path in enumerate(sorted(shared_data("studiogalt", "full").glob("*.usdc"))[:takes]):
        clip = read_clip(path)
        hand = [leaf_name(joint) for joint in clip.skeleton.joints].index("Hand_R")
        pose = forward_kinematics(clip, [hand], base=0)
        matrix = np.degrees(to_matrix(pose.rotation(hand)).reshape(-1, 9)) / np.sqrt(2)
        features = np.hstack([pose.position(hand), matrix]).astype(np.float32)
        at = 0
        while at + 120 <= len(features):
            frames = int(rng.integers(20, 121))
            segments.append(features[at : at + frames])
            groups.append(take)
            at += frames
    return segments, groups


def test_nothing_to_search_in_or_for() -> None:
    queries = pack(motions(0, 2, 3))
    for packed in (pack([]), pack([np.zeros((200, 3))])):
        found = search(prepare(packed), queries)
        assert (found.ids == -1).all()
        assert np.isinf(found.costs).all()
        assert found.ids.shape == found.costs.shape == (2, 5)
    assert search(prepare(queries), pack([])).ids.shape == (0, 5)


def test_what_cannot_be_used_is_refused() -> None:
    with pytest.raises(InputError, match="segment 1"):
        pack([np.zeros((3, 2)), np.full((3, 2), np.nan)])
    with pytest.raises(InputError, match="1e9"):
        pack([np.full((3, 2), 2e9)])
    with pytest.raises(InputError, match="empty"):
        pack([np.zeros((0, 2))])
    with pytest.raises(UsageError, match="same number"):
        pack([np.zeros((3, 2)), np.zeros((3, 1))])
    with pytest.raises(UsageError, match="shape"):
        pack([np.zeros(3)])
    with pytest.raises(UsageError, match="ids"):
        pack([np.zeros((3, 2))], ids=[1, 2])
    packed = pack(motions(0, 20, 3))
    broken = packed.features.copy()
    broken[7, 1] = np.nan
    with pytest.raises(InputError, match="library"):
        prepare(replace(packed, features=broken))
    index = prepare(packed)
    for arguments in ({"k": 0}, {"max_ratio": 0.5}, {"exclude": [[1]]}):
        with pytest.raises(UsageError):
            search(index, packed, **arguments)
    with pytest.raises(UsageError, match="features"):
        search(index, pack([np.zeros((20, 2))]))


def test_index_does_not_depend_on_threads_and_can_be_stored(tmp_path) -> None:
    packed = pack(motions(3, 200, 5))
    one, two = prepare(packed, threads=1), prepare(packed, threads=2)
    for field in fields(SearchIndex):
        values = getattr(one, field.name)
        assert np.array_equal(values, getattr(two, field.name))
        np.save(tmp_path / field.name, values)
    stored = SearchIndex(
        *(np.load(tmp_path / f"{field.name}.npy", mmap_mode="c") for field in fields(SearchIndex))
    )
    queries = pack(motions(4, 3, 5))
    same(search(one, queries), search(stored, queries))


def test_importing_is_cheap() -> None:
    code = "import sys, usdhand.search; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_segments_are_views() -> None:
    packed = pack([np.zeros((2, 2)), np.ones((3, 2))])
    assert isinstance(packed, PackedSegments)
    assert np.shares_memory(packed[1], packed.features)
    assert packed.lengths.tolist() == [2, 3]
