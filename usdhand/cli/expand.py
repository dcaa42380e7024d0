"""usdhand expand."""

from __future__ import annotations

from pathlib import Path

import click

from usdhand.cli.common import (
    check_report,
    dry_run_option,
    flatten_option,
    force_option,
    json_option,
    map_option,
    output_option,
    quiet_option,
    report_option,
    say,
    skel_option,
    warn_lost,
    warn_of,
    write_report,
)


@click.command("expand")
@click.argument("rig", type=click.Path(path_type=Path))
@output_option("The motion (.usda, .usdc, .usd, .usdz).")
@click.option(
    "--onto",
    metavar="CHARACTER",
    type=click.Path(path_type=Path),
    help="Put the hands on this character, whatever its rig.",
)
@skel_option
@flatten_option
@map_option
@report_option
@dry_run_option
@force_option
@json_option
@quiet_option
def command(
    rig: Path,
    output: Path,
    onto: Path | None,
    skel: str | None,
    flatten: bool,
    maps: tuple[Path, ...],
    report: Path | None,
    dry_run: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Turn a reduced rig back into motion, on its own or another character.

    Dependent channels are computed from the free ones (also after someone edited those) and
    baked, with the body, into a SkelAnimation.

    \b
    Examples:
      usdhand expand ok_rig.usda -o ok.usda
      usdhand expand ok_rig.usda --onto samples/characters/ben.usdc -o ben_ok.usda
    """
    from usdhand import verbs as api
    from usdhand.formats.output import check_output
    from usdhand.formats.suffixes import USD_SUFFIXES
    from usdhand.report.document import document, dumps
    from usdhand.report.results import problems_data

    conventions = api.conventions_from(maps)
    inputs = [rig] if onto is None else [rig, onto]
    check_output(output, inputs, force, USD_SUFFIXES)
    check_report(report, force)
    if onto is None:
        motion = api.expand(rig, conventions, skel)
    else:
        motion = api.expand_onto(rig, onto, skel, conventions)
    warn_of(motion, quiet)
    if not dry_run:
        lost = api.write_clip(
            motion, output, flatten=flatten, force=force, conventions=conventions, inputs=inputs
        )
        warn_lost(output, lost, quiet or as_json)
    result = {
        "output": None if dry_run else str(output),
        "frames": len(motion),
        "fps": motion.fps,
        "free_channels": len(api.read_rig(rig, None if onto else skel).free),
        "problems": problems_data(motion.problems),
    }
    settings = {"onto": onto, "skel": skel, "flatten": flatten}
    text = dumps(document("expand", [*inputs, *maps], settings, result))
    write_report(report, text, force)
    if as_json:
        click.echo(text)
        return
    say(
        f"{result['frames']} frames at {motion.fps:g} fps from {result['free_channels']} free "
        f"channels; {'nothing written (dry run)' if dry_run else f'written to {output}'}",
        quiet,
    )
