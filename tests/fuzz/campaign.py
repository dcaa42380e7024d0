"""Damaged files of every kind through the verbs, in forked children with limits.

usage: python campaign.py [--tries N] [--seed N] [--formats bvh,usda,...] [--keep FOLDER]
    [--corpus FOLDER] [--minutes M] [--counts FILE]

Of each try, one of these comes: it works, and no value that was written is not finite; it is
refused in words, and nothing was written; USD crashes, which the program's own guard tells. All
else is a failure: another error, a crash in a format that is not USD's, 10 s of the processor,
1 GB more memory, anything printed past the program's own messages.
"""

from __future__ import annotations

import argparse
import collections
import gc
import json
import os
import pickle
import random
import resource
import select
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Children are forked from a process that has done everything once, where no thread may run.
os.environ |= {"PXR_WORK_THREAD_LIMIT": "1", "OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from builders.report_schemas import judged
from pxr import Work

from fuzz.asked import USD, requests
from fuzz.judged import Result, judge
from fuzz.mutations import damaged

SECONDS = 10
STUCK_S = 120.0  # without an answer, on a busy machine
GROWTH = 1 << 30
# USD makes room for what a damaged crate claims to hold before it looks how long the file is, and
# then refuses it: that growth is its own, and limited by MOST alone.
CRATES = ("usdc", "usdz")
MOST = 3 << 30  # more is refused by the system, which may end a library without a word
ROUND = 100  # tries a child
TURN = 2000  # tries in which every kind has its share
TOLD_S = 60.0
SHARES = {
    "bvh": 18,
    "usda": 18,
    "usdc": 18,
    "usdz": 8,
    "glb": 8,
    "gltf": 8,
    "fbx": 2,
    "rig.usda": 4,
    "rig.usdc": 4,
    "library.usdc": 3,
    "fill.json": 3,
    "splice.json": 3,
    "map.toml": 4,
    "edits.json": 3,
}
WARMING = ("usdc", "bvh", "glb", "rig.usda", "library.usdc", "fill.json", "map.toml")


@dataclass(frozen=True)
class Try:
    """One damaged file: its kind, and the number that its damage and its verb follow from.

    One that failed before is in a file, and goes through all verbs.
    """

    kind: str
    number: int
    file: Path | None = None

    @property
    def seed(self) -> str:
        return self.kind if self.kind.count(".") else f"s.{self.kind}"

    def content(self, seeds: Path) -> bytes:
        if self.file is not None:
            return self.file.read_bytes().replace(b"SEEDS", os.fsencode(seeds))
        rng = random.Random(f"{self.kind} {self.number}")
        return damaged((seeds / self.seed).read_bytes(), self.kind.rpartition(".")[2], rng)

    def result(self, folder: Path, seeds: Path) -> Result:
        file = folder / f"t{self.number}.{self.kind.rpartition('.')[2]}"
        content = self.content(seeds)
        file.write_bytes(content)
        number = None if self.file is not None else self.number
        result = judge(requests(self.kind, file, seeds, number), file)
        return result if file.read_bytes() == content else Result("input changed")


def campaign(tries: list[Try], seeds: Path) -> Iterator[tuple[Try, Result]]:
    """Judge all tries in children that die alone."""
    warm_up(seeds)
    for start in range(0, len(tries), ROUND):
        left = tries[start : start + ROUND]
        while left:
            done = 0
            for result in _child(left, seeds):
                yield left[done], result
                done += 1
            left = left[done:]


def warm_up(seeds: Path) -> None:
    """Do once what children do, with files that are sound."""
    Work.SetConcurrencyLimit = lambda _: None  # it stays one, without a thread to see to that
    with tempfile.TemporaryDirectory() as name, judged():
        for kind in WARMING:
            sound = Try(kind, 0, seeds / Try(kind, 0).seed)
            result = sound.result(Path(name), seeds)
            next(Path(name).iterdir()).unlink()
            if result.what not in ("works", "refused"):
                raise AssertionError(f"a sound {kind} file: {result}")
    end = time.monotonic() + SECONDS
    while threads := list(Path("/proc/self/task").iterdir())[1:]:  # some may be about to end
        if time.monotonic() > end:
            raise AssertionError(f"{len(threads)} threads would be lost in children")
        time.sleep(0.05)
    gc.freeze()  # so that children share this memory


def _child(tries: list[Try], seeds: Path) -> Iterator[Result]:
    """Results of tries by a child, the last one that of its death."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        try:
            _work(tries, seeds, writer)
        finally:  # whatever happens: what stands behind the fork is the parent's
            os._exit(1)
    os.close(writer)
    told = 0
    with os.fdopen(reader, "rb") as answers:
        while told < len(tries):
            if not select.select([answers], [], [], STUCK_S)[0]:
                os.kill(child, signal.SIGKILL)
            head = answers.read(4)
            if len(head) < 4:
                break
            told += 1
            yield pickle.loads(answers.read(struct.unpack("<I", head)[0]))
    _, status = os.waitpid(child, 0)
    if told < len(tries):
        yield _death(os.waitstatus_to_exitcode(status), tries[told].kind)


def _death(code: int, kind: str) -> Result:
    name = signal.Signals(-code).name if code < 0 else f"exit {code}"
    if name in ("SIGPROF", "SIGKILL"):
        return Result("hang", name)
    usd = kind in USD and code < 0
    return Result("crashed" if usd else "crash", name)


def _work(tries: list[Try], seeds: Path, writer: int) -> None:
    noise = tempfile.TemporaryFile()  # noqa: SIM115  (it lives as long as the child)
    os.dup2(noise.fileno(), 1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # the command line drops it as well
    sys.stderr = sys.stdout
    data = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (data + MOST, data + MOST))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as name, judged():
        for tried in tries:
            before = _most_memory(reset=True)
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            result = tried.result(Path(name), seeds)
            next(Path(name).iterdir()).unlink()
            usd_s_own = result.what == "refused" and tried.kind.endswith(CRATES)
            grown = _most_memory() - before
            if not result.failed and not usd_s_own and grown > GROWTH:
                result = Result("growth", f"{grown >> 20} MB")
            if not result.failed and (said := _noise(noise.fileno())):
                result = Result("noise", said)
            answer = pickle.dumps(result)
            os.write(writer, struct.pack("<I", len(answer)) + answer)


def _most_memory(reset: bool = False) -> int:
    """Most bytes that were in memory since the last reset."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) << 10


def _noise(number: int) -> str:
    """What was printed past the program's own messages."""
    sys.stdout.flush()
    size = os.lseek(number, 0, os.SEEK_CUR)
    os.lseek(number, 0, os.SEEK_SET)
    said = os.read(number, min(size, 150)).decode(errors="backslashreplace")
    os.ftruncate(number, 0)
    os.lseek(number, 0, os.SEEK_SET)
    return said


def planned(count: int, seed: int, kinds: list[str]) -> list[Try]:
    """Tries in the shares of their kinds; kinds in turn, so that any part of them is mixed."""
    rng = random.Random(seed)
    weights = [SHARES[kind] for kind in kinds]
    numbers = range(seed * 10_000_000, seed * 10_000_000 + count)
    drawn = rng.choices(kinds, weights, k=count)
    rounds = sorted(zip(drawn, numbers, strict=True), key=lambda x: (x[1] // TURN, x[0]))
    return [Try(kind, number) for kind, number in rounds]


def make_seeds(folder: Path) -> None:
    """In another process, so that no thread runs where children are forked."""
    script = Path(__file__).with_name("seeds.py")
    path = os.pathsep.join(p for p in sys.path if p)
    subprocess.run(
        [sys.executable, script, folder], check=True, env=os.environ | {"PYTHONPATH": path}
    )


def report(counts: dict[str, collections.Counter[str]], seconds: float) -> str:
    """Say how many tries of each kind came to what."""
    whats = sorted({what for kind in counts.values() for what in kind})
    lines = [" ".join([f"{'kind':14}", *(f"{what:>12}" for what in whats), f"{'tries':>8}"])]
    for kind, count in sorted(counts.items()):
        row = [f"{kind:14}", *(f"{count[what]:12}" for what in whats), f"{sum(count.values()):8}"]
        lines.append(" ".join(row))
    total = sum(sum(count.values()) for count in counts.values())
    return "\n".join([*lines, f"{total} tries, {total / seconds:.1f} a second"])


def kept(folder: Path) -> list[Try]:
    """Inputs that failed before: NAME_NUMBER_SEED."""
    tries = []
    for file in sorted(folder.iterdir()):
        _, number, seed = file.name.rsplit("_", 2)
        tries.append(Try(seed.removeprefix("s."), int(number), file))
    return tries


def keep(tried: Try, result: Result, folder: Path, seeds: Path) -> None:
    """Keep an input that failed."""
    folder.mkdir(exist_ok=True, parents=True)
    name = f"{result.what.replace(' ', '-')}_{tried.number}_{tried.seed}"
    (folder / name).write_bytes(tried.content(seeds).replace(os.fsencode(seeds), b"SEEDS"))


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--formats", default=",".join(SHARES))
    parser.add_argument("--corpus", type=Path, help="folder of inputs that failed before, instead")
    parser.add_argument("--keep", type=Path, help="folder for inputs that failed or crashed USD")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--counts", type=Path, help="file for the counts as JSON, once a minute")
    given = parser.parse_args()
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        seeds = Path(name)
        make_seeds(seeds)
        begin = told = time.monotonic()
        drawn = planned(given.tries, given.seed, given.formats.split(","))
        for tried, result in campaign(kept(given.corpus) if given.corpus else drawn, seeds):
            counts[tried.kind][result.what] += 1
            if result.what not in ("works", "refused"):
                failed += result.failed
                print(tried.kind, tried.number, result.what, result.detail, flush=True)
                if given.keep:
                    keep(tried, result, given.keep, seeds)
            now = time.monotonic()
            if given.counts and now > told + TOLD_S:
                told = now
                given.counts.write_text(json.dumps(counts | {"seconds": now - begin}))
            if now > begin + 60.0 * given.minutes:
                break
    print(report(counts, now - begin))
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
