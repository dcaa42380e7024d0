"""What `preview` reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def preview_result(
    lanes: Sequence[Mapping[str, Any]], notes: Sequence[str], size: int, output: Path
) -> dict[str, Any]:
    """Everything `preview` reports; ``size`` is that of the page in bytes."""
    return {
        "lanes": [_lane(lane) for lane in lanes],
        "notes": list(notes),
        "bytes": size,
        "output": str(output),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """How much is on the page, and where it is."""
    del verbose
    return (
        f"{len(result['lanes'])} lanes, {result['bytes'] / 1e6:.1f} MB\n"
        f"written to {result['output']}"
    )


def _lane(lane: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("name", "alternative", "frames", "file_fps", "fps", "duration")
    return {key: lane[key] for key in keys} | {
        "hands": list(lane["hands"]),
        "meshes": len(lane["meshes"]),
    }
