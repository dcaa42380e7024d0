"""Values that motion can have: finite, and of a size that can be meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.motion.clip import Clip
from usdhand.motion.rotations import Array

# Centimetres and scales: a million kilometres. Products of values below it do not overflow.
LARGEST = 1e11


def check_clip(clip: Clip, file: str | Path, what: str = "") -> None:
    """Refuse a clip with values that are not finite or absurdly large.

    Every clip passes here when it has been read, and again before it is written.

    Parameters
    ----------
    file : for the message
    what : the clip in that message, if it is not what the file holds: "the result"

    Raises
    ------
    InputError
        if there is such a value; it names the first one, with its joint and frame.
    """
    skeleton, said = clip.skeleton, f"{what or 'the motion'} has"
    poses = (("bind", skeleton.bind), ("rest", skeleton.rest))
    for name, pose in poses:
        if (at := _first_bad(pose)) is not None:
            _refuse(file, said, f"a {name} transform", pose[at], skeleton.joints[at[0]])
    for name, values in (
        ("rotation", clip.rotations),
        ("translation", clip.translations),
        ("scale", clip.scales),
    ):
        if (at := _first_bad(values)) is not None:
            where = f"{skeleton.joints[at[1]]}, time code {clip.time_code(at[0]):g}"
            _refuse(file, said, f"a {name}", values[at], where)
    if not 0.0 < clip.fps < np.inf:
        raise InputError(f"{file}: {clip.fps:g} frames a second are not plausible.")


def _refuse(file: str | Path, said: str, name: str, value: float, where: str) -> None:
    advice = "Check the units, scales and transforms above the skeleton"
    raise InputError(
        f"{file}: {said} {name} with the value {value:g}, which is not plausible ({where}). "
        f"{advice}."
    )


def _first_bad(values: Array | NDArray[np.floating]) -> tuple[int, ...] | None:
    """Where the first value stands that is no number or too large, None if there is none."""
    own = values[:1] if values.ndim and len(values) > 1 and values.strides[0] == 0 else values
    # Two passes without a temporary; nan is neither below nor above.
    if not own.size or (own.max() <= LARGEST and own.min() >= -LARGEST):
        return None
    bad = np.argwhere(~(np.abs(own) <= LARGEST))[0]
    return tuple(int(i) for i in bad)
