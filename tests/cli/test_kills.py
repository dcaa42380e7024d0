"""Whatever ends a program while it writes: the old file or the new one, and nothing beside it."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from builders.crashing import writers

import usdhand
from usdhand.errors import OutputError
from usdhand.formats import atomic
from usdhand.formats.atomic import PREFIX, written_beside

REPOSITORY = Path(__file__).resolve().parents[2]
SAMPLES = REPOSITORY / "samples"
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
pytestmark = pytest.mark.skipif(os.name != "posix", reason="this system has no signals")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library, and with what each writer writes when nothing happens."""
    folder = tmp_path_factory.mktemp("kills")
    clips = [SAMPLES / "gestures" / f"{name}.usdc" for name in ("ok_01", "ok_02", "big_01")]
    usdhand.write_library(
        usdhand.build_library(clips, folder / "library.usdc").library, folder / "library.usdc"
    )
    return folder


def started(arguments: list[str], limit: int | None = None) -> subprocess.Popen[str]:
    def limited() -> None:
        import resource

        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.Popen(
        [sys.executable, "-m", "usdhand", *arguments],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=limited,
    )


def finished(arguments: list[str]) -> None:
    with started(arguments) as process:
        said = process.communicate()[1]
    assert process.returncode == 0, said


def killed(arguments: list[str], folder: Path, rng: random.Random, usual: float) -> None:
    """Start a writer, and end it at a random moment, or while it writes."""
    number = rng.choice(SIGNALS)
    with started(arguments) as process:
        if rng.random() < 0.5:
            time.sleep(rng.uniform(0.0, usual))
        else:
            while process.poll() is None and not list(folder.glob(f"{PREFIX}*")):
                time.sleep(0.001)
            time.sleep(rng.choice([0.0, 0.002, 0.02]))
        if number == signal.SIGKILL and rng.random() < 0.5:
            process.kill()  # the parent alone
        else:
            with contextlib.suppress(ProcessLookupError):  # it has ended already
                os.killpg(process.pid, number)
        process.communicate()
        wait_for_session(process.pid)


def wait_for_session(leader: int) -> None:
    """Until all processes that a program has started have ended."""
    for _ in range(1000):
        try:
            os.killpg(leader, 0)
        except (ProcessLookupError, PermissionError):
            return
        time.sleep(0.01)
    raise AssertionError("a process has outlived its parent")


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def assert_old_or_new(place: Path, times: int, seed: int) -> None:
    rng = random.Random(seed)
    for name, (arguments, output) in writers(place, SAMPLES).items():
        path = place / output
        begin = time.monotonic()
        finished(arguments)
        usual = time.monotonic() - begin
        new, expected = path.read_bytes(), files(place)
        library = name.startswith("library")  # the old one is read first
        old = (place / "library.usdc").read_bytes() if library else b"old"
        for _ in range(times):
            path.write_bytes(old)
            killed(arguments, place, rng, usual)
            assert path.read_bytes() in (old, new), f"{name}: neither the old file nor the new one"
        finished(arguments)
        assert path.read_bytes() == new, f"{name}: equal runs write other bytes"
        assert files(place) == expected, f"{name}: something was left"


def test_killed_writers_leave_nothing(place: Path) -> None:
    assert_old_or_new(place, 2, 1)


@pytest.mark.slow
def test_three_hundred_kills(place: Path) -> None:
    assert_old_or_new(place, 300 // len(writers(place, SAMPLES)), 2)


@pytest.mark.parametrize("share", [0.0, 0.4, 0.999])
def test_a_full_disk_leaves_the_old_file(place: Path, share: float) -> None:
    """A limit to the size of files stands for it: the same calls fail."""
    for name, (arguments, output) in writers(place, SAMPLES).items():
        path = place / output
        if not path.exists() or path.stat().st_size < 100:
            finished(arguments)
        size = path.stat().st_size
        before = path.read_bytes()
        expected = files(place)
        with started(arguments, int(share * size)) as process:
            said = process.communicate()[1]
        assert process.returncode == 2, f"{name}: {process.returncode} {said}"
        assert "Traceback" not in said
        assert "unexpected" not in said
        assert path.read_bytes() == before, name
        assert files(place) == expected, name


# -- one file -----------------------------------------------------------------------------------


def fails(temporary: Path) -> None:
    temporary.write_text("half")
    raise OSError(28, "No space left on device")


def ends(temporary: Path) -> None:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(5)


@pytest.mark.parametrize(("write", "error"), [(fails, OutputError), (ends, SystemExit)])
def test_a_file_is_whole_or_as_it_was(
    tmp_path: Path, write: Callable[[Path], None], error: type[BaseException]
) -> None:
    path = tmp_path / "out.txt"
    path.write_text("old")
    with pytest.raises(error), written_beside(path) as temporary:
        write(temporary)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out.txt"]
    with written_beside(path) as temporary:
        assert temporary.parent == tmp_path
        temporary.write_text("new")
    assert path.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["out.txt"]


def test_what_is_not_ours_or_in_use_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(atomic, "_tidied", set())
    (tmp_path / f"{PREFIX}1.0.tmp.lock").touch()
    (tmp_path / f"{PREFIX}1.0.tmp.usda").touch()
    (tmp_path / f"{PREFIX}1.0.tmp.abc").mkdir()
    (tmp_path / f"{PREFIX}1.0.tmp.abc" / "flat.usdc").touch()
    (tmp_path / f"{PREFIX}1.1.tmp.usda").touch()  # without a lock
    (tmp_path / ".out.interrupted.usdc").touch()
    with written_beside(tmp_path / "a.txt") as first:
        first.touch()
        monkeypatch.setattr(atomic, "_tidied", set())
        with written_beside(tmp_path / "b.txt") as second:
            second.touch()
            assert first.exists()
    kept = [f"{PREFIX}1.1.tmp.usda", ".out.interrupted.usdc", "a.txt", "b.txt"]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(kept)


def test_signals_that_are_ignored_stay_so(tmp_path: Path) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with written_beside(tmp_path / "out.txt") as temporary:
            temporary.write_text("new")
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
    assert (tmp_path / "out.txt").read_text() == "new"


def test_content_is_on_the_disk_before_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    replace = os.replace
    monkeypatch.setattr(os, "fsync", lambda _: done.append("fsync"))
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append("replace"), replace(a, b)))
    with written_beside(tmp_path / "out.txt") as temporary:
        temporary.write_text("new")
    assert done == ["fsync", "replace"]
