"""What files do not say, told from the body in them: its unit of length and its up axis."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from usdhand.motion import Problem
from usdhand.motion.rotations import Array

FOOT = re.compile(r"foot|ankle|toe", re.IGNORECASE)
HEAD = re.compile(r"head", re.IGNORECASE)
_LEG = re.compile(r"foot|ankle|toe|leg|knee|thigh|shin|calf", re.IGNORECASE)

# The longest way from the root to an end of a human body, along its bones (hips to fingertips), and
# what passes for one in a file that has no more to say. A part of a body may be far smaller.
USUAL_REACH_CM = 150.0
BODY_REACH_CM = (80.0, 400.0)
PART_REACH_CM = (5.0, 400.0)
METRIC = {"centimetres": 1.0, "metres": 100.0, "millimetres": 0.1}
OTHERS = {"decimetres": 10.0, "inches": 2.54, "units of the CMU library": 2.54 / 0.45}

# How much longer a body must be along Z than along Y to stand on Z.
CLEARLY_LONGER = 1.25


def guess_units(
    offsets: Array, parents: NDArray[np.intp], names: Iterable[str]
) -> tuple[float, Problem]:
    """Centimetres of one unit of length, by the length of the bones.

    Parameters
    ----------
    offsets : (joints, 3) joint-to-parent translations
    parents : (joints,) parents before their children, -1 for roots; roots' offsets do not count
    """
    reach = max(float(bone_ways(offsets, parents).max()), 1e-9)
    body = any(map(_LEG.search, names))
    least, most = BODY_REACH_CM if body else PART_REACH_CM
    fitting = {name: cm for name, cm in METRIC.items() if least <= reach * cm <= most}
    if not fitting and body:
        near = sorted(
            OTHERS.items(), key=lambda item: abs(np.log(reach * item[1] / USUAL_REACH_CM))
        )
        fitting = {name: cm for name, cm in near if least <= reach * cm <= most}
    if not fitting:
        message = (
            f"the file does not say its unit, and bones reaching {reach:.4g} from the root fit "
            "none: read as centimetres; --units says otherwise"
        )
        return 1.0, Problem("guessed-units", message)
    name, cm = next(iter(fitting.items()))
    message = (
        f"the file does not say its unit: read as {name}, in which the bones reach "
        f"{reach * cm:.0f} cm from the root; --units says otherwise"
    )
    return cm, Problem("guessed-units", message, severity="note")


def guess_up(poses: Iterable[Array], names: Iterable[str]) -> tuple[str, Problem]:
    """Up axis: "Z" if a body with legs, by names, is clearly longer along Z than along Y, else "Y".

    Parameters
    ----------
    poses : joint positions (frames, joints, 3) of the reference pose and of the motion; what each
        of them says counts the same, so that who lies down in the motion has not turned the world
    """
    said = 0.0
    for positions in poses:
        if len(positions):
            _, y, z = np.maximum(np.median(np.ptp(positions, axis=1), axis=0), 1e-9)
            said += float(np.clip(np.log(z / y), -2.0, 2.0))
    body = any(map(_LEG.search, names))  # hands alone may lie any way
    up = "Z" if body and said > np.log(CLEARLY_LONGER) else "Y"
    message = f"the file does not say which axis is up: read as {up} up; --input-up says otherwise"
    return up, Problem("guessed-up-axis", message, severity="note")


def bone_ways(offsets: Array, parents: NDArray[np.intp]) -> Array:
    """Length of the bones from the root to each joint (joints,); parents before children."""
    ways = np.where(parents < 0, 0.0, np.linalg.norm(offsets, axis=-1))
    for joint, parent in enumerate(parents):
        if parent >= 0:
            ways[joint] += ways[parent]
    return ways
