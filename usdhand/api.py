"""The verbs of usdhand as functions on values; what is odd comes back beside the result.

Example
-------
>>> import usdhand                                             # doctest: +SKIP
>>> clip = usdhand.read_clip("samples/gestures/ok_01.usdc")    # doctest: +SKIP
>>> [reduction] = usdhand.reduce_hands([clip], preset=4)       # doctest: +SKIP
>>> reduction.rig.free                                         # doctest: +SKIP
>>> usdhand.write_rig(reduction, "ok_rig.usdc")                # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from usdhand.anatomy import SIDES, Conventions, Hands, Side, load_conventions, map_character
from usdhand.compare import Comparison, compare_clips
from usdhand.errors import HandNotFoundError, InputError, UsageError
from usdhand.formats.usd import rig as usd_rig
from usdhand.formats.usd.check import Finding, check_file
from usdhand.formats.usd.read import clip_from_character, read_character, read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.reduce import (
    PRESETS,
    Fit,
    ReducedRig,
    Reduction,
    Target,
    Thresholds,
    apply_rig,
    fit_rig,
)
from usdhand.reduce import expand as expand_channels

__all__ = [
    "Comparison",
    "Finding",
    "apply_rig",
    "check_file",
    "compare",
    "expand",
    "expand_onto",
    "find_hands",
    "read_character",
    "read_clip",
    "read_rig",
    "reduce_hands",
    "reduction_target",
    "write_clip",
    "write_rig",
]


def find_hands(
    clip: Clip, conventions: Conventions | None = None, sides: Sequence[Side] = SIDES
) -> Hands:
    """Find the hands of a clip's skeleton and build their anatomical frames.

    Raises
    ------
    HandNotFoundError
        if there is no hand, or an ambiguous one, or none on the wanted side.
    """
    character = map_character(clip.skeleton, conventions)
    wanted = [side for side in sides if side in character.hands]
    if not wanted:
        there = " and ".join(character.hands)
        raise HandNotFoundError(f"No {' or '.join(sides)} hand was found, only the {there} one.")
    return Hands.of(clip, character, wanted)


def reduction_target(
    preset: int | None = None,
    range_deg: float | None = None,
    rmsd: float | None = None,
    free_channels: int | None = None,
    max_error: float | None = None,
) -> Target:
    """Make a target from what was given; preset 4 if nothing was.

    Raises
    ------
    UsageError
        if more than one way is used, or a preset or threshold is out of range.
    """
    thresholds = None
    if preset is not None and preset not in PRESETS:
        raise UsageError(
            f"There is no preset {preset}; presets are {', '.join(map(str, PRESETS))}."
        )
    if preset is not None and (range_deg is not None or rmsd is not None):
        raise UsageError("A preset sets both thresholds; give a preset or thresholds, not both.")
    if range_deg is not None or rmsd is not None:
        thresholds = Thresholds(range_deg or 0.0, rmsd or 0.0)
        if not (thresholds.range >= 0 and 0 <= thresholds.rmsd <= 2):
            raise UsageError("Thresholds: a range of 0 degrees or more, an rmsd from 0 to 2.")
    elif preset is not None:
        thresholds = PRESETS[preset]
    elif free_channels is None and max_error is None:
        thresholds = PRESETS[4]
    return Target(thresholds, free_channels, max_error)


def reduce_hands(
    clips: Sequence[Clip],
    *,
    preset: int | None = None,
    range_deg: float | None = None,
    rmsd: float | None = None,
    free_channels: int | None = None,
    max_error: float | None = None,
    fit: Fit = "paper",
    most_controllers: int = 1,
    rig: ReducedRig | None = None,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
) -> list[Reduction]:
    """Fit one rig to all clips (or apply a fitted one) and express every clip in it.

    Parameters
    ----------
    preset : 1 to 4, the paper's steps; or ``range_deg`` (degrees) and ``rmsd`` thresholds;
        or ``free_channels``, how many shall stay; or ``max_error``, the largest RMS error of any
        channel in degrees
    fit : "paper" keeps standard deviations, "least-squares" has the least error
    most_controllers : how many channels one may follow, with least squares
    rig : a fitted rig to apply as it is

    Returns
    -------
    list of Reduction, one a clip, all with the same rig.
    """
    if not clips:
        raise UsageError("There is no clip to reduce.")
    hands = [find_hands(clip, conventions, sides) for clip in clips]
    if rig is None:
        target = reduction_target(preset, range_deg, rmsd, free_channels, max_error)
        rig = fit_rig(clips, hands, target, fit, most_controllers)
    return [apply_rig(rig, clip, h) for clip, h in zip(clips, hands, strict=True)]


def expand(path: str | Path, conventions: Conventions | None = None) -> Clip:
    """Motion of a rig file: dependent channels computed from its free ones."""
    stored = usd_rig.read_stored_rig(path)
    hands = usd_rig.with_stored_frames(find_hands(stored.clip, conventions), stored.frames)
    return expand_channels(stored.rig, stored.free, stored.clip, hands)


def expand_onto(
    path: str | Path,
    target: str | Path,
    skel: str | None = None,
    conventions: Conventions | None = None,
) -> Clip:
    """Motion of a rig file's hands on another character, in the rig's time.

    The body keeps the target's own motion, its ends held, or its bind pose where it has none.
    """
    stored = usd_rig.read_stored_rig(path)
    character = find_character(Path(target), skel)
    body = clip_from_character(character) if character.animation else read_character(target, skel)
    body = _in_time_of(body, stored.clip)
    return expand_channels(stored.rig, stored.free, body, find_hands(body, conventions))


def compare(
    a: Clip, b: Clip, *, align: bool = False, conventions: Conventions | None = None
) -> Comparison:
    """Compare motion B with motion A; see `usdhand.compare.compare_clips`."""
    return compare_clips(a, b, find_hands(a, conventions), find_hands(b, conventions), align)


def read_rig(path: str | Path) -> ReducedRig:
    """Read the relations of a rig file, to apply them to other clips."""
    return usd_rig.read_rig(path)


def write_rig(
    reduction: Reduction, output: str | Path, *, flatten: bool = False, force: bool = False
) -> None:
    """Write a reduced clip as a rig over the file it was read from."""
    character = find_character(_source(reduction.clip), reduction.clip.origin.skeleton_path)
    usd_rig.write_rig(reduction, character, Path(output), flatten=flatten, force=force)


def write_clip(
    clip: Clip,
    output: str | Path,
    *,
    flatten: bool = False,
    force: bool = False,
    conventions: Conventions | None = None,
    inputs: Sequence[Path] = (),
) -> None:
    """Write a clip's hands as a layer over the file it was read from; the body stays as it is.

    Raises
    ------
    InputError
        if the clip was not read from a file.
    OutputError
        if the output is refused or cannot be written.
    """
    character = find_character(_source(clip), clip.origin.skeleton_path)
    changed = [int(j) for f in find_hands(clip, conventions).frames.values() for j in f.joints]
    write_motion(
        character, clip, changed, Path(output), flatten=flatten, force=force, inputs=inputs
    )


def conventions_from(files: Sequence[Path]) -> Conventions | None:
    """Return the built-in conventions with a user's files on top, None without any."""
    return load_conventions(*files) if files else None


def _source(clip: Clip) -> Path:
    if clip.origin.path is None:
        raise InputError(f"{clip.name}: this clip was not read from a file, so there is no stage.")
    return clip.origin.path


def _in_time_of(body: Clip, other: Clip) -> Clip:
    """Return a body at the frames of another clip, its ends held."""
    seconds = np.arange(len(other)) / other.fps
    frames = np.clip(seconds * body.fps, 0, len(body) - 1)
    per_second = body.origin.time_codes_per_second
    origin = replace(
        body.origin,
        first_time_code=other.start * per_second,
        time_codes_per_frame=per_second / other.fps,
    )
    return replace(
        body,
        rotations=interpolate_rotations(body.rotations, frames),
        translations=interpolate(body.translations, frames),
        scales=interpolate(body.scales, frames),
        fps=other.fps,
        origin=origin,
    )
