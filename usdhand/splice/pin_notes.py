"""What is odd about pins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from usdhand.anatomy import Side
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.splice.reach import Contradiction


def contradiction_notes(body: Clip, found: Mapping[Side, Sequence[Contradiction]]) -> list[Problem]:
    """Notes on pins that motion speaks against: by how much, and what they move."""
    notes = []
    for side, odd in found.items():
        for c in odd:
            frame = min(round(c.pin.body * body.fps), len(body) - 1)
            notes.append(
                Problem(
                    "pin-contradicts",
                    f"pin {c.pin}: the motion of the {side} hand says {c.off:.2f} s otherwise; the "
                    f"pin moves the timing from {c.start:.2f} to {c.end:.2f} s. If it is right, a "
                    "second pin on either side tells how far it reaches",
                    f"time code {body.time_code(frame):g}",
                )
            )
    return notes
