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
from pathlib import Path

from usdhand.errors import OutputError

try:
    import fcntl
except ImportError:  # not on this system: what killed programs leave is not removed
    fcntl = None  # type: ignore[assignment]

PREFIX = ".usdhand."
LOCK = ".tmp.lock"
_numbers = itertools.count()
_tidied: set[Path] = set()


@contextmanager
def written_beside(output: Path) -> Iterator[Path]:
    """A path in the output's folder that replaces it once the block has ended without an error.

    It is removed also when the program is told to end. What is left of a program that was killed is
    removed by the next one that writes to the folder.
    """
    folder = output.absolute().parent
    tidy(folder)
    name = f"{PREFIX}{os.getpid()}.{next(_numbers)}"
    temporary = output.with_name(f"{name}.tmp{output.suffix}")
    try:
        with _ended_by_exception(), _locked(output.with_name(f"{name}{LOCK}")):
            try:
                yield temporary
                _to_disk(temporary)
                os.replace(temporary, output)  # noqa: PTH105  (atomic on every system)
            finally:
                temporary.unlink(missing_ok=True)
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
                for path in folder.glob(f"{lock.name.removesuffix('.lock')}*"):
                    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        except OSError:  # its program is at work, or it is not ours to remove
            continue


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Keep a lock as long as this process lives; whoever gets it later may tidy up."""
    if fcntl is None:
        yield
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
        try:
            yield
        finally:
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
def _ended_by_exception() -> Iterator[None]:
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
