"""Whether two versions of usdhand have the same results, value by value.

Run: python benchmarks/same_results.py BEFORE AFTER [--real FOLDER] [--work FOLDER] [--verbs ...]
         [--quick] [--reuse] [--all] [--tolerance X]

BEFORE and AFTER call the two versions: a path of `usdhand`, or a command such as
"env PYTHONPATH=/a/checkout /an/environment/bin/usdhand". Every command of same_steps.py is run with
both, each in a folder of its own, on copies of the samples and, with --real, of real takes. Then
all that was printed and written is compared: reports key by key (new keys are listed, and are no
difference), USD files at all specs, fields and time samples, glTF, BVH and pages by their numbers,
exit codes and messages. Exit 1 if anything differs that is not named as mended; numbers that differ
by no more than --tolerance are counted by themselves.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import same_inputs
from same_steps import Step, all_steps, chosen
from same_values import Difference, file_differences, text_differences, tree_differences

SAMPLES = Path(__file__).resolve().parent.parent / "samples"
VERSIONS = ("before", "after")
SAID = ".said.json"  # what a step printed, beside what it wrote
SHOWN = 12  # differences of a step, without --all
LONGEST_S = 1200


@dataclass(frozen=True)
class Judged:
    """A step with what it wrote and what of it differs."""

    step: Step
    files: int
    differences: tuple[Difference, ...]
    tolerance: float

    @property
    def changed(self) -> list[Difference]:
        """Without what is only new."""
        return [d for d in self.differences if d.what != "new"]

    @property
    def wrong(self) -> list[Difference]:
        """Without what is only new, or near enough."""
        return [d for d in self.changed if not d.size <= self.tolerance]

    @property
    def state(self) -> str:
        """The column of the table that it counts for."""
        if self.wrong:
            return "mended" if self.step.mended else "differ"
        return "near" if self.changed else "equal"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("before", help="path or command of the version that is right")
    parser.add_argument("after", help="path or command of the version to judge")
    parser.add_argument("--real", type=Path, help="the shared data folder with real takes")
    parser.add_argument("--work", type=Path, help="folder to work in, kept; else a temporary one")
    parser.add_argument("--verbs", nargs="+", default=[], help="these only, or 'bad' inputs")
    parser.add_argument("--quick", action="store_true", help="a part, in under two minutes")
    parser.add_argument("--reuse", action="store_true", help="what BEFORE gave in --work last time")
    parser.add_argument("--tolerance", type=float, default=0.0, help="of numbers (0: none)")
    parser.add_argument("--all", action="store_true", help="print every difference")
    arguments = parser.parse_args()
    with contextlib.ExitStack() as stack:
        work = arguments.work or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        return _compare(work.resolve(), arguments)


def _compare(work: Path, arguments: argparse.Namespace) -> int:
    begun = time.monotonic()
    steps = chosen(all_steps(arguments.real is not None), arguments.verbs, arguments.quick)
    known = (work / "inputs" / "real").exists() == (arguments.real is not None)
    if not (arguments.reuse and known and (work / "inputs" / "made").exists()):
        _make_inputs(work / "inputs", arguments.real)
    inputs = _tree_hash(work / "inputs")
    commands = [shlex.split(arguments.before), shlex.split(arguments.after)]
    for name in VERSIONS:
        if not (arguments.reuse and name == "before"):
            shutil.rmtree(work / name, ignore_errors=True)
        (work / name).mkdir(exist_ok=True)
    with ThreadPoolExecutor(2) as both:
        for i, step in enumerate(steps, 1):
            _progress(f"{i} of {len(steps)}: {step.name}")
            runs = zip(VERSIONS, commands, strict=True)
            list(both.map(lambda run, s=step: _run(s, run[1], work / run[0]), runs))
    _progress("comparing")
    hashes = [_hashes(work / name) for name in VERSIONS]
    judged = [_judge(step, work, hashes, arguments.tolerance) for step in steps]
    _progress("")
    if _tree_hash(work / "inputs") != inputs:
        change = Difference("inputs", "changed", detail="a command wrote to its input")
        judged.append(Judged(Step("inputs", "inputs"), 0, (change,), 0.0))
    _print(judged, SHOWN if not arguments.all else sys.maxsize)
    print(f"\n{len(steps)} commands with each version, {time.monotonic() - begun:.0f} s; in {work}")
    return int(any(j.state == "differ" for j in judged))


def _make_inputs(folder: Path, real: Path | None) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for source, name in ((SAMPLES, "samples"), (real, "real")):
        for path in sorted(source.rglob("*")) if source else ():
            if path.is_file() and path.suffix not in (".md", ".py", ".pyc"):
                target = folder / name / path.relative_to(source)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)
    same_inputs.make(folder / "samples", folder / "made")


def _tree_hash(folder: Path) -> str:
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        found.update(str(path.relative_to(folder)).encode())
        found.update(path.read_bytes() if path.is_file() else b"")
    return found.hexdigest()


def _run(step: Step, command: Sequence[str], folder: Path) -> None:
    """Run a step in the folder of a version, unless it has been."""
    own = folder / step.name
    inputs = {"s": "../inputs/samples", "r": "../inputs/real", "m": "../inputs/made"}
    places = {name: inputs.get(name, step.name if name == "o" else name) for name in step.needs}
    words = shlex.split(step.command.format(**places))
    if (own / SAID).exists() and json.loads((own / SAID).read_text())["words"] == words:
        return
    shutil.rmtree(own, ignore_errors=True)
    own.mkdir()
    said: dict[str, Any] = {"words": words}
    if words[0].startswith("!"):
        paths = [folder / word for word in words[1:]]
        try:
            getattr(same_inputs, words[0][1:])(*paths)
        except Exception as error:  # a step before it failed: this one is told as that is
            said |= {"code": 1, "stdout": "", "stderr": f"{type(error).__name__}"}
        else:
            said |= {"code": 0, "stdout": "", "stderr": ""}
    else:
        begun = time.monotonic()
        done = subprocess.run([*command, *words], cwd=folder, env=_environment(), text=True,
                              capture_output=True, timeout=LONGEST_S, check=False)  # fmt: skip
        said |= {"seconds": round(time.monotonic() - begun, 2)}
        texts = (text.replace(str(folder.parent), "WORK") for text in (done.stdout, done.stderr))
        said |= {"code": done.returncode, **dict(zip(("stdout", "stderr"), texts, strict=True))}
    (own / SAID).write_text(json.dumps(said))


def _environment() -> dict[str, str]:
    """Nothing that would make one version read parts of another, or lines of other widths."""
    kept = {k: v for k, v in os.environ.items()
            if not k.startswith(("PYTHON", "USDHAND", "PXR", "VIRTUAL_ENV"))}  # fmt: skip
    return kept | {"COLUMNS": "100", "TERM": "dumb", "LC_ALL": "C.UTF-8"}


def _hashes(folder: Path) -> dict[str, str]:
    """Names of all files that steps wrote by their SHA-256."""
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {hashlib.sha256(p.read_bytes()).hexdigest(): str(p.relative_to(folder)) for p in files}


def _judge(step: Step, work: Path, hashes: Sequence[Mapping[str, str]], tolerance: float) -> Judged:
    folders = [work / name / step.name for name in VERSIONS]
    said = [json.loads((folder / SAID).read_text()) for folder in folders]
    found = list(_said_differences(*said))
    names = [_files(folder) for folder in folders]
    for name in sorted(names[0] | names[1]):
        if name not in names[1]:
            found.append(Difference(name, "missing", detail="the file"))
        elif name not in names[0]:
            found.append(Difference(name, "changed", detail="a new file"))
        else:
            for d in file_differences(folders[0] / name, folders[1] / name):
                found.append(Difference(f"{name}: {d.place}", d.what, d.size, d.detail))
    if any(x["code"] < 0 or "Traceback" in x["stderr"] for x in said):
        found.append(
            Difference("run", "changed", detail=f"ended by itself: {said[1]['stderr'][-200:]}")
        )
    real = [d for d in found if not _one_file(d, hashes)]
    return Judged(step, len(names[0]), tuple(_grouped(real)), tolerance)


def _one_file(difference: Difference, hashes: Sequence[Mapping[str, str]]) -> bool:
    """Two hashes of one file that a step wrote: crates of equal runs differ in bytes."""
    two = re.fullmatch("'([0-9a-f]{64})' -> '([0-9a-f]{64})'", difference.detail)
    names = [own.get(x) for own, x in zip(hashes, two.groups(), strict=True)] if two else [None]
    return names[0] is not None and names[0] == names[1]


def _said_differences(before: dict[str, Any], after: dict[str, Any]) -> Iterator[Difference]:
    if before["code"] != after["code"]:
        yield Difference("exit code", "changed", detail=f"{before['code']} -> {after['code']}")
    for name in ("stdout", "stderr"):
        texts = before[name], after[name]
        try:
            trees = [json.loads(text) for text in texts]
        except ValueError:
            yield from text_differences(*texts, place=name)
        else:
            yield from (Difference(f"{name}: {d.place}", d.what, d.size, d.detail)
                        for d in tree_differences(*trees))  # fmt: skip


def _files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {SAID}


def _grouped(differences: Iterable[Difference]) -> Iterator[Difference]:
    """One for all of a place, as for all time samples of an attribute: the largest."""
    places: dict[tuple[str, str], list[Difference]] = defaultdict(list)
    for difference in differences:
        places[difference.place, difference.what].append(difference)
    for (place, what), found in places.items():
        sizes = [d.size for d in found if not math.isnan(d.size)]
        size = max(sizes) if sizes else math.nan
        times = f" ({len(found)} times)" if len(found) > 1 else ""
        yield Difference(place, what, size, f"{found[0].detail}{times}")


def _print(judged: Sequence[Judged], most: int) -> None:
    states = ("equal", "near", "differ", "mended")
    rows = [("", "commands", "files", *states, "largest", "new keys")]
    groups = list(dict.fromkeys(j.step.group for j in judged))
    for group in [*groups, "all"]:
        own = [j for j in judged if group in (j.step.group, "all")]
        found = [j.state for j in own]
        sizes = [d.size for j in own if j.state != "mended" for d in j.changed]
        known = [size for size in sizes if not math.isnan(size)]
        new = {d.place for j in own for d in j.differences if d.what == "new"}
        counts = (len(own), sum(j.files for j in own), *map(found.count, states))
        largest = f"{max(known):.2g}" if known else "values" if sizes else "-"
        rows.append((group, *map(str, counts), largest, str(len(new))))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(w) if i == 0 else cell.rjust(w)
                        for i, (cell, w) in enumerate(zip(row, widths, strict=True))))  # fmt: skip
    for state, head in (("differ", "DIFFERENT"), ("mended", "Different, and meant")):
        for one in (j for j in judged if j.state == state):
            print(f"\n{head}: {one.step.name}  [{one.step.command}]")
            if state == "mended":
                print(f"  since {one.step.mended}")
            for d in one.wrong[:most]:
                size = "" if math.isnan(d.size) else f" by up to {d.size:.3g}"
                print(f"  {d.place}: {d.what}{size}; {d.detail}")
            if len(one.wrong) > most:
                print(f"  and {len(one.wrong) - most} more; --all shows them")
    new = sorted({d.place for j in judged for d in j.differences if d.what == "new"})
    if new:
        print("\nNew keys: " + ", ".join(new[:most]) + (", ..." if len(new) > most else ""))


def _progress(text: str) -> None:
    if sys.stderr.isatty():
        print(f"\r{text:<60}", end="" if text else "\r", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
