"""Curves of a SkelAnimation: read, checked and brought to the frames of a clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdSkel

from usdhand.errors import InputError
from usdhand.formats.usd.samples import EVERY, Track, blocks, open_track
from usdhand.motion import Problem
from usdhand.motion.rotations import Array

UNIT_TOLERANCE = 1e-6  # of a squared norm: what rounding to float32 leaves
SHORTEST = 1e-6  # squared norm below which a quaternion has no direction
STEADY_TOLERANCE = 1e-3  # frames: how far samples may lie off a steady grid
SLOWEST_NATIVE_FPS = 12.0  # sparser samples are keys of curves, not frames
FASTEST_TIME_CODES = 240.0  # above, time codes are ticks rather than frames

MOST_FRAMES = 1_000_000  # more is a mistake in time codes: 4.6 hours at 60 fps

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
        return [track.times for track in tracks if track is not None and not track.still]


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
    if not (np.abs(norms - 1.0) <= UNIT_TOLERANCE).all():
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


def frame_times(stage: Usd.Stage, samples: list[Array]) -> tuple[Array, tuple[Problem, ...]]:
    """Time codes of a clip's frames: those of its samples where steady, else a steady grid.

    Raises
    ------
    InputError
        if the time codes cannot be meant.
    """
    times = _union(samples)
    per_second = stage.GetTimeCodesPerSecond()
    if not np.isfinite(times).all() or not 0 < per_second < np.inf:
        raise InputError(
            f"{stage.GetRootLayer().realPath}: its time codes are no times, at {per_second:g} time "
            "codes a second. Export the animation again."
        )
    if not len(times):
        return np.array([stage.GetStartTimeCode()]), ()
    if len(times) == 1:
        return times, ()
    step = (times[-1] - times[0]) / (len(times) - 1)
    steady = np.abs(np.diff(times) - step).max() < STEADY_TOLERANCE * step
    if steady and per_second / step >= SLOWEST_NATIVE_FPS:
        return times, ()
    frame = _frame(times, per_second, stage.GetFramesPerSecond())
    count = int(np.floor((times[-1] - times[0]) / frame + 1e-6)) + 1
    if count > MOST_FRAMES:
        raise InputError(
            f"{stage.GetRootLayer().realPath}: its {len(times)} samples are spread over time codes "
            f"{times[0]:g} to {times[-1]:g}, which would make {count} frames. Check the time codes "
            "or timeCodesPerSecond."
        )
    problem = Problem(
        "resampled",
        f"{len(times)} samples are not a steady sequence of frames: read every {frame:g} time "
        "codes, interpolated as USD does",
    )
    return np.asarray(times[0] + frame * np.arange(count)), (problem,)


def _frame(times: Array, per_second: float, fps: float) -> float:
    """Time codes a frame of a steady grid over unsteady samples."""
    ticks = per_second > FASTEST_TIME_CODES
    frame = per_second / (fps if 0 < fps < np.inf else 24.0) if ticks else 1.0
    shortest = float(np.diff(times).min())
    on_grid = (times - times[0]) / shortest
    if np.abs(on_grid - np.round(on_grid)).max() < STEADY_TOLERANCE and (
        frame / 20 <= shortest < frame
    ):
        return shortest
    return frame


def _union(samples: list[Array]) -> Array:
    if not samples:
        return np.empty(0)
    if all(np.array_equal(samples[0], other) for other in samples[1:]):
        return samples[0]
    return np.unique(np.concatenate(samples).round(9))


def joint_targets(animation: UsdSkel.Animation, joints: Sequence[str]) -> NDArray[np.intp]:
    """Place in ``joints`` of each joint that an animation lists, -1 for unknown ones."""
    index = {joint: i for i, joint in enumerate(joints)}
    listed = animation.GetJointsAttr().Get() or ()
    return np.array([index.get(str(token), -1) for token in listed], dtype=np.intp)
