"""Segments of motion packed one after the other: what the search reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdhand.errors import InputError, UsageError

T = TypeVar("T", bound=np.generic)

MAX_FEATURE = 1e9
"""Larger features would overflow the float32 sums of squares."""


@dataclass(frozen=True, eq=False)
class PackedSegments:
    """Segments, each a matrix of feature rows, in one array; made by `pack`.

    The local cost of two frames is the squared Euclidean distance of their rows, so features
    arrive already weighted (cm, degrees).

    Attributes
    ----------
    features : (total_frames, D) float32, C order; may be memory-mapped
    offsets : (segments + 1,) int64, segment s is ``features[offsets[s]:offsets[s + 1]]``
    ids : (segments,) int64, names that the search returns and breaks ties by
    groups : (segments,) int32, which clip a segment is from (0 or more)
    """

    features: NDArray[np.float32]
    offsets: NDArray[np.int64]
    ids: NDArray[np.int64]
    groups: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, segment: int) -> NDArray[np.float32]:
        """Features of one segment, (frames, D), not copied."""
        return self.features[self.offsets[segment] : self.offsets[segment + 1]]

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Frames of each segment, (segments,)."""
        return np.diff(self.offsets)


def pack(
    segments: Sequence[ArrayLike],
    ids: ArrayLike | None = None,
    groups: ArrayLike | None = None,
) -> PackedSegments:
    """Put segments one after the other.

    Parameters
    ----------
    segments : matrices (frames, D) of weighted features, one row or more each; none at all is legal
    ids : (segments,) default 0, 1, 2, ...
    groups : (segments,) default 0, 1, 2, ...: each segment a clip of its own

    Raises
    ------
    InputError
        if a feature is not a number or beyond `MAX_FEATURE`, or a segment has no frame.
    UsageError
        if the shapes do not agree.

    Examples
    --------
    >>> packed = pack([[[0.0], [1.0]], [[2.0], [3.0], [4.0]]])
    >>> packed.lengths.tolist(), packed[1][:, 0].tolist()
    ([2, 3], [2.0, 3.0, 4.0])
    """
    matrices = [_checked(segment, number) for number, segment in enumerate(segments)]
    if len({matrix.shape[1] for matrix in matrices}) > 1:
        raise UsageError("segments do not all have the same number of features")
    count = len(matrices)
    lengths = [len(matrix) for matrix in matrices]
    return PackedSegments(
        np.concatenate(matrices) if matrices else np.empty((0, 0), np.float32),
        np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        _column(ids, count, np.int64, "ids"),
        _column(groups, count, np.int32, "groups"),
    )


def _checked(segment: ArrayLike, number: int) -> NDArray[np.float32]:
    matrix = np.ascontiguousarray(segment, dtype=np.float32)
    if matrix.ndim != 2:
        raise UsageError(f"segment {number} has shape {matrix.shape}, not (frames, features)")
    if not matrix.size:
        raise InputError(f"segment {number} is empty")
    if not np.all(np.abs(matrix) <= MAX_FEATURE):
        raise InputError(f"segment {number} has features that are not numbers or beyond 1e9")
    return matrix


def _column(values: ArrayLike | None, count: int, dtype: type[T], name: str) -> NDArray[T]:
    column = np.arange(count, dtype=dtype) if values is None else np.asarray(values, dtype=dtype)
    if column.shape != (count,):
        raise UsageError(f"{name} has shape {column.shape}, not ({count},)")
    return column
