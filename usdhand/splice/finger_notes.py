"""What is odd about the fingers of two clips: they do not move, or the hand clip has no more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from usdhand.anatomy import HandFrames, Hands, Side
from usdhand.anatomy.channels import encode, fingers_move
from usdhand.errors import InputError
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.problems import Problem, listed

# The last pose of a hand clip that stays for as many seconds is worth a note.
HELD_S = 0.5


def still_finger_notes(
    body: Clip, hand_clip: Clip, body_hands: Hands, hand_hands: Hands, sides: Sequence[Side]
) -> list[Problem]:
    """Notes on hands whose fingers do not move in the hand clip.

    Raises
    ------
    InputError
        if none do, and fingers of the body move: then the clips are swapped, or the wrong ones.
    """
    still = [s for s in sides if not _move(hand_clip, hand_hands.frames[s])]
    lost = [s for s in still if _move(body, body_hands.frames[s])]
    if lost and len(still) == len(sides):
        raise InputError(
            f"No finger moves in the hand clip {hand_clip.name}, but fingers of the body "
            f"{body.name} do, and would be lost. Are the clips swapped? The body comes first."
        )
    notes = []
    for side in still:
        note = f"the fingers of the {side} hand do not move in the hand clip {hand_clip.name}"
        note += ", and replace moving ones of the body" if side in lost else ""
        notes.append(Problem("still-fingers", note))
    return notes


def frozen_notes(
    body: Clip,
    hand_clip: Clip,
    frozen: Mapping[Side, tuple[Sequence[tuple[float, float]], Sequence[tuple[float, float]]]],
) -> list[Problem]:
    """Notes on what recordings lack: frames that repeat the one before, then a jump.

    Parameters
    ----------
    frozen : first and last seconds of every range, of the body and of the hand clip
    """
    notes = []
    for side, both in frozen.items():
        for clip, ranges, kind in zip((body, hand_clip), both, ("body", "hand clip"), strict=True):
            if not ranges:
                continue
            where = listed([f"{a:.2f} to {b:.2f} s" for a, b in ranges])
            what = " and fingers bridged" if clip is hand_clip else ""
            notes.append(
                Problem(
                    "frozen-frames",
                    f"the {side} arm of the {kind} {clip.name} freezes at {where}, as when "
                    f"markers are hidden: its motion is bridged there{what}",
                )
            )
    return notes


def held_pose_notes(body: Clip, hand_clip: Clip, warps: Mapping[Side, Array]) -> list[Problem]:
    """Notes on hands that hold the hand clip's first or last pose for long.

    Parameters
    ----------
    warps : (body frames,) seconds of the hand clip
    """
    least = HELD_S * body.fps
    held: dict[str, list[Side]] = {}
    for side, warp in warps.items():
        before = int(np.searchsorted(warp, 1e-6, "right"))
        after = int(np.searchsorted(warp, hand_clip.duration - 1e-6))
        if before > least:
            at = body.time_code(before - 1)
            text = f"begins at time code {at:g} of the body; fingers hold its first pose until then"
            held.setdefault(text, []).append(side)
        if len(body) - after > least:
            at = body.time_code(after)
            text = f"ends at time code {at:g} of the body; fingers hold its last pose afterwards"
            held.setdefault(text, []).append(side)
    return [
        Problem("held-pose", f"the hand clip {text} ({' and '.join(s)})")
        for text, s in held.items()
    ]


def _move(clip: Clip, frames: HandFrames) -> bool:
    return fingers_move(encode(clip, frames).values)
