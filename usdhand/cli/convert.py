"""usdhand convert."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from usdhand.cli.common import (
    check_report,
    dry_run_option,
    fail,
    files_argument,
    find_files,
    force_option,
    json_option,
    map_option,
    quiet_option,
    report_option,
    say,
    skel_option,
    warn,
    with_progress,
    write_report,
)
from usdhand.errors import UsageError, UsdHandError

if TYPE_CHECKING:
    from usdhand.verbs.convert import Converted, Edits, Reading

UNITS = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}
Span = tuple[float | None, float | None]
FORMATS = ("usdc", "usda", "usd", "usdz", "bvh", "glb", "gltf")


def _units(_: click.Context, __: click.Parameter, value: str | None) -> float | None:
    """Centimetres of a unit's name, or of a number."""
    if value is None or value in UNITS:
        return None if value is None else UNITS[value]
    try:
        number = float(value)
    except ValueError:
        number = 0.0
    if not 0.0 < number < float("inf"):
        raise click.BadParameter(f"'{value}' is none of {', '.join(UNITS)}, nor a number of cm.")
    return number


def _span(_: click.Context, __: click.Parameter, value: str | None) -> Span:
    """Two time codes with a colon between; either may be missing."""
    if value is None:
        return None, None
    try:
        first, last = (float(part) if part.strip() else None for part in value.split(":"))
    except ValueError as error:
        raise click.BadParameter(f"'{value}' is no FIRST:LAST in time codes.") from error
    return first, last


@click.command("convert")
@files_argument()
@click.option(
    "-o",
    "--output",
    metavar="OUTPUT",
    type=click.Path(path_type=Path),
    help="The file to write; its suffix tells the format.",
)
@click.option(
    "--out-dir",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for the results of several inputs, or of all animations of one.",
)
@click.option(
    "--to",
    "suffix",
    type=click.Choice(FORMATS),
    help="Format of the files in --out-dir.  [default: usdc]",
)
@click.option(
    "--onto",
    metavar="CHARACTER",
    type=click.Path(path_type=Path),
    help="Put the fingers of the inputs on this character, and write it instead.",
)
@click.option("--fps", type=float, metavar="RATE", help="Resample to this frame rate.")
@click.option("--start", type=float, metavar="TIME", help="Time code of the first frame.")
@click.option(
    "--trim", callback=_span, metavar="FIRST:LAST", help="Keep these time codes of the input."
)
@click.option(
    "--scale", type=float, default=1.0, show_default=True, help="Factor on the character's size."
)
@click.option(
    "--up", type=click.Choice(["Y", "Z"]), help="Up axis of the output (USD and BVH). [default: Y]"
)
@click.option(
    "--root-motion",
    type=click.Choice(["keep", "drop"]),
    default="keep",
    show_default=True,
    help="Whether the character travels, or stays over the spot where it starts.",
)
@click.option(
    "--units",
    callback=_units,
    metavar="UNIT",
    help="Unit of an input that is not USD: mm, cm, m, in, ft or a number of cm.",
)
@click.option("--input-up", type=click.Choice(["Y", "Z"]), help="Its up axis, if it is not USD.")
@click.option("--animation", metavar="NAME", help="Animation where a file has several.")
@skel_option
@click.option("--onto-skel", metavar="PRIM", help="Skeleton of the character to put fingers on.")
@map_option
@report_option
@dry_run_option
@force_option
@json_option
@quiet_option
def command(
    files: tuple[str, ...],
    output: Path | None,
    out_dir: Path | None,
    suffix: str | None,
    onto: Path | None,
    fps: float | None,
    start: float | None,
    trim: Span,
    scale: float,
    up: str | None,
    root_motion: Literal["keep", "drop"],
    units: float | None,
    input_up: str | None,
    animation: str | None,
    skel: str | None,
    onto_skel: str | None,
    maps: tuple[Path, ...],
    report: Path | None,
    dry_run: bool,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Convert motion between USD, BVH, glTF (also VRM) and FBX (read only).

    A converted USD file stands alone, with a complete character; of a USD input all else is kept,
    meshes, materials and cameras too. With --onto the fingers go to another character, whatever
    its names, axes and proportions. What a file does not say is guessed, and said.

    \b
    Examples:
      usdhand convert talk.bvh -o talk.usda --fps 30 --start 1001
      usdhand convert takes/*.fbx --out-dir usd
      usdhand convert gloves.glb --onto hero.usd -o hero_hands.usdc
    """
    from usdhand.formats.files import Reading
    from usdhand.report.document import document, dumps
    from usdhand.verbs.clips import conventions_from
    from usdhand.verbs.convert import Edits

    edits = Edits(fps, start, trim, scale, root_motion, up)
    reading = Reading(skel, animation, units, input_up)
    conventions = conventions_from(maps)
    if onto_skel is not None and onto is None:
        raise UsageError("--onto-skel chooses a skeleton of --onto CHARACTER, which is not given.")
    paths = find_files(files)
    jobs, code = _jobs(paths, reading, output, out_dir, suffix, force)
    check_report(report, force)
    results: list[dict[str, Any]] = []
    for path, own, target in with_progress(jobs, "converting"):
        result: dict[str, Any] = {"path": str(path), "output": None if dry_run else str(target)}
        try:
            result |= _convert(
                path, target, edits, own, onto, onto_skel, conventions, force, dry_run
            )
        except UsdHandError as error:
            if len(jobs) == 1:
                raise
            fail(error)
            code = max(code, error.exit_code)
            result |= {"output": None, "error": str(error)}
        else:
            _tell(result, quiet or as_json, quiet)
        results.append(result)
    settings = _settings(edits, reading, onto, onto_skel)
    inputs = [*paths, *([onto] if onto else []), *maps]
    text = dumps(document("convert", inputs, settings, {"files": results}))
    write_report(report, text, force)
    if as_json:
        click.echo(text)
    click.get_current_context().exit(code)


Job = tuple[Path, "Reading", Path]


def _jobs(
    paths: list[Path],
    reading: Reading,
    output: Path | None,
    out_dir: Path | None,
    suffix: str | None,
    force: bool,
) -> tuple[list[Job], int]:
    """What to read and where to write it, and the exit code of files that cannot be read."""
    from usdhand.formats.output import check_folder, check_output, make_folder
    from usdhand.formats.suffixes import WRITABLE

    if (output is None) == (out_dir is None):
        raise UsageError("Give either -o OUTPUT or --out-dir DIR.")
    if output is not None:
        if suffix is not None and output.suffix.lower() != f".{suffix}":
            raise UsageError(f"--to {suffix} and -o {output} contradict each other.")
        if len(paths) > 1:
            raise UsageError(f"{len(paths)} inputs need --out-dir DIR instead of -o.")
        check_output(output, paths, force, WRITABLE)
        return [(paths[0], reading, output)], 0
    assert out_dir is not None
    check_folder(out_dir)
    jobs: list[Job] = []
    code = 0
    for path in paths:
        try:
            jobs += [
                (path, own, out_dir / f"{name}.{suffix or 'usdc'}")
                for name, own in _each(path, reading)
            ]
        except UsdHandError as error:
            fail(error)
            code = max(code, error.exit_code)
    targets = [target for _, _, target in jobs]
    if double := next((t for t in targets if targets.count(t) > 1), None):
        raise UsageError(f"Two results would both be {double}; convert them to several folders.")
    make_folder(out_dir)
    for target in targets:
        check_output(target, paths, force, WRITABLE)
    return jobs, code


def _each(path: Path, reading: Reading) -> list[tuple[str, Reading]]:
    """A name and a reading for every animation of a file."""
    from dataclasses import replace

    from usdhand.formats.files import animation_names

    if reading.animation is not None:
        return [(path.stem, reading)]
    names = animation_names(path)
    if len(names) < 2:
        return [(path.stem, reading)]
    return [(f"{path.stem}.{_file_part(name)}", replace(reading, animation=name)) for name in names]


def _file_part(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)


def _convert(
    path: Path,
    target: Path,
    edits: Edits,
    own: Reading,
    onto: Path | None,
    onto_skel: str | None,
    conventions: Any,
    force: bool,
    dry_run: bool,
) -> dict[str, Any]:
    from usdhand.report.converting import convert_result
    from usdhand.verbs.convert import Reading, convert

    done: Converted = convert(
        path,
        target,
        edits,
        own,
        onto=onto,
        onto_reading=Reading(skel=onto_skel),
        conventions=conventions,
        force=force,
        dry_run=dry_run,
    )
    return convert_result(done.source, done.clip, done.animated, done.lost, conventions)


def _settings(
    edits: Edits, reading: Reading, onto: Path | None, onto_skel: str | None
) -> dict[str, Any]:
    return {
        "fps": edits.fps,
        "start": edits.start,
        "trim": list(edits.trim),
        "scale": edits.scale,
        "up": edits.up,
        "root_motion": edits.root_motion,
        "skel": reading.skel,
        "animation": reading.animation,
        "cm_per_unit": reading.cm_per_unit,
        "input_up": reading.up,
        "onto": onto,
        "onto_skel": onto_skel,
    }


def _tell(result: dict[str, Any], no_text: bool, quiet: bool) -> None:
    for problem in result["problems"]:
        if problem["severity"] == "warning":
            warn(f"{result['path']}: {problem['message']}", quiet)
    for problem in result["lost"]:
        if problem["severity"] == "warning":
            warn(f"{result['output']}: {problem['message']}", quiet)
    motion = (
        f"{result['frames']} frames at {result['fps']:g} fps from time code {result['start']:g}"
        if result["animated"]
        else "no motion, the bind pose"
    )
    hands = f"hands by convention '{result['convention']}'" if result["convention"] else "no hands"
    lines = [f"{result['path']}: {result['joints']} joints, {motion}; {hands}"]
    notes = [p for p in result["problems"] if p["code"].startswith("guessed")] + result["lost"]
    lines += [f"  {note['message']}" for note in notes if note["severity"] == "note"]
    if result["renamed_joints"]:
        lines.append(
            f"  {result['renamed_joints']} joints have other names in USD than in the file"
        )
    written = "nothing written (dry run)" if result["output"] is None else result["output"]
    say(
        "\n".join([*lines, f"  written to {written}" if result["output"] else f"  {written}"]),
        no_text,
    )
