"""usdhand reduce."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from usdhand.cli.common import (
    check_plots,
    check_report,
    dry_run_option,
    files_argument,
    find_files,
    flatten_option,
    force_option,
    json_option,
    map_option,
    output_option,
    plots_option,
    quiet_option,
    report_option,
    say,
    side_option,
    sides,
    skel_option,
    table,
    verbose_option,
    warn,
    warn_lost,
    warn_of,
    with_progress,
    write_plots,
    write_report,
)

if TYPE_CHECKING:
    from usdhand.reduce.method import Reduction


@click.command("reduce")
@files_argument("clips")
@output_option("The rig file (.usda, .usdc, .usd, .usdz); for several clips a folder.")
@click.option(
    "--preset",
    type=click.IntRange(1, 4),
    help="The paper's steps: 1 range<1; 2 and rmsd<0.3; 3 range<5; 4 and rmsd<0.5. [default: 4]",
)
@click.option("--range", "range_deg", type=float, metavar="DEG", help="Constant below this range.")
@click.option("--rmsd", type=float, metavar="X", help="Linear below this RMS deviation (0 to 2).")
@click.option("--target-dofs", type=int, metavar="N", help="Leave N channels free.")
@click.option(
    "--max-error", type=float, metavar="DEG", help="Largest RMS error of any channel allowed."
)
@click.option(
    "--fit",
    type=click.Choice(["paper", "least-squares"]),
    default="paper",
    show_default=True,
    help="Slopes that keep standard deviations, or with the least error.",
)
@click.option(
    "--controllers",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="How many channels one may follow (needs --fit least-squares).",
)
@click.option(
    "--rig",
    "rig_file",
    metavar="RIG",
    type=click.Path(path_type=Path),
    help="Apply the relations of this rig instead of fitting.",
)
@side_option
@flatten_option
@skel_option
@map_option
@report_option
@plots_option
@dry_run_option
@force_option
@json_option
@quiet_option
@verbose_option
def command(
    clips: tuple[str, ...],
    output: Path,
    preset: int | None,
    range_deg: float | None,
    rmsd: float | None,
    target_dofs: int | None,
    max_error: float | None,
    fit: Literal["paper", "least-squares"],
    controllers: int,
    rig_file: Path | None,
    side: str,
    flatten: bool,
    skel: str | None,
    maps: tuple[Path, ...],
    report: Path | None,
    plots: Path | None,
    dry_run: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Reduce hands to a rig of a few free channels.

    Finds which finger rotations barely move and which follow others linearly (Joerg & O'Sullivan
    2009), over all clips together, and writes the rig as custom attributes over each clip, with
    the reduced motion baked beside it.

    \b
    Examples:
      usdhand reduce samples/gestures/ok_01.usdc -o ok_rig.usda
      usdhand reduce takes/*.usdc -o rigs/ --target-dofs 20 --fit least-squares
      usdhand reduce new_take.usdc --rig rigs/take_01.rig.usdc -o new_rig.usdc
    """
    from usdhand import verbs as api
    from usdhand.errors import UsageError
    from usdhand.formats.output import make_folder
    from usdhand.report.document import document, dumps
    from usdhand.report.plots import reducing
    from usdhand.report.results import reduce_result

    paths = find_files(clips)
    outputs = _outputs(paths, output)
    settings: dict[str, Any] = {
        "preset": preset,
        "range": range_deg,
        "rmsd": rmsd,
        "target_dofs": target_dofs,
        "max_error": max_error,
        "fit": fit,
        "controllers": controllers,
        "rig": rig_file,
        "side": side,
        "skel": skel,
        "flatten": flatten,
    }
    asked = [
        k
        for k in ("preset", "range", "rmsd", "target_dofs", "max_error")
        if settings[k] is not None
    ]
    if rig_file is not None and asked:
        raise UsageError(f"--rig applies a rig as it is; --{asked[0].replace('_', '-')} fits one.")
    if rig_file is not None and (fit != "paper" or controllers > 1):
        raise UsageError("--rig applies a rig as it is; --fit and --controllers are for fitting.")
    api.reduction_target(preset, range_deg, rmsd, target_dofs, max_error)
    inputs = [*paths, *([rig_file] if rig_file else []), *maps]
    _check_outputs(outputs, inputs, force)
    check_report(report, force)
    check_plots(plots, reducing.NAMES, force)

    conventions = api.conventions_from(maps)
    rig = api.read_rig(rig_file) if rig_file else None
    read = [api.read_clip(path, skel) for path in with_progress(paths, "reading")]
    for clip in read:
        warn_of(clip, quiet)
    reductions = api.reduce_hands(
        read,
        preset=preset,
        range_deg=range_deg,
        rmsd=rmsd,
        free_channels=target_dofs,
        max_error=max_error,
        fit=fit,
        most_controllers=controllers,
        rig=rig,
        conventions=conventions,
        sides=sides(side),
    )
    results = [
        reduce_result(r) | {"output": None if dry_run else str(o)}
        for r, o in zip(reductions, outputs, strict=True)
    ]
    inputs = [*paths, *([rig_file] if rig_file else []), *maps]
    for reduction in reductions:
        for note in reduction.hands.notes:
            warn(f"{reduction.clip.origin.path}: {note}", quiet)
    whole = results[0] if len(results) == 1 else {"clips": results}
    text = dumps(document("reduce", inputs, settings, whole))
    if not dry_run:
        make_folder(outputs[0].parent)
        for reduction, target in with_progress(
            list(zip(reductions, outputs, strict=True)), "writing"
        ):
            lost = api.write_rig(reduction, target, flatten=flatten, force=force)
            warn_lost(target, lost, quiet or as_json)
    write_report(report, text, force)
    write_plots(plots, lambda: reducing.figures(reductions), force, quiet or as_json)
    if as_json:
        click.echo(text)
        return
    say(_rig_text(reductions[0], results[0], verbose), quiet)
    for result in results:
        say(_error_text(result), quiet)
        where = "nothing written (dry run)" if dry_run else f"written to {result['output']}"
        say(f"  {where}", quiet)


def _outputs(paths: list[Path], output: Path) -> list[Path]:
    """One output a clip: the file given, or files in the folder given."""
    if len(paths) == 1 and not output.is_dir():
        return [output]
    return [output / f"{path.stem}.rig.usdc" for path in paths]


def _check_outputs(outputs: list[Path], inputs: list[Path], force: bool) -> None:
    from usdhand.errors import OutputError
    from usdhand.formats.output import check_folder, check_output
    from usdhand.formats.suffixes import USD_SUFFIXES

    if len(set(outputs)) < len(outputs):
        raise OutputError("Two clips have the same name, so their rigs would replace each other.")
    folder = outputs[0].parent
    if len(outputs) > 1 and not folder.exists():  # made once there is something to put in
        check_folder(folder)
        return
    for path in outputs:
        check_output(path, inputs, force, USD_SUFFIXES)


def _rig_text(reduction: Reduction, result: dict[str, Any], verbose: bool) -> str:
    rig = reduction.rig
    kinds = [r.kind for r in rig.relations]
    thresholds = result["thresholds"]
    lines = [
        f"{len(rig.free)} of {len(rig.names)} channels stay free "
        f"({kinds.count('constant')} constant, {kinds.count('linear')} follow; range < "
        f"{thresholds['range_deg']:g} deg, rmsd < {thresholds['rmsd']:g}, {rig.fit} fit)",
        "free: " + (" ".join(rig.free) or "none"),
    ]
    if over := result["followed_to_root_over_threshold"]:
        lines.append(f"{len(over)} follow a root beyond the threshold: {' '.join(over)}")
    if verbose:
        head = ["channel", "kind", "follows", "slope", "rmsd", "RMS deg", "max deg"]
        rows = [
            [
                c["name"],
                c["kind"],
                " ".join(c["controllers"]),
                " ".join(f"{s:.3f}" for s in c["slopes"]),
                "" if c["rmsd"] is None else f"{c['rmsd']:.2f}",
                f"{c['rms_error_deg']:.3f}",
                f"{c['max_error_deg']:.3f}",
            ]
            for c in result["channels"]
        ]
        lines += ["", table([head, *rows], right=(3, 4, 5, 6)), ""]
    return "\n".join(lines)


def _error_text(result: dict[str, Any]) -> str:
    tips, total = result["fingertip_error_mm"], result["total_error"]["fingertip_error_mm"]
    rms, largest = result["rms_error_deg"], result["max_error_deg"]
    return (
        f"{result['clip']}\n"
        f"  reduction: RMS {rms:.2f} deg, max {largest:.1f} deg; "
        f"fingertips mean {tips['mean']:.1f} mm, max {tips['max']:.1f} mm "
        f"(PCA of the same size: RMS {result['pca_rms_error_deg']:.2f} deg)\n"
        f"  with the {len(result['held_channels'])} angles outside the model held: fingertips mean "
        f"{total['mean']:.1f} mm, max {total['max']:.1f} mm"
    )
