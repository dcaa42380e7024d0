"""usdhand compare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from usdhand.cli.common import (
    check_report,
    json_option,
    map_option,
    quiet_option,
    report_option,
    say,
    skel_option,
    table,
    verbose_option,
    write_report,
)


@click.command("compare")
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option("--align", is_flag=True, help="Shift B by the lag that is found, then compare.")
@click.option(
    "--max-rms", type=float, metavar="DEG", help="Exit 5 if the RMS over channels is larger."
)
@skel_option
@click.option("--skel-b", metavar="PRIM", help="Skeleton of B, if it is another one.")
@map_option
@report_option
@click.option("--force", is_flag=True, help="Replace a report that exists.")
@json_option
@quiet_option
@verbose_option
def command(
    a: Path,
    b: Path,
    align: bool,
    max_rms: float | None,
    skel: str | None,
    skel_b: str | None,
    maps: tuple[Path, ...],
    report: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Compare motion B with motion A: degrees, fingertips, smoothness, lag.

    Characters may differ: hands are compared by anatomical channels, fingertips in the palm's
    axes. Both are taken from their first frame on, at A's frame rate.

    \b
    Example:
      usdhand compare talk_01_full.usdc talk_01_filled.usda
    """
    from usdhand import verbs as api
    from usdhand.errors import QualityError
    from usdhand.report.document import document, dumps
    from usdhand.report.results import compare_result

    check_report(report, force)
    conventions = api.conventions_from(maps)
    clips = [api.read_clip(a, skel), api.read_clip(b, skel_b or skel)]
    comparison = api.compare(*clips, align=align, conventions=conventions)
    settings = {"align": align, "skel": skel, "skel_b": skel_b, "max_rms": max_rms}
    result = compare_result(comparison)
    text = dumps(document("compare", [a, b, *maps], settings, result))
    write_report(report, text, force)
    if as_json:
        click.echo(text)
    else:
        _print(result, quiet, verbose)
    if max_rms is not None and not comparison.rms_deg <= max_rms:
        raise QualityError(
            f"{b} differs from {a} by {comparison.rms_deg:.3f} deg RMS, more than {max_rms:g}."
        )


def _print(result: dict[str, Any], quiet: bool, verbose: bool) -> None:
    lag = result["lag_s"]
    tips, jerk = result["fingertip_mm"], result["jerk_deg_s3"]
    say(
        f"{len(result['channels'])} hand channels over {result['frames']} frames: "
        f"RMS {result['rms_deg']:.3f} deg, max {result['max_deg']:.3f} deg\n"
        f"fingertips: mean {tips['mean']:.3f} mm, max {tips['max']:.3f} mm\n"
        f"jerk: A {jerk['a']:.3g}, B {jerk['b']:.3g} deg/s^3\n"
        f"lag of B: {'hands too still to tell' if lag is None else f'{lag:+.4f} s'}",
        quiet,
    )
    rows = sorted(result["channels"], key=lambda c: -c["rms_deg"])
    shown = rows if verbose else rows[:5]
    head = ["channel", "RMS deg", "max deg"]
    lines = [[c["name"], f"{c['rms_deg']:.3f}", f"{c['max_deg']:.3f}"] for c in shown]
    say("\n" + table([head, *lines], right=(1, 2)), quiet)
    if verbose and result["joints"]:
        lines = [
            [j["name"], f"{j['rms_deg']:.3f}", f"{j['max_deg']:.3f}"] for j in result["joints"]
        ]
        say("\n" + table([["joint", "RMS deg", "max deg"], *lines], right=(1, 2)), quiet)
