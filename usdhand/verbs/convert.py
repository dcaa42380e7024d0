"""Clips from one format to another, edited on the way; fingers from one character to another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from usdhand.anatomy import SIDES
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError, UsageError, UsdHandError
from usdhand.formats.atomic import written_beside
from usdhand.formats.files import (
    animation_names,
    is_usd,
    read_any,
    read_character,
    write_other,
)
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.reading import DEFAULT, Reading
from usdhand.formats.sources import character_under
from usdhand.formats.suffixes import USD_SUFFIXES, WRITABLE
from usdhand.formats.usd.convert import StageEdit, placed, write_made, write_placed
from usdhand.motion import Clip, resample
from usdhand.motion.editing import (
    counted_in_frames,
    in_place,
    recounted,
    scaled,
    starting_at,
    trim,
)
from usdhand.motion.resample import resample_like
from usdhand.problems import Problem
from usdhand.report.convert import convert_result, summary
from usdhand.requests.convert import ConvertRequest, Edits
from usdhand.rigs import Conventions, map_character
from usdhand.units import UpAxis
from usdhand.verbs.clips import conventions_of, find_hands, misleading_names, rig_files
from usdhand.verbs.convert_jobs import Job, jobs_of
from usdhand.verbs.files import find_files
from usdhand.verbs.outcome import Journal, Outcome
from usdhand.workers import each_apart

MOST_MADE = 10_000_000


@displayed(
    lambda done: {
        "clip": done.clip,
        "animated": done.animated,
        "lost": len(done.lost),
    }
)
@dataclass(frozen=True, eq=False)
class Converted:
    """What was written.

    Attributes
    ----------
    clip : the motion that the output shows
    source : the clip as it was read
    animated : whether there is motion, or a bind pose only
    lost : what the output's format could not keep, and motion or hands that --onto left out
    """

    clip: Clip
    source: Clip
    animated: bool
    lost: tuple[Problem, ...]


def convert(
    path: str | Path,
    output: str | Path,
    edits: Edits | None = None,
    reading: Reading = DEFAULT,
    *,
    onto: str | Path | None = None,
    onto_reading: Reading = DEFAULT,
    conventions: Conventions | None = None,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
    dry_run: bool = False,
) -> Converted:
    """Read a file of any format and write it as ``output``, of the format of its suffix.

    Parameters
    ----------
    onto : a character that gets the fingers of ``path``, and is written instead of it
    flatten : write one file also where it is ascii with much motion, see `write_new`
    allow_outside : pack files from outside the input's folder into a .usdz, too

    Raises
    ------
    InputError
        if a file cannot be used.
    UsageError
        if there are several skeletons or animations and none is chosen, or edits cannot be meant.
    HandNotFoundError
        if fingers are to go to another character and the two have no hand in common.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    edits, output = edits or Edits(), Path(output)
    inputs = [Path(path), *([Path(onto)] if onto else [])]
    check_outputs(written_files(output, flatten=flatten), inputs, force, WRITABLE)
    _check_up(output, edits.up or "Y")
    lost: tuple[Problem, ...] = ()
    source, animated = read_any(path, reading=reading)
    if onto is None:
        body, body_file, fingers = source, Path(path), None
    else:
        body, unread = _character(Path(onto), onto_reading)
        body_file, fingers, animated = Path(onto), source, True
        lost = (*unread, *_left_out(source, body, conventions))
    usd_to_usd = is_usd(body_file) and output.suffix.lower() in USD_SUFFIXES

    def motion(clip: Clip) -> Clip:
        if fingers is not None:
            clip = retarget_hands(fingers, clip, conventions)
        return edit_frames(clip, edits, conventions)

    if usd_to_usd:
        clip, placement = _placed(motion(body), edits, retimed=fingers is not None)
        edited = edits.of_frames or fingers is not None
        if not dry_run:
            character = placed(character_under(body), placement)
            lost += write_placed(
                character,
                clip,
                output,
                edited=edited,
                flatten=flatten,
                allow_outside=allow_outside,
                force=force,
                inputs=inputs,
            )
    else:
        clip = scaled(counted_in_frames(motion(body)), edits.scale)
        if edits.start is not None:
            clip = starting_at(clip, edits.start)
        if not dry_run:
            up = edits.up or "Y"
            lost += write_new(clip, output, up=up, animated=animated, flatten=flatten, force=force)
    return Converted(clip, source, animated, lost)


def edit_frames(clip: Clip, edits: Edits, conventions: Conventions | None = None) -> Clip:
    """Trim, resample and keep in place, as far as the edits ask for it.

    Raises
    ------
    UsageError
        if a rate, time code or scale cannot be meant.
    """
    clip = trim(clip, *edits.trim)
    if edits.fps is not None:
        if edits.fps > 0 and clip.duration * edits.fps > MOST_MADE:
            raise UsageError(f"{edits.fps:g} frames a second would make over {MOST_MADE} frames.")
        clip = resample(clip, edits.fps)
    if edits.root_motion == "drop":
        clip = in_place(clip, _hips(clip, conventions))
    return clip


def write_new(
    clip: Clip,
    output: str | Path,
    *,
    up: Literal["Y", "Z"] = "Y",
    animated: bool = True,
    flatten: bool = False,
    force: bool = False,
) -> tuple[Problem, ...]:
    """Write a clip as a file of its own, and return what its format could not keep.

    Parameters
    ----------
    up : up axis of the file
    animated : False for a character at its bind pose
    flatten : write one file; else the motion of a .usda goes to a crate beside it,
        ``NAME.motion.usdc``, if it is more than a few frames

    Raises
    ------
    UsageError
        if the format cannot have this axis up.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    output = Path(output)
    suffix = output.suffix.lower()
    given = [p for p in [clip.origin.path] if p]
    check_outputs(written_files(output, flatten=flatten), given, force, WRITABLE)
    _check_up(output, up)
    if suffix in USD_SUFFIXES:
        return write_made(clip, output, up=up, animated=animated, flatten=flatten)
    with written_beside(output) as temporary:
        return write_other(clip, temporary, suffix, up)


def retarget_hands(hands: Clip, target: Clip, conventions: Conventions | None = None) -> Clip:
    """Put the finger motion of one clip on another character, with the times of the hands.

    Channels that both hands have are taken by their anatomical angles; the others, and the body,
    stay those of the target, whose motion is held at its end if the hands last longer.

    Raises
    ------
    HandNotFoundError
        if the two have no hand, or no finger joint of one, in common.
    """
    theirs = find_hands(hands, conventions)
    body = resample_like(target, hands)
    own = find_hands(body, conventions)
    sides = [side for side in own.frames if side in theirs.frames]
    if not sides:
        raise HandNotFoundError(
            f"{hands.name} and {target.name} have no hand in common: the one has the "
            f"{' and '.join(theirs.frames)}, the other the {' and '.join(own.frames)} one."
        )
    own = replace(own, frames={side: own.frames[side] for side in sides})
    taken, kept = theirs.encode(hands), own.encode(body)
    shared = [name for name in kept.names if name in set(taken.names)]
    if not shared:
        raise HandNotFoundError(f"{hands.name} and {target.name} have no finger joint in common.")
    return own.decode(kept.replaced(taken.select(shared)), body)


def _check_up(output: Path, up: str) -> None:
    """Refuse an up axis that the output cannot have, before anything is written."""
    if up not in get_args(UpAxis):
        raise UsageError(f"up: '{up}' must be {' or '.join(get_args(UpAxis))}.")
    if up == "Z" and output.suffix.lower() in (".glb", ".gltf"):
        raise UsageError(f"{output}: glTF is always Y up, so --up Z is not possible.")


def _placed(clip: Clip, edits: Edits, retimed: bool) -> tuple[Clip, StageEdit]:
    """Return a clip as its stage shows it when that is placed anew, and how that is done."""
    new = edits.fps or (clip.fps if retimed else None)
    counted = recounted(clip, new or clip.origin.time_codes_per_second)
    shown = counted if edits.start is None else starting_at(counted, edits.start)
    offset = shown.origin.first_time_code - counted.origin.first_time_code
    return scaled(shown, edits.scale), StageEdit(new, offset, edits.scale, edits.up)


def _character(path: Path, reading: Reading) -> tuple[Clip, tuple[Problem, ...]]:
    """Read a character that gets fingers; of several animations it takes none."""
    names = animation_names(path)
    if len(names) < 2 or reading.animation is not None:
        return read_any(path, reading=reading)[0], ()
    message = f"{path.name} has {len(names)} animations: its body stays at the bind pose"
    return read_character(path, reading=reading), (Problem("several-animations", message),)


def _left_out(hands: Clip, body: Clip, conventions: Conventions | None) -> tuple[Problem, ...]:
    """Say what a character does not get, or loses, when it takes the fingers of a clip."""
    found = []
    theirs, own = (find_hands(clip, conventions).frames for clip in (hands, body))
    for side in SIDES:
        if (side in theirs) != (side in own):
            without = body if side in theirs else hands
            message = f"{without.name} has no {side} hand, so this hand gets no fingers"
            found.append(Problem("no-common-hand", message))
    longer = body.duration - hands.duration
    if len(body) > 1 and abs(longer) > 1.5 / hands.fps:
        what = "is cut" if longer > 0 else "holds its last pose"
        message = (
            f"the result has the length of the hands: the body's motion {what} for the last "
            f"{abs(longer):.2f} s"
        )
        found.append(Problem("other-length", message))
    return tuple(found)


def _hips(clip: Clip, conventions: Conventions | None) -> int:
    """Return the joint that carries the body: the hips, or the first root where none is found."""
    try:
        found = map_character(clip.skeleton, conventions).hips
    except HandNotFoundError:
        found = None
    return int(np.flatnonzero(clip.skeleton.parents < 0)[0]) if found is None else found


@dataclass(frozen=True)
class _Done:
    """What came of it: the report's part, what is odd about the file, and what is lost."""

    result: dict[str, Any]
    odd: tuple[Problem, ...]
    lost: tuple[Problem, ...]


def run(request: ConvertRequest, journal: Journal) -> Outcome:
    """Convert every file, or every animation of one; of several, bad ones are left out."""
    if request.onto_skel is not None and request.onto is None:
        raise UsageError("--onto-skel chooses a skeleton of --onto CHARACTER, which is not given.")
    conventions = conventions_of(request)
    paths = find_files(request.files)
    jobs, code = jobs_of(paths, request, journal)
    results: list[dict[str, Any]] = []
    written: list[Path] = []
    each = partial(_converted, request=request, conventions=conventions)
    for job, done in journal.each(each_apart(each, jobs), "converting", len(jobs)):
        result: dict[str, Any] = {"path": str(job.path), "output": None}
        results.append(result)
        if isinstance(done, UsdHandError):
            if len(jobs) == 1:
                raise done
            journal.fail(done, job.path)
            code = max(code, done.exit_code)
            result |= {"error": str(done)}
            continue
        result |= done.result
        journal.about(job.path, done.odd, "warning")
        journal.about(job.target, done.lost, "warning")
        if not request.dry_run:
            result["output"] = str(job.target)
            written.append(job.target)
    inputs = (*paths, *filter(None, [request.onto]), *rig_files(request))
    return Outcome(
        request,
        inputs,
        lambda: {"files": results},
        summary,
        written=tuple(written),
        exit_code=code,
    )


def _converted(job: Job, request: ConvertRequest, conventions: Conventions | None) -> _Done:
    done = convert(
        job.path,
        job.target,
        request.edits,
        job.reading,
        onto=request.onto,
        onto_reading=Reading(skel=request.onto_skel),
        conventions=conventions,
        flatten=request.flatten,
        allow_outside=request.allow_outside,
        force=request.force,
        dry_run=request.dry_run,
    )
    result = convert_result(done.source, done.clip, done.animated, done.lost, conventions)
    odd = done.source.problems
    if request.onto is not None:
        for clip in (done.source, done.clip):
            odd += misleading_names(clip, conventions)
    return _Done(result, odd, done.lost)
