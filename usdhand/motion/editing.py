"""Clips cut, moved in time, scaled, or kept in place."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from usdhand.errors import UsageError
from usdhand.motion.clip import Clip
from usdhand.motion.kinematics import forward_kinematics
from usdhand.motion.timing import quotient, recounted_code

FRAME_TOLERANCE = 1e-6  # of a frame
LATEST_START = 1e9  # time codes; beyond, single frames are no longer told apart in a file
SMALLEST_SCALE = 1e-6


def trim(clip: Clip, first: float | None, last: float | None) -> Clip:
    """Return the frames from one time code to another, both included.

    Parameters
    ----------
    first, last : time codes of the clip's file; None for its first and last frame

    Raises
    ------
    UsageError
        if no frame lies between them.
    """
    codes = clip.time_codes
    slack = FRAME_TOLERANCE * clip.origin.time_codes_per_frame
    low = codes[0] if first is None else first
    high = codes[-1] if last is None else last
    inside = np.flatnonzero((codes >= low - slack) & (codes <= high + slack))
    if not len(inside):
        raise UsageError(
            f"{clip.name}: no frame from {low:g} to {high:g}; its time codes are {codes[0]:g} to "
            f"{codes[-1]:g}."
        )
    rows = slice(int(inside[0]), int(inside[-1]) + 1)
    return replace(
        clip,
        rotations=clip.rotations[rows],
        translations=clip.translations[rows],
        scales=clip.scales[rows],
        origin=replace(clip.origin, first_time_code=float(codes[rows.start])),
    )


def counted_in_frames(clip: Clip) -> Clip:
    """Return the clip with a time code a frame, as files have that are made anew.

    It has no source any more: time codes of that count otherwise.
    """
    return replace(recounted(clip, clip.fps), source=None)


def recounted(clip: Clip, per_second: float) -> Clip:
    """Return the clip at the same times, so many time codes being a second."""
    origin, step = clip.origin, quotient(per_second, clip.fps)
    old = origin.time_codes_per_second
    if per_second == old and math.isclose(step, origin.time_codes_per_frame):
        return clip
    first = recounted_code(origin.first_time_code, old, per_second)
    origin = replace(
        origin,
        time_codes_per_second=per_second,
        first_time_code=first,
        time_codes_per_frame=step,
    )
    return replace(clip, origin=origin)


def starting_at(clip: Clip, time_code: float) -> Clip:
    """Return the clip with its first frame at ``time_code``.

    Raises
    ------
    UsageError
        if that is no time.
    """
    if not abs(time_code) <= LATEST_START:
        raise UsageError(f"A start of {time_code:g} is not possible: give a time code.")
    return replace(clip, origin=replace(clip.origin, first_time_code=float(time_code)))


def scaled(clip: Clip, factor: float) -> Clip:
    """Return the clip with a character of ``factor`` times its size.

    It has no source any more: that character is another one.

    Raises
    ------
    UsageError
        if the factor is not a positive number.
    """
    if not SMALLEST_SCALE <= factor <= 1.0 / SMALLEST_SCALE:
        raise UsageError(f"A scale of {factor:g} is not possible: give a number above 0.")
    bind, rest = clip.skeleton.bind.copy(), clip.skeleton.rest.copy()
    bind[:, :3, 3] *= factor
    rest[:, :3, 3] *= factor
    skeleton = replace(clip.skeleton, bind=bind, rest=rest)
    translations = clip.translations * factor
    return replace(clip, skeleton=skeleton, translations=translations, source=None)


def in_place(clip: Clip, hips: int) -> Clip:
    """Return the clip with its ``hips`` staying over one spot; heading and height are kept."""
    path = forward_kinematics(clip, [hips]).position(hips)
    away = (path - path[0]) * np.array([1.0, 0.0, 1.0])
    roots = np.flatnonzero(clip.skeleton.parents < 0)
    translations = clip.translations.copy()
    translations[:, roots] -= away[:, None]
    return replace(clip, translations=translations)
