"""What library, fill and evaluate report, as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from usdhand.anatomy import SIDES, Side
from usdhand.anatomy.hand import SIDE_PREFIX
from usdhand.evaluate.agreement import Agreement
from usdhand.evaluate.reconstruction import METHODS, HandError
from usdhand.fill.candidates import Candidate, SearchSpace
from usdhand.fill.library import ARM_FPS, MotionLibrary
from usdhand.fill.results import Alternative, Choice, Filled, FilledPart
from usdhand.motion import Clip
from usdhand.motion.resample import interpolate
from usdhand.motion.rotations import Array
from usdhand.report.document import rounded

LISTED = 3  # names that a message shows before it says "and N more"


def counted(count: int, noun: str) -> str:
    """Say a number and what it counts: 1 clip, 2 clips."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def listed(names: Sequence[str]) -> str:
    """Show the first few names, and how many more there are."""
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def library_result(library: MotionLibrary, gone: Sequence[str] = ()) -> dict[str, Any]:
    """Everything `library info` shows; ``gone`` are clips whose file is not there."""
    labels = sorted({c.label for c in library.clips if c.label})
    cutting = library.segmentation
    return {
        "clips": len(library.clips),
        "minutes": rounded(library.minutes),
        "actors": sorted({c.actor for c in library.clips if c.actor}),
        "labels": {x: sum(c.label == x for c in library.clips) for x in labels},
        "segments": {
            s: sum(len(c.hands[s].segments) for c in library.clips if s in c.hands) for s in SIDES
        },
        "segmentation": {
            "speed_cm_s": cutting.speed,
            "shortest_s": cutting.shortest,
            "longest_s": cutting.longest,
        },
        "left_out": [{"path": x.path, "reason": x.reason} for x in library.left_out],
        "damaged": [{"path": x.path, "reason": x.reason} for x in library.damaged],
        "gone": list(gone),
    }


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


def evaluation_result(
    agreements: Sequence[Agreement], errors: Sequence[HandError]
) -> dict[str, Any]:
    """Everything `evaluate` reports; the confusion matrix is that of the best metric."""
    result: dict[str, Any] = {}
    if agreements:
        best = max(agreements, key=lambda a: a.share)
        result["label_agreement"] = {
            "segments": best.segments,
            "metrics": [{"name": a.metric, "share": rounded(a.share)} for a in agreements],
            "best": best.metric,
            "labels": list(best.labels),
            "confusion": [[rounded(x) for x in row] for row in best.confusion],
        }
    if errors:
        result["reconstruction"] = {
            side: {method: _mean_error(errors, side, method) for method in METHODS}
            for side in sorted({e.side for e in errors})
        }
        result["takes"] = [
            {
                "take": e.take,
                "side": e.side,
                "method": e.method,
                "degrees": rounded(e.degrees),
                "fingertip_mm": rounded(e.fingertip_mm),
                "jerk": rounded(e.jerk),
            }
            for e in errors
        ]
    return result


def _mean_error(errors: Sequence[HandError], side: str, method: str) -> dict[str, float]:
    """Means over all frames of all takes."""
    own = [e for e in errors if e.side == side and e.method == method]
    weights = [e.frames for e in own]

    def mean(values: list[float]) -> float:
        return rounded(np.average(values, weights=weights))

    return {
        "degrees": mean([e.degrees for e in own]),
        "fingertip_mm": mean([e.fingertip_mm for e in own]),
        "jerk": mean([e.jerk for e in own]),
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
