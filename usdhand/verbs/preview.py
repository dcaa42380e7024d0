"""Clips and reports gathered into a page to look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from usdhand.anatomy import Side
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError, UsageError
from usdhand.formats.atomic import written_beside
from usdhand.formats.files import is_usd, read_any
from usdhand.formats.hashing import file_hash
from usdhand.formats.output import check_output
from usdhand.formats.usd.shown import ShownMotion, read_shown
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.problems import listed
from usdhand.report.preview.events import (
    lane_of,
    read_report,
    report_rows,
    report_verb,
    retiming,
    warp_rows,
)
from usdhand.report.preview.lanes import Lane, lane_data, unshown
from usdhand.report.preview.pack import Pack
from usdhand.report.preview.page import figure, page
from usdhand.report.preview.summary import preview_result, summary
from usdhand.requests.preview import PreviewRequest, PreviewSettings
from usdhand.rigs import Conventions
from usdhand.verbs.clips import conventions_of, find_hands, rig_files
from usdhand.verbs.files import check_several, find_files
from usdhand.verbs.outcome import Journal, Outcome

PAGE_SUFFIXES = (".html", ".htm")
MOST_SHOWN = 6  # lanes, when the page opens


@displayed(
    lambda page: {
        "lanes": len(page.lanes),
        "megabytes": len(page.html) / 1e6,
        "notes": page.notes,
    }
)
@dataclass(frozen=True, eq=False)
class Previewed:
    """A page, the clips it was made of, and what a person should know about it."""

    html: str
    clips: tuple[Clip, ...]
    lanes: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]


def preview_clips(
    clips: Sequence[Clip | str | Path],
    settings: PreviewSettings | None = None,
    *,
    skel: str | None = None,
    reports: Sequence[str | Path] = (),
    figures: Sequence[str | Path] = (),
    title: str | None = None,
    conventions: Conventions | None = None,
) -> Previewed:
    """Make a page of clips: side by side or over each other, in sync from their first frames.

    Parameters
    ----------
    clips : clips, or files of any format, with their meshes where these are USD
    skel : path or name of the skeleton of files with several
    reports : JSON reports of `fill` or `splice`, for the timeline, of files that are shown; with
        that of a splice, its hand clip plays in the time of the body
    figures : SVG or PNG files to show below

    Raises
    ------
    InputError
        if a file cannot be used.
    UsageError
        if there is nothing to show, or a report belongs to none of the files.
    """
    for name, several in (("clips", clips), ("reports", reports), ("figures", figures)):
        check_several(name, several)
    if not clips:
        raise UsageError("There is nothing to show: give a file.")
    settings = settings or PreviewSettings()
    read = [(Path(path), read_report(Path(path))) for path in reports]
    pictures = [figure(Path(path)) for path in figures]
    names = _names([c if isinstance(c, Clip) else Path(c) for c in clips])
    lanes = [
        lane
        for source, name in names.items()
        for lane in _lanes(source, name, skel, settings, conventions)
    ]
    rows = [row for path, report in read for row in _report_rows(report, path, lanes)]
    lanes = _retimed(lanes, dict(retiming(report) for _, report in read))
    if not any(report_verb(report) == "splice" for _, report in read):
        rows += [row for lane in lanes if lane.shown for row in _warp_rows(lane)]
    lanes, hidden = _few_shown(lanes)
    pack = Pack()
    made = [lane_data(lane, pack, settings.max_frames) for lane in lanes]
    notes = tuple(f"{d['name']}: {note}" for d in made for note in d["notes"])
    data = {"lanes": made, "rows": rows, "notes": hidden, **pack.document()}
    text = page(title or _title(list(names.values())), data, pictures)
    return Previewed(text, tuple(lane.clip for lane in lanes), tuple(made), (*notes, *hidden))


def write_preview(
    previewed: Previewed,
    output: str | Path,
    *,
    force: bool = False,
    inputs: Sequence[str | Path] = (),
) -> None:
    """Write a page.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written.
    """
    output = Path(output)
    check_output(output, inputs, force, PAGE_SUFFIXES)
    with written_beside(output) as temporary:
        temporary.write_text(previewed.html, encoding="utf-8", errors="backslashreplace")


def _lanes(
    source: Clip | Path,
    name: str,
    skel: str | None,
    settings: PreviewSettings,
    conventions: Conventions | None,
) -> list[Lane]:
    if isinstance(source, Clip):
        takes = [ShownMotion(source)]
    elif is_usd(source):
        takes = read_shown(source, skel, skins=settings.max_points > 0)
    else:
        takes = [ShownMotion(read_any(source, skel)[0])]
    return [_lane(take, name, i == 0, settings, conventions) for i, take in enumerate(takes)]


def _lane(
    take: ShownMotion,
    name: str,
    first: bool,
    settings: PreviewSettings,
    conventions: Conventions | None,
) -> Lane:
    notes = [*take.notes, *(str(p) for p in take.clip.problems if p.severity == "warning")]
    try:
        hands = find_hands(take.clip, conventions)
        notes += hands.notes
    except HandNotFoundError as error:
        hands = None
        whose = f"{take.clip.origin.path or take.clip.name}: "
        notes.append(f"no close-ups and curves: {str(error).removeprefix(whose)}")
    skins = take.skins
    if word := unshown(skins, settings.max_points):
        skins = ()
        notes.append(word)
    return Lane(
        name=f"{name} {take.alternative}".rstrip(),
        clip=take.clip,
        hands=hands,
        alternative=take.alternative,
        shown=first,
        skins=skins,
        relations=take.rig.relations if take.rig else (),
        warps=take.warps,
        notes=tuple(notes) if first else (),
    )


def _report_rows(
    report: Mapping[str, Any], path: Path, lanes: Sequence[Lane]
) -> list[dict[str, Any]]:
    rows = report_rows(report, path)
    lane = lane_of(report, path, lanes, _hashes(lanes))
    return [{**row, "source": path.name, "lane": lane.name} for row in rows]


def _hashes(lanes: Sequence[Lane]) -> list[str]:
    return [file_hash(lane.clip.origin.path or Path()) or "" for lane in lanes]


def _retimed(lanes: Sequence[Lane], warps: Mapping[str, Mapping[Side, Array]]) -> list[Lane]:
    """Lanes of the hand clips that were spliced play in the time of the body."""
    if not any(warps):
        return list(lanes)
    return [
        replace(lane, retime=warps.get(h, {}))
        for lane, h in zip(lanes, _hashes(lanes), strict=True)
    ]


def _warp_rows(lane: Lane) -> list[dict[str, Any]]:
    return [
        {**row, "source": "", "lane": lane.name} for row in warp_rows(lane.warps, lane.clip.fps)
    ]


def _few_shown(lanes: Sequence[Lane]) -> tuple[list[Lane], list[str]]:
    shown = [i for i, lane in enumerate(lanes) if lane.shown]
    if len(shown) <= MOST_SHOWN:
        return list(lanes), []
    first = shown[:MOST_SHOWN]
    word = f"the first {MOST_SHOWN} of {len(lanes)} lanes are shown; select others on the page"
    return [replace(lane, shown=i in first) for i, lane in enumerate(lanes)], [word]


def _title(names: Sequence[str]) -> str:
    return listed(names, MOST_SHOWN if len(names) <= MOST_SHOWN else 2)


def _names(sources: Sequence[Clip | Path]) -> dict[Clip | Path, str]:
    """Names of lanes: the files' own, with as many folders as tell them apart; those of clips."""
    files = [source for source in sources if isinstance(source, Path)]

    def name(file: Path) -> str:
        parts = file.absolute().with_suffix("").parts
        for count in range(1, len(parts)):
            own = parts[-count:]
            if sum(f.absolute().with_suffix("").parts[-count:] == own for f in files) == 1:
                return "/".join(own)
        return file.name

    names: dict[Clip | Path, str] = {file: name(file) for file in files}
    for clip in (source for source in sources if isinstance(source, Clip)):
        own, number = clip.name or "clip", 1
        while own in names.values():
            number += 1
            own = f"{clip.name or 'clip'} {number}"
        names[clip] = own
    return {source: names[source] for source in sources}


def run(request: PreviewRequest, journal: Journal) -> Outcome:
    """Make a page of files and write it."""
    paths, output = find_files(request.files), request.output
    inputs = [*paths, *request.reports, *request.figures]
    check_output(output, inputs, request.force, PAGE_SUFFIXES)
    previewed = preview_clips(
        paths,
        request.settings,
        skel=request.skel,
        reports=request.reports,
        figures=request.figures,
        title=request.title,
        conventions=conventions_of(request),
    )
    for note in previewed.notes:
        journal.warn("preview", note)
    write_preview(previewed, output, force=request.force, inputs=inputs)
    size = output.stat().st_size
    return Outcome(
        request,
        (*inputs, *rig_files(request)),
        lambda: preview_result(previewed.lanes, previewed.notes, size, output),
        summary,
        written=(output,),
    )
