"""How well a library tells fingers from arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from usdhand.anatomy import SIDES
from usdhand.errors import InputError, UsdHandError
from usdhand.evaluate.agreement import Agreement, label_agreement
from usdhand.evaluate.reconstruction import HandError, reconstruction_errors
from usdhand.fill.candidates import SearchSpace
from usdhand.fill.library import LibraryClip, MotionLibrary, Part
from usdhand.fill.method import moving_sides, space_for
from usdhand.fill.settings import FillSettings
from usdhand.formats.files import read_clip
from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.library import read_library
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.progress import Progress, each
from usdhand.report.evaluate import evaluation_result, summary
from usdhand.report.plots import evaluating as plotting
from usdhand.report.plots.style import check_plots
from usdhand.requests.evaluate import EvaluateRequest
from usdhand.requests.fill import PRESETS
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, rig_files
from usdhand.verbs.files import find_files
from usdhand.verbs.outcome import Journal, Outcome


def measure_library(
    library: MotionLibrary,
    folder: str | Path,
    settings: FillSettings | None = None,
    *,
    takes: Sequence[Clip] | None = None,
    conventions: Conventions | None = None,
    progress: Progress | None = None,
) -> tuple[list[HandError], list[Problem]]:
    """Fill every clip of a library from the others and compare with its true fingers.

    Parameters
    ----------
    folder : of the library, which its clips' paths are relative to
    takes : clips to fill instead, such as those of another rig
    progress : gets how many clips are done and how many there are; False stops

    Returns
    -------
    errors, and the clips that could not be filled, or have still fingers, with the reason

    Raises
    ------
    CancelledError
        if ``progress`` returned False.
    """
    settings = settings or FillSettings()
    sources: list[Clip | LibraryClip] = list(library.clips if takes is None else takes)
    spaces: dict[Part, SearchSpace] = {
        (side,): space_for(library, (side,), settings)
        for side in SIDES
        if any(side in c.hands for c in library.clips)
    }
    errors: list[HandError] = []
    left: list[Problem] = []
    for source in each(sources, len(sources), progress):
        try:
            clip = _library_source(source, folder) if isinstance(source, LibraryClip) else source
            hands = find_hands(clip, conventions)
            moving = moving_sides(hands.encode(clip), hands)
            # The library has no still hands, so of its own clips there is nothing to say.
            if still := [] if takes is None else [s for s in hands.frames if s not in moving]:
                which = " and ".join(still)
                left.append(
                    Problem(
                        "left-out",
                        f"the {which} fingers do not move, so there is nothing to compare with",
                        file=clip.name,
                    )
                )
            if not moving:
                continue
            errors += reconstruction_errors(
                clip,
                hands,
                library,
                settings,
                sides=moving,
                content_hash=file_hash(clip.origin.path) if clip.origin.path else None,
                spaces=None if settings.couple else spaces,
            )
        except UsdHandError as error:
            left.append(Problem("left-out", str(error), file=source.name))
    return errors, left


def _library_source(clip: LibraryClip, folder: str | Path) -> Clip:
    return read_clip(Path(folder, clip.path), clip.skel or None)


def run(request: EvaluateRequest, journal: Journal) -> Outcome:
    """Measure a library by leaving out one clip at a time, or by other takes."""
    settings = replace(PRESETS[request.preset], k=request.k)
    if request.metric:
        settings = replace(settings, metric=request.metric)
    if request.plots is not None:
        check_plots(request.plots, plotting.NAMES, request.force)
    library = read_library(request.library)
    paths = find_files(request.takes) if request.takes else []
    agreements = _agreements(request, library, journal)
    for entry in library.damaged:
        message = f"{entry.file} of the library cannot be used: {entry.message}"
        journal.warn("damaged", message)
    errors: list[HandError] = []
    left_out: list[Problem] = []
    if not request.labels_only:
        takes, unread = _read(paths, journal) if paths else (None, [])
        errors, left = measure_library(
            library,
            request.library.absolute().parent,
            settings,
            takes=takes,
            conventions=conventions_of(request),
            progress=journal.progress("evaluating"),
        )
        left_out = [*unread, *left]
        for take in left_out:
            journal.warn("left-out", f"left out: {take.file}: {take.message}")
        if not errors:
            raise InputError("No clip could be filled from the others.")

    def report() -> dict[str, Any]:
        left = [{"path": take.file, "reason": take.message} for take in left_out]
        return evaluation_result(agreements, errors) | {"left_out": left}

    return Outcome(
        request,
        (request.library, *paths, *rig_files(request)),
        report,
        summary,
        settings={"metric": settings.metric, "fill": asdict(settings)},
        figures=lambda: plotting.figures(agreements, errors),
    )


def _agreements(
    request: EvaluateRequest, library: MotionLibrary, journal: Journal
) -> list[Agreement]:
    try:
        return label_agreement(library, k=request.k)
    except InputError as error:
        if request.labels_only:
            raise
        if not request.takes:  # else it is about the takes
            journal.warn("no-labels", str(error))
        return []


def _read(paths: Sequence[Path], journal: Journal) -> tuple[list[Clip], list[Problem]]:
    """Clips, and the files that are none."""
    clips, left = [], []
    for path in journal.each(paths, "reading"):
        try:
            clips.append(replace(read_clip(path), source=None))  # none of them is written
        except UsdHandError as error:
            left.append(Problem("left-out", str(error), file=str(path)))
    return clips, left
