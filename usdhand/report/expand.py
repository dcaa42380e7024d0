"""What `expand` reports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usdhand.motion import Clip
from usdhand.report.text import problems_data, written_to


def expand_result(motion: Clip, free_channels: int) -> dict[str, Any]:
    """Everything `expand` reports."""
    return {
        "frames": len(motion),
        "fps": motion.fps,
        "free_channels": free_channels,
        "problems": problems_data(motion.problems),
    }


def summary(result: Mapping[str, Any], verbose: bool) -> str:
    """One line."""
    del verbose
    return (
        f"{result['frames']} frames at {result['fps']:g} fps from {result['free_channels']} free "
        f"channels; {written_to(result)}"
    )
