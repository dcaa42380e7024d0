"""Motion libraries built from files of any format."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from numbers import Integral
from pathlib import Path, PurePosixPath

from usdhand.anatomy import Hands
from usdhand.anatomy.at_bind import moved_frames
from usdhand.display import displayed
from usdhand.errors import InputError, UsageError, UsdHandError
from usdhand.fill.library import (
    LibraryClip,
    MotionLibrary,
    hand_segments,
    library_clip,
)
from usdhand.fill.settings import Segmentation
from usdhand.formats.files import read_clip
from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.library import is_library, read_library, relative_path, write_library
from usdhand.motion import Clip
from usdhand.problems import Problem
from usdhand.progress import Progress, each
from usdhand.rigs import Conventions
from usdhand.verbs.clips import find_hands, misleading_names
from usdhand.verbs.files import check_several
from usdhand.workers import each_apart


@displayed(
    lambda built: {
        "library": built.library,
        "read": built.read,
        "unchanged": built.unchanged,
        "unmatched": len(built.unmatched),
        "removed": len(built.removed),
    }
)
@dataclass(frozen=True)
class BuildResult:
    """A built library, and how many of its clips were read now or kept unchanged.

    ``unmatched`` are files that have labels but are not among the clips;
    ``removed`` are clips of the old library that were not given this time;
    ``problems`` are what is odd about clips that were read now and are used.
    """

    library: MotionLibrary
    read: int
    unchanged: int
    unmatched: tuple[str, ...] = ()
    removed: tuple[LibraryClip, ...] = ()
    problems: tuple[Problem, ...] = ()


# A clip that was read, or why it is left out; and what is odd about it.
_Read = tuple[LibraryClip | Problem, tuple[Problem, ...]]


@dataclass(frozen=True)
class _Task:
    """One clip to read; goes to another process."""

    path: Path
    name: str
    relative: str
    content_hash: str
    label: str
    actor: str
    segmentation: Segmentation
    conventions: Conventions | None

    def __str__(self) -> str:
        return str(self.path)


def build_library(
    paths: Sequence[str | Path],
    output: str | Path,
    *,
    segmentation: Segmentation | None = None,
    labels: Mapping[str, tuple[str, str]] | None = None,
    previous: MotionLibrary | None = None,
    rebuild: bool = False,
    conventions: Conventions | None = None,
    jobs: int = 0,
    progress: Progress | None = None,
    keep: float = 10.0,
) -> BuildResult:
    """Read clips into a library; a clip that cannot be used is left out with its reason.

    Parameters
    ----------
    output : where the library will be written, for relative paths
    labels : file -> (label, actor), the file name with as many folders as make it unique, with
        or without its suffix; else labels come from file names
    previous : clips whose content has not changed are taken over from it; labels that someone
        edited, and actors, of the others too, as long as file or content is the same
    rebuild : keep only labels and actors
    jobs : processes that read, so that a file that crashes USD is left out; 0 to read in this one
    keep : seconds after which what was read is saved beside the output, so that a build that was
        interrupted continues there
    progress : gets how many clips are read and how many there are; False stops, and what was read
        is kept as after an interruption

    Raises
    ------
    UsageError
        if a clip is given twice, or ``jobs`` or ``keep`` is not possible.
    InputError
        if no clip can be used.
    CancelledError
        if ``progress`` returned False.
    """
    check_several("paths", paths)
    if isinstance(jobs, bool) or not isinstance(jobs, Integral) or jobs < 0:
        raise UsageError(f"jobs: {jobs!r} processes are not possible: give 0 or more.")
    if not keep >= 0:
        raise UsageError(f"keep: {keep!r} seconds are not possible: give 0 or more.")
    files, output = [Path(path) for path in paths], Path(output)
    cutting = segmentation or Segmentation()
    kept = _kept_file(output)
    known = _known([None if rebuild else previous, _read_kept(kept)])
    tasks: list[_Task] = []
    clips: list[LibraryClip] = []
    left: list[Problem] = []
    problems: list[Problem] = []
    used: set[str] = set()
    contents = [file_hash(path) for path in files]
    before = _Before.of(previous, contents)
    for path, name, content in zip(files, _unique_names(files), contents, strict=True):
        relative = relative_path(path, output)
        if content is None:
            left.append(Problem("left-out", "no such file", file=relative))
            continue
        old, cut_as = known.get((content, relative)) or known.get((content, "")) or (None, cutting)
        row = _row_of(path, labels or {})
        used.add(row)
        label, actor = _words(path, (labels or {}).get(row), before.find(content, relative) or old)
        if old is None:
            task = _Task(path, name, relative, content, label, actor, cutting, conventions)
            tasks.append(task)
            continue
        old = replace(old, name=name, path=relative, label=label, actor=actor)
        clips.append(old if cut_as == cutting else _cut_again(old, cutting))
    kept_clips, read = len(clips), {task.name for task in tasks}
    results = _run(tasks, jobs)
    next_time = time.monotonic() + keep
    try:
        for done, odd in each(results, len(tasks), progress):
            (clips if isinstance(done, LibraryClip) else left).append(done)
            problems += odd
            if time.monotonic() > next_time:
                # A tenth of the time at most: the larger the library, the rarer.
                next_time += max(keep, 10.0 * _keep(clips[kept_clips:], cutting, kept))
    except BaseException:
        _keep(clips[kept_clips:], cutting, kept)
        raise
    if not clips:
        reasons = "; ".join(f"{entry.file}: {entry.message}" for entry in left[:3])
        raise InputError(f"No clip can be used for a library. {reasons}")
    doubtful = [clip for clip in clips if clip.doubt]
    if doubtful and len(doubtful) < len(clips):
        clips = [clip for clip in clips if not clip.doubt]
        left += [Problem("left-out", _no_mixing(clip), file=clip.path) for clip in doubtful]
    else:
        problems += [Problem("doubtful-units", clip.doubt, file=clip.path) for clip in doubtful]
    unchanged = sum(clip.name not in read for clip in clips)
    ordered = tuple(sorted(clips, key=lambda c: c.name))
    library = MotionLibrary(ordered, cutting, tuple(sorted(left, key=lambda entry: entry.file)))
    unmatched = tuple(file for file in labels or {} if file not in used)
    here = {*contents, *(relative_path(path, output) for path in files)}
    removed = tuple(
        clip
        for clip in (previous.clips if previous else ())
        if clip.content_hash not in here and clip.path not in here
    )
    counts = len(ordered) - unchanged, unchanged
    return BuildResult(library, *counts, unmatched, removed, tuple(problems))


def _no_mixing(clip: LibraryClip) -> str:
    """Why a clip is not put beside others."""
    return (
        f"its unit of length is doubtful, and other clips' are not: {clip.doubt} with "
        "'usdhand convert' and add the result"
    )


@dataclass(frozen=True, eq=False)
class _Before:
    """Clips of the library that is built again: by content and file, content, or file alone.

    By file alone only where the content is nowhere else: there someone edited the file; else it
    was given another name.
    """

    clips: Mapping[tuple[str, str], LibraryClip]

    @classmethod
    def of(cls, library: MotionLibrary | None, contents: Iterable[str | None]) -> _Before:
        found: dict[tuple[str, str], LibraryClip] = {}
        here = set(contents)
        for clip in library.clips if library else ():
            found.setdefault((clip.content_hash, clip.path), clip)
            found.setdefault((clip.content_hash, ""), clip)
            if clip.content_hash not in here:
                found.setdefault(("", clip.path), clip)
        return cls(found)

    def find(self, content: str, path: str) -> LibraryClip | None:
        """The clip with this content, or of this file."""
        keys = ((content, path), (content, ""), ("", path))
        return next((self.clips[key] for key in keys if key in self.clips), None)


def forget_interrupted(output: Path) -> None:
    """Remove what an interrupted build of this library kept; it is in the library now."""
    _kept_file(output).unlink(missing_ok=True)


def interrupted_clips(output: Path) -> int:
    """How many clips an interrupted build of this library has kept for the next one."""
    kept = _read_kept(_kept_file(output))
    return len(kept.clips) if kept else 0


def gone_clips(library: MotionLibrary, folder: Path) -> list[str]:
    """Paths of clips whose file is not there; filling needs none of them, `measure_library` all."""
    return [clip.path for clip in library.clips if not (folder / clip.path).is_file()]


def _kept_file(output: Path) -> Path:
    return output.with_name(f".{output.stem}.interrupted.usdc")


def _keep(clips: Sequence[LibraryClip], segmentation: Segmentation, path: Path) -> float:
    """Write what was read so far; seconds that it took."""
    start = time.monotonic()
    if clips:
        write_library(MotionLibrary(tuple(clips), segmentation), path, force=True)
    return time.monotonic() - start


def _read_kept(path: Path) -> MotionLibrary | None:
    try:
        return read_library(path) if path.exists() else None
    except InputError:
        return None


def _known(
    libraries: Iterable[MotionLibrary | None],
) -> dict[tuple[str, str], tuple[LibraryClip, Segmentation]]:
    """Clips by content and path, and by content alone, with how they were cut."""
    known: dict[tuple[str, str], tuple[LibraryClip, Segmentation]] = {}
    for library in libraries:
        for clip in library.clips if library else ():
            for key in ((clip.content_hash, clip.path), (clip.content_hash, "")):
                known.setdefault(key, (clip, library.segmentation))  # type: ignore[union-attr]
    return known


def _row_of(path: Path, labels: Mapping[str, tuple[str, str]]) -> str:
    """Under which name a file stands among labels, with or without folders and suffix; else ""."""
    for whole in (path.absolute(), path.absolute().with_suffix("")):
        for start in range(len(whole.parts)):
            name = "/".join(whole.parts[start:])
            if labels.get(name):
                return name
    return ""


def _words(path: Path, given: tuple[str, str] | None, old: LibraryClip | None) -> tuple[str, str]:
    """Label and actor: from a table, else as someone edited them, else by the name."""
    actor = old.actor if old else ""
    if given:
        return given[0], given[1] or actor
    edited = old is not None and is_edited(old)
    return (old.label if old and edited else label_of(path.stem)), actor


def is_edited(clip: LibraryClip) -> bool:
    """Whether a clip's label is not the one of its file's name."""
    return clip.label != label_of(PurePosixPath(clip.path).stem)


def label_of(stem: str) -> str:
    """Label in a file name: what stands before a running number, ``doubt_shrug_03``; else none."""
    found = re.fullmatch(r"(.*?[A-Za-z])[ _.-]*\d+", stem)
    return found.group(1) if found else ""


def _run(tasks: Sequence[_Task], jobs: int) -> Iterator[_Read]:
    if jobs < 1:
        yield from map(_read, tasks)
        return
    with closing(each_apart(_read, tasks, jobs)) as results:
        for task, found in results:
            yield (_left_out(task, found), ()) if isinstance(found, UsdHandError) else found


def _left_out(task: _Task, error: UsdHandError) -> Problem:
    # The reason stands beside the path, which need not be in it again.
    reason = str(error).removeprefix(f"{task.path}: ")
    return Problem("left-out", reason, file=task.relative)


def _read(task: _Task) -> _Read:
    try:
        clip = read_clip(task.path)
        if len(clip) < 2:
            return Problem("left-out", "it is a single frame", file=task.relative), ()
        hands = find_hands(clip, task.conventions)
        made = library_clip(
            clip,
            hands,
            task.segmentation,
            path=task.relative,
            content_hash=task.content_hash,
            label=task.label,
            actor=task.actor,
        )
        if not made.hands:
            return Problem("left-out", "its fingers do not move", file=task.relative), ()
        return replace(made, name=task.name), (*_oddities(task, clip, hands, made),)
    except UsdHandError as error:
        if is_library(task.path):
            return Problem("left-out", "it is a motion library", file=task.relative), ()
        return _left_out(task, error), ()


def _oddities(task: _Task, clip: Clip, hands: Hands, made: LibraryClip) -> Iterator[Problem]:
    """What a person should know of a clip that is used."""
    for problem in misleading_names(clip, task.conventions):
        yield replace(problem, file=task.relative)
    still = [s for s, f in hands.frames.items() if moved_frames(clip, f) is None]
    if still:
        what = f"{' and '.join(still)} hand stays in the bind pose"
        yield Problem("bind-pose", what, file=task.relative)
    ends = [side for side, hand in made.hands.items() if hand.used is not None]
    if ends:
        what = f"{' and '.join(ends)} hand starts or ends in the bind pose"
        yield Problem("bind-pose", what, file=task.relative)


def _cut_again(clip: LibraryClip, segmentation: Segmentation) -> LibraryClip:
    """Return a clip with other segments; its motion need not be read again."""
    hands = {
        side: replace(hand, segments=hand_segments([hand], segmentation))
        for side, hand in clip.hands.items()
    }
    return replace(clip, hands=hands)


def _unique_names(paths: Sequence[Path]) -> list[str]:
    """File names without suffix; where they repeat, with the folder's name before."""
    if len({path.absolute() for path in paths}) < len(paths):
        raise UsageError("A clip is given twice.")
    stems = Counter(path.stem for path in paths)
    numbers: Counter[str] = Counter()
    names: dict[str, None] = {}
    for path in paths:
        repeated = stems[path.stem] > 1
        name = wanted = f"{path.absolute().parent.name}_{path.stem}" if repeated else path.stem
        while name in names or (name != path.stem and name in stems):
            numbers[wanted] += 1
            name = f"{wanted}_{numbers[wanted] + 1}"
        names[name] = None
    return list(names)
