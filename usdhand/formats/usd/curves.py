"""Curves of a SkelAnimation: read, checked and brought to the frames of a clip."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdSkel, Vt

from usdhand.errors import InputError
from usdhand.formats.usd.samples import EVERY, Track, blocks, open_track
from usdhand.motion.rotations import Array
from usdhand.motion.timing import (
    FASTEST_TIME_CODES,
    MOST_FRAMES,
    SPARSE,
    Clock,
    Timing,
    find_timing,
)
from usdhand.problems import Problem

SQUARED_UNIT_TOLERANCE = 1e-6  # of a squared norm: what rounding to float32 leaves
SHORTEST = 1e-6  # squared norm below which a quaternion has no direction
USUAL_FPS = 24.0  # of a stage that counts ticks and does not say its frame rate

Fault = tuple[NDArray[np.bool_], str]  # (samples, joints) that cannot be used, and what they are
Finish = Callable[[Array, slice], Fault | None]


@dataclass(frozen=True, eq=False)
class Tracks:
    """The motion attributes of a SkelAnimation, None where nothing is authored."""

    rotations: Track | None
    translations: Track | None
    scales: Track | None

    @classmethod
    def of(cls, animation: UsdSkel.Animation, joints: int) -> Tracks:
        """Open the attributes of an animation of so many joints."""
        return cls(
            open_track(animation.GetRotationsAttr(), (joints, 4)),
            open_track(animation.GetTranslationsAttr(), (joints, 3)),
            open_track(animation.GetScalesAttr(), (joints, 3)),
        )

    def at(self, times: Array) -> Tracks:
        """The same attributes at other times, as USD interpolates them."""
        rotations, translations, scales = (
            None if track is None else track.at(times)
            for track in (self.rotations, self.translations, self.scales)
        )
        return Tracks(rotations, translations, scales)

    @property
    def times(self) -> list[Array]:
        """Sample times of those that have any."""
        tracks = (self.rotations, self.translations, self.scales)
        return [track.times for track in tracks if track is not None and len(track.times)]


def type_problems(tracks: Tracks, where: str) -> Iterator[Problem]:
    """Tell values of other types than UsdSkel reads: it then shows the rest pose."""
    for track, wanted, name in (
        (tracks.rotations, Vt.QuatfArray, "quatf[]"),
        (tracks.translations, Vt.Vec3fArray, "float3[]"),
        (tracks.scales, Vt.Vec3hArray, "half3[]"),
    ):
        if track is None or isinstance(value := track.get(track.keys[0]), wanted):
            continue
        message = (
            f"the values of {track.attribute.GetName()} are {type(value).__name__} instead of "
            f"{name}, so USD shows the rest pose; they are read all the same, and 'usdhand "
            "convert' writes them anew"
        )
        yield Problem("wrong-type", message, where)


def read_curve(
    track: Track, joints: Sequence[str], targets: NDArray[np.intp], neutral: Array, finish: Finish
) -> Array:
    """Read a motion attribute: (times of ``track``, joints, n), one row if it is still.

    Parameters
    ----------
    joints : of the skeleton
    targets : (elements,) place among ``joints`` of each element of the attribute, -1 for none
    neutral : (joints, n) values of joints that the attribute does not have
    finish : checks and changes each block of samples while it is in the processor's cache:
        passes over all of a long take would cost more than reading it

    Raises
    ------
    InputError
        if a sample is blocked, has another number of elements, or ``finish`` finds a fault.
    """
    values = np.empty((len(track.keys), *neutral.shape))
    whole = np.array_equal(targets, np.arange(len(joints)))
    elements = EVERY if whole else np.flatnonzero(targets >= 0)
    places = targets[elements]
    for block in blocks(len(values)):
        if not whole:
            values[block] = neutral
        track.fill(values[block], block.start, elements, places)
        fault = finish(values, block)
        if fault is not None:
            bad, what = fault
            sample, joint = (int(i) for i in np.argwhere(bad)[0])
            times = track.times[block]
            at = f"time code {times[sample]:g}" if len(times) else "the default value"
            raise InputError(
                f"{track.where}: {what} in {track.attribute.GetPath()}, "
                f"joint '{joints[joint]}', at {at}. Repair or export the animation again."
            )
    return values


def finish_rotations(values: Array, block: slice) -> Fault | None:
    """Bring quaternions to unit length and to the half space of the sample before, in place."""
    rows = values[block]
    norms = _dot(rows, rows)
    if not (np.abs(norms - 1.0) <= SQUARED_UNIT_TOLERANCE).all():
        if not np.isfinite(norms).all():
            return ~np.isfinite(norms), "not-a-number"
        if norms.min() < SHORTEST:
            return norms < SHORTEST, "zero-length quaternion"
        rows /= np.sqrt(norms)[..., None]
    joined = values[max(block.start - 1, 0) : block.stop]
    flips = _dot(joined[1:], joined[:-1]) < 0
    if flips.any():
        odd = np.logical_xor.accumulate(flips, axis=0)
        np.negative(joined[1:], out=joined[1:], where=odd[..., None])
    return None


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b) @ np.ones(a.shape[-1]))  # a quarter faster than einsum


def finish_vectors(factor: float) -> Finish:
    """Return what multiplies vectors by ``factor``, in place."""

    def finish(values: Array, block: slice) -> Fault | None:
        rows = values[block]
        if not np.isfinite(rows.sum()):
            return ~np.all(np.isfinite(rows), axis=2), "not-a-number"
        if factor != 1.0:
            rows *= factor
        return None

    return finish


def frame_timing(stage: Usd.Stage, samples: list[Array]) -> tuple[Timing, tuple[Problem, ...]]:
    """Find a clip's frames: its samples where they are steady, else a steady grid over them.

    Raises
    ------
    InputError
        if the time codes cannot be meant.
    """
    where = stage.GetRootLayer().realPath
    samples = samples or [np.array([stage.GetStartTimeCode()])]
    per_second, said = stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()
    if not all(np.isfinite(times).all() for times in samples) or not 0 < per_second < np.inf:
        raise InputError(
            f"{where}: its time codes are not times, at {per_second:g} time codes a second. Export "
            "the animation again."
        )
    if per_second <= FASTEST_TIME_CODES:
        rate = per_second
    else:
        rate = said if 0 < said < np.inf else USUAL_FPS
    timing = find_timing(samples, Clock(per_second, rate))
    if timing.rhythm == "rounded" and not SPARSE <= per_second <= FASTEST_TIME_CODES:
        message = (
            f"{per_second:g} time codes a second are no frames: {timing.fps:g} frames a second are "
            f"read, on which its {len(timing.keys)} samples lie, rounded"
        )
        return timing, (Problem("guessed-fps", message),)
    if timing.rhythm != "uneven":
        return timing, ()
    count, first, last = len(timing.keys), timing.keys[0], timing.keys[-1]
    if timing.count > MOST_FRAMES:
        raise InputError(
            f"{where}: its {count} samples are spread over time codes {first:g} to {last:g}, which "
            f"would make {timing.count} frames. Check the time codes or timeCodesPerSecond."
        )
    problem = Problem(
        "resampled",
        f"{count} samples are not evenly spaced: read every {timing.step:g} time "
        "codes, interpolated as USD does",
    )
    return timing, (problem,)


def joint_targets(animation: UsdSkel.Animation, joints: Sequence[str]) -> NDArray[np.intp]:
    """Place in ``joints`` of each joint that an animation lists, -1 for unknown ones."""
    index = {joint: i for i, joint in enumerate(joints)}
    listed = animation.GetJointsAttr().Get() or ()
    return np.array([index.get(str(token), -1) for token in listed], dtype=np.intp)
