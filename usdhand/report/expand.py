"""What `expand` reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from usdhand.motion import Clip
from usdhand.problems import counted
from usdhand.reduce.rig import ReducedRig
from usdhand.report.reduce import fitted_data
from usdhand.report.text import problems_data, written_to

WORST = 5


def expand_result(motion: Clip, rig: ReducedRig, from_clip: bool = False) -> dict[str, Any]:
    """Everything `expand` reports; ``from_clip`` where the free channels are those of a clip."""
    return {
        "frames": len(motion),
        "fps": motion.fps,
        "free_channels": len(rig.free),
        "from_clip": from_clip,
        "dependent_channels": [
            {"name": r.name, "kind": r.kind, "fitted": fitted_data(r)}
            for r in rig.relations
            if r.kind != "free"
        ],
        "problems": problems_data(motion.problems),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """One line; how well the dependent channels were told, where they were made of a clip's."""
    lines = [
        f"{counted(result['frames'], 'frame')} at {result['fps']:g} fps from "
        f"{counted(result['free_channels'], 'free channel')}; {written_to(result)}"
    ]
    if result["from_clip"] or verbose:
        lines += told_lines(result["dependent_channels"], verbose)
    return "\n".join(lines)


def told_lines(channels: Sequence[Mapping[str, Any]], verbose: bool) -> list[str]:
    """How well channels were told on the takes that their rig was fitted to, the worst first."""
    known = [c for c in channels if c["fitted"]["told"] is not None]
    if not known:
        follow = counted(len(channels), "channel follows", "channels follow")
        return [f"{follow}; the rig does not say how well they were told"]

    def error(channel: Mapping[str, Any]) -> float:
        fitted = channel["fitted"]
        unseen = fitted["left_out_error_deg"]
        return float(fitted["rms_error_deg"] if unseen is None else unseen)

    worst = sorted(known, key=error, reverse=True)
    shown = worst if verbose else worst[:WORST]
    on = "on takes left out" if known[0]["fitted"]["left_out_error_deg"] is not None else "there"
    return [
        f"{counted(len(channels), 'channel is', 'channels are')} made from those; on the takes "
        "that the rig was fitted to, median "
        f"{100 * median(c['fitted']['told'] for c in known):.0f} % of their motion was told",
        f"largest errors {on}: "
        + ", ".join(
            f"{c['name']} {error(c):.1f} deg ({100 * c['fitted']['told']:.0f} % told)"
            for c in shown
        ),
    ]
