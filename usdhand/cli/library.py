"""usdhand library build, usdhand library info."""

from __future__ import annotations

import csv
import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from usdhand.cli.common import (
    check_report,
    files_argument,
    find_files,
    force_option,
    json_option,
    map_option,
    output_option,
    quiet_option,
    report_option,
    say,
    warn,
    write_report,
)
from usdhand.errors import UsageError, UsdHandError
from usdhand.formats.suffixes import READABLE

if TYPE_CHECKING:
    from usdhand.fill.library import LibraryClip, MotionLibrary

COLUMNS = {"file", "label", "actor"}
OUTPUTS = (".usd", ".usda", ".usdc")


@click.group("library")
def command() -> None:
    """Build a motion library that `fill` takes fingers from, and show what is in one.

    \b
    Example:
      usdhand library build samples/gestures -o gestures.usdc
    """


@command.command("build")
@files_argument("clips")
@output_option("The library (.usdc, .usda, .usd).")
@click.option(
    "--labels",
    metavar="FILE.csv",
    type=click.Path(path_type=Path),
    help="Columns file, label and (if wanted) actor; else labels are taken from file names.",
)
@click.option(
    "--speed", type=float, metavar="CM/S", help="Cut where the wrist is slower than this."
)
@click.option("--shortest", type=float, metavar="S", help="Shortest segment.")
@click.option("--longest", type=float, metavar="S", help="Longest segment.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes.")
@click.option("--rebuild", is_flag=True, help="Read all clips again; labels are kept.")
@map_option
@report_option
@force_option
@json_option
@quiet_option
def build(
    clips: tuple[str, ...],
    output: Path,
    labels: Path | None,
    speed: float | None,
    shortest: float | None,
    longest: float | None,
    jobs: int,
    rebuild: bool,
    maps: tuple[Path, ...],
    report: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Read clips with body and fingers into a library.

    A folder stands for all clips in it and in the folders below. Run again, it reads only what
    changed and keeps labels that someone edited; clips of the old library that are not given any
    more are removed and listed. A clip that cannot be used is reported and left out. The library
    is a USD stage with a prim a clip.

    \b
    Examples:
      usdhand library build samples/gestures -o gestures.usdc
      usdhand library build takes/*.usdc -o takes.usdc --jobs 2 --labels takes.csv
    """
    from usdhand.errors import OutputError
    from usdhand.formats.output import check_output
    from usdhand.report.document import document, dumps
    from usdhand.report.filling import counted, library_result
    from usdhand.verbs import fill as filling

    paths = [p for p in _files(clips) if not _same(p, output)]
    check_output(output, paths, True, OUTPUTS)
    check_report(report, force)
    if output.exists() and not filling.is_library(output):
        raise OutputError(f"{output} exists and is no motion library; give another name.")
    previous = _previous(output, rebuild, quiet)
    segmentation = _segmentation(speed, shortest, longest, None if rebuild else previous)
    table = _read_labels(labels) if labels else None
    try:
        with _terminated_as_interrupted():
            result = filling.build_library(
                paths,
                output,
                segmentation=segmentation,
                labels=table,
                previous=previous,
                rebuild=rebuild,
                maps=maps,
                jobs=jobs,
                progress=_progress,
            )
    except _Terminated:
        raise TerminatedBuildError(_what_is_kept(output)) from None
    except KeyboardInterrupt:
        raise InterruptedBuildError(_what_is_kept(output)) from None
    filling.write_library(result.library, output, force=True)
    filling.forget_interrupted(output)
    data = library_result(result.library) | {
        "output": str(output),
        "read": result.read,
        "unchanged": result.unchanged,
        "labels_without_clip": list(result.unmatched),
        "removed": [{"path": x.path, "label": x.label, "actor": x.actor} for x in result.removed],
    }
    settings: dict[str, Any] = {"jobs": jobs, "labels": labels, "rebuild": rebuild, "maps": maps}
    settings["segmentation"] = asdict(result.library.segmentation)
    text = dumps(document("library", [*paths, *maps], settings, data))
    write_report(report, text, force)
    if as_json:
        click.echo(text)
        return
    for entry in previous.damaged if previous else ():
        warn(f"{entry.path} of the old library cannot be used: {entry.reason}", quiet)
    for left in result.library.left_out:
        warn(f"left out: {left.path}: {left.reason}", quiet)
    if result.removed:
        warn(_what_is_removed(result.removed), quiet)
    if result.unmatched:
        some = ", ".join(result.unmatched[:3]) + (", ..." if len(result.unmatched) > 3 else "")
        warn(f"{labels}: {len(result.unmatched)} rows match no clip: {some}", quiet)
    say(
        _text(data | {"left_out": []})
        + f"\n{counted(result.read, 'clip')} read, {result.unchanged} unchanged",
        quiet,
    )
    say(f"written to {output}", quiet)


@command.command("info")
@click.argument("library", type=click.Path(path_type=Path))
@json_option
@quiet_option
def info(library: Path, as_json: bool, quiet: bool) -> None:
    """Show minutes, clips, actors, segments, labels and problems of a library.

    \b
    Example:
      usdhand library info gestures.usdc
    """
    from usdhand.report.document import document, dumps
    from usdhand.report.filling import library_result
    from usdhand.verbs import fill as filling

    motions = filling.read_library(library)
    data = library_result(motions, filling.gone_clips(motions, library.absolute().parent))
    if as_json:
        click.echo(dumps(document("library", [library], {}, data)))
    else:
        say(_text(data), quiet)


def _text(data: dict[str, Any]) -> str:
    from usdhand.report.filling import counted

    segments, cut = data["segments"], data["segmentation"]
    lines = [
        f"{counted(data['clips'], 'clip')}, {data['minutes']:.2f} minutes, segments: "
        f"{segments['left']} left, {segments['right']} right "
        f"({cut['shortest_s']:g} to {cut['longest_s']:g} s, cut at {cut['speed_cm_s']:g} cm/s)",
    ]
    if data["actors"]:
        lines.append("actors: " + ", ".join(data["actors"]))
    if data["labels"]:
        lines.append("labels: " + ", ".join(f"{k} ({n})" for k, n in data["labels"].items()))
    lines += [f"left out: {x['path']}: {x['reason']}" for x in data["left_out"]]
    lines += [f"cannot be used: {x['path']}: {x['reason']}" for x in data["damaged"]]
    lines += [f"file gone (fine for fill, not for evaluate): {path}" for path in data["gone"]]
    return "\n".join(lines)


def _files(arguments: Sequence[str]) -> list[Path]:
    """Files named, matching wildcards, or anywhere below folders; each once."""
    found: dict[Path, Path] = {}
    for argument in arguments:
        folder = Path(argument)
        if folder.is_dir():
            below = (p for p in sorted(folder.rglob("*")) if p.suffix.lower() in READABLE)
            paths = [p for p in below if p.is_file() and not _hidden(p.relative_to(folder))]
            if not paths:
                raise UsageError(
                    f"{folder} and the folders below hold no {', '.join(READABLE)} file."
                )
        else:
            paths = find_files([argument])
        for path in paths:
            found.setdefault(path.absolute(), path)
    return list(found.values())


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _previous(output: Path, rebuild: bool, quiet: bool) -> MotionLibrary | None:
    """The library that is built again; of one that cannot be read, --rebuild needs nothing."""
    from usdhand.errors import InputError
    from usdhand.verbs import fill as filling

    if not output.exists():
        return None
    try:
        return filling.read_library(output)
    except InputError as error:
        if not rebuild:
            raise
        warn(f"labels and actors of the old library are lost: {error}", quiet)
        return None


def _what_is_removed(clips: Sequence[LibraryClip]) -> str:
    """Say which clips of the old library were not given; work of a person in full."""
    from usdhand.report.filling import counted, listed
    from usdhand.verbs.library import is_edited

    text = (
        f"{counted(len(clips), 'clip')} of the old library removed, since not given this time: "
        + listed([clip.path for clip in clips])
    )
    edited = [clip for clip in clips if is_edited(clip) or clip.actor]
    if edited:
        words = (f"{x.path}: {x.label}" + (f" ({x.actor})" if x.actor else "") for x in edited)
        text += "\n  with labels of their own: " + ", ".join(words)
    return text


def _what_is_kept(output: Path) -> str:
    from usdhand.report.filling import counted
    from usdhand.verbs.library import interrupted_clips

    count = interrupted_clips(output)
    verb = "is" if count == 1 else "are"
    kept = f"{counted(count, 'clip')} read so far {verb} kept" if count else "nothing was read yet"
    old = "; the library is as it was" if output.exists() else ""
    return f"Interrupted: {kept}{old}. The same command goes on where it stopped."


class InterruptedBuildError(UsdHandError):
    """A build was interrupted (exit 1)."""


class TerminatedBuildError(UsdHandError):
    """A build was ended by SIGTERM (exit 143)."""

    exit_code = 143


class _Terminated(KeyboardInterrupt):
    """SIGTERM while clips are read."""


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM raises `_Terminated`, so that what was read so far is kept."""

    def terminate(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough
        raise _Terminated

    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _segmentation(
    speed: float | None, shortest: float | None, longest: float | None, previous: Any
) -> Any:
    from dataclasses import replace

    from usdhand.fill.settings import Segmentation

    usual = previous.segmentation if previous else Segmentation()
    given = {"speed": speed, "shortest": shortest, "longest": longest}
    return replace(usual, **{k: v for k, v in given.items() if v is not None})


def _read_labels(path: Path) -> dict[str, tuple[str, str]]:
    from usdhand.errors import InputError

    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            head = file.readline()
            file.seek(0)
            reader = csv.DictReader(file, delimiter=max(",;\t", key=head.count))
            rows, columns = list(reader), set(reader.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error}).") from error
    if not {"file", "label"} <= columns:
        raise InputError(f"{path}: needs a head with the columns file and label.")
    if columns - COLUMNS:
        unknown = ", ".join(sorted(map(str, columns - COLUMNS)))
        raise InputError(f"{path}: unknown columns {unknown}; there are file, label and actor.")
    return {
        Path((row["file"] or "").strip()).as_posix(): (
            (row["label"] or "").strip(),
            (row.get("actor") or "").strip(),
        )
        for row in rows
    }


def _progress(items: Iterable[object], count: int) -> Iterable[object]:
    from rich.console import Console

    console = Console(stderr=True)
    if count < 3 or not console.is_terminal:
        return items
    from rich.progress import track

    return track(items, total=count, description="reading", console=console, transient=True)


def _same(a: Path, b: Path) -> bool:
    return a.exists() and b.exists() and a.samefile(b)
