"""A reduced rig turned back into motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from usdhand.errors import UsageError
from usdhand.formats.files import read_any
from usdhand.formats.output import check_output
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd import rig as usd_rig
from usdhand.formats.usd.rig import StoredRig
from usdhand.motion import Clip
from usdhand.motion.resample import resample_like
from usdhand.problems import Problem
from usdhand.reduce.method import expand as expand_channels
from usdhand.report.expand import expand_result, summary
from usdhand.requests.expand import ExpandRequest
from usdhand.rigs import Conventions, load_conventions
from usdhand.verbs.clips import find_hands, misleading_names, write_clip
from usdhand.verbs.outcome import Journal, Outcome


def expand(
    path: str | Path,
    conventions: Conventions | None = None,
    skel: str | None = None,
    *,
    refresh: bool = False,
) -> Clip:
    """Motion of a rig file: dependent channels computed from its free ones.

    ``skel`` chooses a rig by its skeleton where the file has several. What has changed of the clip
    that the rig was made from is in the ``problems`` of the result.

    Parameters
    ----------
    refresh : take the body from that clip as it is now

    Raises
    ------
    InputError
        if the file cannot be read, or holds no rig, several, or one that contradicts itself.
    UsageError
        if ``refresh`` is wanted of a file that does not refer to the clip.
    HandNotFoundError
        if its character has no hands.
    """
    return _expanded(usd_rig.read_stored_rig(path, skel), conventions, refresh)


def expand_onto(
    path: str | Path,
    target: Clip | str | Path,
    skel: str | None = None,
    conventions: Conventions | None = None,
    *,
    rig_skel: str | None = None,
) -> Clip:
    """Motion of a rig file's hands on another character, in the rig's time.

    The body keeps the target's own motion, held at its ends, or its bind pose if it has none.

    Parameters
    ----------
    target : a clip, or a file of any format; ``skel`` chooses its skeleton
    rig_skel : chooses a rig by its skeleton where the file has several. ``skel`` does where it is
        the skeleton of one of them

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
    stored, chosen = _chosen(path, skel, rig_skel)
    return _expanded_onto(stored, target, skel, conventions, chosen)


def run(request: ExpandRequest, journal: Journal) -> Outcome:
    """Bake a rig's motion over its own input, or over another character."""
    rig, onto, skel = request.rig, request.onto, request.skel
    conventions = load_conventions(*request.maps)
    inputs = [rig] if onto is None else [rig, onto]
    check_output(request.output, inputs, request.force, USD_SUFFIXES)
    if onto is None:
        if request.rig_skel is not None:
            raise UsageError("--rig-skel is for --onto; without it, --skel chooses the rig.")
        stored = usd_rig.read_stored_rig(rig, skel)
        motion = _expanded(stored, conventions, request.refresh)
    else:
        if request.refresh:
            raise UsageError("--refresh has no effect with --onto: leave one of them out.")
        stored, chosen = _chosen(rig, skel, request.rig_skel)
        motion = _expanded_onto(stored, onto, skel, conventions, chosen)
    journal.about(motion.origin.path, motion.problems, "warning")
    journal.about(motion.origin.path, misleading_names(motion, conventions), "warning")
    if not request.dry_run:
        lost = write_clip(
            motion,
            request.output,
            flatten=request.flatten,
            allow_outside=request.allow_outside,
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


def _expanded(stored: StoredRig, conventions: Conventions | None, refresh: bool) -> Clip:
    hands = usd_rig.with_stored_frames(find_hands(stored.clip, conventions), stored.frames)
    if refresh:
        return _refreshed(stored, conventions)
    motion = expand_channels(stored.rig, stored.free, stored.clip, hands)
    joints = stored.clip.skeleton.joints
    moved = {joints[j] for frames in hands.frames.values() for j in frames.links.moving}
    changed = stored.source.change(moved) if stored.source else None
    if changed is None:
        return motion
    problem = Problem("changed-source", changed)
    return replace(motion, problems=(*motion.problems, problem))


def _refreshed(stored: StoredRig, conventions: Conventions | None) -> Clip:
    """The hands of a rig on the body that its own source has now."""
    source = stored.source
    if source is None:
        raise UsageError(
            f"{stored.character.path} does not refer to the clip that it was made from, so there "
            "is nothing to refresh the body from. Give that clip: --onto CLIP"
        )
    body = resample_like(read_any(source.path, source.skeleton)[0], stored.clip)
    hands = usd_rig.with_stored_frames(find_hands(body, conventions), stored.frames)
    return expand_channels(stored.rig, stored.free, body, hands)


def _chosen(path: str | Path, skel: str | None, rig_skel: str | None) -> tuple[StoredRig, bool]:
    """The rig, and whether ``skel`` chose it, which may then be of no use for the target."""
    names_one = rig_skel is None and skel is not None and usd_rig.names_a_rig(path, skel)
    return usd_rig.read_stored_rig(path, skel if names_one else rig_skel, "--rig-skel"), names_one


def _expanded_onto(
    stored: StoredRig,
    target: Clip | str | Path,
    skel: str | None,
    conventions: Conventions | None,
    of_rig: bool,
) -> Clip:
    body = target if isinstance(target, Clip) else _target(target, skel, of_rig)
    body = resample_like(body, stored.clip)
    return expand_channels(stored.rig, stored.free, body, find_hands(body, conventions))


def _target(target: str | Path, skel: str | None, of_rig: bool) -> Clip:
    try:
        return read_any(target, skel)[0]
    except UsageError:
        if not of_rig:
            raise
        return read_any(target)[0]
