"""Method 3 on clips and files: a hand clip spliced onto a body clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from usdhand.anatomy import SIDES, Side
from usdhand.errors import UsageError, UsdHandError
from usdhand.formats.files import read_clip
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.sources import character_under
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.character import as_on_stage
from usdhand.formats.usd.warp import author_warps
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.progress import Progress
from usdhand.report.plots import splicing as plotting
from usdhand.report.plots.style import check_plots
from usdhand.report.splice import splice_result, summary
from usdhand.requests.edits import read_pins
from usdhand.requests.shared import sides
from usdhand.requests.splice import SpliceRequest
from usdhand.requests.takes import TakeFile, read_manifest
from usdhand.rigs import Conventions
from usdhand.splice.method import Spliced, splice
from usdhand.splice.settings import Pin, SpliceSettings
from usdhand.splice.takes import Take, splice_takes
from usdhand.verbs.clips import conventions_of, find_hands, misleading_names, rig_files
from usdhand.verbs.outcome import Journal, Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def splice_hands(
    body: Clip,
    hands: Clip,
    settings: SpliceSettings | None = None,
    *,
    pins: Sequence[Pin | str] = (),
    claps: Sequence[Pin | str] = (),
    sides: Sequence[Side] = SIDES,
    conventions: Conventions | None = None,
    progress: Progress | None = None,
) -> Spliced:
    """Give a body clip the fingers of a hand clip of the same performance.

    Parameters
    ----------
    pins : moments that belong together, besides those of the settings: `Pin` in seconds from the
        clips' first frames, or texts in time codes of their clips, see `parse_pin`
    claps : moments that both recordings show at once, likewise, besides those of the settings
    progress : gets how many rounds of alignment are done, those of each hand, and how many there
        are; what returns False stops

    Raises
    ------
    HandNotFoundError
        if the clips have no hand, or no finger joint of one, in common.
    InputError
        if no hand moves, so that there is nothing to align, and pins do not give the timing; if the
        body's fingers move and none of the hand clip's do.
    UsageError
        if pins contradict each other, or the clips' lengths are too different.
    CancelledError
        if ``progress`` returned False.
    """
    settings = settings or SpliceSettings()
    own, heard = (
        tuple(parse_pin(p, body, hands) if isinstance(p, str) else p for p in given)
        for given in (pins, claps)
    )
    settings = replace(settings, pins=(*settings.pins, *own), claps=(*settings.claps, *heard))
    return splice(
        body,
        hands,
        find_hands(body, conventions, sides),
        find_hands(hands, conventions, sides),
        settings,
        progress,
    )


def parse_pin(text: str, body: Clip, hands: Clip) -> Pin:
    """Read a pin ``[left:|right:]BODY:HAND[:TOLERANCE]`` in time codes of the clips' files.

    The tolerance is in time codes of the hand clip; without one the pin is exact.

    Raises
    ------
    UsageError
        if it is not such a text, or a time code is outside its clip.
    """
    first, _, rest = text.partition(":")
    side = next((s for s in SIDES if s == first.strip().lower()), None)
    try:
        numbers = [float(part) for part in (rest if side else text).split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not np.isfinite(numbers).all():
        raise UsageError(
            f"'{text}' is not a pin: give BODY:HAND or BODY:HAND:TOLERANCE in time codes, for one "
            "hand with left: or right: before it."
        )

    def seconds(kind: str, clip: Clip, time_code: float) -> float:
        since = time_code - clip.origin.first_time_code
        if not -1e-6 <= time_code - clip.time_codes[0] <= np.ptp(clip.time_codes) + 1e-6:
            raise UsageError(
                f"Pin {text}: {time_code:g} is outside the {kind} clip, whose time codes are "
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
    allow_outside: bool = False,
    force: bool = False,
    conventions: Conventions | None = None,
    inputs: Sequence[str | Path] = (),
) -> tuple[Problem, ...]:
    """Write a spliced body as a layer over its file, with the warps as attributes of a Scope.

    The wrists are written too where they are the hand clip's. A body that was made in memory
    becomes a complete character.

    Returns what one file, if it was to be one, could not keep.

    Raises
    ------
    InputError
        if the file that it was read from was written anew since, or a result is no number.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    character = character_under(spliced.clip)
    clip = as_on_stage(spliced.clip, character)
    hands = find_hands(clip, conventions, list(spliced.hands))
    changed = [j for frames in hands.frames.values() for j in frames.links.moving]
    if spliced.settings.wrist == "hands":
        changed += [hands.character.hands[side].wrist for side in spliced.hands]
    return write_motion(
        character,
        clip,
        changed,
        Path(output),
        flatten=flatten,
        allow_outside=allow_outside,
        force=force,
        inputs=inputs,
        author=author_warps(
            clip.time_codes.tolist(),
            {s: a.warp[:, 1].tolist() for s, a in spliced.hands.items()},
            {
                s: [(p.take, clip.time_code(round(p.start * clip.fps))) for p in a.pieces]
                for s, a in spliced.hands.items()
                if a.pieces
            },
        ),
    )


def run(request: SpliceRequest, journal: Journal) -> Outcome:
    """Splice a hand clip, or several, onto a body clip."""
    if request.manifest is None and (request.body is None or request.hands is None):
        raise UsageError("Give the files BODY and HANDS, or several hand clips with --manifest.")
    body, takes = _takes(request)
    files = [take.hands for take in takes]
    output, several = request.output, request.manifest is not None
    outputs = written_files(output, flatten=request.flatten)
    check_outputs(outputs, [body, *files], request.force, USD_SUFFIXES)
    if request.plots is not None:
        check_plots(request.plots, plotting.NAMES, request.force)
    conventions = conventions_of(request)
    clip = read_clip(body, request.skel)
    clips = [_hand_clip(take) for take in takes]
    for take in takes:
        if body.resolve() == take.hands.resolve() and request.skel == take.skel:
            journal.warn("same-file", "body and hand clip are the same", body)
    for read in (clip, *clips):
        journal.about(read.origin.path, read.problems, "warning")
        journal.about(read.origin.path, misleading_names(read, conventions), "warning")
    progress, wanted = journal.progress("splicing"), sides(request.side)
    if several:
        given = [
            Take(
                hand_clip,
                find_hands(hand_clip, conventions, [s for s in take.sides if s in wanted]),
                replace(
                    request.settings,
                    pins=tuple(parse_pin(p, clip, hand_clip) for p in take.pins),
                    claps=tuple(parse_pin(p, clip, hand_clip) for p in take.claps),
                ),
            )
            for take, hand_clip in zip(takes, clips, strict=True)
        ]
        hands = find_hands(clip, conventions, sides(request.side))
        spliced = splice_takes(clip, given, hands, request.settings, progress)
    else:
        spliced = splice_hands(
            clip,
            clips[0],
            request.settings,
            pins=takes[0].pins,
            claps=takes[0].claps,
            sides=sides(request.side),
            conventions=conventions,
            progress=progress,
        )
    journal.about(body, spliced.problems, "warning", "note")
    if not request.dry_run:
        lost = write_spliced(
            spliced,
            output,
            flatten=request.flatten,
            allow_outside=request.allow_outside,
            force=request.force,
            conventions=conventions,
            inputs=files,
        )
        journal.about(output, lost, "warning", "note")

    def report() -> dict[str, Any]:
        return splice_result(spliced) | {
            "takes": [str(file) for file in files] if several else [],
            "output": None if request.dry_run else str(output),
        }

    def figures() -> dict[str, Figure]:
        ours = find_hands(clip, conventions, sides(request.side))
        theirs = find_hands(clips[0], conventions, sides(request.side))
        return plotting.figures(spliced, clip, clips[0], ours, theirs, request.settings)

    more = [f for f in (request.manifest, request.edits) if f is not None]
    return Outcome(
        request,
        (body, *files, *more, *rig_files(request)),
        report,
        summary,
        settings={"pins": [p for take in takes for p in take.pins]},
        figures=figures,
        written=() if request.dry_run else (output,),
    )


def _takes(request: SpliceRequest) -> tuple[Path, tuple[TakeFile, ...]]:
    """The body and what goes onto it."""
    if request.manifest is None:
        assert request.body is not None
        assert request.hands is not None
        pins = (*request.pins, *(read_pins(request.edits) if request.edits else ()))
        own = TakeFile(request.hands, request.hands_skel, pins, request.claps, SIDES)
        return request.body, (own,)
    if request.hands is not None:
        raise UsageError("The hand clips are those of the manifest: give no HANDS with --manifest.")
    if request.pins or request.claps or request.edits:
        raise UsageError("With --manifest, pins and claps are those of its takes.")
    if request.plots is not None:
        raise UsageError("Plots are of one hand clip: give no --plots with --manifest.")
    manifest = read_manifest(request.manifest)
    body = request.body or manifest.body
    if body is None:
        raise UsageError(f'Give the file BODY; {request.manifest} has no "body".')
    return body, tuple(replace(t, skel=t.skel or request.hands_skel) for t in manifest.takes)


def _hand_clip(take: TakeFile) -> Clip:
    try:
        return read_clip(take.hands, take.skel)
    except UsdHandError as error:
        raise type(error)(str(error).replace("--skel", "--hands-skel")) from error
