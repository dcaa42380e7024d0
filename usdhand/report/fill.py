"""What `fill` reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from usdhand.anatomy import Side
from usdhand.anatomy.hand import SIDE_PREFIX
from usdhand.fill.candidates import Candidate, SearchSpace
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.fill.results import Alternative, Choice, Filled, FilledPart
from usdhand.motion import Clip
from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.problems import counted
from usdhand.report.document import rounded
from usdhand.report.text import written_to


def fill_result(filled: Filled, library: MotionLibrary, body: Clip) -> dict[str, Any]:
    """Everything `fill` reports."""
    hands: dict[str, Any] = {}
    for part in filled.parts:
        best = part.alternatives[0]
        for side in part.part:
            hands[side] = {
                "segments": [_choice_data(c, part.space, library) for c in best.choices],
                "cost": rounded(best.cost),
                "seams": _seams(best, side, body.fps)
                | {"max_acceleration_captured_deg_s2": _captured(part, side, library, body.fps)},
            }
    most = max(len(p.alternatives) for p in filled.parts)
    return {
        "hands": hands,
        "alternatives": [_alternative_data(filled, i, library, body.fps) for i in range(most)],
        "kept": list(filled.kept),
        "without": list(filled.without),
        "missing": {side: list(joints) for side, joints in filled.missing.items()},
        "left_out": list(filled.left_out),
        "still": list(filled.still),
        "set_aside": {side: list(names) for side, names in filled.set_aside.items()},
        "fps": rounded(body.fps),
        "frames": len(body),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """A line a hand, the costs of alternatives, and every segment if ``verbose``."""
    lines = []
    for side, paths in result.get("added_joints", {}).items():
        lines.append(
            f"{side} hand: {counted(len(paths), 'joint')} added from {result['fingers_from']}"
        )
    for side, hand in result["hands"].items():
        clips = {s["clip"] for s in hand["segments"]}
        seams = hand["seams"]
        lines.append(
            f"{side} hand: {counted(len(hand['segments']), 'segment')} from "
            f"{counted(len(clips), 'clip')}; largest "
            f"angular acceleration {seams['max_acceleration_deg_s2']:.0f} deg/s^2 at the seams, "
            f"{seams['max_acceleration_elsewhere_deg_s2']:.0f} elsewhere, "
            f"{seams['max_acceleration_captured_deg_s2']:.0f} in the library"
        )
        for s in hand["segments"] if verbose else ():
            lines.append(
                f"  {s['start']:7.2f} to {s['end']:7.2f} s: {s['clip']} "
                f"{s['clip_start']:.2f} to {s['clip_end']:.2f} s, cost {s['cost']:.1f}"
            )
    if len(result["alternatives"]) > 1:
        costs = ", ".join(f"{a['cost']:.3f}" for a in result["alternatives"])
        lines.append(f"{len(result['alternatives'])} alternatives, costs {costs}")
    return "\n".join([*lines, written_to(result)])


def _alternative_data(
    filled: Filled, number: int, library: MotionLibrary, fps: float
) -> dict[str, Any]:
    """One of the results: what it costs, and the piece of the library for each segment."""
    parts = [
        (part, part.alternatives[min(number, len(part.alternatives) - 1)]) for part in filled.parts
    ]
    hands = [(side, part.space, own) for part, own in parts for side in part.part]
    return {
        "cost": rounded(sum(own.cost for _, own in parts)),
        "clips": {
            side: [_clip_name(c, space, library) for c in own.choices] for side, space, own in hands
        },
        "hands": {
            side: {
                "segments": [_piece_data(c, space, library) for c in own.choices],
                "cost": rounded(own.cost),
                "seams": _seams(own, side, fps),
            }
            for side, space, own in hands
        },
    }


def _piece_data(choice: Choice, space: SearchSpace, library: MotionLibrary) -> dict[str, Any]:
    chosen = choice.candidates[choice.chosen]
    return {
        "start": rounded(choice.start),
        "end": rounded(choice.end),
        **_candidate_data(chosen, space, library),
        "transition_cost": rounded(choice.transition_cost),
        "node_cost": rounded(choice.node_cost),
        "stretched": rounded(chosen.stretch),
    }


def _choice_data(choice: Choice, space: SearchSpace, library: MotionLibrary) -> dict[str, Any]:
    return _piece_data(choice, space, library) | {
        "candidates": [_candidate_data(c, space, library) for c in choice.candidates],
    }


def _candidate_data(
    candidate: Candidate, space: SearchSpace, library: MotionLibrary
) -> dict[str, Any]:
    return {
        "clip": library.clips[space.clips[candidate.segment]].name,
        "clip_start": rounded(space.firsts[candidate.segment] / ARM_FPS),
        "clip_end": rounded(space.lasts[candidate.segment] / ARM_FPS),
        "cost": rounded(candidate.cost),
    }


def _clip_name(choice: Choice, space: SearchSpace, library: MotionLibrary) -> str:
    return str(library.clips[space.clips[choice.candidates[choice.chosen].segment]].name)


def _seams(alternative: Alternative, side: Side, fps: float) -> dict[str, Any]:
    """Angular acceleration of a hand at the seams beside that of everything in between."""
    own = [n.startswith(SIDE_PREFIX[side]) for n in alternative.names]
    acceleration = np.abs(np.diff(alternative.curves[:, own], n=2, axis=0)) * fps**2
    at_seams = np.zeros(len(acceleration), dtype=bool)
    for seam in alternative.seams:
        at_seams[max(seam - 2, 0) : seam + 1] = True
    return {
        "times_s": [rounded(s / fps) for s in alternative.seams],
        "max_acceleration_deg_s2": _largest(acceleration[at_seams]),
        "max_acceleration_elsewhere_deg_s2": _largest(acceleration[~at_seams]),
    }


def _captured(part: FilledPart, side: Side, library: MotionLibrary, fps: float) -> float:
    """Largest angular acceleration of the library's own motion, in the clips that were used."""
    choices = part.alternatives[0].choices
    used = {int(part.space.clips[c.candidates[c.chosen].segment]) for c in choices}
    largest = 0.0
    for clip in (library.clips[i] for i in sorted(used)):
        frames = np.asarray(np.arange(int(clip.duration * fps) + 1) * (clip.fps / fps), float)
        curves = interpolate(clip.hands[side].fingers, frames)
        largest = max(largest, float(np.abs(np.diff(curves, n=2, axis=0)).max(initial=0.0)))
    return rounded(largest * fps**2)


def _largest(values: Array) -> float:
    return rounded(values.max(initial=0.0))
