"""Files that are whole or not there, whatever ends the program while they are written."""

from __future__ import annotations

import itertools
import os
import shutil
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from usdhand.errors import OutputError

try:
    import fcntl
except ImportError:  # not on this system: what killed programs leave is not removed
    fcntl = None  # type: ignore[assignment]

PREFIX = ".usdhand."
LOCK = ".tmp.lock"
MOST_NAMES = 10_000  # bytes of the names in a lock
_numbers = itertools.count()
_tidied: set[Path] = set()


@contextmanager
def written_beside(output: Path) -> Iterator[Path]:
    """A path in the output's folder that replaces it once the block has ended without an error.

    It is removed also when the program is told to end. What is left of a program that was killed is
    removed by the next one that writes to the folder.
    """
    with _work_on(output) as (start, _):
        temporary = start.with_name(f"{start.name}{output.suffix}")
        yield temporary
        _to_disk(temporary)
        os.replace(temporary, output)  # noqa: PTH105  (atomic on every system)


@dataclass(frozen=True)
class Pair:
    """Paths to write a file and a part of it beside it to.

    Attributes
    ----------
    part : the part
    interim : the file as it refers to ``part``
    final : the file as it refers to the part by the name that it will have
    """

    part: Path
    interim: Path
    final: Path

    @property
    def spare(self) -> Path:
        """The part once more, to be renamed."""
        return self.part.with_name(f"{self.part.stem}.spare{self.part.suffix}")

    @classmethod
    def at(cls, start: Path, output: Path, part: Path) -> Pair:
        """The paths that begin with ``start``."""
        return cls(
            start.with_name(f"{start.name}.part{part.suffix}"),
            start.with_name(f"{start.name}{output.suffix}"),
            start.with_name(f"{start.name}.final{output.suffix}"),
        )

    def finish(self, output: Path, part: Path) -> None:
        """Give the part its name if the file is there; this can be done again at any point."""
        if self.interim.exists() or not self.final.exists():
            return
        if self.spare.exists():
            os.replace(self.spare, part)  # noqa: PTH105
        os.replace(self.final, output)  # noqa: PTH105


@contextmanager
def pair_written_beside(output: Path, part: Path) -> Iterator[Pair]:
    """Like `written_beside`, for a file that refers to a part of it in the same folder.

    Two files cannot be replaced at once. So the new file refers to a part of another name first:
    whenever the program ends, the old file has its old part, and the new one its new part. What
    is left to be done then, the next program that writes to the folder does.
    """
    with _work_on(output) as (start, lock):
        pair = Pair.at(start, output, part)
        yield pair
        for path in (pair.part, pair.interim, pair.final):
            _to_disk(path)
        _same_file(pair.part, pair.spare)
        lock.write_text(f"{output.name}\n{part.name}\n", encoding="utf-8")
        _to_disk(lock)
        os.replace(pair.interim, output)  # noqa: PTH105
        pair.finish(output, part)
        pair.part.unlink()


def _same_file(source: Path, target: Path) -> None:
    """Give a file another name; where a drive has one name a file, a copy."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
        _to_disk(target)


@contextmanager
def _work_on(output: Path) -> Iterator[tuple[Path, Path]]:
    """The start of paths for temporary files in the output's folder, and a lock on them."""
    tidy(output.absolute().parent)
    start = output.with_name(f"{PREFIX}{os.getpid()}.{next(_numbers)}.tmp")
    lock = start.with_name(f"{start.name}.lock")
    try:
        with _locked(lock):
            try:
                with ended_by_exception():
                    yield start, lock
            except BaseException:
                _clear(lock)
                raise
    except OSError as error:
        raise OutputError(f"{output}: cannot be written ({error.strerror or error}).") from error


def tidy(folder: Path) -> None:
    """Remove what programs that were killed have left in a folder; looked for once a process."""
    if fcntl is None or folder in _tidied:
        return
    _tidied.add(folder)
    for lock in folder.glob(f"{PREFIX}*{LOCK}"):
        try:
            with lock.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _clear(lock)
        except OSError:  # its program is at work, or it is not ours to remove
            continue


def _clear(lock: Path) -> None:
    """Do what was left to be done, and remove temporary files; their lock last."""
    start = lock.with_suffix("")
    if lock.exists():
        with lock.open("rb") as file:
            names = os.fsdecode(file.read(MOST_NAMES)).splitlines()
        if len(names) == 2 and all(Path(name).name == name for name in names):
            output, part = (lock.with_name(name) for name in names)
            Pair.at(start, output, part).finish(output, part)
    for path in sorted(lock.parent.glob(f"{start.name}*"), key=lambda p: p == lock):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep a lock as long as this process lives; whoever gets it later may tidy up."""
    if fcntl is None:
        yield
        path.unlink(missing_ok=True)
        return
    while True:
        file = path.open("wb")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # no locks on this drive, so that nobody else gets it either
            break
        if path.exists() and os.path.samestat(path.stat(), os.fstat(file.fileno())):
            break
        file.close()  # somebody tidied it up before it was locked
    with file:
        yield
        path.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    """Wait until a file is on the disk: else it may be empty after a loss of power."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def ending_signals() -> list[signal.Signals]:
    """Signals that tell a program to end; what is ignored, such as SIGHUP below nohup, stays so."""
    kinds = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    return [kind for kind in kinds if signal.getsignal(kind) is not signal.SIG_IGN]


@contextmanager
def ended_by_exception() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into an exception, so that what was begun is cleaned up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    kinds = ending_signals()

    def end(number: int, _: object) -> None:
        for kind in kinds:
            signal.signal(kind, signal.SIG_IGN)  # once is enough
        sys.exit(128 + number)

    before = {kind: signal.signal(kind, end) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, signal.SIG_DFL if handler is None else handler)
