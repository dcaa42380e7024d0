"""Work that is done once a session, whichever worker of pytest-xdist asks for it first."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import re
import shlex
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from builders.cli_runner import run
from conftest import REPOSITORY

FEW = ("ok_01", "ok_02", "big_01", "big_02")


@dataclass(frozen=True)
class SharedWork:
    """Folders that are made once and only read from then on, one a key."""

    root: Path

    def folder(self, key: str, make: Callable[[Path], object]) -> Path:
        """The folder that `make` fills; where that fails nothing is kept, and the next fails."""
        place, unfinished = self.root / key, self.root / f"{key}.part"
        with self._alone(key):
            if not place.exists():
                shutil.rmtree(unfinished, ignore_errors=True)
                unfinished.mkdir(parents=True)
                make(unfinished)
                unfinished.rename(place)
        return place

    @contextlib.contextmanager
    def _alone(self, key: str) -> Iterator[None]:
        self.root.mkdir(parents=True, exist_ok=True)
        with (self.root / f"{key}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # let go of by the system, whatever ends the process
            yield


@dataclass(frozen=True)
class Shell:
    """What a reader of a page has in front of them: the samples, and what was made from them.

    Attributes
    ----------
    work : where lines are run, each once for all that show it on the same files
    made : folder of `work` by the path of every file there is
    """

    work: SharedWork
    made: Mapping[str, Path]

    def after(self, line: str) -> Shell:
        """After one more line: a command, or whole Python code.

        It is run in a folder with the files that it names, and with those that they were made
        from; so a line that writes what is there already fails as it would for a reader.
        """
        words = set(re.findall(r"[\w./-]+", line))
        named = {at for path, at in self.made.items() if {path, path.split("/")[0]} & words}
        sources = sorted(named)
        text = "\n".join([line, *(at.name for at in sources)])
        key = hashlib.sha256(text.encode()).hexdigest()[:20]
        place = self.work.folder(key, lambda folder: _run(line, folder, sources))
        files = [p.relative_to(place) for p in place.rglob("*") if p.is_file()]
        come = {
            f.as_posix(): place
            for f in files
            if not any(_same(at / f, place / f) for at in sources)
        }
        return Shell(self.work, {**self.made, **come})


def few_gestures(work: SharedWork) -> Path:
    """A library of four samples, for reading only."""
    files = (REPOSITORY / "samples" / "gestures" / f"{name}.usdc" for name in FEW)
    made = work.folder("few", lambda at: run("library", "build", *files, "-o", at / "few.usdc"))
    return made / "few.usdc"


def _same(one: Path, other: Path) -> bool:
    """Whether a file is a copy of another that nothing was written over."""
    if not one.is_file():
        return False
    a, b = one.stat(), other.stat()
    return (a.st_size, a.st_mtime_ns) == (b.st_size, b.st_mtime_ns)


def _run(line: str, folder: Path, sources: list[Path]) -> None:
    for source in sources:
        shutil.copytree(
            source, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("samples")
        )
    (folder / "samples").symlink_to(REPOSITORY / "samples")
    with contextlib.chdir(folder):
        if not line.startswith("usdhand "):
            exec(compile(line, "<page>", "exec"), {})
            return
        run(*shlex.split(line)[1:])
