"""What files do not say, told from the body in them: its unit of length and its up axis."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.problems import Problem

FOOT = re.compile(r"foot|ankle|toe", re.IGNORECASE)
UPRIGHT = 0.7  # of the way from feet to head: at least so much of it goes up where a body stands
HEAD = re.compile(r"head", re.IGNORECASE)
_LEG = re.compile(r"foot|ankle|toe|leg|knee|thigh|shin|calf", re.IGNORECASE)
_BEYOND_A_HAND = re.compile(
    r"hips|pelvis|spine|chest|torso|neck|head|clavicle|shoulder|elbow|arm", re.IGNORECASE
)

# The longest way from the root to an end of a human body, along its bones (hips to fingertips), and
# what passes for one in a file that has no more to say. A part of a body may be far smaller.
USUAL_REACH_CM = 150.0
BODY_REACH_CM = (80.0, 400.0)
PART_REACH_CM = (5.0, 400.0)
METRIC = {"centimetres": 1.0, "metres": 100.0, "millimetres": 0.1}
OTHERS = {"decimetres": 10.0, "inches": 2.54}
# Files of the CMU motion library measure in inches / 0.45; their joints have these names.
CMU, CMU_CM = "units of the CMU library", 2.54 / 0.45
CMU_JOINTS = {"lhipjoint", "rhipjoint", "lowerback"}
# From the wrist to the tip of a finger.
USUAL_HAND_CM, HAND_REACH_CM = 18.0, (11.0, 27.0)

# How much longer a body must be along Z than along Y to stand on Z.
CLEARLY_LONGER = 1.25


def guess_units(
    offsets: Array, parents: NDArray[np.intp], names: Sequence[str]
) -> tuple[float, Problem]:
    """Centimetres of one unit of length, by names that tell it, else by the length of the bones.

    Parameters
    ----------
    offsets : (joints, 3) joint-to-parent translations
    parents : (joints,) parents before their children, -1 for roots; roots' offsets do not count

    Returns
    -------
    The guess, and a note; a warning where another unit would do as well.
    """
    reach = max(float(bone_ways(offsets, parents).max()), 1e-9)
    told, fitting = _fitting_units(reach, parents, names)
    if not fitting:
        message = (
            f"the file does not say its unit, and bones reaching {reach:.4g} from the root fit "
            "none: read as centimetres. If that is wrong, give --units"
        )
        return 1.0, Problem("guessed-units", message)
    name, cm = next(iter(fitting.items()))
    message = (
        f"the file does not say its unit: read as {name}, in which the bones reach "
        f"{reach * cm:.0f} cm from the root. If that is wrong, give --units"
    )
    sure = told or name in METRIC
    return cm, Problem("guessed-units", message, severity="note" if sure else "warning")


def _fitting_units(
    reach: float, parents: NDArray[np.intp], names: Sequence[str]
) -> tuple[bool, dict[str, float]]:
    """Whether names tell the unit, and the units that fit a skeleton, the likeliest first."""
    if {name.lower() for name in names} >= CMU_JOINTS and _within(BODY_REACH_CM, reach * CMU_CM):
        return True, {CMU: CMU_CM}
    body = any(map(_LEG.search, names))
    if not body and _is_hand_alone(parents, names):
        return False, _nearest(reach, USUAL_HAND_CM, HAND_REACH_CM, METRIC | OTHERS)
    least_to_most = BODY_REACH_CM if body else PART_REACH_CM
    metric = {n: cm for n, cm in METRIC.items() if _within(least_to_most, reach * cm)}
    if metric or not body:
        return False, metric
    return False, _nearest(reach, USUAL_REACH_CM, BODY_REACH_CM, OTHERS | {CMU: CMU_CM})


def _nearest(
    reach: float, usual: float, limits: tuple[float, float], units: Mapping[str, float]
) -> dict[str, float]:
    """Units in which a reach is within limits, that in which it is most usual first."""
    near = sorted(units.items(), key=lambda item: abs(np.log(reach * item[1] / usual)))
    return {name: cm for name, cm in near if _within(limits, reach * cm)}


def _within(limits: tuple[float, float], value: float) -> bool:
    return limits[0] <= value <= limits[1]


def _is_hand_alone(parents: NDArray[np.intp], names: Sequence[str]) -> bool:
    """Whether a skeleton is one hand from the wrist, or several: short chains, no trunk, no arm."""
    if any(map(_BEYOND_A_HAND.search, names)):
        return False
    depth, leaves = np.zeros(len(parents), int), set(range(len(parents)))
    for joint, parent in enumerate(parents):
        if parent >= 0:
            depth[joint] = depth[parent] + 1
            leaves.discard(int(parent))
    roots = int((parents < 0).sum())
    return 3 <= depth.max(initial=0) <= 6 and 3 * roots <= len(leaves) <= 6 * roots


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
    message = (
        f"the file does not say which axis is up: read as {up} up. If that is wrong, give "
        "--input-up"
    )
    return up, Problem("guessed-up-axis", message, severity="note")


def stands(places: Array, names: Sequence[str]) -> bool:
    """Whether a body with joints at ``places`` (joints, 3) has its head above and its feet below.

    By names; False for a skeleton without a head or feet by name.
    """
    heads, feet = ([j for j, n in enumerate(names) if p.search(n)] for p in (HEAD, FOOT))
    if not heads or not feet:
        return False
    spread = float(np.linalg.norm(places[heads].mean(axis=0) - places[feet].mean(axis=0)))
    return bool(places[heads, 1].mean() - places[feet, 1].mean() > UPRIGHT * spread)


def bone_ways(offsets: Array, parents: NDArray[np.intp]) -> Array:
    """Length of the bones from the root to each joint (joints,); parents before children."""
    ways = np.where(parents < 0, 0.0, np.linalg.norm(offsets, axis=-1))
    for joint, parent in enumerate(parents):
        if parent >= 0:
            ways[joint] += ways[parent]
    return ways
