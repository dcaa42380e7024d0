"""A reduced rig turned back into motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from usdhand.anatomy.channels import Channels, Hands
from usdhand.errors import UsageError
from usdhand.formats.files import read_any, read_clip
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd import rig as usd_rig
from usdhand.formats.usd.rig import StoredRig
from usdhand.formats.usd.rig_frames import with_stored_frames
from usdhand.formats.usd.rig_version import check_version
from usdhand.motion import Clip
from usdhand.motion.resample import resample_like
from usdhand.problems import Problem, listed
from usdhand.reduce.method import expand as expand_channels
from usdhand.reduce.method import free_of
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.variation import Variation
from usdhand.report.expand import expand_result, summary
from usdhand.requests.expand import ExpandRequest
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, misleading_names, rig_files, write_clip
from usdhand.verbs.outcome import Journal, Outcome

# A channel that changes by less over a clip is still.
STILL_DEG = 0.01


def expand(
    path: str | Path,
    conventions: Conventions | None = None,
    skel: str | None = None,
    *,
    refresh: bool = False,
    variation: Variation | None = None,
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
        if ``refresh`` is wanted of a file that does not refer to the clip, or there is to be a
        variation, and the rig does not say of what.
    HandNotFoundError
        if its character has no hands.
    """
    return _expanded(usd_rig.read_stored_rig(path, skel), conventions, refresh, variation)


def expand_onto(
    path: str | Path,
    target: Clip | str | Path,
    skel: str | None = None,
    conventions: Conventions | None = None,
    *,
    rig_skel: str | None = None,
    variation: Variation | None = None,
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
        if the target has several skeletons and none is chosen, its hands have no channel of the
        rig, or there is to be a variation, and the rig does not say of what.
    HandNotFoundError
        if the target has no hands.
    """
    stored, chosen = _chosen(path, skel, rig_skel)
    body = _target(target, skel, chosen)
    return _onto(stored.rig, stored.free, stored.clip, body, conventions, variation)


def expand_motion(
    rig: ReducedRig,
    motion: Clip,
    target: Clip | str | Path | None = None,
    skel: str | None = None,
    conventions: Conventions | None = None,
    *,
    variation: Variation | None = None,
) -> Clip:
    """Motion whose free channels are those of a clip, and whose other ones a rig makes of them.

    Parameters
    ----------
    motion : a clip of which only the free channels are used, such as a capture with few markers
    target : another character to put the hands on, see `expand_onto`; the clip's own if None

    Raises
    ------
    UsageError
        if the clip's hands lack a free channel, or as `expand_onto`.
    HandNotFoundError
        if a clip has no hands.
    """
    free, own = _free_channels(rig, motion, conventions)
    return _made_of(rig, free, motion, own, target, skel, conventions, variation)


def run(request: ExpandRequest, journal: Journal) -> Outcome:
    """Bake a rig's motion over its own input, over a clip, or over another character."""
    variation = Variation(request.variation, request.seed)
    conventions = conventions_of(request)
    inputs = [p for p in (request.rig, request.motion, request.onto) if p is not None]
    outputs = written_files(request.output, flatten=request.flatten)
    check_outputs(outputs, inputs, request.force, USD_SUFFIXES)
    rig, motion = _baked(request, journal, conventions, variation)
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
        return {"output": output} | expand_result(motion, rig, request.motion is not None)

    written = () if request.dry_run else (request.output,)
    return Outcome(request, (*inputs, *rig_files(request)), report, summary, written=written)


def _baked(
    request: ExpandRequest,
    journal: Journal,
    conventions: Conventions | None,
    variation: Variation,
) -> tuple[ReducedRig, Clip]:
    onto, skel = request.onto, request.skel
    if request.motion is not None:
        if request.refresh:
            raise UsageError("--refresh has no effect with --motion: leave one of them out.")
        rig = usd_rig.read_rig(request.rig, request.rig_skel)
        clip = read_clip(request.motion, skel if onto is None else None)
        free, own = _free_channels(rig, clip, conventions)
        journal.about(request.motion, _doubts(rig, free), "warning")
        return rig, _made_of(rig, free, clip, own, onto, skel, conventions, variation)
    if onto is None:
        if request.rig_skel is not None:
            raise UsageError("--rig-skel is for --onto; without it, --skel chooses the rig.")
        stored = usd_rig.read_stored_rig(request.rig, skel)
        return stored.rig, _expanded(stored, conventions, request.refresh, variation)
    if request.refresh:
        raise UsageError("--refresh has no effect with --onto: leave one of them out.")
    stored, chosen = _chosen(request.rig, skel, request.rig_skel)
    body = _target(onto, skel, chosen)
    motion = _onto(stored.rig, stored.free, stored.clip, body, conventions, variation)
    return stored.rig, motion


def _free_channels(
    rig: ReducedRig, clip: Clip, conventions: Conventions | None
) -> tuple[Channels, Hands]:
    hands = find_hands(clip, conventions)
    return free_of(rig, clip, hands.encode(clip)), hands


def _made_of(
    rig: ReducedRig,
    free: Channels,
    clip: Clip,
    own: Hands,
    target: Clip | str | Path | None,
    skel: str | None,
    conventions: Conventions | None,
    variation: Variation | None,
) -> Clip:
    """Motion from the free channels of a clip, on its own hands or on those of a target."""
    if target is None:
        return expand_channels(rig, free, clip, own, variation)
    return _onto(rig, free, clip, _target(target, skel), conventions, variation)


def _doubts(rig: ReducedRig, free: Channels) -> Iterator[Problem]:
    """What speaks against taking a clip's free channels at their word."""
    curves = dict(zip(free.names, free.values.T, strict=True))
    still = [name for name, curve in curves.items() if np.ptp(curve) < STILL_DEG]
    if still:
        yield Problem(
            "still-free-channels",
            f"{len(still)} of the rig's {len(free)} free channels do not move in this clip, and "
            f"what follows them stays still with them: {listed(still)}",
            severity="warning",
        )
    limits = {r.name: r.limits for r in rig.relations if r.limits is not None}
    beyond = [
        name
        for name, curve in curves.items()
        if name in limits and (curve.min() < limits[name].low or curve.max() > limits[name].high)
    ]
    if beyond:
        yield Problem(
            "beyond-limits",
            f"{len(beyond)} free channels go beyond what the rig was fitted to and a hand can do; "
            f"what follows them is held within its own limits: {listed(beyond)}",
            severity="warning",
        )


def _expanded(
    stored: StoredRig,
    conventions: Conventions | None,
    refresh: bool,
    variation: Variation | None,
) -> Clip:
    if refresh:
        return _refreshed(stored, conventions, variation)
    hands = with_stored_frames(find_hands(stored.clip, conventions), stored.frames)
    motion = expand_channels(stored.rig, stored.free, stored.clip, hands, variation)
    joints = stored.clip.skeleton.joints
    moved = {joints[j] for frames in hands.frames.values() for j in frames.links.moving}
    changed = stored.source.change(moved) if stored.source else None
    if changed is None:
        return motion
    problem = Problem("changed-source", changed)
    return replace(motion, problems=(*motion.problems, problem))


def _refreshed(
    stored: StoredRig, conventions: Conventions | None, variation: Variation | None
) -> Clip:
    """The hands of a rig on the body that its own source has now."""
    source = stored.source
    if source is None:
        raise UsageError(
            f"{stored.character.path} does not refer to the clip that it was made from, so there "
            "is nothing to refresh the body from. Give that clip: --onto CLIP"
        )
    body = resample_like(read_any(source.path, source.skeleton)[0], stored.clip)
    hands = with_stored_frames(find_hands(body, conventions), stored.frames)
    return expand_channels(stored.rig, stored.free, body, hands, variation)


def _chosen(path: str | Path, skel: str | None, rig_skel: str | None) -> tuple[StoredRig, bool]:
    """The rig, and whether ``skel`` chose it, which may then be of no use for the target."""
    names_one = rig_skel is None and skel is not None and usd_rig.names_a_rig(path, skel)
    stored = usd_rig.read_stored_rig(path, skel if names_one else rig_skel, "--rig-skel")
    check_version(stored.version, stored.character.path)
    return stored, names_one


def _onto(
    rig: ReducedRig,
    free: Channels,
    clip: Clip,
    body: Clip,
    conventions: Conventions | None,
    variation: Variation | None,
) -> Clip:
    """Put the hands on a body, in the time of the clip that the free channels are of."""
    body = resample_like(body, clip)
    return expand_channels(rig, free, body, find_hands(body, conventions), variation)


def _target(target: Clip | str | Path, skel: str | None, of_rig: bool = False) -> Clip:
    """The target as a clip; ``skel`` that chose the rig need not be one of its skeletons."""
    if isinstance(target, Clip):
        return target
    try:
        return read_any(target, skel)[0]
    except UsageError:
        if not of_rig:
            raise
        return read_any(target)[0]
