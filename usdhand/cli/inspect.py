"""usdhand inspect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from usdhand.cli.common import (
    fail,
    files_argument,
    find_files,
    json_option,
    map_option,
    quiet_option,
    say,
    skel_option,
    table,
    verbose_option,
)

if TYPE_CHECKING:
    from usdhand.rigs import Conventions


@click.command("inspect")
@files_argument()
@skel_option
@map_option
@json_option
@quiet_option
@verbose_option
def command(
    files: tuple[str, ...],
    skel: str | None,
    maps: tuple[Path, ...],
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Show skeletons, timing, units, hands and problems of files.

    \b
    Example:
      usdhand inspect samples/characters samples/gestures/ok_01.usdc
    """
    from usdhand.errors import HandNotFoundError, UsdHandError
    from usdhand.report.document import document, dumps
    from usdhand.verbs.clips import conventions_from

    paths = find_files(files)
    conventions = conventions_from(maps)
    results, code = [], 0
    for path in paths:
        result: dict[str, Any] = {"path": str(path)}
        try:
            result |= _inspect(path, skel, conventions)
        except UsdHandError as error:
            result["error"] = str(error)
            code = max(code, error.exit_code)
            fail(error)
        else:
            if "hand_error" in result:
                code = max(code, 4)
                if quiet or as_json:
                    fail(HandNotFoundError(result["hand_error"]))
            if not as_json:
                say(_text(result, verbose), quiet)
        results.append(result)
    if as_json:
        click.echo(dumps(document("inspect", [*paths, *maps], {"skel": skel}, {"files": results})))
    click.get_current_context().exit(code)


def _inspect(path: Path, skel: str | None, conventions: Conventions | None) -> dict[str, Any]:
    from usdhand.errors import HandNotFoundError
    from usdhand.formats.files import animation_names, read_any, read_character
    from usdhand.report.results import inspect_result
    from usdhand.verbs.clips import find_hands

    names = animation_names(path)
    clip, animated = read_any(path, skel) if len(names) < 2 else (read_character(path, skel), False)
    more = {"animations": list(names)} if len(names) > 1 else {}
    try:
        return inspect_result(clip, find_hands(clip, conventions), animated) | more
    except HandNotFoundError as error:
        return inspect_result(clip, None, animated) | more | {"hand_error": str(error)}


def _text(result: dict[str, Any], verbose: bool) -> str:
    skeleton = f"skeleton {result['skeleton']}, " if result["skeleton"] else ""
    lines = [
        f"{result['path']}",
        f"  {skeleton}{result['joints']} joints, "
        f"{result['cm_per_unit']:g} cm a unit, {result['up_axis']} up",
    ]
    if result["animation"]:
        lines.append(
            f"  motion {result['animation']}, {result['frames']} frames at {result['fps']:g} fps, "
            f"{result['start_s']:.3f} to {result['end_s']:.3f} s"
        )
    elif "animations" in result:
        names = ", ".join(f"'{name}'" for name in result["animations"])
        lines.append(f"  {len(result['animations'])} animations: {names}")
    else:
        lines.append("  no motion")
    if "hand_error" in result:
        lines.append(f"  no hands: {result['hand_error']}")
    else:
        lines += _hand_lines(result, verbose)
    lines += [f"  note: {note}" for note in result.get("notes", ())]
    lines += [
        f"  {p['severity']}: {p['message']}" + (f" ({p['where']})" if p["where"] else "")
        for p in result["problems"]
    ]
    return "\n".join(lines)


def _hand_lines(result: dict[str, Any], verbose: bool) -> list[str]:
    lines = [f"  hands by convention '{result['convention']}'"]
    for side, hand in result["hands"].items():
        missing = f", without {', '.join(hand['missing'])}" if hand["missing"] else ""
        lines.append(
            f"    {side}: {len(hand['joints'])} joints{missing}, wrist {_leaf(hand['wrist'])}, "
            f"elbow {_leaf(hand['elbow'])}, shoulder {_leaf(hand['shoulder'])}"
        )
    body = ", ".join(f"{k} {_leaf(result[k])}" for k in ("hips", "chest", "neck", "head"))
    lines.append(f"    body: {body}")
    channels = result.get("channels", [])
    shown = [c for c in channels if verbose or c["flexion"]]
    if shown:
        head = ["channel" if verbose else "flexion", "min deg", "max deg", "mean deg"]
        numbers = [
            [c["name"], *(f"{c[k]:.1f}" for k in ("min_deg", "max_deg", "mean_deg"))] for c in shown
        ]
        lines += ["    " + line for line in table([head, *numbers], right=(1, 2, 3)).splitlines()]
    if verbose:
        for side, hand in result["hands"].items():
            lines += [f"    {side} {name}: {path}" for name, path in hand["joints"].items()]
    return lines


def _leaf(joint: str | None) -> str:
    return "not found" if joint is None else joint.rsplit("/", 1)[-1]
