"""What `library build` and `library info` report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usdhand.anatomy import SIDES
from usdhand.fill.library import MotionLibrary
from usdhand.problems import counted
from usdhand.report.document import rounded


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
        "left_out": [{"path": x.file, "reason": x.message} for x in library.left_out],
        "damaged": [{"path": x.file, "reason": x.message} for x in library.damaged],
        "gone": list(gone),
    }


def summary(data: Mapping[str, Any], verbose: bool) -> str:
    """What is in a library; after a build, what was read, and where it is."""
    del verbose
    segments, cut = data["segments"], data["segmentation"]
    lines = [
        f"{counted(data['clips'], 'clip')}, {data['minutes']:.2f} minutes, segments: "
        f"{segments['left']} left, {segments['right']} right "
        f"({cut['shortest_s']:g} to {cut['longest_s']:g} s, cut at {cut['speed_cm_s']:g} cm/s)",
    ]
    if data["actors"]:
        lines.append("actors: " + ", ".join(data["actors"]))
    if data["labels"]:
        lines.append("labels: " + ", ".join(f"{k} ({n})" for k, n in data["labels"].items()))
    built = "output" in data
    if not built:
        lines += [f"left out: {x['path']}: {x['reason']}" for x in data["left_out"]]
    lines += [f"cannot be used: {x['path']}: {x['reason']}" for x in data["damaged"]]
    why = "file missing (evaluate needs it, fill does not)"
    lines += [f"{why}: {path}" for path in data["gone"]]
    if built:
        read = f"{counted(data['read'], 'clip')} read, {data['unchanged']} unchanged"
        lines += [read, f"written to {data['output']}"]
    return "\n".join(lines)
