"""Finger angles: names, joint limits, handshapes, and how angles turn the bones of a hand.

A handshape is 25 angles in degrees, in the order of `CHANNELS`. Flexion brings a fingertip toward
the palm; a positive spread takes a finger away from the middle finger (the middle finger itself:
toward the thumb). The thumb's base has three angles: `across` swings it over the palm toward the
little finger, `palmar` lifts it out of the plane of the palm, `oppose` rolls it about its bone
until its pad faces the fingers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .body import DIGITS, FINGERS, PALMAR, Array, Body, axis_angle

FINGER_ANGLES = ("mcp", "spread", "roll", "pip", "dip")
THUMB_ANGLES = ("across", "palmar", "oppose", "mcp", "ip")
CHANNELS = tuple(f"thumb_{a}" for a in THUMB_ANGLES) + tuple(
    f"{f}_{a}" for f in FINGERS for a in FINGER_ANGLES
)
INDEX = {name: i for i, name in enumerate(CHANNELS)}

_FINGER_LIMITS = {
    "mcp": (-20, 90), "spread": (-20, 20), "roll": (-8, 8), "pip": (0, 110), "dip": (0, 80),
}  # fmt: skip
_THUMB_LIMITS = {
    "across": (-15, 50), "palmar": (-10, 45), "oppose": (-10, 65), "mcp": (-5, 60), "ip": (-10, 80),
}  # fmt: skip
LIMITS = np.array(
    [_THUMB_LIMITS[a] for a in THUMB_ANGLES]
    + [_FINGER_LIMITS[a] for _ in FINGERS for a in FINGER_ANGLES],
    dtype=float,
)


def shape(
    thumb: Sequence[float],
    mcp: Sequence[float],
    pip: Sequence[float],
    spread: Sequence[float],
    dip: Sequence[float] | None = None,
) -> Array:
    """A handshape from a few rows of numbers.

    Parameters
    ----------
    thumb
        The five thumb angles.
    mcp, pip, spread
        One angle for each of index, middle, ring and little finger.
    dip
        Likewise; two thirds of `pip` where not given, as tendons have it.
    """
    values = list(thumb)
    for i in range(4):
        far = 2 / 3 * pip[i] if dip is None else dip[i]
        values += [mcp[i], spread[i], 0.1 * spread[i], pip[i], far]
    return np.array(values, dtype=float)


ZERO = np.zeros(len(CHANNELS))
SHAPES: Mapping[str, Array] = {
    "relaxed": shape((20, 12, 18, 12, 18), (16, 24, 29, 33), (26, 33, 37, 40), (-4, 0, -4, -6)),
    "resting": shape((24, 10, 18, 14, 22), (20, 28, 33, 37), (32, 38, 42, 46), (-5, 0, -5, -8)),
    # The thumb lies on the middle finger.
    "attention": shape((43, 21, 58, 12, 20), (2, 72, 76, 76), (5, 92, 94, 88), (-2, 0, -6, -10)),
    "big": shape((-4, 10, 6, 4, 8), (8, 7, 8, 10), (13, 14, 16, 17), (6, 0, 5, 8)),
    "doubt_shrug": shape((2, 10, 8, 8, 14), (12, 17, 20, 22), (21, 25, 28, 30), (2, 0, 0, 1)),
    # Thumb and index pads meet (solved for both hands), the others fan out.
    "ok": shape((36, 9, 12, 3, 8), (41, 20, 11, 2), (64, 22, 16, 12), (-2, 1, 2, 5),
                (44, 14, 10, 8)),
    "palm_presentation": shape((4, 6, 5, 6, 10), (4, 9, 13, 16), (11, 16, 19, 20),
                               (-2, 0, -2, -2)),
    "small": shape((22, 26, 34, 12, 16), (36, 41, 45, 47), (24, 27, 29, 30), (-4, 0, -5, -9)),
    # Thumb and index pads an inch apart.
    "small_pinch": shape((34, 27, 58, 6, 9), (57, 60, 64, 66), (32, 62, 70, 70), (-3, 0, -5, -9),
                         (14, 42, 48, 48)),
    "turn": shape((12, 14, 16, 10, 16), (20, 23, 26, 26), (28, 31, 34, 33), (2, 0, -1, 0)),
    "wipe": shape((14, 4, 4, 4, 6), (2, 3, 4, 5), (4, 5, 6, 7), (-4, 0, -5, -9)),
}  # fmt: skip


def bend_bones(body: Body, hand: Array, angles: Array) -> dict[str, Array]:
    """Turn the bones of a left hand.

    Parameters
    ----------
    body
        Whose hand it is.
    hand
        Rotation of the hand away from the zero pose, (frames, 3, 3).
    angles
        Finger angles in degrees, (frames, 25).

    Returns
    -------
    dict
        Rotations away from the zero pose by joint name without the side, e.g. `index2`.
    """

    def angle(name: str) -> Array:
        return np.asarray(angles[:, INDEX[name]])

    turn: dict[str, Array] = {}
    for digit in DIGITS:
        bone, bend = body.directions[digit], body.bend[digit]
        hinge = np.cross(bone, bend)
        if digit == "thumb":
            lift = np.cross(bone, PALMAR)
            lift = lift / np.linalg.norm(lift)
            first = (
                axis_angle(-PALMAR, angle("thumb_across"))
                @ axis_angle(lift, angle("thumb_palmar"))
                @ axis_angle(bone, angle("thumb_oppose"))
            )
            second, third = angle("thumb_mcp"), angle("thumb_ip")
        else:
            turn[f"{digit}0"] = hand
            away = 1.0 if digit in ("index", "middle") else -1.0
            first = (
                axis_angle(hinge, angle(f"{digit}_mcp"))
                @ axis_angle(bend, away * angle(f"{digit}_spread"))
                @ axis_angle(bone, angle(f"{digit}_roll"))
            )
            second, third = angle(f"{digit}_pip"), angle(f"{digit}_dip")
        turn[f"{digit}1"] = hand @ first
        turn[f"{digit}2"] = turn[f"{digit}1"] @ axis_angle(hinge, second)
        turn[f"{digit}3"] = turn[f"{digit}2"] @ axis_angle(hinge, third)
        turn[f"{digit}4"] = turn[f"{digit}3"]
    return turn
