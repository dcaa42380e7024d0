"""A reduced rig turned back into motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from usdhand.formats.files import read_any
from usdhand.formats.output import check_output
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd import rig as usd_rig
from usdhand.motion import Clip
from usdhand.motion.resample import resample_like
from usdhand.reduce.method import expand as expand_channels
from usdhand.report.expand import expand_result, summary
from usdhand.requests.expand import ExpandRequest
from usdhand.rigs import Conventions, load_conventions
from usdhand.verbs.clips import find_hands, misleading_names, write_clip
from usdhand.verbs.outcome import Journal, Outcome


def expand(
    path: str | Path, conventions: Conventions | None = None, skel: str | None = None
) -> Clip:
    """Motion of a rig file: dependent channels computed from its free ones.

    ``skel`` chooses a rig by its skeleton where the file has several.

    Raises
    ------
    InputError
        if the file cannot be read, or holds no rig, several, or one that contradicts itself.
    HandNotFoundError
        if its character has no hands.
    """
    return _expanded(usd_rig.read_stored_rig(path, skel), conventions)


def expand_onto(
    path: str | Path,
    target: Clip | str | Path,
    skel: str | None = None,
    conventions: Conventions | None = None,
) -> Clip:
    """Motion of a rig file's hands on another character, in the rig's time.

    The body keeps the target's own motion, held at its ends, or its bind pose if it has none.

    Parameters
    ----------
    target : a clip, or a file of any format; ``skel`` chooses its skeleton

    Raises
    ------
    InputError
        if a file cannot be read, or holds no rig, several, or one that contradicts itself.
    UsageError
        if the target has several skeletons and none is chosen, or its hands have no channel of the
        rig.
    HandNotFoundError
        if the target has no hands.
    """
    return _expanded_onto(usd_rig.read_stored_rig(path), target, skel, conventions)


def run(request: ExpandRequest, journal: Journal) -> Outcome:
    """Bake a rig's motion over its own input, or over another character."""
    rig, onto, skel = request.rig, request.onto, request.skel
    conventions = load_conventions(*request.maps)
    inputs = [rig] if onto is None else [rig, onto]
    check_output(request.output, inputs, request.force, USD_SUFFIXES)
    stored = usd_rig.read_stored_rig(rig, skel if onto is None else None)
    if onto is None:
        motion = _expanded(stored, conventions)
    else:
        motion = _expanded_onto(stored, onto, skel, conventions)
    journal.about(motion.origin.path, motion.problems, "warning")
    journal.about(motion.origin.path, misleading_names(motion, conventions), "warning")
    if not request.dry_run:
        lost = write_clip(
            motion,
            request.output,
            flatten=request.flatten,
            force=request.force,
            conventions=conventions,
            inputs=inputs,
        )
        journal.about(request.output, lost, "warning", "note")

    def report() -> dict[str, Any]:
        output = None if request.dry_run else str(request.output)
        return {"output": output} | expand_result(motion, len(stored.rig.free))

    written = () if request.dry_run else (request.output,)
    return Outcome(request, (*inputs, *request.maps), report, summary, written=written)


def _expanded(stored: usd_rig.StoredRig, conventions: Conventions | None) -> Clip:
    hands = usd_rig.with_stored_frames(find_hands(stored.clip, conventions), stored.frames)
    return expand_channels(stored.rig, stored.free, stored.clip, hands)


def _expanded_onto(
    stored: usd_rig.StoredRig,
    target: Clip | str | Path,
    skel: str | None,
    conventions: Conventions | None,
) -> Clip:
    body = target if isinstance(target, Clip) else read_any(target, skel)[0]
    body = resample_like(body, stored.clip)
    return expand_channels(stored.rig, stored.free, body, find_hands(body, conventions))
