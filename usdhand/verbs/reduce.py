"""Method 1 on clips and files: reduce and expand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np

from usdhand.anatomy import SIDES, Side
from usdhand.errors import UsageError
from usdhand.formats.files import read_any, reopened
from usdhand.formats.usd import rig as usd_rig
from usdhand.motion import Clip, Problem
from usdhand.motion.resample import in_time_of
from usdhand.reduce.fit import PRESETS, Fit, Thresholds
from usdhand.reduce.method import Reduction, Target, apply_rig, fit_rig
from usdhand.reduce.method import expand as expand_channels
from usdhand.reduce.rig import ReducedRig
from usdhand.rigs import Conventions
from usdhand.verbs.clips import find_hands


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
    if fit not in get_args(Fit):
        raise UsageError(f"There is no fit '{fit}'; there are {' and '.join(get_args(Fit))}.")
    hands = [
        find_hands(clip, conventions, sides, [c for c in clips if _same_skeleton(c, clip)])
        for clip in clips
    ]
    sources = [h.encode(clip) for clip, h in zip(clips, hands, strict=True)]
    if rig is None:
        target = reduction_target(preset, range_deg, rmsd, free_channels, max_error)
        rig = fit_rig(clips, hands, target, fit, most_controllers, sources)
    each = zip(clips, hands, sources, strict=True)
    return [apply_rig(rig, clip, h, source) for clip, h, source in each]


def expand(
    path: str | Path, conventions: Conventions | None = None, skel: str | None = None
) -> Clip:
    """Motion of a rig file: dependent channels computed from its free ones.

    ``skel`` chooses a rig by its skeleton where the file has several.
    """
    stored = usd_rig.read_stored_rig(path, skel)
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
    body, _ = read_any(target, skel)
    body = in_time_of(body, stored.clip)
    return expand_channels(stored.rig, stored.free, body, find_hands(body, conventions))


def read_rig(path: str | Path, skel: str | None = None) -> ReducedRig:
    """Read the relations of a rig file, to apply them to other clips.

    ``skel`` chooses a rig by its skeleton where the file has several.
    """
    return usd_rig.read_rig(path, skel)


def write_rig(
    reduction: Reduction, output: str | Path, *, flatten: bool = False, force: bool = False
) -> tuple[Problem, ...]:
    """Write a reduced clip as a rig over the file it was read from.

    Returns what one file, if it was to be one, could not keep.
    """
    return usd_rig.write_rig(
        reduction, reopened(reduction.clip), Path(output), flatten=flatten, force=force
    )


def _same_skeleton(a: Clip, b: Clip) -> bool:
    """Whether two clips are of one character, so that they may share anatomical frames."""
    return a.skeleton.joints == b.skeleton.joints and np.allclose(
        a.skeleton.bind, b.skeleton.bind, atol=1e-4
    )
