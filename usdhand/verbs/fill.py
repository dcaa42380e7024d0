"""Method 2 on clips and files: fingers for a body from a library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdhand.anatomy import SIDES, Side
from usdhand.errors import HandNotFoundError, UsageError, UsdHandError
from usdhand.fill.library import MotionLibrary
from usdhand.fill.method import fill
from usdhand.fill.results import Filled
from usdhand.fill.settings import FillSettings
from usdhand.formats.files import read_clip
from usdhand.formats.hashing import file_hash
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.sources import character_under
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.library import is_library, read_library
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.progress import Progress
from usdhand.report.fill import fill_result, summary
from usdhand.report.fill_problems import fill_problems
from usdhand.report.plots import filling as plotting
from usdhand.report.plots.style import check_plots
from usdhand.requests.fill import FillRequest
from usdhand.requests.shared import sides
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, misleading_names, rig_files
from usdhand.verbs.finger_joints import add_fingers, lacks_fingers
from usdhand.verbs.outcome import Journal, Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def fill_fingers(
    body: Clip,
    library: MotionLibrary,
    settings: FillSettings | None = None,
    *,
    sides: Sequence[Side] = SIDES,
    replace_motion: bool = False,
    conventions: Conventions | None = None,
    progress: Progress | None = None,
) -> Filled:
    """Give a body clip the fingers of similar motions.

    Library clips of the same performance, by content or by motion, are left out.

    Parameters
    ----------
    sides : hands to fill
    replace_motion : also replace finger motion that is there and moves
    progress : gets how many segments are done, those of each hand, and how many there are; what
        returns False stops

    Raises
    ------
    UsageError
        if all hands already move and may not be replaced.
    HandNotFoundError
        if the body has no hand, or no finger joints (`add_finger_joints` adds some).
    InputError
        if the library has no motion for any of the hands, or the body is a single frame.
    CancelledError
        if ``progress`` returned False.
    """
    try:
        hands = find_hands(body, conventions, sides)
    except HandNotFoundError as error:
        bare = lacks_fingers(body, conventions, sides)
        if not bare:
            raise
        raise HandNotFoundError(
            f"{body.origin.path or body.name}: the skeleton has no finger joints below its "
            f"{' and '.join(bare)} wrist, so there is nothing to put finger motion on. "
            "--add-fingers adds those of the library's character, scaled to the body; "
            "--fingers-from CHARACTER those of another one."
        ) from error
    content = file_hash(body.origin.path) if body.origin.path else None
    return fill(
        body,
        hands,
        library,
        settings,
        sides=sides,
        replace_motion=replace_motion,
        content_hash=content,
        progress=progress,
    )


def write_filled(
    filled: Filled,
    output: str | Path,
    *,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
    inputs: Sequence[str | Path] = (),
) -> tuple[Problem, ...]:
    """Write a filled body as a layer over its file; alternatives are variants of the animation.

    A body that was made in memory becomes a complete character.

    Returns what flattening could not keep, and other problems of the file.

    The variant set ``fingers`` is on the new SkelAnimation; ``choice_1``, the best, is selected.
    Joints that the body has beyond its file (`add_finger_joints`) are added to its Skeleton.

    Raises
    ------
    InputError
        if the file that it was read from was written anew since, or a result is no number.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    best = filled.clips[0]
    digits = len(str(len(filled.clips)))  # so that editors sort them
    variants = {f"choice_{i:0{digits}}": clip for i, clip in enumerate(filled.clips, 1)}
    return write_motion(
        character_under(best),
        best,
        filled.changed,
        Path(output),
        flatten=flatten,
        allow_outside=allow_outside,
        force=force,
        inputs=inputs,
        variants=variants if len(variants) > 1 else None,
    )


def run(request: FillRequest, journal: Journal) -> Outcome:
    """Fill a body's fingers from a library."""
    output, wanted = request.output, sides(request.side)
    given = [request.body, request.library, *filter(None, [request.fingers_from])]
    outputs = written_files(output, flatten=request.flatten)
    check_outputs(outputs, given, request.force, USD_SUFFIXES)
    if request.plots is not None:
        check_plots(request.plots, plotting.NAMES, request.force)
    conventions = conventions_of(request)
    library = read_library(request.library)
    for entry in library.damaged:
        message = f"{entry.file} of the library cannot be used: {entry.message}"
        journal.warn("damaged", message)
    sources = [request.library.parent / entry.path for entry in library.clips]
    check_outputs(outputs, sources, request.force, USD_SUFFIXES)
    clip = _read_body(request)
    journal.about(request.body, clip.problems, "warning")
    journal.about(request.body, misleading_names(clip, conventions), "warning")
    added = add_fingers(request, clip, library, conventions, journal)
    filled = fill_fingers(
        added.grafted.clip if added else clip,
        library,
        request.settings,
        sides=wanted,
        # A digit that a body without hands has may move: it gets the motion of its new hand.
        replace_motion=request.replace or (added is not None and set(added.joints) >= set(wanted)),
        conventions=conventions,
        progress=journal.progress("filling"),
    )
    journal.tell(*fill_problems(filled, library, request.settings, str(request.body)))
    if not request.dry_run:
        lost = write_filled(
            filled,
            output,
            flatten=request.flatten,
            allow_outside=request.allow_outside,
            force=request.force,
            inputs=given[1:],
        )
        journal.about(output, lost, "warning", "note")

    def report() -> dict[str, Any]:
        body = added.grafted.clip if added else clip
        result = fill_result(filled, library, body)
        result["output"] = None if request.dry_run else str(output)
        if added:
            result |= {"added_joints": added.joints, "fingers_from": added.source}
        return result

    def figures() -> dict[str, Figure]:
        body = added.grafted.clip if added else clip
        return plotting.figures(filled, body, find_hands(body, conventions, wanted), library)

    cutting = request.settings.segmentation or library.segmentation
    return Outcome(
        request,
        (*given, *rig_files(request)),
        report,
        summary,
        settings={"segmentation": asdict(cutting), "add_fingers": bool(added)},
        figures=figures,
        written=() if request.dry_run else (output,),
    )


def _read_body(request: FillRequest) -> Clip:
    body = request.body
    refusal = f"{body} is a motion library; give the clip to fill, and the library with --library."
    try:
        clip = read_clip(body, request.skel)
    except UsdHandError as error:
        if is_library(body):
            raise UsageError(refusal) from error
        raise
    if is_library(clip):
        raise UsageError(refusal)
    return clip
