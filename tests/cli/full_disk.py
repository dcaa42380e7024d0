"""A disk that is full after so many pages, for every writer: old files or new ones.

usage: unshare --map-root-user --mount python full_disk.py SIZES [NAME]

A small drive in memory stands for the disk, and children of one process for the program. SIZES are
tried of each writer, or all from none to enough if it is 0. Prints how many times it was full.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

# Children are forked from a process that has done everything once, where no thread may run.
os.environ |= {"PXR_WORK_THREAD_LIMIT": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "agg"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from builders.crashing import writers

import usdhand
from usdhand.cli.main import main
from usdhand.formats.atomic import PREFIX

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
PAGE = 4096
DRIVE = "48m"
Files = dict[str, bytes]


def commands(folder: Path) -> dict[str, list[str]]:
    """Return every writer, those of more than one file included."""
    clip, report, plots = SAMPLES / "gestures" / "ok_01.usdc", folder / "q.json", folder / "plots"
    more = ["--report", str(report), "--plots", str(plots), "--force"]
    made = {name: arguments for name, (arguments, _) in writers(folder, SAMPLES).items()}
    return made | {"report": ["reduce", str(clip), "-o", str(folder / "q.usda"), *more]}


def files(folder: Path) -> Files:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def called(arguments: list[str]) -> tuple[int, str]:
    """Exit code and messages of the program in a child."""
    with tempfile.TemporaryFile(dir="/dev/shm") as said:
        child = os.fork()
        if not child:
            try:
                os.dup2(said.fileno(), 1)
                os.dup2(said.fileno(), 2)
                main(arguments)
            except SystemExit as end:
                os._exit(int(end.code or 0))
            finally:
                os._exit(99)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said.seek(0)
        return code, said.read().decode(errors="replace")


def check(name: str, arguments: list[str], folder: Path, sizes: int) -> int:
    """See what is there after the disk was full at any page; how often it was."""
    others = files(folder)
    code, said = called(arguments)
    assert code == 0, f"{name}: {code} {said}"
    new = {path: data for path, data in files(folder).items() if others.get(path) != data}
    pages = sum(len(data) // PAGE + 2 for data in new.values())
    tried: list[int] = list(range(2 * pages + 4))
    if sizes:
        tried = sorted({0, 1, *random.Random(name).sample(range(pages), min(sizes, pages))})
    times = 0
    for free in tried:
        library = name.startswith("library")  # the old one is read first
        old = dict.fromkeys(new, others["library.usdc"] if library else b"old")
        for path, data in old.items():
            (folder / path).write_bytes(data)
        filler = folder.parent / "filler"
        with filler.open("wb") as file:
            drive = os.statvfs(folder)
            if (size := (drive.f_bavail - free) * drive.f_frsize) > 0:
                os.posix_fallocate(file.fileno(), 0, size)
        code, said = called(arguments)
        filler.unlink()
        where = f"{name} with {free} pages: {code} {said}"
        assert "Traceback" not in said, where
        assert "unexpected" not in said, where
        found = files(folder)
        assert not [path for path in found if path not in others | new], f"{where} {list(found)}"
        for path, data in found.items():
            assert data in (others.get(path), old.get(path), new.get(path)), f"{where}: {path}"
        parts = [path for path in new if path.endswith((".usda", ".motion.usdc"))]
        whole = {found[path] == new[path] for path in parts}
        assert len(whole) < 2, f"{where}: half of a pair"
        if code == 0:
            assert all(found[path] == data for path, data in new.items()), where
            if not sizes:
                break
        times += code != 0
    code, said = called(arguments)
    found = files(folder)
    assert code == 0, f"{name}: {said}"
    assert found == others | new, f"{name}: {list(found)}"
    assert not list(folder.glob(f"{PREFIX}*"))
    return times


def run(sizes: int, only: str = "") -> int:
    drive = Path(tempfile.mkdtemp())
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DRIVE}", "tmpfs", drive], check=True)
    try:
        folder = drive / "out"
        folder.mkdir()
        clips = [SAMPLES / "gestures" / f"{name}.usdc" for name in ("ok_01", "ok_02", "big_01")]
        library = folder / "library.usdc"
        usdhand.write_library(usdhand.build_library(clips, library).library, library)
        chosen = {name: a for name, a in commands(folder).items() if only in name}
        return sum(check(name, a, folder, sizes) for name, a in chosen.items())
    finally:
        subprocess.run(["umount", "-l", drive], check=True)
        drive.rmdir()


if __name__ == "__main__":
    print(run(int(sys.argv[1]), *sys.argv[2:]))
