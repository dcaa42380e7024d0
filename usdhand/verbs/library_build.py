"""A motion library built, or built again."""

from __future__ import annotations

import csv
import io
import signal
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from usdhand.errors import (
    InputError,
    InterruptedBuildError,
    OutputError,
    TerminatedBuildError,
)
from usdhand.fill.library import LibraryClip, MotionLibrary
from usdhand.fill.settings import Segmentation
from usdhand.formats.atomic import ending_signals
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.usd.library import is_library, read_library, write_library
from usdhand.inputs import read_text
from usdhand.problems import Problem, counted, listed
from usdhand.report.library import library_result, summary
from usdhand.requests.library import LibraryBuildRequest
from usdhand.verbs.clips import conventions_of, rig_files
from usdhand.verbs.files import find_files_below
from usdhand.verbs.library import (
    BuildResult,
    build_library,
    forget_interrupted,
    interrupted_clips,
    is_edited,
)
from usdhand.verbs.outcome import Journal, Outcome

COLUMNS = {"file", "label", "actor"}
OUTPUTS = (".usd", ".usda", ".usdc")


def run(request: LibraryBuildRequest, journal: Journal) -> Outcome:
    """Read what is new or changed, and write the library."""
    output = request.output
    paths = [p for p in find_files_below(request.clips) if not _same(p, output)]
    check_outputs(written_files(output), paths, True, OUTPUTS)
    previous = _previous(request, journal)
    labels = _read_labels(request.labels) if request.labels else None
    conventions = conventions_of(request)
    try:
        with _terminated_as_interrupted():
            built = build_library(
                paths,
                output,
                segmentation=_segmentation(request, None if request.rebuild else previous),
                labels=labels,
                previous=previous,
                rebuild=request.rebuild,
                conventions=conventions,
                jobs=request.jobs,
                progress=journal.progress("reading"),
            )
    except _Terminated:
        raise TerminatedBuildError(_what_is_kept(output)) from None
    except KeyboardInterrupt:
        raise InterruptedBuildError(_what_is_kept(output)) from None
    write_library(built.library, output, force=True)
    forget_interrupted(output)
    _tell(built, previous, request, journal)

    def report() -> dict[str, Any]:
        removed = [{"path": x.path, "label": x.label, "actor": x.actor} for x in built.removed]
        return library_result(built.library) | {
            "output": str(output),
            "read": built.read,
            "unchanged": built.unchanged,
            "labels_without_clip": list(built.unmatched),
            "removed": removed,
        }

    return Outcome(
        request,
        (*paths, *rig_files(request)),
        report,
        summary,
        settings={"segmentation": asdict(built.library.segmentation)},
        written=(output,),
    )


def _tell(
    built: BuildResult,
    previous: MotionLibrary | None,
    request: LibraryBuildRequest,
    journal: Journal,
) -> None:
    for entry in previous.damaged if previous else ():
        message = f"{entry.file} of the old library cannot be used: {entry.message}"
        journal.warn("damaged", message)
    for entry in built.library.left_out:
        own = entry.message.startswith(entry.file)  # the message names it
        named = entry.message if own else f"{entry.file}: {entry.message}"
        journal.warn("left-out", f"left out: {named}", entry.file)
    journal.about(request.output, (p for p in built.problems if p.code != "bind-pose"), "warning")
    for what, files in _by_message(p for p in built.problems if p.code == "bind-pose"):
        message = f"{counted(len(files), 'clip')}: the {what}, which is left out: {listed(files)}"
        journal.warn("bind-pose", message)
    if built.removed:
        journal.warn("removed", _what_is_removed(built.removed))
    if built.unmatched:
        some = listed(built.unmatched)
        message = f"{len(built.unmatched)} rows match no clip: {some}"
        journal.warn("labels-without-clip", message, request.labels or "")


def _by_message(problems: Iterable[Problem]) -> list[tuple[str, list[str]]]:
    """Messages with the files that they are of."""
    found: dict[str, list[str]] = {}
    for problem in problems:
        found.setdefault(problem.message, []).append(problem.file)
    return sorted(found.items())


def _previous(request: LibraryBuildRequest, journal: Journal) -> MotionLibrary | None:
    """The library that is built again; of one that cannot be read, --rebuild needs nothing."""
    if not request.output.exists():
        return None
    try:
        return read_library(request.output, old=request.rebuild)
    except InputError as error:
        if not is_library(request.output):
            message = f"{request.output} exists and is not a motion library; give another name."
            raise OutputError(message) from error
        if not request.rebuild:
            raise
        journal.warn("lost-labels", f"labels and actors of the old library are lost: {error}")
        return None


def _what_is_removed(clips: Sequence[LibraryClip]) -> str:
    """Say which clips of the old library were not given; work of a person in full."""
    text = (
        f"{counted(len(clips), 'clip')} of the old library removed, since not given this time: "
        + listed([clip.path for clip in clips])
    )
    edited = [clip for clip in clips if is_edited(clip) or clip.actor]
    if edited:
        words = (f"{x.path}: {x.label}" + (f" ({x.actor})" if x.actor else "") for x in edited)
        text += "\n  with edited labels: " + ", ".join(words)
    return text


def _what_is_kept(output: Path) -> str:

    count = interrupted_clips(output)
    verb = "is" if count == 1 else "are"
    kept = f"{counted(count, 'clip')} read so far {verb} kept" if count else "nothing was read yet"
    old = "; the library is as it was" if output.exists() else ""
    return f"Interrupted: {kept}{old}. The same command continues where this one stopped."


class _Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP while clips are read."""


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM and SIGHUP raise `_Terminated`, so that what was read so far is kept."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's
        return
    kinds = ending_signals()

    def terminate(*_: object) -> None:
        for kind in kinds:
            signal.signal(kind, signal.SIG_IGN)  # once is enough
        raise _Terminated

    before = {kind: signal.signal(kind, terminate) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _segmentation(request: LibraryBuildRequest, previous: MotionLibrary | None) -> Segmentation:
    usual = previous.segmentation if previous else Segmentation()
    given = {"speed": request.speed, "shortest": request.shortest, "longest": request.longest}
    return replace(usual, **{k: v for k, v in given.items() if v is not None})


def _read_labels(path: Path) -> dict[str, tuple[str, str]]:
    try:
        with io.StringIO(read_text(path).removeprefix("\ufeff"), newline="") as file:
            head = file.readline()
            file.seek(0)
            reader = csv.DictReader(file, delimiter=max(",;\t", key=head.count))
            rows, columns = list(reader), set(reader.fieldnames or ())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error}).") from error
    if not {"file", "label"} <= columns:
        raise InputError(f"{path}: needs a header with the columns file and label.")
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


def _same(a: Path, b: Path) -> bool:
    return a.exists() and b.exists() and a.samefile(b)
