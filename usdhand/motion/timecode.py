"""Time codes as clocks show them: HH:MM:SS:FF (SMPTE ST 12-1)."""

from __future__ import annotations

import re

_TEXT = re.compile(r"(\d{1,2}):([0-5]\d):([0-5]\d)([:;.,])(\d{1,3})")
# Frames that 29.97 frames a second drop in every minute but the tenth ones, of each 30.
DROPPED = 2


def seconds_of(text: str, fps: float) -> float:
    """Seconds since midnight of a time code; with ``;`` before the frames, some are dropped.

    Raises
    ------
    ValueError
        if it is no time code at this rate.
    """
    found = _TEXT.fullmatch(text.strip())
    nominal = round(fps)
    if found is None or nominal < 1 or int(found[5]) >= nominal:
        raise ValueError(f"'{text}' is no time code HH:MM:SS:FF of {fps:g} frames a second")
    hours, minutes, seconds, frame = (int(found[k]) for k in (1, 2, 3, 5))
    minutes += 60 * hours
    count = (60 * minutes + seconds) * nominal + frame
    if found[4] == ";":
        if nominal % 30:
            raise ValueError(f"'{text}' drops frames, which {fps:g} frames a second do not")
        count -= DROPPED * (nominal // 30) * (minutes - minutes // 10)
    return count / fps


def clock_text(seconds: float) -> str:
    """Seconds since midnight as HH:MM:SS.mmm."""
    sign = "-" if seconds < 0 else ""
    thousandths = round(abs(seconds) * 1000)
    whole, thousandths = divmod(thousandths, 1000)
    minutes, second = divmod(whole, 60)
    return f"{sign}{minutes // 60:02d}:{minutes % 60:02d}:{second:02d}.{thousandths:03d}"
