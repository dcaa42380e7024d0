"""Damaged files of every kind through the verbs, in forked children with limits.

usage: python campaign.py [--tries N] [--seed N] [--formats bvh,usda,...] [--keep FOLDER]
    [--corpus FOLDER] [--minutes M]

Of each try, one of these comes: it works, and no value that was written is not finite; it is
refused in words, and nothing was written; USD crashes, which the program's own guard tells. All
else is a failure: another error, a crash in a format that is not USD's, 10 s of the processor,
1 GB more memory.
"""

from __future__ import annotations

import argparse
import collections
import importlib
import os
import pickle
import random
import re
import resource
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from fuzz.mutations import damaged

SECONDS = 10
STUCK_S = 120.0  # without an answer, on a busy machine
GROWTH = 1 << 30
ROUND = 40  # tries a child
NOT_FINITE = re.compile(rb"(?<![\w.\"])(?:nan|-?inf)(?![\w\"])")
USD = ("usda", "usdc", "usdz", "rig.usda", "rig.usdc", "library.usdc")
SHARES = {
    "bvh": 20,
    "usda": 20,
    "usdc": 20,
    "usdz": 6,
    "glb": 10,
    "gltf": 10,
    "fbx": 1,
    "rig.usda": 4,
    "rig.usdc": 4,
    "library.usdc": 4,
    "fill.json": 4,
    "splice.json": 4,
    "map.toml": 4,
}
USED = (
    *(f"verbs.{verb}" for verb in ("inspect", "convert", "reduce", "preview", "check", "expand")),
    *(f"verbs.{verb}" for verb in ("library_info", "fill", "rerun")),
    *(f"formats.{name}" for name in ("bvh.read", "bvh.write", "gltf.read", "gltf.write")),
    "formats.fbx.read",
)


@dataclass(frozen=True)
class Try:
    """One damaged file: its kind, and the number that its damage and its verb follow from.

    One that failed before is in a file.
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


@dataclass(frozen=True)
class Result:
    """What came of a try: "works", "refused", "crashed", or what is wrong."""

    what: str
    detail: str = ""

    @property
    def failed(self) -> bool:
        return self.what not in ("works", "refused", "crashed")


def requests(kind: str, file: Path, seeds: Path, number: int) -> list[object]:
    """What is asked of a damaged file."""
    from usdhand.requests.check import CheckRequest
    from usdhand.requests.convert import ConvertRequest
    from usdhand.requests.expand import ExpandRequest
    from usdhand.requests.fill import FillRequest
    from usdhand.requests.inspect import InspectRequest
    from usdhand.requests.library import LibraryInfoRequest
    from usdhand.requests.preview import PreviewRequest
    from usdhand.requests.reduce import ReduceRequest
    from usdhand.requests.rerun import RerunRequest

    folder, name = file.parent, str(file)
    if kind.startswith("rig."):
        return [ExpandRequest(rig=file, output=folder / "out.usda")]
    if kind.startswith("library."):
        out = folder / "out.usda"
        filling = FillRequest(body=seeds / "body.usdc", library=file, output=out, replace=True)
        return [LibraryInfoRequest(library=file), *([filling] if number % 4 == 0 else [])]
    if kind.endswith(".json"):
        shown = str(seeds / ("filled.usdc" if kind == "fill.json" else "spliced.usdc"))
        page = folder / "out.html"
        return [
            PreviewRequest(files=(shown,), reports=(file,), output=page),
            RerunRequest(report_file=file, output=folder / "out.usda"),
        ][number % 2 :][:1]
    if kind == "map.toml":
        return [InspectRequest(files=(str(seeds / "s.bvh"),), maps=(file,))]
    onto = seeds / "s.usdc"
    others: list[object] = [
        ConvertRequest(files=(name,), output=folder / "out.usda"),
        ConvertRequest(files=(name,), output=folder / "out.bvh"),
        ConvertRequest(files=(name,), output=folder / "out.glb"),
        ConvertRequest(files=(name,), output=folder / "out.usda", onto=onto),
        ReduceRequest(clips=(name,), output=folder / "out.usda"),
        PreviewRequest(files=(name,), output=folder / "out.html"),
    ]
    if kind in USD:
        others.append(CheckRequest(files=(name,)))
    return [InspectRequest(files=(name,)), others[number % len(others)]]


def judge(tried: Try, content: bytes, folder: Path, seeds: Path) -> Result:
    """Do what is asked of a damaged file, and say what came of it."""
    from usdhand.errors import UsdHandError
    from usdhand.verbs.run import run

    file = folder / f"t{tried.number}.{tried.kind.rpartition('.')[2]}"
    file.write_bytes(content)
    what = Result("refused")
    try:
        for request in requests(tried.kind, file, seeds, tried.number):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    code = run(request).exit_code  # type: ignore[arg-type]
                    what = Result("refused" if code else "works")
                except UsdHandError as error:
                    what = Result("refused")
                    str(error).encode("utf-8", "backslashreplace")
                    if left := [p.name for p in folder.iterdir() if p != file]:
                        return Result("left behind", f"{type(request).__name__} {left}: {error}")
        for path in folder.glob("out.*"):
            if path.suffix in (".usda", ".bvh") and (found := NOT_FINITE.search(path.read_bytes())):
                return Result("not finite", f"{path.name} at {found.start()}")
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)
        own = [f"{Path(f.filename).name}:{f.lineno}" for f in where if "usdhand" in f.filename]
        return Result(type(error).__name__, f"{' '.join(own[-3:])} {str(error)[:150]}")
    finally:
        for path in folder.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    return what


def campaign(tries: list[Try], seeds: Path) -> Iterator[tuple[Try, Result]]:
    """Judge all tries in children that die alone."""
    import_all()
    for start in range(0, len(tries), ROUND):
        left = tries[start : start + ROUND]
        while left:
            done = 0
            for result in _child(left, seeds):
                yield left[done], result
                done += 1
            left = left[done:]


def import_all() -> None:
    """Import what the verbs need before children are forked; no stage is opened here."""
    for name in USED:
        importlib.import_module(f"usdhand.{name}")


def _child(tries: list[Try], seeds: Path) -> Iterator[Result]:
    """Results of tries by a child, the last one that of its death."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        _work(tries, seeds, writer)
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
    size = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (size + GROWTH, size + GROWTH))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as name:
        for tried in tries:
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            result = judge(tried, tried.content(seeds), Path(name), seeds)
            if not result.failed and (said := _noise(noise.fileno())):
                result = Result("noise", said)
            answer = pickle.dumps(result)
            os.write(writer, struct.pack("<I", len(answer)) + answer)
    os._exit(0)


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
    rounds = sorted(zip(drawn, numbers, strict=True), key=lambda x: (x[1] // 2000, x[0]))
    return [Try(kind, number) for kind, number in rounds]


def make_seeds(folder: Path) -> None:
    """In another process, so that no thread runs where children are forked."""
    script = Path(__file__).with_name("seeds.py")
    path = os.pathsep.join(p for p in sys.path if p)
    subprocess.run(
        [sys.executable, script, folder], check=True, env=os.environ | {"PYTHONPATH": path}
    )


def report(counts: dict[str, collections.Counter[str]]) -> str:
    """Say how many tries of each kind came to what."""
    whats = sorted({what for kind in counts.values() for what in kind})
    lines = [" ".join([f"{'kind':14}", *(f"{what:>12}" for what in whats), f"{'tries':>8}"])]
    for kind, count in sorted(counts.items()):
        row = [f"{kind:14}", *(f"{count[what]:12}" for what in whats), f"{sum(count.values()):8}"]
        lines.append(" ".join(row))
    return "\n".join([*lines, f"{sum(sum(count.values()) for count in counts.values())} tries"])


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
    given = parser.parse_args()
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    end, failed = time.monotonic() + 60.0 * given.minutes, 0
    with tempfile.TemporaryDirectory() as name:
        seeds = Path(name)
        make_seeds(seeds)
        drawn = planned(given.tries, given.seed, given.formats.split(","))
        for tried, result in campaign(kept(given.corpus) if given.corpus else drawn, seeds):
            counts[tried.kind][result.what] += 1
            if result.what not in ("works", "refused"):
                failed += result.failed
                print(tried.kind, tried.number, result.what, result.detail, flush=True)
                if given.keep:
                    keep(tried, result, given.keep, seeds)
            if time.monotonic() > end:
                break
    print(report(counts))
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
