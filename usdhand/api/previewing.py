"""Clips and reports gathered into a page to look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from usdhand.anatomy import Conventions
from usdhand.api.clips import find_hands
from usdhand.errors import HandNotFoundError, UsageError
from usdhand.formats.files import is_usd, read_any
from usdhand.formats.hashing import file_hash
from usdhand.formats.output import check_output, written_beside
from usdhand.formats.usd.takes import Take, read_takes
from usdhand.motion import Clip
from usdhand.report.preview.events import read_report, report_rows, report_verb, retiming, warp_rows
from usdhand.report.preview.lanes import Lane, lane_data, unshown
from usdhand.report.preview.pack import Pack
from usdhand.report.preview.page import figure, page

__all__ = ["PreviewSettings", "Previewed", "preview_clips", "write_preview"]

PAGE_SUFFIXES = (".html", ".htm")


@dataclass(frozen=True)
class PreviewSettings:
    """What goes into a page.

    Attributes
    ----------
    max_frames : longer clips keep every second, third, ... frame, so that they have no more
    max_points : characters with larger meshes are shown as bones; 0 for no meshes at all
    """

    max_frames: int = 10_800
    max_points: int = 40_000

    def __post_init__(self) -> None:
        if self.max_frames < 2:
            raise UsageError(f"A page of {self.max_frames} frames shows no motion: give 2 or more.")


@dataclass(frozen=True, eq=False)
class Previewed:
    """A page, the clips it was made of, and what a person should know about it."""

    html: str
    clips: tuple[Clip, ...]
    lanes: tuple[dict[str, Any], ...]
    notes: tuple[str, ...]


def preview_clips(
    files: Sequence[str | Path],
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
    reports : JSON reports of `fill` or `splice`, for the timeline; with that of a splice, its hand
        clip plays in the time of the body
    figures : SVG or PNG files to show below

    Raises
    ------
    InputError
        if a file cannot be used.
    """
    if not files:
        raise UsageError("There is nothing to show: give a file.")
    settings = settings or PreviewSettings()
    read = [(Path(path), read_report(Path(path))) for path in reports]
    pictures = [figure(Path(path)) for path in figures]
    names = _names([Path(f) for f in files])
    lanes = [
        lane
        for path, name in names.items()
        for lane in _lanes(path, name, skel, settings, conventions)
    ]
    warps = dict(retiming(report) for _, report in read)
    hashes = {path: file_hash(path) for path in names} if any(warps) else {}
    lanes = [_retimed(lane, warps.get(hashes.get(_source(lane)) or "", {})) for lane in lanes]
    rows = [
        {**row, "source": str(path)} for path, report in read for row in report_rows(report, path)
    ]
    if not any(report_verb(report) == "splice" for _, report in read):
        warped = [lane for lane in lanes if lane.warps and lane.shown]
        rows += [
            {**row, "source": lane.name}
            for lane in warped
            for row in warp_rows(lane.warps, lane.clip.fps)
        ]
    pack = Pack()
    made = [lane_data(lane, pack, settings.max_frames) for lane in lanes]
    words = tuple(word for _, word in made if word)
    notes = tuple(f"{lane.name}: {note}" for lane in lanes for note in lane.notes) + words
    data = {"lanes": [d for d, _ in made], "rows": rows, "notes": [], **pack.document()}
    text = page(title or ", ".join(names.values()), data, pictures)
    return Previewed(text, tuple(lane.clip for lane in lanes), tuple(d for d, _ in made), notes)


def write_preview(
    previewed: Previewed, output: str | Path, *, force: bool = False, inputs: Sequence[Path] = ()
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
        temporary.write_text(previewed.html, encoding="utf-8")


def _lanes(
    path: Path,
    name: str,
    skel: str | None,
    settings: PreviewSettings,
    conventions: Conventions | None,
) -> list[Lane]:
    if is_usd(path):
        takes = read_takes(path, skel, skins=settings.max_points > 0)
    else:
        takes = [Take(read_any(path, skel)[0])]
    return [_lane(take, name, i == 0, settings, conventions) for i, take in enumerate(takes)]


def _lane(
    take: Take, name: str, first: bool, settings: PreviewSettings, conventions: Conventions | None
) -> Lane:
    notes = [*take.notes, *(str(p) for p in take.clip.problems if p.severity == "warning")]
    try:
        hands = find_hands(take.clip, conventions)
        notes += hands.notes
    except HandNotFoundError as error:
        hands = None
        notes.append(f"no close-ups and curves: {error}")
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


def _retimed(lane: Lane, warps: Any) -> Lane:
    return replace(lane, retime=warps) if warps else lane


def _source(lane: Lane) -> Path:
    return lane.clip.origin.path or Path()


def _names(files: Sequence[Path]) -> dict[Path, str]:
    """Names of lanes: the files' own, with their folders where they are the same."""
    stems = [f.stem for f in files]
    return {f: f.stem if stems.count(f.stem) == 1 else str(f.with_suffix("")) for f in files}
