"""What splice reports, as plain data."""

from __future__ import annotations

from typing import Any

from usdhand.motion import Clip
from usdhand.report.document import rounded
from usdhand.splice.method import Alignment, Spliced
from usdhand.splice.settings import Pin


def splice_result(spliced: Spliced) -> dict[str, Any]:
    """Everything `splice` reports; seconds count from the clips' first frames, as in `fill`."""
    body = spliced.clip
    return {
        "hands": {side: _hand_data(alignment, body) for side, alignment in spliced.hands.items()},
        "notes": list(spliced.notes),
        "fps": rounded(body.fps),
        "frames": len(body),
    }


def _hand_data(alignment: Alignment, body: Clip) -> dict[str, Any]:
    return {
        "warp": [[rounded(b), rounded(h)] for b, h in alignment.warp],
        "pins": [_pin_data(p) for p in alignment.pins],
        "cost": rounded(alignment.cost),
        "pass_lag": rounded(alignment.pass_lag),
        "taken_from": alignment.taken_from,
        "measured_from": {"body": alignment.origins[0], "hands": alignment.origins[1]},
        "phases": [
            {
                "start": rounded(p.start),
                "end": rounded(p.end),
                "quality": None if p.quality is None else rounded(p.quality),
                "look": p.low,
            }
            for p in alignment.phases
        ],
        "look_at": [
            rounded(_time_code(body, (p.start + p.end) / 2)) for p in alignment.phases if p.low
        ],
        "channels": list(alignment.channels),
    }


def _pin_data(pin: Pin) -> dict[str, Any]:
    return {
        "body": rounded(pin.body),
        "hand": rounded(pin.hand),
        "tolerance": rounded(pin.tolerance),
    }


def _time_code(clip: Clip, seconds: float) -> float:
    """Time code of a clip's frame nearest to seconds from its first frame."""
    o = clip.origin
    return o.first_time_code + round(seconds * clip.fps) * o.time_codes_per_frame
