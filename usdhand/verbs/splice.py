"""Method 3 on clips and files: a hand clip spliced onto a body clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from usdhand.anatomy import SIDES, Side
from usdhand.errors import UsageError
from usdhand.formats.files import reopened
from usdhand.formats.usd.warp import author_warps
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip, Problem
from usdhand.rigs import Conventions
from usdhand.splice.method import Spliced, splice
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.verbs.clips import find_hands

__all__ = ["parse_pin", "splice_hands", "write_spliced"]


def splice_hands(
    body: Clip,
    hands: Clip,
    settings: SpliceSettings | None = None,
    *,
    pins: Sequence[Pin | str] = (),
    sides: Sequence[Side] = SIDES,
    conventions: Conventions | None = None,
) -> Spliced:
    """Give a body clip the fingers of a hand clip of the same performance.

    Parameters
    ----------
    pins : moments that belong together, besides those of the settings: `Pin` in seconds from the
        clips' first frames, or texts in time codes of their clips, see `parse_pin`
    """
    settings = settings or SpliceSettings()
    own = tuple(parse_pin(p, body, hands) if isinstance(p, str) else p for p in pins)
    settings = replace(settings, pins=(*settings.pins, *own))
    return splice(
        body,
        hands,
        find_hands(body, conventions, sides),
        find_hands(hands, conventions, sides),
        settings,
    )


def parse_pin(text: str, body: Clip, hands: Clip) -> Pin:
    """Read a pin ``[left:|right:]BODY:HAND[:TOLERANCE]`` in time codes of the clips' files.

    The tolerance is in time codes of the hand clip; without one the pin is exact.
    """
    first, _, rest = text.partition(":")
    side = next((s for s in SIDES if s == first.strip().lower()), None)
    try:
        numbers = [float(part) for part in (rest if side else text).split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
        raise UsageError(
            f"'{text}' is no pin: give BODY:HAND or BODY:HAND:TOLERANCE in time codes, for one "
            "hand with left: or right: before it."
        )

    def seconds(kind: str, clip: Clip, time_code: float) -> float:
        since = time_code - clip.origin.first_time_code
        if not -1e-6 <= time_code - clip.time_codes[0] <= np.ptp(clip.time_codes) + 1e-6:
            raise UsageError(
                f"Pin {text}: {time_code:g} is outside of the {kind} clip, whose time codes are "
                f"{clip.time_codes[0]:g} to {clip.time_codes[-1]:g}."
            )
        return since / clip.origin.time_codes_per_second

    tolerance = numbers[2] / hands.origin.time_codes_per_second if len(numbers) == 3 else 0.0
    return Pin(
        seconds("body", body, numbers[0]), seconds("hand", hands, numbers[1]), tolerance, side, text
    )


def write_spliced(
    spliced: Spliced,
    output: str | Path,
    *,
    flatten: bool = False,
    force: bool = False,
    wrist: bool = False,
    conventions: Conventions | None = None,
    inputs: Sequence[Path] = (),
) -> tuple[Problem, ...]:
    """Write a spliced body as a layer over its file, with the warps as attributes of a Scope.

    Parameters
    ----------
    wrist : whether the wrists have changed as well
    """
    clip = spliced.clip
    character = reopened(clip)
    hands = find_hands(clip, conventions, list(spliced.hands))
    changed = [j for frames in hands.frames.values() for j in frames.links.moving]
    if wrist:
        changed += [hands.character.hands[side].wrist for side in spliced.hands]
    return write_motion(
        character,
        clip,
        changed,
        Path(output),
        flatten=flatten,
        force=force,
        inputs=inputs,
        author=author_warps(
            clip.time_codes.tolist(), {s: a.warp[:, 1].tolist() for s, a in spliced.hands.items()}
        ),
    )
