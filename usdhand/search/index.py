"""What the search knows about a library before it sees a query: order, codes and boxes."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.search.segments import MAX_FEATURE, PackedSegments

UNROLL = 4
"""Features that the kernels take at a time."""

_HALF = np.array([0, 0.02, 0.05, 0.09, 0.14, 0.2, 0.28, 0.38])
CELL_EDGES = np.concatenate([_HALF, [0.5], 1 - _HALF[::-1]])
"""Cells of a candidate in normalised time: narrow near the ends, where a warp can stray least."""

CODES = 65535
"""The largest code of a feature."""


@dataclass(frozen=True, eq=False)
class SearchIndex:
    """A library ready to be searched; made by `prepare`. Plain arrays, that can be stored.

    Candidates are in order of length. What is read all the time is small: 16-bit codes of the
    features and 8-bit boxes. The features themselves, which are not copied, decide between the
    few candidates that are left: they may be memory-mapped (``mmap_mode="c"``: numba compiles
    read-only arrays apart).

    Attributes
    ----------
    features : (total_frames, D) float32
    codes : (total_frames, D') uint16, D' is D rounded up to a multiple of `UNROLL`
    code_origin, code_step : (D',) float64, a feature is about ``origin + step * code``
    begins : (candidates,) int64, first frame
    lengths : (candidates,) int64, frames, rising
    ids : (candidates,) int64
    groups : (candidates,) int32
    low, high : (cells, D, candidates) uint8, between them are all frames in that part of a
        candidate, see `CELL_EDGES`
    box_origin, box_unit : (D,) and (1,) float64, what the boxes are measured from and in
    """

    features: NDArray[np.float32]
    codes: NDArray[np.uint16]
    code_origin: NDArray[np.float64]
    code_step: NDArray[np.float64]
    begins: NDArray[np.int64]
    lengths: NDArray[np.int64]
    ids: NDArray[np.int64]
    groups: NDArray[np.int32]
    low: NDArray[np.uint8]
    high: NDArray[np.uint8]
    box_origin: NDArray[np.float64]
    box_unit: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.ids)


def prepare(packed: PackedSegments, threads: int | None = None) -> SearchIndex:
    """Sort a library by length, code and box its features.

    Parameters
    ----------
    packed : the library
    threads : default all cores; the result does not depend on it

    Raises
    ------
    InputError
        if a feature is not a number or beyond `MAX_FEATURE`.
    """
    from usdhand.search.boxes import encode, fill_boxes

    features, offsets = packed.features, packed.offsets
    order = np.argsort(packed.lengths, kind="stable")
    begins, lengths = offsets[order], packed.lengths[order]
    code_origin, code_step = _code_scale(features, threads)
    box_origin, box_unit = _box_scale(features)
    codes = np.zeros((len(features), len(code_step)), np.uint16)
    shape = (len(CELL_EDGES) - 1, features.shape[1], len(order))
    low, high = np.empty(shape, np.uint8), np.empty(shape, np.uint8)

    def encode_frames(start: int, stop: int) -> None:
        encode(features, code_origin, code_step, start, stop, codes)

    def box_candidates(start: int, stop: int) -> None:
        fill_boxes(
            features, begins, lengths, CELL_EDGES, box_origin, box_unit[0], start, stop, low, high
        )

    in_chunks(encode_frames, len(features), threads)
    in_chunks(box_candidates, len(order), threads)
    return SearchIndex(
        features,
        codes,
        code_origin,
        code_step,
        begins,
        lengths,
        packed.ids[order],
        packed.groups[order],
        low,
        high,
        box_origin,
        box_unit,
    )


def _code_scale(
    features: NDArray[np.float32], threads: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest value of each feature and the width of a code, padded with zeros."""
    width = -(-features.shape[1] // UNROLL) * UNROLL
    origin, step = np.zeros(width), np.zeros(width)
    if not features.size:
        return origin, step
    extremes: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []

    def measure(start: int, stop: int) -> None:
        chunk = features[start:stop]
        extremes.append((chunk.min(axis=0), chunk.max(axis=0)))

    in_chunks(measure, len(features), threads)
    lowest = np.min([low for low, _ in extremes], axis=0).astype(np.float64)
    highest = np.max([high for _, high in extremes], axis=0).astype(np.float64)
    if not (np.all(lowest >= -MAX_FEATURE) and np.all(highest <= MAX_FEATURE)):
        raise InputError("the library has features that are not numbers or beyond 1e9")
    origin[: len(lowest)] = lowest
    step[: len(lowest)] = (highest - lowest) / CODES
    return origin, step


def _box_scale(
    features: NDArray[np.float32],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What boxes are measured from and in: one unit, to cover nearly all of the widest feature."""
    if not features.size:
        return np.zeros(features.shape[1]), np.ones(1)
    sample = features[:: max(1, len(features) // 100_000)]
    low, high = np.percentile(sample.astype(np.float64), [0.1, 99.9], axis=0)
    unit = max(float(np.max(high - low)) / 255, 1e-6)
    return (low + high) / 2 - 127.5 * unit, np.array([unit])


def in_chunks(
    task: Callable[[int, int], None], count: int, threads: int | None, chunks: int = 16
) -> None:
    """Run ``task(start, stop)`` over ``range(count)``, in so many chunks a thread."""
    workers = threads or len(os.sched_getaffinity(0))
    edges = np.linspace(0, count, min(count, chunks * workers) + 1).astype(int).tolist()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(task, edges[:-1], edges[1:]))  # raises what a task raised
