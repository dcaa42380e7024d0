"""The clock of a recording, as far as a stage has one."""

from __future__ import annotations

from pxr import Usd

from usdhand.motion.timecode import seconds_of
from usdhand.problems import Problem

# Keys of customLayerData under which a time code is found, that of the stage's start.
KEYS = ("timecode", "startTimecode", "start_timecode")


def clock_at(stage: Usd.Stage, time_code: float) -> tuple[float | None, tuple[Problem, ...]]:
    """Seconds of the recording's clock at a time code of the stage, None if it has no clock.

    A clock is a text HH:MM:SS:FF of the stage's start in the custom data of the root layer, in
    frames of framesPerSecond; or else the stage's time codes, if it says where they start.
    """
    data = stage.GetRootLayer().customLayerData
    text = next((data[key] for key in KEYS if key in data), None)
    per_second = stage.GetTimeCodesPerSecond()
    says_start = stage.HasAuthoredTimeCodeRange() or stage.HasAuthoredMetadata("startTimeCode")
    if isinstance(text, str):
        try:
            begins = seconds_of(text, _frame_rate(stage))
        except ValueError as error:
            return None, (Problem("odd-timecode", f"{error}: the stage's time code is not used"),)
        start = stage.GetStartTimeCode() if says_start else time_code
        return begins + (time_code - start) / per_second, ()
    return (time_code / per_second if says_start else None), ()


def _frame_rate(stage: Usd.Stage) -> float:
    """Frames a second that a time code counts."""
    says = stage.HasAuthoredMetadata("framesPerSecond")
    return float(stage.GetFramesPerSecond() if says else stage.GetTimeCodesPerSecond())
