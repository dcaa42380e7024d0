"""usdhand preview."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from usdhand.cli.common import (
    files_argument,
    find_files,
    force_option,
    json_option,
    map_option,
    output_option,
    quiet_option,
    say,
    skel_option,
    warn,
)


@click.command("preview")
@files_argument()
@output_option("The page (.html).")
@click.option(
    "--with-report",
    "reports",
    metavar="FILE",
    multiple=True,
    type=click.Path(path_type=Path),
    help="JSON report of fill or splice of one of the files: its segments, phases and pins are on "
    "the timeline; repeatable.",
)
@click.option(
    "--figure",
    "figures",
    metavar="FILE",
    multiple=True,
    type=click.Path(path_type=Path),
    help="SVG or PNG to show below; repeatable.",
)
@click.option("--title", help="Heading of the page.  [default: names of the files]")
@click.option(
    "--max-frames",
    type=click.IntRange(2),
    default=10_800,
    show_default=True,
    help="Longer clips keep every second, third, ... frame.",
)
@click.option(
    "--max-points",
    type=click.IntRange(0),
    default=40_000,
    show_default=True,
    help="Characters with larger meshes are shown as bones; 0 for bones only.",
)
@skel_option
@map_option
@force_option
@json_option
@quiet_option
def command(
    files: tuple[str, ...],
    output: Path,
    reports: tuple[Path, ...],
    figures: tuple[Path, ...],
    title: str | None,
    max_frames: int,
    max_points: int,
    skel: str | None,
    maps: tuple[Path, ...],
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make a page to look at clips with: one HTML file that opens offline in any browser.

    Files play side by side or over each other, in sync from their first frames, with close-up
    cameras on the hands and curves of their channels. Alternatives that fill wrote into a file
    are lanes of their own.

    \b
    Example:
      usdhand preview samples/gestures/ok_01.usdc samples/gestures/ok_02.usdc -o ok.html
    """
    from usdhand import verbs as api
    from usdhand.formats.output import check_output
    from usdhand.report.document import document, dumps
    from usdhand.verbs.preview import (
        PAGE_SUFFIXES,
        PreviewSettings,
        preview_clips,
        write_preview,
    )

    paths = find_files(files)
    inputs = [*paths, *reports, *figures]
    check_output(output, inputs, force, PAGE_SUFFIXES)
    previewed = preview_clips(
        paths,
        PreviewSettings(max_frames, max_points),
        skel=skel,
        reports=reports,
        figures=figures,
        title=title,
        conventions=api.conventions_from(maps),
    )
    for note in previewed.notes:
        warn(note, quiet)
    write_preview(previewed, output, force=force, inputs=inputs)
    if as_json:
        settings = {"title": title, "max_frames": max_frames, "max_points": max_points}
        result = {
            "lanes": [_summary(lane) for lane in previewed.lanes],
            "notes": list(previewed.notes),
            "bytes": output.stat().st_size,
            "output": str(output),
        }
        click.echo(dumps(document("preview", [*inputs, *maps], settings | {"skel": skel}, result)))
        return
    say(f"{len(previewed.lanes)} lanes, {output.stat().st_size / 1e6:.1f} MB", quiet)
    say(f"written to {output}", quiet)


def _summary(lane: dict[str, Any]) -> dict[str, Any]:
    keys = ("name", "alternative", "frames", "file_fps", "fps", "duration")
    return {key: lane[key] for key in keys} | {
        "hands": list(lane["hands"]),
        "meshes": len(lane["meshes"]),
    }
