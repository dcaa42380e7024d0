"""Which files `convert` reads, and where it writes each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from usdhand.errors import UsageError, UsdHandError
from usdhand.formats.files import animation_names
from usdhand.formats.output import check_folder, check_outputs, make_folder
from usdhand.formats.paths import written_files
from usdhand.formats.reading import Reading
from usdhand.formats.suffixes import WRITABLE
from usdhand.requests.convert import ConvertRequest
from usdhand.verbs.outcome import Journal


@dataclass(frozen=True)
class Job:
    """One file to write."""

    path: Path
    reading: Reading
    target: Path

    def __str__(self) -> str:
        return str(self.path)


def jobs_of(
    paths: Sequence[Path], request: ConvertRequest, journal: Journal
) -> tuple[list[Job], int]:
    """What to read and where to write it, and the exit code of files that cannot be read."""
    output, folder = request.output, request.out_dir
    if output is not None and folder is None:
        if request.to is not None and output.suffix.lower() != f".{request.to}":
            raise UsageError(f"--to {request.to} and -o {output} contradict each other.")
        if len(paths) > 1:
            raise UsageError(f"{len(paths)} inputs need --out-dir DIR instead of -o.")
        outputs = written_files(output, flatten=request.flatten)
        check_outputs(outputs, paths, request.force, WRITABLE)
        return [Job(paths[0], request.reading, output)], 0
    if folder is None or output is not None:
        raise UsageError("Give either -o OUTPUT or --out-dir DIR.")
    check_folder(folder)
    jobs: list[Job] = []
    code = 0
    stems = Counter(path.stem for path in paths)
    for path in paths:
        try:
            # Files of one name in several formats keep their suffixes, to be told apart.
            stem = path.stem if stems[path.stem] == 1 else path.name
            each = _each(path, stem, request.reading)
        except UsdHandError as error:
            journal.fail(error, path)
            code = max(code, error.exit_code)
            continue
        suffix = request.to or "usdc"
        jobs += [Job(path, own, folder / f"{name}.{suffix}") for name, own in each]
    counts = Counter(job.target for job in jobs)
    if double := next((target for target, count in counts.items() if count > 1), None):
        raise UsageError(f"Two results would both be {double}; convert them to several folders.")
    make_folder(folder)
    outputs = [f for job in jobs for f in written_files(job.target, flatten=request.flatten)]
    check_outputs(outputs, paths, request.force, WRITABLE)
    return jobs, code


def _each(path: Path, stem: str, reading: Reading) -> list[tuple[str, Reading]]:
    """A name and a reading for every animation of a file."""
    names = () if reading.animation is not None else animation_names(path)
    if len(names) < 2:
        return [(stem, reading)]
    return [(f"{stem}.{_file_part(name)}", replace(reading, animation=name)) for name in names]


def _file_part(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
