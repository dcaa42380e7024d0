"""usdhand splice."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from usdhand.cli.common import (
    check_plots,
    check_report,
    dry_run_option,
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
    warn,
    warn_lost,
    warn_of,
    write_plots,
    write_report,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@click.command("splice")
@click.argument("body", type=click.Path(path_type=Path))
@click.argument("hands", type=click.Path(path_type=Path))
@output_option("The body with the hand clip's fingers (.usda, .usdc, .usd, .usdz).")
@click.option(
    "--pin",
    "pins",
    metavar="BODY:HAND[:TOL]",
    multiple=True,
    help="Time codes of both clips that belong together, exactly or within a tolerance in time "
    "codes of the hand clip; for one hand with left: or right: before it; repeatable.",
)
@click.option(
    "--band",
    metavar="FIRST,SECOND",
    default="0.3,0.1",
    show_default=True,
    help="How far the clips' timing may differ in both passes, as shares of the body's length.",
)
@click.option(
    "--align",
    type=click.Choice(["local", "trunk"]),
    default="local",
    show_default=True,
    help="How the clips are turned to each other: by the motion around every frame, or by the "
    "trunks.",
)
@click.option(
    "--wrist",
    type=click.Choice(["body", "hands"]),
    default="body",
    show_default=True,
    help="Which clip the wrists' rotation comes from.",
)
@side_option
@flatten_option
@skel_option
@click.option("--hands-skel", metavar="PRIM", help="The same for the hand clip.")
@map_option
@report_option
@plots_option
@dry_run_option
@force_option
@json_option
@quiet_option
@click.option("-v", "--verbose", is_flag=True, help="Print every phase.")
def command(
    body: Path,
    hands: Path,
    output: Path,
    pins: tuple[str, ...],
    band: str,
    align: str,
    wrist: str,
    side: str,
    flatten: bool,
    skel: str | None,
    hands_skel: str | None,
    maps: tuple[Path, ...],
    report: Path | None,
    plots: Path | None,
    dry_run: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Put the fingers of a hand clip on a body clip, both of the same performance.

    Finds out which moments belong together from how both arms move, whatever their size, timing
    and direction in the room, retimes the hand clip and puts its fingers on the body (Majkowska,
    Zordan and Faloutsos 2006). The body's own motion and timing stay as they are.

    \b
    Example:
      usdhand splice samples/conversations/talk_01_body.usdc samples/hands/talk_01_hands_a.usdc \\
        --pin 1:1 --pin 181:403 -o talk.usda --report talk.json

    The hand clip of the example shows the first six seconds of the body: pins say where it begins
    and ends. Of clips that begin and end together, no pin is needed.
    """
    from usdhand import verbs as api
    from usdhand.errors import UsdHandError
    from usdhand.formats.output import check_output
    from usdhand.formats.suffixes import USD_SUFFIXES
    from usdhand.report.document import document, dumps
    from usdhand.report.plots import splicing as plotting
    from usdhand.report.splicing import splice_result
    from usdhand.splice.settings import SpliceSettings
    from usdhand.verbs import splice as splicing

    settings = SpliceSettings(band=_widths(band), align=align, wrist=wrist)  # type: ignore[arg-type]
    check_output(output, [body, hands], force, USD_SUFFIXES)
    check_report(report, force)
    check_plots(plots, plotting.NAMES, force)
    conventions = api.conventions_from(maps)
    clip = api.read_clip(body, skel)
    try:
        hand_clip = api.read_clip(hands, hands_skel)
    except UsdHandError as error:
        raise type(error)(str(error).replace("--skel", "--hands-skel")) from error
    if body.resolve() == hands.resolve() and skel == hands_skel:
        warn(f"{body}: body and hand clip are the same", quiet)
    warn_of(clip, quiet)
    warn_of(hand_clip, quiet)
    spliced = splicing.splice_hands(
        clip, hand_clip, settings, pins=pins, sides=sides(side), conventions=conventions
    )
    for note in spliced.notes:
        warn(f"{body} with {hands}: {note}", quiet)
    if not dry_run:
        lost = splicing.write_spliced(
            spliced,
            output,
            flatten=flatten,
            force=force,
            wrist=wrist == "hands",
            conventions=conventions,
            inputs=[hands],
        )
        warn_lost(output, lost, quiet or as_json)
    result = splice_result(spliced) | {"output": None if dry_run else str(output)}
    shown = {"pins": list(pins), "band": list(settings.band), "align": align, "wrist": wrist}
    more = {"side": side, "skel": skel, "hands_skel": hands_skel}
    text = dumps(document("splice", [body, hands, *maps], shown | more, result))
    write_report(report, text, force)

    def draw() -> dict[str, Figure]:
        ours, theirs = (api.find_hands(c, conventions, sides(side)) for c in (clip, hand_clip))
        return plotting.figures(spliced, clip, hand_clip, ours, theirs, settings)

    write_plots(plots, draw, force, quiet or as_json)
    if as_json:
        click.echo(text)
        return
    say(_text(result, verbose), quiet)
    say("nothing written (dry run)" if dry_run else f"written to {output}", quiet)


def _widths(text: str) -> tuple[float, float]:
    from usdhand.errors import UsageError

    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError as error:
        raise UsageError(f"--band {text}: give two numbers, such as 0.3,0.1.") from error
    return first, second


def _text(result: dict[str, Any], verbose: bool) -> str:
    lines = []
    for side, hand in result["hands"].items():
        measured = hand["measured_from"]
        follows = f", follows the {hand['taken_from']} one" if hand["taken_from"] else ""
        lines.append(
            f"{side} hand: {len(hand['channels'])} channels, {len(hand['phases'])} phases, the "
            f"second pass moved them by {1000 * hand['pass_lag']:.0f} ms; measured from "
            f"{measured['body']} and {measured['hands']}{follows}"
        )
        if hand["look_at"]:
            frames = ", ".join(f"{frame:g}" for frame in hand["look_at"])
            lines.append(f"  low agreement, consider a --pin, near time codes {frames}")
        for p in hand["phases"] if verbose else ():
            quality = "holds" if p["quality"] is None else f"agreement {p['quality']:.2f}"
            lines.append(f"  {p['start']:7.2f} to {p['end']:7.2f} s: {quality}")
    return "\n".join(lines)
