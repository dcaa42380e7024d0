"""usdhand evaluate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from usdhand.cli.common import (
    check_plots,
    check_report,
    find_files,
    force_option,
    json_option,
    map_option,
    plots_option,
    quiet_option,
    report_option,
    say,
    table,
    warn,
    with_progress,
    write_plots,
    write_report,
)

if TYPE_CHECKING:
    from usdhand.evaluate.reconstruction import HandError
    from usdhand.fill.library import Left
    from usdhand.motion import Clip


@click.command("evaluate")
@click.argument("library", type=click.Path(path_type=Path))
@click.option("--k", type=click.IntRange(1), default=5, show_default=True, help="Nearest segments.")
@click.option(
    "--takes",
    metavar="PATH",
    multiple=True,
    help="Fill these clips instead of the library's own, such as those of another rig.",
)
@click.option(
    "--preset",
    type=click.Choice(["default", "paper"]),
    default="default",
    show_default=True,
    help="Settings of fill, see `usdhand fill`.",
)
@click.option("--metric", help="Metric of fill instead of the preset's.")
@click.option("--labels-only", is_flag=True, help="Only the share of labels, no reconstruction.")
@map_option
@report_option
@plots_option
@force_option
@json_option
@quiet_option
def command(
    library: Path,
    k: int,
    takes: tuple[str, ...],
    preset: str,
    metric: str | None,
    labels_only: bool,
    maps: tuple[Path, ...],
    report: Path | None,
    plots: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Measure how well a library tells fingers from arms, leaving out one clip at a time.

    The share of same-label segments among the nearest, for single features and combinations, with
    the confusion matrix (Joerg, Hodgins and Safonova 2012, section 4); and how near filled fingers
    come to the true ones, beside the nearest segment, a random take, the mean pose, the rest pose
    and the best candidate in hindsight.

    \b
    Example:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand evaluate gestures.usdc
    """
    from dataclasses import asdict, replace

    from usdhand.errors import InputError
    from usdhand.evaluate.agreement import label_agreement
    from usdhand.fill.settings import PAPER, FillSettings
    from usdhand.report.document import document, dumps
    from usdhand.report.filling import evaluation_result
    from usdhand.report.plots import evaluating
    from usdhand.verbs import fill as filling

    settings = replace(PAPER if preset == "paper" else FillSettings(), k=k)
    if metric:
        settings = replace(settings, metric=metric)
    check_report(report, force)
    check_plots(plots, evaluating.NAMES, force)
    motions = filling.read_library(library)
    paths = find_files(takes) if takes else []
    agreements = []
    try:
        agreements = label_agreement(motions, k=k)
    except InputError as error:
        if labels_only:
            raise
        if not paths:  # else it is about the takes
            warn(str(error), quiet)
    errors: list[HandError] = []
    left_out: list[Left] = []
    for entry in motions.damaged:
        warn(f"{entry.path} of the library cannot be used: {entry.reason}", quiet)
    if not labels_only:
        given, unread = _read(paths) if paths else (None, [])
        errors, left = filling.measure_library(
            motions, library.absolute().parent, settings, takes=given, maps=maps
        )
        left_out = [*unread, *left]
        for take in left_out:
            warn(f"left out: {take.path}: {take.reason}", quiet)
        if not errors:
            raise InputError("No clip could be filled from the others.")
    result = evaluation_result(agreements, errors)
    result |= {"left_out": [{"path": take.path, "reason": take.reason} for take in left_out]}
    shown = {"k": k, "preset": preset, "metric": settings.metric, "maps": maps}
    shown |= {"labels_only": labels_only, "fill": asdict(settings)}
    text = dumps(document("evaluate", [library, *paths, *maps], shown, result))
    write_report(report, text, force)
    write_plots(plots, lambda: evaluating.figures(agreements, errors), force, quiet or as_json)
    if as_json:
        click.echo(text)
    else:
        say(_text(result), quiet)


def _read(paths: Sequence[Path]) -> tuple[list[Clip], list[Left]]:
    """Clips, and the files that are none."""
    from usdhand import verbs as api
    from usdhand.errors import UsdHandError
    from usdhand.fill.library import Left

    clips, left = [], []
    for path in with_progress(paths, "reading"):
        try:
            clips.append(api.read_clip(path))
        except UsdHandError as error:
            left.append(Left(str(path), str(error)))
    return clips, left


def _text(result: dict[str, Any]) -> str:
    parts = []
    if "label_agreement" in result:
        found = result["label_agreement"]
        rows = [[m["name"], f"{100 * m['share']:.1f} %"] for m in found["metrics"]]
        head = ["feature", "same label among the nearest"]
        parts.append(f"{found['segments']} labelled segments\n" + table([head, *rows], right=(1,)))
        labels = found["labels"]
        matrix = [
            [label, *(f"{100 * x:.0f}" for x in row)]
            for label, row in zip(labels, found["confusion"], strict=True)
        ]
        parts.append(
            f"confusion of {found['best']} (% of the nearest)\n"
            + table([["", *labels], *matrix], right=range(1, len(labels) + 1))
        )
    for side, methods in result.get("reconstruction", {}).items():
        rows = [
            [name, f"{e['degrees']:.2f}", f"{e['fingertip_mm']:.1f}", f"{e['jerk']:.3g}"]
            for name, e in methods.items()
        ]
        head = [f"{side} hand", "deg", "fingertips mm", "jerk deg/s^3"]
        parts.append(table([head, *rows], right=(1, 2, 3)))
    return "\n\n".join(parts)
