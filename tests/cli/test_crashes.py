"""A file that crashes USD is named, and takes nothing with it; processes end with their parents."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from builders.crashing import crashing, short_clip
from builders.in_memory import in_memory, sample

import usdhand
from usdhand.errors import CancelledError, CrashedError, InputError, UnforeseenError, UsageError
from usdhand.requests.convert import ConvertRequest
from usdhand.verbs.run import run
from usdhand.workers import each_apart

REPOSITORY = Path(__file__).resolve().parents[2]
posix = pytest.mark.skipif(os.name != "posix", reason="this system has no fork and no signals")


def shell(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "usdhand", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment())


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(REPOSITORY)}


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clips")
    crashing(folder / "crashes.usdc")
    for name in ("a.bvh", "b.usdc"):
        usdhand.write_new(short_clip(), folder / name)
    return folder


@posix
@pytest.mark.parametrize(
    "arguments",
    [
        ("inspect", "crashes.usdc"),
        ("convert", "crashes.usdc", "-o", "out.bvh"),
        ("convert", "a.bvh", "--onto", "crashes.usdc", "-o", "out.usda"),
        ("reduce", "b.usdc", "crashes.usdc", "-o", "rigs"),
        ("library", "info", "crashes.usdc"),
        ("check", "crashes.usdc"),
        ("preview", "a.bvh", "crashes.usdc", "-o", "out.html"),
    ],
    ids=" ".join,
)
def test_a_single_run_ends_with_a_message(clips: Path, arguments: tuple[str, ...]) -> None:
    before = sorted(clips.iterdir())
    done = shell(*arguments, cwd=clips)
    assert done.returncode == 3
    assert "crashes.usdc: USD crashed while this file was read (SIG" in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(clips.iterdir()) == before


@posix
def test_a_batch_goes_on(clips: Path, tmp_path: Path) -> None:
    done = shell("inspect", "a.bvh", "crashes.usdc", "b.usdc", "--json", cwd=clips)
    assert done.returncode == 3
    assert "crashes.usdc: USD crashed" in done.stderr
    document = json.loads(done.stdout)
    assert ["error" in file for file in document["files"]] == [False, True, False]
    problems = document["outcome"]["problems"]
    assert [p["code"] for p in problems if p["severity"] == "error"] == ["crashed"]
    files = ("a.bvh", "crashes.usdc", "b.usdc", "none.usdc")
    done = shell("convert", *files, "--out-dir", tmp_path, "--to", "bvh", cwd=clips)
    assert done.returncode == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.bvh", "b.bvh"]


@posix
def test_a_library_is_built_of_the_others(tmp_path: Path) -> None:
    for name in ("ok_01", "ok_02"):
        usdhand.write_new(in_memory(sample(f"gestures/{name}")), tmp_path / f"{name}.usdc")
    crashing(tmp_path / "crashes.usdc")
    build = ("library", "build", tmp_path, "-o", tmp_path / "l.usdc", "--rebuild", "--json")
    for jobs in (1, 2):
        done = shell(*build, "--jobs", jobs)
        assert done.returncode == 0, done.stderr
        assert "left out: crashes.usdc: USD crashed" in done.stderr
        assert json.loads(done.stdout)["read"] == 2


def test_names_in_several_formats_keep_their_suffixes(tmp_path: Path) -> None:
    for name in ("s.bvh", "s.usdc", "t.bvh"):
        usdhand.write_new(short_clip(), tmp_path / name)
    files = tuple(str(tmp_path / name) for name in ("s.bvh", "s.usdc", "t.bvh"))
    out = tmp_path / "out"
    run(ConvertRequest(files=files, out_dir=out, to="usda"))
    assert sorted(p.name for p in out.iterdir()) == ["s.bvh.usda", "s.usdc.usda", "t.usda"]


# -- workers ------------------------------------------------------------------------------------


def work(item: object) -> object:
    if item == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if item == "exits":
        os._exit(7)
    if item == "refused":
        raise UsageError("no")
    if item == "unforeseen":
        raise KeyError("what")
    print("noise")
    return os.getpid(), item


@posix
@pytest.mark.parametrize("jobs", [1, 3])
def test_whatever_an_item_does_the_others_are_done(jobs: int) -> None:
    items = ["a", "dies", "b", "refused", "exits", "unforeseen", "c", "dies", "d"]
    found = list(each_apart(work, items, jobs))
    if jobs == 1:
        assert [item for item, _ in found] == items
    assert sorted(item for item, _ in found) == sorted(items)
    kinds = {"refused": UsageError, "unforeseen": UnforeseenError}
    kinds |= dict.fromkeys(("dies", "exits"), CrashedError)
    for item, result in found:
        assert isinstance(result, kinds.get(item, tuple)), result
        if item in "abcd":
            assert result[1] == item
            assert result[0] != os.getpid()
    said = {item: str(result) for item, result in found}
    assert "SIGKILL, which often means" in said["dies"]
    assert "exit code 7" in said["exits"]
    assert "KeyError" in said["unforeseen"]


def test_a_single_item_is_worked_on_here() -> None:
    assert list(each_apart(work, ["a"])) == [("a", (os.getpid(), "a"))]
    with pytest.raises(KeyError):
        list(each_apart(work, ["unforeseen"]))
    assert isinstance(next(each_apart(work, ["refused"]))[1], UsageError)


def forever(item: str) -> None:
    Path(item).write_text(str(os.getpid()))
    time.sleep(600)


@posix
def test_workers_end_when_nobody_wants_more(tmp_path: Path) -> None:
    items = [str(tmp_path / name) for name in "ab"]
    results = each_apart(sleeping, [*items, "quick"], 3)
    assert next(results)[0] == "quick"
    pids = [wait_for(Path(item)) for item in items]
    results.close()
    assert all(ended(pid) for pid in pids)


def test_whoever_watches_stops_workers_too(tmp_path: Path) -> None:
    for name in ("a.bvh", "b.bvh", "c.bvh"):
        usdhand.write_new(short_clip(), tmp_path / name)
    files = tuple(str(tmp_path / name) for name in ("a.bvh", "b.bvh", "c.bvh"))
    request = ConvertRequest(files=files, out_dir=tmp_path / "out", to="bvh")
    before = threading.active_count()
    with pytest.raises(CancelledError) as stopped:
        run(request, watch=lambda *_: False)
    assert threading.active_count() == before, "no worker is left behind the error"
    assert stopped.value.exit_code == 130


def sleeping(item: str) -> str:
    if item != "quick":
        forever(item)
    return item


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends children with their parent")
def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    code = (
        "import sys; from cli.test_crashes import forever; from usdhand.workers import each_apart\n"
        f"list(each_apart(forever, [{str(tmp_path / 'a')!r}, {str(tmp_path / 'b')!r}], 2))"
    )
    own = environment()
    own["PYTHONPATH"] += os.pathsep + str(REPOSITORY / "tests")
    with subprocess.Popen([sys.executable, "-c", code], env=own) as parent:
        pids = [wait_for(tmp_path / name) for name in "ab"]
        parent.kill()
    assert all(ended(pid) for pid in pids)


def wait_for(path: Path) -> int:
    while not path.exists() or not path.read_text():
        time.sleep(0.02)
    return int(path.read_text())


def ended(pid: int) -> bool:
    for _ in range(500):
        try:
            os.kill(pid, 0)
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (ProcessLookupError, FileNotFoundError):
            return True
        time.sleep(0.02)
    return False


# -- interruptions ------------------------------------------------------------------------------


@posix
@pytest.mark.parametrize("seconds", [0.12, 0.25, 0.4])
def test_ctrl_c_ends_with_130_also_during_imports(tmp_path: Path, seconds: float) -> None:
    """It goes to all processes of the terminal."""
    command = [sys.executable, "-m", "usdhand", "evaluate", str(tmp_path / "none.usdc")]
    for _ in range(3):
        with subprocess.Popen(
            command, env=environment(), stderr=subprocess.PIPE, start_new_session=True, text=True
        ) as process:
            time.sleep(seconds)
            os.killpg(process.pid, signal.SIGINT)
            said = process.communicate()[1]
        # It may have been earlier than any line of ours, or too late.
        assert process.returncode in (130, 3, -signal.SIGINT), said
        if process.returncode == 130:
            assert "Traceback" not in said
            assert said.strip() == "Interrupted."
            return


@posix
def test_interrupted_imports_that_make_errors_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from usdhand.cli import entry, interrupt

    def interrupted(*_: object) -> None:
        try:
            interrupt.interrupt()
        except KeyboardInterrupt as error:
            raise ImportError("numpy failed to import") from error

    monkeypatch.setattr("usdhand.cli.main.main", interrupted)
    monkeypatch.setattr(interrupt.Interrupt, "came", False)
    with pytest.raises(SystemExit) as ended_with:
        entry._work()
    assert ended_with.value.code == 130


@posix
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_reach_the_work(clips: Path, tmp_path: Path, number: signal.Signals) -> None:
    command = [
        sys.executable,
        "-m",
        "usdhand",
        "preview",
        str(clips / "b.usdc"),
        "-o",
        str(tmp_path / "p.html"),
    ]
    with subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE) as process:
        time.sleep(0.3)
        process.send_signal(number)
        process.communicate()
    assert process.returncode in (128 + number, -number, 0)
    left = [p.name for p in tmp_path.iterdir()]
    assert left == (["p.html"] if process.returncode == 0 else [])


def test_errors_of_files_have_their_exit_codes() -> None:
    assert issubclass(CrashedError, InputError)
    assert (CrashedError.exit_code, UnforeseenError.exit_code) == (3, 1)


@posix
def test_nothing_but_our_own_words_reaches_people(tmp_path: Path) -> None:
    """USD prints to the number of stderr when a table of a crate is said to lie beyond its end."""
    path = tmp_path / "beyond.usdc"
    usdhand.write_new(short_clip(), path)
    data = bytearray(path.read_bytes())
    table = int.from_bytes(data[16:24], "little")
    data[table + 24 : table + 32] = (4_110_440_000).to_bytes(8, "little")
    path.write_bytes(data)
    done = shell("inspect", path)
    assert done.returncode == 3
    assert done.stdout == ""
    assert done.stderr.startswith(f"Error: {path}")
    assert len(done.stderr.splitlines()) == 1
    text = tmp_path / "long.usda"
    text.write_text('#usda 1.0\ndef Xform "a" { double x = ' + "z" * 9000 + " }\n")
    done = shell("inspect", text)
    assert done.returncode == 3
    assert len(done.stderr) < 500
