"""What splice reports, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usdhand.motion import Clip
from usdhand.report.document import rounded
from usdhand.report.text import written_to
from usdhand.splice.alignment import Alignment
from usdhand.splice.method import Spliced
from usdhand.splice.settings import Pin


def splice_result(spliced: Spliced) -> dict[str, Any]:
    """Everything `splice` reports; seconds count from the clips' first frames, as in `fill`."""
    body = spliced.clip
    return {
        "hands": {side: _hand_data(alignment, body) for side, alignment in spliced.hands.items()},
        "pins_wanted": _pins_wanted(spliced),
        "notes": [str(problem) for problem in spliced.problems],
        "fps": rounded(body.fps),
        "frames": len(body),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """A line a hand, where to look, and every phase if ``verbose``."""
    lines = []
    for side, hand in result["hands"].items():
        measured = hand["measured_from"]
        follows = f", follows the {hand['taken_from']} one" if hand["taken_from"] else ""
        lines.append(
            f"{side} hand: {len(hand['channels'])} channels, {len(hand['phases'])} phases, the "
            f"second pass moved them by {1000 * hand['pass_lag']:.0f} ms; measured from "
            f"{measured['body']} and {measured['hands']}{follows}"
        )
        if hand["look_at"]:
            frames = ", ".join(f"{frame:g}" for frame in hand["look_at"])
            lines.append(f"  low agreement, consider a --pin, near time codes {frames}")
        for p in hand["pieces"]:
            name = Path(result["takes"][p["take"]]).name
            lines.append(f"  {p['start']:.2f} to {p['end']:.2f} s: {name}")
        for d in hand["doubts"]:
            lines.append(
                f"  look at {d['start']:.1f} to {d['end']:.1f} s, {side} hand: off by up to "
                f"{d['off']:.1f} s"
            )
        for p in hand["phases"] if verbose else ():
            quality = "holds" if p["quality"] is None else f"agreement {p['quality']:.2f}"
            lines.append(f"  {p['start']:7.2f} to {p['end']:7.2f} s: {quality}")
    if result["pins_wanted"]:
        wanted = ", ".join(f"{p['time_code']:g} ({p['side']})" for p in result["pins_wanted"])
        lines.append(f"pins would help most at the body's time codes {wanted}")
    return "\n".join([*lines, written_to(result)])


def _pins_wanted(spliced: Spliced) -> list[dict[str, Any]]:
    """Where pins would help most, in this order, with what is shown there now."""
    found = [
        {
            "side": side,
            "body": rounded(p.start),
            "time_code": rounded(_time_code(spliced.clip, p.start)),
            "hand": rounded(float(np.interp(p.start, *alignment.warp.T))),
            "off": rounded(p.off),
        }
        for side, alignment in spliced.hands.items()
        for p in alignment.wanted_pins
    ]
    return sorted(found, key=lambda p: -p["off"])


def _hand_data(alignment: Alignment, body: Clip) -> dict[str, Any]:
    return {
        "warp": [[rounded(b), rounded(h)] for b, h in alignment.warp],
        "pins": [_pin_data(p) for p in alignment.pins],
        "cost": rounded(alignment.cost),
        "pass_lag": rounded(alignment.pass_lag),
        "taken_from": alignment.taken_from,
        "measured_from": {"body": alignment.origins[0], "hands": alignment.origins[1]},
        "deviation": None
        if alignment.deviation is None
        else [rounded(d) for d in alignment.deviation],
        "doubts": [
            {"start": rounded(d.start), "end": rounded(d.end), "off": rounded(d.off)}
            for d in alignment.doubts
        ],
        "one_timing": alignment.shared,
        "frozen": {
            clip: [[rounded(a), rounded(b)] for a, b in ranges]
            for clip, ranges in zip(("body", "hands"), alignment.frozen, strict=True)
        },
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
        "pieces": [
            {"take": p.take, "start": rounded(p.start), "end": rounded(p.end)}
            for p in alignment.pieces
        ],
    }


def _pin_data(pin: Pin) -> dict[str, Any]:
    return {
        "body": rounded(pin.body),
        "hand": rounded(pin.hand),
        "tolerance": rounded(pin.tolerance),
    }


def _time_code(clip: Clip, seconds: float) -> float:
    """Time code of a clip's frame nearest to seconds from its first frame."""
    return clip.time_code(round(seconds * clip.fps))
