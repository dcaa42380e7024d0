"""Library segments whose arm motion is like that of a body segment.

Joerg, Hodgins & Safonova 2012, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdhand.fill.arm import ArmMotion
from usdhand.fill.library import ARM_FPS, MotionLibrary, Part, hand_segments
from usdhand.fill.metric import feature_rows
from usdhand.fill.segment import segments, wrist_speed
from usdhand.fill.settings import Metric, Segmentation
from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.search import PackedSegments, SearchIndex, pack, prepare, search, warp_many


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Segments of a library for one part of the body, ready to be searched.

    Attributes
    ----------
    clips, firsts, lasts : (segments,) index of the clip, first and last frame at `ARM_FPS`
    """

    part: Part
    metric: Metric
    segmentation: Segmentation
    clips: NDArray[np.intp]
    firsts: NDArray[np.intp]
    lasts: NDArray[np.intp]
    packed: PackedSegments
    index: SearchIndex


@dataclass(frozen=True, eq=False)
class Candidate:
    """A library segment for a body segment.

    Attributes
    ----------
    segment : its index in the search space
    cost : mean squared distance of the warped arm motion (equation 1)
    warp : (frames,) frame of the library segment for each frame of the body segment
    stretch : what the body segment's length was multiplied by before, since the library has none
        of like length; 1 else
    """

    segment: int
    cost: float
    warp: NDArray[np.intp]
    stretch: float = 1.0


def search_space(
    library: MotionLibrary, part: Part, metric: Metric, segmentation: Segmentation | None = None
) -> SearchSpace:
    """Cut and pack a library's clips that have all hands of ``part``.

    With a ``segmentation``, the clips are cut anew; else as the library is.
    """
    cutting = segmentation or library.segmentation
    as_stored = len(part) == 1 and cutting == library.segmentation
    clips: list[int] = []
    firsts: list[int] = []
    lasts: list[int] = []
    pieces: list[NDArray[np.float32]] = []
    for number, clip in enumerate(library.clips):
        if not set(part) <= set(clip.hands):
            continue
        hands = [clip.hands[side] for side in part]
        rows = part_rows([hand.arm for hand in hands], metric)
        cut = hands[0].segments if as_stored else hand_segments(hands, cutting)
        for first, last in cut:
            clips.append(number)
            firsts.append(first)
            lasts.append(last)
            pieces.append(rows[first : last + 1])
    packed = pack(pieces, groups=np.array(clips, dtype=np.int32))
    return SearchSpace(
        part,
        metric,
        cutting,
        np.array(clips, dtype=np.intp),
        np.array(firsts, dtype=np.intp),
        np.array(lasts, dtype=np.intp),
        packed,
        prepare(packed),
    )


def part_rows(arms: Sequence[ArmMotion], metric: Metric) -> NDArray[np.float32]:
    """Feature rows (frames, D) of the arms of a part together."""
    return np.concatenate([feature_rows(metric, arm) for arm in arms], axis=1)


def part_segments(arms: Sequence[ArmMotion], segmentation: Segmentation) -> list[tuple[int, int]]:
    """Segments of the arms of a part: cut where the faster one comes to rest."""
    speeds = [wrist_speed(a.hips_position, ARM_FPS, segmentation.smoothing) for a in arms]
    return segments(np.max(speeds, axis=0), ARM_FPS, segmentation)


def find_candidates(
    queries: Sequence[NDArray[np.float32]],
    space: SearchSpace,
    count: int,
    factor: float = 1.5,
    exclude: Sequence[int] = (),
) -> list[list[Candidate]]:
    """The ``count`` best library segments for each query, best first.

    Parameters
    ----------
    queries : (frames, D) feature rows
    factor : largest ratio of lengths
    exclude : clips that are not taken, such as the very one that is filled

    A query that has no library segment within the factor is first brought to the nearest length
    that has one; `Candidate.stretch` says so.
    """
    found = _search(queries, space, count, factor, exclude)
    alone = [i for i, own in enumerate(found) if not own]
    lengths = (space.lasts - space.firsts + 1)[~np.isin(space.clips, list(exclude))]
    if not alone or not len(lengths):
        return found
    stretched = []
    for i in alone:
        apart = np.abs(np.log(lengths / len(queries[i])))
        frames = np.linspace(0, len(queries[i]) - 1, int(lengths[np.argmin(apart)]))
        stretched.append(interpolate(queries[i].astype(np.float64), frames).astype(np.float32))
    for i, longer, own in zip(
        alone, stretched, _search(stretched, space, count, factor, exclude), strict=True
    ):
        ratio = (len(longer) - 1) / (len(queries[i]) - 1)
        found[i] = [replace(candidate, stretch=ratio) for candidate in own]
    return found


def _search(
    queries: Sequence[NDArray[np.float32]],
    space: SearchSpace,
    count: int,
    factor: float,
    exclude: Sequence[int],
) -> list[list[Candidate]]:
    asked = pack(queries)
    groups = np.array(exclude, np.int32)
    matches = search(space.index, asked, k=count, max_ratio=factor, exclude=groups)
    rows, columns = np.nonzero(matches.ids >= 0)
    segments_found = matches.ids[rows, columns]
    paths = warp_many(asked, space.packed, np.stack([rows, segments_found], axis=1))
    costs = matches.costs[rows, columns].tolist()
    found: list[list[Candidate]] = [[] for _ in queries]
    for row, segment, cost, path in zip(rows, segments_found.tolist(), costs, paths, strict=True):
        found[row].append(Candidate(segment, cost, path))
    return found


@dataclass(frozen=True, eq=False)
class FingerSource:
    """Finger channels (frames, channels) of a library clip, at its rate."""

    fps: float
    curves: Array


def finger_sources(
    library: MotionLibrary, part: Part, joints: Sequence[tuple[str, ...]], clips: Iterable[int]
) -> dict[int, FingerSource]:
    """Fingers of clips that have these joints; ``joints`` are a hand each."""
    return {
        i: FingerSource(
            library.clips[i].fps,
            np.concatenate(
                [
                    library.clips[i].hands[side].curves_of(wanted)
                    for side, wanted in zip(part, joints, strict=True)
                ],
                axis=1,
            ),
        )
        for i in clips
    }


def finger_curves(
    candidates: Sequence[Candidate],
    space: SearchSpace,
    sources: Mapping[int, FingerSource],
    seconds: Array,
) -> Array:
    """Fingers (candidates, frames, channels) of the candidates of one body segment, warped to it.

    Parameters
    ----------
    seconds : (frames,) from the beginning of the body segment
    """
    smooth = smooth_warp(np.stack([c.warp for c in candidates]))
    # One look-up for all candidates, since their warps have the same length.
    along = interpolate(smooth.T, seconds * (ARM_FPS * candidates[0].stretch)).T
    owners = [sources[int(space.clips[c.segment])] for c in candidates]
    firsts = space.firsts[[c.segment for c in candidates]]
    rates = np.array([owner.fps for owner in owners])
    last = np.array([len(owner.curves) - 1 for owner in owners])
    frames = (firsts[:, None] + along) * (rates / ARM_FPS)[:, None]
    frames = np.clip(frames, 0.0, last[:, None])
    low = frames.astype(np.intp)
    high = np.minimum(low + 1, last[:, None])
    part = (frames - low)[..., None]
    curves = np.stack([owner.curves[i] for owner, i in zip(owners, low, strict=True)])
    after = np.stack([owner.curves[i] for owner, i in zip(owners, high, strict=True)])
    return np.asarray(curves + part * (after - curves))


def smooth_warp(paths: NDArray[np.intp], sigma: float = 2.0) -> Array:
    """Warps (n, frames) without their stairs; ends still meet, and time still never runs back."""
    from scipy.ndimage import gaussian_filter1d

    first, last = paths[:, :1], paths[:, -1:]
    straight = first + (last - first) * np.linspace(0.0, 1.0, paths.shape[1])
    away = gaussian_filter1d(paths - straight, sigma, axis=1, mode="nearest")
    smooth = np.clip(straight + away, first, last)
    smooth[:, [0, -1]] = paths[:, [0, -1]]
    return np.asarray(np.maximum.accumulate(smooth, axis=1))
