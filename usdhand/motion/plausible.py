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
    skeleton, of = clip.skeleton, f" of {what}" if what else ""

    def refuse(joint: int, has: str) -> None:
        why = "one of the values that are not numbers" if "nan" in has else "which is not plausible"
        raise InputError(
            f"{file}: joint {skeleton.joints[joint]}{of} {has}, {why}. Check the units and "
            "transforms above the skeleton."
        )

    for name, pose in (("bind", skeleton.bind), ("rest", skeleton.rest)):
        if (at := _first_bad(pose)) is not None:
            refuse(at[0], f"has a {name} transform with the value {pose[at]:g}")
    for name, values in (("rotation", clip.rotations), ("scale", clip.scales)):
        if (at := _first_bad(values)) is not None:
            when = f"at time code {clip.time_code(at[0]):g}"
            refuse(at[1], f"has a {name} with the value {values[at]:g} {when}")
    if (at := _first_bad(clip.translations)) is not None:
        far = np.linalg.norm(clip.translations[at[:2]])
        when = f"at time code {clip.time_code(at[0]):g}"
        refuse(at[1], f"is {far:.3g} cm from its parent {when}")
    if not 0.0 < clip.fps < np.inf:
        raise InputError(f"{file}: {clip.fps:g} frames a second are not plausible.")


def _first_bad(values: Array | NDArray[np.floating]) -> tuple[int, ...] | None:
    """Where the first value stands that is no number or too large, None if there is none."""
    own = values[:1] if values.ndim and len(values) > 1 and values.strides[0] == 0 else values
    # Two passes without a temporary; nan is neither below nor above.
    if not own.size or (own.max() <= LARGEST and own.min() >= -LARGEST):
        return None
    bad = np.argwhere(~(np.abs(own) <= LARGEST))[0]
    return tuple(int(i) for i in bad)
