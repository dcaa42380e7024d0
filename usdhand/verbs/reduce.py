"""Method 1 on clips and files: hands reduced to a rig."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from usdhand.anatomy import SIDES, Hands, Side
from usdhand.anatomy.channels import Channels
from usdhand.errors import OutputError, UsageError
from usdhand.formats.files import read_clip
from usdhand.formats.output import check_folder, check_outputs, make_folder
from usdhand.formats.paths import written_files
from usdhand.formats.sources import character_under
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd import rig as usd_rig
from usdhand.formats.usd.rig_library import write_fitted_rig
from usdhand.motion import Clip, Skeleton
from usdhand.motion.skeleton import same_bind
from usdhand.problems import Problem
from usdhand.reduce.evidence import Takes, gather
from usdhand.reduce.method import Reduction, apply_rig, fit_to
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.settings import Criteria, ReduceSettings
from usdhand.report.plots import curve
from usdhand.report.plots import reducing as plotting
from usdhand.report.plots.style import check_plots
from usdhand.report.reduce import curve_data, fit_result, fit_summary, reduce_result, summary
from usdhand.requests.reduce import ReduceRequest
from usdhand.requests.shared import sides
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_all_hands, find_hands, rig_files
from usdhand.verbs.files import check_several, find_files
from usdhand.verbs.outcome import Journal, Outcome


def reduce_hands(
    clips: Sequence[Clip],
    settings: ReduceSettings | None = None,
    *,
    rig: ReducedRig | None = None,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
) -> list[Reduction]:
    """Fit one rig to all clips (or apply a fitted one) and express every clip in it.

    Parameters
    ----------
    settings : how to fit
    rig : a fitted rig to apply as it is

    Returns
    -------
    list of Reduction, one a clip, all with the same rig.

    Raises
    ------
    UsageError
        if there is no clip, the settings contradict each other, or the rig has channels that a
        clip's hands lack.
    HandNotFoundError
        if a clip has no hands.
    InputError
        if a clip has one frame, or the clips' hands have different joints, so that no rig can be
        fitted to them.
    """
    check_several("clips", clips)
    settings = settings or ReduceSettings()
    if not clips:
        raise UsageError("There is no clip to reduce.")
    hands = find_all_hands(clips, conventions, sides)
    sources = [h.encode(clip) for clip, h in zip(clips, hands, strict=True)]
    evidence = None
    if rig is None:
        evidence = gather(zip(clips, hands, sources, strict=True))
        rig = fit_evidence(evidence, settings)
    each = zip(clips, hands, sources, strict=True)
    return [replace(apply_rig(rig, clip, h, source), evidence=evidence) for clip, h, source in each]


def fit_evidence(evidence: Takes, settings: ReduceSettings) -> ReducedRig:
    """Fit a rig as settings say."""
    by_rules = settings.target.thresholds is not None
    fit = settings.fit or ("paper" if by_rules else "least-squares")
    return fit_to(evidence, settings.target, fit, settings.controllers, settings.choice)


def read_rig(path: str | Path, skel: str | None = None) -> ReducedRig:
    """Read the relations of a rig file, to apply them to other clips.

    ``skel`` chooses a rig by its skeleton where the file has several.

    Raises
    ------
    InputError
        if the file cannot be read, holds no rig or several, or one that contradicts itself.
    """
    return usd_rig.read_rig(path, skel)


def write_rig(
    reduction: Reduction | ReducedRig,
    output: str | Path,
    *,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
) -> tuple[Problem, ...]:
    """Write a reduced clip as a rig over the file it was read from.

    A clip that was made in memory becomes a character with its own motion first. A rig without a
    clip (see `fit_rig`) is written alone, to be applied to clips.

    Returns what one file, if it was to be one, could not keep.

    Raises
    ------
    InputError
        if the file that it was read from was written anew since, or a result is no number.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    if isinstance(reduction, ReducedRig):
        write_fitted_rig(reduction, output, force=force)
        return ()
    character = character_under(reduction.clip, animated=True)
    return usd_rig.write_rig(
        reduction,
        character,
        Path(output),
        flatten=flatten,
        allow_outside=allow_outside,
        force=force,
    )


def fit_rig(
    clips: Sequence[Clip | str | Path],
    settings: ReduceSettings | None = None,
    *,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = SIDES,
) -> ReducedRig:
    """Fit one rig to all clips, one at a time.

    Clips of one character have the anatomical frames of its first.

    Parameters
    ----------
    clips : clips, or files, which are read when their turn comes and given up at once

    Raises
    ------
    UsageError
        if the settings contradict each other.
    HandNotFoundError
        if a clip has no hands.
    InputError
        if there is no clip, one has a single frame, or their hands have different joints.
    """
    check_several("clips", clips)
    values = (clip if isinstance(clip, Clip) else read_clip(clip) for clip in clips)
    evidence = gather(_encoded(values, conventions, sides))
    return fit_evidence(evidence, settings or ReduceSettings())


def _encoded(
    clips: Iterable[Clip], conventions: Conventions | None, sides: Sequence[Side]
) -> Iterator[tuple[Clip, Hands, Channels]]:
    """Clips with their hands and channels, one at a time."""
    known: dict[tuple[str, ...], list[tuple[Skeleton, Hands]]] = {}
    for clip in clips:
        own = known.setdefault(clip.skeleton.joints, [])
        hands = next((h for s, h in own if same_bind(s, clip.skeleton)), None)
        if hands is None:
            hands = find_hands(clip, conventions, sides)
            own.append((clip.skeleton, hands))
        yield clip, hands, hands.encode(clip)


def run(request: ReduceRequest, journal: Journal) -> Outcome:
    """Fit one rig to all clips, or apply a fitted one, and write a rig over each clip."""
    if request.fit_only:
        return _fit_only(request, journal)
    paths = find_files(request.clips)
    outputs = _outputs(paths, request.output)
    inputs = [*paths, *([request.rig] if request.rig else []), *rig_files(request)]
    _check_fitting(request)
    _check_outputs(outputs, inputs, request)
    if request.plots is not None:
        check_plots(request.plots, plotting.NAMES, request.force)
    conventions = conventions_of(request)
    rig = read_rig(request.rig) if request.rig else None
    clips = [read_clip(path, request.skel) for path in journal.each(paths, "reading")]
    for clip in clips:
        journal.about(clip.origin.path, clip.problems, "warning")
    reductions = reduce_hands(
        clips, request.settings, rig=rig, conventions=conventions, sides=sides(request.side)
    )
    for reduction in reductions:
        journal.about(reduction.clip.origin.path, reduction.hands.problems, "warning", "note")
    if not request.dry_run:
        make_folder(outputs[0].parent)
        pairs = list(zip(reductions, outputs, strict=True))
        for reduction, target in journal.each(pairs, "writing"):
            lost = write_rig(
                reduction,
                target,
                flatten=request.flatten,
                allow_outside=request.allow_outside,
                force=request.force,
            )
            journal.about(target, lost, "warning", "note")

    def report() -> dict[str, Any]:
        results = [
            reduce_result(r) | {"output": None if request.dry_run else str(o)}
            for r, o in zip(reductions, outputs, strict=True)
        ]
        evidence = reductions[0].evidence
        more = {} if evidence is None else {"curve": curve_data(evidence, request.settings)}
        return (results[0] if len(results) == 1 else {"clips": results}) | more

    return Outcome(
        request,
        tuple(inputs),
        report,
        summary,
        figures=lambda: plotting.figures(reductions, request.settings),
        written=() if request.dry_run else tuple(outputs),
    )


def _fit_only(request: ReduceRequest, journal: Journal) -> Outcome:
    """Fit one rig to all clips and write its relations alone."""
    paths = find_files(request.clips)
    if request.rig is not None:
        raise UsageError("--rig applies a rig as it is; --fit-only fits one.")
    if request.flatten:
        raise UsageError("--fit-only writes one file without a character; --flatten has no use.")
    _check_fitting(request)
    own = written_files(request.output)
    check_outputs(own, [*paths, *rig_files(request)], request.force, USD_SUFFIXES)
    if request.plots is not None:
        check_plots(request.plots, curve.NAMES, request.force)

    def reading() -> Iterator[Clip]:
        for path in journal.each(paths, "reading"):
            clip = read_clip(path, request.skel)
            journal.about(clip.origin.path, clip.problems, "warning")
            yield replace(clip, source=None)

    conventions = conventions_of(request)
    evidence = gather(_encoded(reading(), conventions, sides(request.side)))
    rig = fit_evidence(evidence, request.settings)
    if not request.dry_run:
        write_fitted_rig(rig, request.output, force=request.force)

    def report() -> dict[str, Any]:
        output = None if request.dry_run else str(request.output)
        by_count = curve_data(evidence, request.settings)
        return fit_result(rig, evidence) | {"output": output, "curve": by_count}

    return Outcome(
        request,
        (*paths, *rig_files(request)),
        report,
        fit_summary,
        figures=lambda: curve.figures(rig, evidence, request.settings),
        written=() if request.dry_run else (request.output,),
    )


def _check_fitting(request: ReduceRequest) -> None:
    given = request.settings
    asked = {
        "--preset": given.preset,
        "--range": given.range_deg,
        "--rmsd": given.rmsd,
        "--target-dofs": given.free_channels,
        "--max-error": given.max_error,
    }
    used = [flag for flag, value in asked.items() if value is not None]
    if request.rig is not None and used:
        raise UsageError(f"--rig applies a rig as it is; {used[0]} fits one.")
    if request.rig is not None and (given.fit is not None or given.controllers is not None):
        raise UsageError("--rig applies a rig as it is; --fit and --controllers are for fitting.")
    if request.rig is not None and given.choice != Criteria():
        raise UsageError(
            "--rig applies a rig as it is; --measure, --keep, --prefer and --symmetric are for "
            "fitting."
        )
    _ = given.target  # refuses what contradicts itself before anything is read


def _outputs(paths: Sequence[Path], output: Path) -> list[Path]:
    """One output a clip: the file given, or files in the folder given."""
    if len(paths) == 1 and not output.is_dir():
        return [output]
    return [output / f"{path.stem}.rig.usdc" for path in paths]


def _check_outputs(outputs: Sequence[Path], inputs: Sequence[Path], request: ReduceRequest) -> None:
    if len(set(outputs)) < len(outputs):
        raise OutputError("Two clips have the same name, so their rigs would replace each other.")
    folder = outputs[0].parent
    if len(outputs) > 1 and not folder.exists():  # made once there is something to put in
        check_folder(folder)
        return
    own = [path for output in outputs for path in written_files(output, flatten=request.flatten)]
    check_outputs(own, inputs, request.force, USD_SUFFIXES)
