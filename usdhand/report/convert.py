"""What `convert` reports of a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.report.document import rounded
from usdhand.report.text import problems_data, written_to
from usdhand.rigs import Conventions, map_character


def convert_result(
    source: Clip,
    clip: Clip,
    animated: bool,
    lost: Sequence[Problem],
    conventions: Conventions | None = None,
) -> dict[str, Any]:
    """What was read, what was guessed, and what could not be kept."""
    origin = source.origin
    return {
        "joints": len(clip.skeleton),
        "animated": animated,
        "frames": len(clip) if animated else 0,
        "fps": rounded(clip.fps),
        "start": rounded(clip.origin.first_time_code),
        "read": {
            "skeleton": origin.skeleton_path,
            "animation": origin.animation_path or None,
            "fps": rounded(source.fps),
            "cm_per_unit": rounded(origin.cm_per_unit),
            "up_axis": origin.up_axis,
        },
        "convention": _convention(clip, conventions),
        "renamed_joints": _renamed(clip),
        "problems": problems_data(source.problems),
        "lost": problems_data(lost),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """What was read, guessed and written of each file."""
    del verbose
    return "\n".join(_text(file) for file in result["files"] if "error" not in file)


def _text(result: Mapping[str, Any]) -> str:
    motion = (
        f"{result['frames']} frames at {result['fps']:g} fps from time code {result['start']:g}"
        if result["animated"]
        else "no motion, the bind pose"
    )
    hands = f"hands by convention '{result['convention']}'" if result["convention"] else "no hands"
    lines = [f"{result['path']}: {result['joints']} joints, {motion}; {hands}"]
    notes = [p for p in result["problems"] if p["code"].startswith("guessed")] + result["lost"]
    lines += [f"  {note['message']}" for note in notes if note["severity"] == "note"]
    if result["renamed_joints"]:
        lines.append(
            f"  {result['renamed_joints']} joints have other names in USD than in the file"
        )
    return "\n".join([*lines, f"  {written_to(result)}"])


def _renamed(clip: Clip) -> int:
    pairs = zip(clip.skeleton.originals, clip.skeleton.names, strict=False)
    return sum(original != name for original, name in pairs)


def _convention(clip: Clip, conventions: Conventions | None) -> str | None:
    try:
        return map_character(clip.skeleton, conventions).convention
    except HandNotFoundError:
        return None
