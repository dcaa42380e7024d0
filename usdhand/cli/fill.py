"""usdhand fill."""

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
    verbose_option,
    warn,
    warn_lost,
    warn_of,
    write_plots,
    write_report,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from usdhand.fill.library import MotionLibrary
    from usdhand.fill.results import Filled


@click.command("fill")
@click.argument("body", type=click.Path(path_type=Path))
@click.option(
    "--library",
    required=True,
    metavar="LIB",
    type=click.Path(path_type=Path),
    help="Library that the fingers are taken from, see `usdhand library build`.",
)
@output_option("The body with fingers (.usda, .usdc, .usd, .usdz).")
@click.option(
    "--preset",
    type=click.Choice(["default", "paper"]),
    default="default",
    show_default=True,
    help="All settings together: the measured best, or the paper's.",
)
@click.option("--metric", help="How arm motions are compared: arm, chordal or euler (the paper's).")
@click.option("--k", type=click.IntRange(1), help="Candidates a segment.  [default: 5]")
@click.option(
    "--alternatives",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Distinct results, as variants of the animation.",
)
@click.option("--couple", is_flag=True, help="Take both hands from the same clip.")
@click.option(
    "--replace", "replace_motion", is_flag=True, help="Replace fingers that already move."
)
@click.option(
    "--add-fingers",
    is_flag=True,
    help="Give a body without finger joints those of the library's character, scaled to it.",
)
@click.option(
    "--fingers-from",
    metavar="CHARACTER",
    type=click.Path(path_type=Path),
    help="Add the finger joints of this character instead of the library's.",
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
    body: Path,
    library: Path,
    output: Path,
    preset: str,
    metric: str | None,
    k: int | None,
    alternatives: int,
    couple: bool,
    replace_motion: bool,
    add_fingers: bool,
    fingers_from: Path | None,
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
    """Give a body clip the fingers of similar motions from a library.

    Cuts the body's arm motion into segments, finds the most similar segments of the library,
    chooses the smoothest path through them and joins the pieces (Joerg, Hodgins and Safonova
    2012). The body stays as it is; the library's clip of the very same motion is left out.

    \b
    Example:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand fill samples/conversations/talk_01_body.usdc --library gestures.usdc -o talk.usda
    """
    from dataclasses import asdict, replace

    from usdhand import verbs as api
    from usdhand.errors import UsageError
    from usdhand.fill.settings import PAPER, FillSettings
    from usdhand.formats.output import check_output
    from usdhand.formats.suffixes import USD_SUFFIXES
    from usdhand.report.document import document, dumps
    from usdhand.report.filling import counted, fill_result, listed
    from usdhand.report.plots import filling as plotting
    from usdhand.verbs import fill as filling
    from usdhand.verbs.finger_joints import (
        fingers_from_library,
        fingers_like,
        lacks_fingers,
        thumb_stubs,
    )

    given: dict[str, Any] = {"metric": metric, "k": k}
    settings = replace(
        PAPER if preset == "paper" else FillSettings(),
        alternatives=alternatives,
        couple=couple,
        **{name: value for name, value in given.items() if value is not None},
    )
    given_files = [body, library, *([fingers_from] if fingers_from else [])]
    check_output(output, given_files, force, USD_SUFFIXES)
    check_report(report, force)
    check_plots(plots, plotting.NAMES, force)
    conventions = api.conventions_from(maps)
    motions = filling.read_library(library)
    for entry in motions.damaged:
        warn(f"{entry.path} of the library cannot be used: {entry.reason}", quiet)
    if body.suffix.lower() in USD_SUFFIXES and filling.is_library(body):
        raise UsageError(f"{body} is a motion library; give the clip to be filled, then --library.")
    clip = api.read_clip(body, skel)
    warn_of(clip, quiet)
    bare = lacks_fingers(clip, conventions, sides(side))
    added = None
    if add_fingers or fingers_from:
        if not bare:
            warn(f"{body} has finger joints, so none are added", quiet)
        elif fingers_from:
            added = fingers_like(clip, fingers_from, conventions, bare)
        else:
            folder = library.absolute().parent
            added = fingers_from_library(clip, motions, folder, conventions, bare)
    elif bare and len(bare) < len(sides(side)):
        warn(f"{body}: the {bare[0]} hand has no finger joints; --add-fingers adds some", quiet)
    if added:
        for hand, stubs in thumb_stubs(clip, conventions, bare).items():
            warn(f"{hand} hand: {listed(stubs)} stays as it is beside the added thumb", quiet)
        clip = added.grafted.clip
    filled = filling.fill_fingers(
        clip,
        motions,
        settings,
        sides=sides(side),
        replace_motion=replace_motion,
        conventions=conventions,
    )
    if filled.kept:
        warn(f"{body}: the {' and '.join(filled.kept)} fingers move already and are kept", quiet)
    for hand in filled.without:
        warn(f"the library has no motion of a {hand} hand like this; it stays as it is", quiet)
    for hand in filled.still:
        warn(f"{body}: the {hand} arm does not move, so its fingers hold one pose", quiet)
    for note in _joint_notes(filled, motions):
        warn(note, quiet)
    for part in filled.parts:
        if part.usable < settings.k:
            hands = " and ".join(part.part)
            warn(
                f"the library has only {counted(part.usable, 'segment')} for the {hands} hand, "
                f"fewer than the {settings.k} candidates a segment that were asked for",
                quiet,
            )
    if len(filled.clips) < alternatives:
        ways = "is only 1 way" if len(filled.clips) == 1 else f"are only {len(filled.clips)} ways"
        warn(f"there {ways} that really differ", quiet)
    if filled.left_out:
        warn(f"not used, since it is the same clip: {', '.join(filled.left_out)}", quiet)
    if not dry_run:
        lost = filling.write_filled(
            filled, output, flatten=flatten, force=force, inputs=given_files[1:]
        )
        warn_lost(output, lost, quiet or as_json)
    result = fill_result(filled, motions, clip) | {"output": None if dry_run else str(output)}
    if added:
        joints = {hand: list(paths) for hand, paths in added.grafted.added.items()}
        result |= {"added_joints": joints, "fingers_from": added.source}
    for hand, found in result["hands"].items():
        odd = [s["stretched"] for s in found["segments"] if s["stretched"] != 1.0]
        if odd:
            warn(
                f"{hand} hand: the library has no segment of like length for {len(odd)} of "
                f"{len(found['segments'])} segments; their fingers move up to "
                f"{max(max(x, 1 / x) for x in odd):.1f} times faster or slower",
                quiet,
            )
    cutting = settings.segmentation or motions.segmentation
    shown = asdict(settings) | {"segmentation": asdict(cutting), "preset": preset, "side": side}
    shown |= {"replace": replace_motion, "add_fingers": bool(added), "fingers_from": fingers_from}
    shown |= {"skel": skel, "maps": maps, "flatten": flatten}
    # Of a long body it takes a second: only where it is asked for.
    wanted = as_json or report is not None
    text = dumps(document("fill", [*given_files, *maps], shown, result)) if wanted else ""
    write_report(report, text, force)

    def draw() -> dict[str, Figure]:
        return plotting.figures(
            filled, clip, api.find_hands(clip, conventions, sides(side)), motions
        )

    write_plots(plots, draw, force, quiet or as_json)
    if as_json:
        click.echo(text)
        return
    say(_text(result, verbose), quiet)
    say("nothing written (dry run)" if dry_run else f"written to {output}", quiet)


def _joint_notes(filled: Filled, library: MotionLibrary) -> list[str]:
    """Which joints were not filled, and which clips were not used for the sake of others."""
    from usdhand.report.filling import counted, listed

    notes = []
    for hand, names in filled.missing.items():
        some = [
            clip.name
            for clip in library.clips
            if clip.name not in filled.left_out
            and hand in clip.hands
            and {*names} & {*clip.hands[hand].joints}
        ]
        which = (
            f"only {counted(len(some), 'clip')} of the library ({listed(some)})"
            if some
            else "no clip of the library"
        )
        verb = "has" if len(some) < 2 else "have"
        notes.append(f"{which} {verb} {', '.join(names)} of the {hand} hand: kept as in the body")
    for hand, names in filled.set_aside.items():
        notes.append(
            f"{hand} hand: {counted(len(names), 'clip')} of the library set aside for lack of "
            f"joints that the others have ({listed(names)})"
        )
    return notes


def _text(result: dict[str, Any], verbose: bool) -> str:
    from usdhand.report.filling import counted

    lines = []
    for side, paths in result.get("added_joints", {}).items():
        lines.append(f"{side} hand: {len(paths)} joints added, as of {result['fingers_from']}")
    for side, hand in result["hands"].items():
        clips = {s["clip"] for s in hand["segments"]}
        seams = hand["seams"]
        lines.append(
            f"{side} hand: {counted(len(hand['segments']), 'segment')} from "
            f"{counted(len(clips), 'clip')}; largest "
            f"angular acceleration {seams['max_acceleration_deg_s2']:.0f} deg/s^2 at the seams, "
            f"{seams['max_acceleration_elsewhere_deg_s2']:.0f} elsewhere, "
            f"{seams['max_acceleration_captured_deg_s2']:.0f} in the library"
        )
        for s in hand["segments"] if verbose else ():
            lines.append(
                f"  {s['start']:7.2f} to {s['end']:7.2f} s: {s['clip']} "
                f"{s['clip_start']:.2f} to {s['clip_end']:.2f} s, cost {s['cost']:.1f}"
            )
    if len(result["alternatives"]) > 1:
        costs = ", ".join(f"{a['cost']:.3f}" for a in result["alternatives"])
        lines.append(f"{len(result['alternatives'])} alternatives, costs {costs}")
    return "\n".join(lines)
