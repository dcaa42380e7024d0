"""What the search needs of one query."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.search.index import CELL_EDGES, CODES, SearchIndex
from usdhand.search.warping import can_warp

_MIDDLE = (CELL_EDGES[4:12] + CELL_EDGES[5:13]) / 2
PART_EDGES = np.sort(np.concatenate([CELL_EDGES, _MIDDLE]))
"""Parts of a query in normalised time."""

STAGES = (6, 12)
"""A warp is first tried up to these parts: a fifth and half of the query's time."""

_CODE_ERROR = 0.52  # steps that a coded feature can be off: half of one, and float32
_TINY = 1e-30  # keeps a limit of zero from losing costs that underflow


@dataclass(frozen=True, eq=False)
class Query:
    """A segment to search for; made by `prepare_query`. See `SearchIndex` for origins and units.

    Attributes
    ----------
    exact : (n, D) float32 features
    frames : (n, D') the same from the origin of the codes
    below, above : (parts, D) enclose the mean of the features over a part, in units of boxes
    parts : (parts + 1,) first frame of each part, and n
    first, last : range of the candidates of a length that may be warped
    slack : factor that float32 sums of the same cost cannot differ by
    margin : how far the root of an accumulated cost of codes can be off, twice
    error : how far a float32 cost can be off that is made of products, see `scan`
    """

    exact: NDArray[np.float32]
    frames: NDArray[np.float32]
    below: NDArray[np.uint8]
    above: NDArray[np.uint8]
    parts: NDArray[np.int64]
    first: int
    last: int
    slack: float
    margin: float
    error: float

    def __len__(self) -> int:
        return len(self.exact)

    def limit(self, worst: float, error: float = 0.0) -> float:
        """Largest approximate cost of a candidate that can in truth be as near as ``worst``.

        The root of an accumulated cost is a norm, so codes that are off by a bounded distance
        move it by no more than that: up for the one that is to be beaten, down for another.
        ``error`` is what both costs can be off by besides.
        """
        root = np.sqrt(max(worst + error, 0.0) * self.slack) + self.margin
        return float(root**2 * self.slack + error + _TINY)


def prepare_query(index: SearchIndex, exact: NDArray[np.float32], max_ratio: float) -> Query:
    """Express a query (n, D) in the units of an index."""
    n, width = exact.shape
    frames = np.zeros((n, len(index.code_step)), np.float32)
    frames[:, :width] = exact - index.code_origin[:width]
    time = np.arange(n) / max(n - 1, 1)
    parts = np.searchsorted(time, PART_EDGES, side="right").astype(np.int64)
    parts[0] = 0
    means = np.zeros((len(parts) - 1, width))
    counts = np.diff(parts)
    sums = np.add.reduceat(exact, parts[:-1][counts > 0], axis=0, dtype=np.float64)
    means[counts > 0] = sums / counts[counts > 0, None]
    means = (means - index.box_origin) / index.box_unit
    first, last = _candidates(n, index.lengths, max_ratio)
    reach = CODES / 2 * index.code_step
    largest = float(np.sum((frames - reach) ** 2, axis=1, dtype=np.float64).max())
    return Query(
        exact,
        frames,
        np.clip(np.floor(means - 1e-6), 0, 255).astype(np.uint8),
        np.clip(np.ceil(means + 1e-6), 0, 255).astype(np.uint8),
        parts,
        first,
        last,
        # a sum of s squares of differences, none negative, is off by at most s + 4 roundings
        1 + 4 * (n + width + means.size + 8) * 2.0**-24,
        2 * float(np.sqrt(n * np.sum((_CODE_ERROR * index.code_step) ** 2))),
        # a sum of D products and two squares is off by some roundings of what they amount to
        n * 2 * (frames.shape[1] + 8) * 2.0**-24 * (largest + float(np.sum(reach**2))),
    )


def _candidates(n: int, lengths: NDArray[np.int64], max_ratio: float) -> tuple[int, int]:
    """Range of the candidates, in order of length, that may be and can be warped to n frames."""
    legal = [
        m for m in range(1, 2 * n) if can_warp(n, m) and m * max_ratio >= n and m <= n * max_ratio
    ]
    if not legal:
        return 0, 0
    first, last = np.searchsorted(lengths, [legal[0], legal[-1] + 1])
    return int(first), int(last)
