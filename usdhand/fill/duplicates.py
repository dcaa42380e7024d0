"""Library clips that are the very performance that is filled, under whatever name or on any rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy import Side
from usdhand.fill.arm import ArmMotion
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.fill.metric import FEATURES
from usdhand.fill.settings import Feature
from usdhand.motion.rotations import Array

# Feature of the arm -> root mean square by which two takes of one performance differ at most, and
# the least range that tells anything: what is still is alike for no reason. Positions are the same
# after retargeting by the hands' places, rotations on a body of other proportions. Of 24 takes on
# two rigs, palms turn alike within 0.04 degrees; those of different takes differ by 8 or more. (A
# root mean square of 1 over the nine numbers of a rotation is 3 degrees.)
SAME_WITHIN: Mapping[Feature, tuple[float, float]] = {
    "hips_position": (1.0, 5.0),
    "hips_palm": (1.0, 15.0),
}
LONGEST_OFFSET_S = 1.0
SMALLEST_OVERLAP = 0.7
SAMPLED_FRAMES = 12  # about so many rule out most offsets
# An excerpt is looked for all along the longer motion. The shorter it is, the more is like it by
# chance: of 24 real takes and 67 samples, pieces of 1 s come as near as 1.0 (positions) and 1.6
# (palms) to some place of another, 1.7 in both; pieces of 2 s as near as 2.2 and 3.5. So a short
# one must be alike in both features. (Of 62 real takes, no piece is told to be of another one; all
# of 2 s are found in their own, and of 1 s those in which an arm moves.)
SHORTEST_EXCERPT_S = 1.0
SHORT_EXCERPT_S = 2.0


@dataclass(frozen=True, eq=False)
class FeatureCurve:
    """A feature over time, (frames, n) in cm or degrees, with what comparing it takes again."""

    rows: Array

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def mean(self) -> Array:
        """(n,) over all frames."""
        return np.asarray(self.rows.mean(axis=0))

    @cached_property
    def spectrum(self) -> NDArray[np.complexfloating]:
        """Transform of the rows less their mean."""
        from scipy import fft  # not scipy.signal, which takes most of a second to import

        return np.asarray(fft.rfft(self.rows - self.mean, self.size, axis=0))

    @cached_property
    def size(self) -> int:
        """Length of the transform."""
        from scipy import fft

        return int(fft.next_fast_len(len(self), real=True))

    @cached_property
    def squares(self) -> Array:
        """(frames + 1,) sums of squares of the rows less their mean, up to each frame."""
        squared = np.square(self.rows - self.mean).sum(axis=1)
        return np.concatenate([[0.0], np.cumsum(squared)])


Rows = Mapping[str, FeatureCurve]


def same_motion(
    library: MotionLibrary, arms: Mapping[Side, ArmMotion], content_hash: str | None
) -> list[int]:
    """Clips with the same content, or with the same motion as a body's ``arms`` at `ARM_FPS`.

    Taking fingers from them would be copying the answer, which is what nobody wants to measure.
    """
    ours = {side: _rows(arm) for side, arm in arms.items()}
    return [
        i
        for i, clip in enumerate(library.clips)
        if (content_hash is not None and clip.content_hash == content_hash)
        or _same([(ours[s], hand.arm) for s, hand in clip.hands.items() if s in ours])
    ]


def _rows(arm: ArmMotion) -> Rows:
    return {name: FeatureCurve(FEATURES[name](arm)) for name in SAME_WITHIN}


def _same(pairs: list[tuple[Rows, ArmMotion]]) -> bool:
    """Whether all pairs are alike in one feature, as a whole or one as part of the other."""
    if not pairs:
        return False
    # The arms of a clip have the same length, so that one is the shorter one in all pairs.
    lengths = sorted((len(pairs[0][0]["hips_palm"]), len(pairs[0][1].wrist)))
    both = [(ours, _rows(arm)) for ours, arm in pairs]
    by_name = {name: [(a[name], b[name]) for a, b in both] for name in SAME_WITHIN}
    whole = lengths[0] >= SMALLEST_OVERLAP * lengths[1]
    if whole and any(
        _same_at_one_offset(by_name[name], *SAME_WITHIN[name]) for name in SAME_WITHIN
    ):
        return True
    if lengths[0] < SHORTEST_EXCERPT_S * ARM_FPS:
        return False
    within, moves = zip(
        *(_excerpt_offsets(by_name[name], *SAME_WITHIN[name]) for name in SAME_WITHIN), strict=True
    )
    if lengths[0] < SHORT_EXCERPT_S * ARM_FPS:
        return any(moves) and bool(np.all(within, axis=0).any())
    return any(m and bool(a.any()) for a, m in zip(within, moves, strict=True))


def _excerpt_offsets(
    pairs: list[tuple[FeatureCurve, FeatureCurve]], tolerance: float, least: float
) -> tuple[NDArray[np.bool_], bool]:
    """At which offsets of the shorter rows in the longer ones all are alike, and if any moves."""
    ordered = [(a, b) if len(a) <= len(b) else (b, a) for a, b in pairs]
    apart = np.max([_apart(short, long) for short, long in ordered], axis=0)
    moves = max(np.ptp(short.rows, axis=0).max() for short, _ in ordered) >= least
    return np.asarray(apart < tolerance), bool(moves)


def _apart(short: FeatureCurve, long: FeatureCurve) -> Array:
    """Root mean square between rows (m, n) and each m rows of (frames, n): (frames - m + 1,)."""
    from scipy import fft

    rows = short.rows - long.mean
    turned = np.conj(fft.rfft(rows, long.size, axis=0))
    turned *= long.spectrum
    products = fft.irfft(turned.sum(axis=1), long.size)[: len(long) - len(rows) + 1]
    windows = long.squares[len(rows) :] - long.squares[: -len(rows)]
    total = np.square(rows).sum() + windows - 2.0 * products
    return np.asarray(np.sqrt(np.maximum(total, 0.0) / rows.size))


def _same_at_one_offset(
    pairs: list[tuple[FeatureCurve, FeatureCurve]], tolerance: float, least: float
) -> bool:
    """Whether all pairs of rows (frames, n) are the same at one offset, and some of them moves."""
    if max(np.ptp(a.rows, axis=0).max() for a, _ in pairs) < least:
        return False
    most = int(LONGEST_OFFSET_S * ARM_FPS)
    offsets = np.arange(-most, most + 1)
    for a, b in pairs:
        offsets = offsets[_within_at_samples(a, b, offsets, tolerance)]
    return any(
        all(_apart_at(a, b, offset) < tolerance for a, b in pairs) for offset in offsets.tolist()
    )


def _overlap(a: FeatureCurve, b: FeatureCurve, offset: NDArray[np.intp]) -> NDArray[np.intp]:
    """Frames that A and B have in common where B is ``offset`` frames late."""
    return np.asarray(np.minimum(len(a) - np.maximum(-offset, 0), len(b) - np.maximum(offset, 0)))


def _within_at_samples(
    a: FeatureCurve, b: FeatureCurve, offsets: NDArray[np.intp], tolerance: float
) -> NDArray[np.bool_]:
    """(offsets,) false where a few frames alone are further apart than all may be."""
    count = _overlap(a, b, offsets)
    frames = np.arange(0, len(a), max(1, len(a) // SAMPLED_FRAMES))
    there = frames + offsets[:, None]
    inside = (there >= 0) & (there < len(b))
    away = a.rows[frames] - b.rows[np.clip(there, 0, len(b) - 1)]
    squares = (np.square(away).sum(axis=2) * inside).sum(axis=1)
    limit = tolerance**2 * count * a.rows.shape[1]
    enough = count >= SMALLEST_OVERLAP * min(len(a), len(b))
    return np.asarray(enough & (squares <= limit * (1.0 + 1e-9)))


def _apart_at(a: FeatureCurve, b: FeatureCurve, offset: int) -> float:
    """Root mean square between the rows that A and B have in common."""
    count = int(_overlap(a, b, np.array(offset)))
    first, second = a.rows[max(-offset, 0) :][:count], b.rows[max(offset, 0) :][:count]
    return float(np.sqrt(np.mean((first - second) ** 2)))
