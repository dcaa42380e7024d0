"""Run every verb on all USD files with skeletons below some folders, and ask UsdSkel about results.

    python benchmarks/public_stages.py FOLDER... [--library LIBRARY] [--most 500]

For stages by others: OpenUSD's tests of UsdSkel, usd-wg/assets, maya-usd, tinyusdz. A verb is
right if joints (and skinned points, where the verb changes no finger) are within 0.01 mm of where
UsdSkel puts them in the input, or if it says why it does nothing. Prints counts by verb, the
reasons, and what is wrong; exit code 1 if anything is. Each file is worked on in a process of its
own, since files may crash USD.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from pxr import Usd, UsdGeom, UsdSkel
from usd_poses import poses

from usdhand.cli.main import main as usdhand
from usdhand.formats.usd.damage import usd_diagnostics

SAME_CM = 1e-3
FLOAT = 1e-6  # of the distance from the origin: UsdSkel counts in float32
LONGEST_S = 300
SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}
LARGEST = 30_000_000
SAMPLES = Path(__file__).parent.parent / "samples"
Outcome = tuple[str, str, str]  # verb; "works", "refuses" or "WRONG"; why


def main() -> int:
    """Run all files and print what came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--library", type=Path, help="for fill; made of the samples by default")
    parser.add_argument("--most", type=int, default=100_000, help="files to run")
    given = parser.parse_args()
    files = sorted(p for f in given.folders for p in f.rglob("*") if p.suffix.lower() in SUFFIXES)
    counts: Counter[tuple[str, str]] = Counter()
    reasons: Counter[tuple[str, str]] = Counter()
    wrong: list[str] = []
    used = 0
    with tempfile.TemporaryDirectory() as folder:
        library = given.library or Path(folder, "library.usdc")
        if not given.library:
            _call("library", "build", SAMPLES / "gestures", "-o", library)
        for file in files:
            if used == given.most:
                break
            outcomes = _in_child(file, library, Path(folder))
            used += bool(outcomes)
            for verb, outcome, why in outcomes:
                counts[verb, outcome] += 1
                if outcome == "refuses":
                    reasons[verb, _kind(why)] += 1
                if outcome == "WRONG":
                    wrong.append(f"{file} {verb}: {why}")
                    print("WRONG", wrong[-1], flush=True)
    print(f"{len(files)} files, {used} with skeletons")
    for verb in dict.fromkeys(verb for verb, _ in counts):
        row = (f"{outcome} {counts[verb, outcome]}" for outcome in ("works", "refuses", "WRONG"))
        print(f"{verb:14}{'  '.join(f'{each:14}' for each in row)}")
    for (verb, why), count in reasons.most_common():
        print(f"{count:5} {verb:14}{why}")
    return bool(wrong)


def _in_child(file: Path, library: Path, folder: Path) -> list[Outcome]:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        signal.alarm(LONGEST_S)
        status = 1
        try:
            with os.fdopen(writing, "w") as pipe, tempfile.TemporaryDirectory(dir=folder) as own:
                for outcome in _outcomes(file, library, Path(own)):
                    pipe.write(json.dumps(outcome) + "\n")
                    pipe.flush()
            status = 0
        except Exception:
            traceback.print_exc()
        finally:
            os._exit(status)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        outcomes = [tuple(json.loads(line)) for line in pipe]
    _, status = os.waitpid(child, 0)
    if status:
        outcomes.append(("process", "WRONG", f"ended by {os.waitstatus_to_exitcode(status)}"))
    return outcomes


def _outcomes(file: Path, library: Path, folder: Path) -> Iterator[Outcome]:
    if file.stat().st_size > LARGEST:
        return
    with usd_diagnostics():
        try:
            before = poses(file)
            skeletons = _skeletons(file)
        except Exception as error:  # USD cannot open it
            first = str(error).strip().splitlines()[-1][:200]
            if b"Skel" in file.read_bytes():
                yield _told("inspect", *_call("inspect", file), f"USD: {first}")
            return
    for number, skeleton in enumerate(skeletons):
        own = folder / str(number)
        own.mkdir()
        yield from _character(file, skeleton, before, library, own)


def _character(
    file: Path, skeleton: str, before: dict[str, np.ndarray], library: Path, folder: Path
) -> Iterator[Outcome]:
    chosen = ("--skel", skeleton)
    yield _told("inspect", *_call("inspect", file, *chosen))
    fingers = _fingers(file, skeleton)
    code, said = _call("check", file, *chosen)
    found_errors = code == 1 and "unexpected" not in said
    yield _told("check", 0 if found_errors else code, said)
    flat, rig = folder / "a.usda", folder / "rig.usda"
    for name, line, output in (
        ("convert usda", ("convert", file, *chosen), flat),
        ("convert usdz", ("convert", file, *chosen, "--allow-outside"), folder / "a.usdz"),
        ("reduce", ("reduce", file, *chosen), rig),
        ("expand", ("expand", rig), folder / "full.usda"),
        ("fill", ("fill", file, *chosen, "--library", library), folder / "filled.usda"),
        ("splice", ("splice", file, file, *chosen), folder / "spliced.usda"),
    ):
        if name == "expand" and not rig.exists():
            continue
        outcome = _told(name, *_call(*line, "-o", output))
        if outcome[1] == "works":
            moved = set() if line[0] == "convert" else fingers
            why = _difference(before, output, None if line[0] == "convert" else skeleton, moved)
            outcome = (name, "WRONG", why) if why else outcome
        yield outcome
    for suffix in ("bvh", "glb"):
        output = folder / f"a.{suffix}"
        yield _told(f"convert {suffix}", *_call("convert", file, *chosen, "-o", output))
    if flat.exists():
        yield _told("compare", *_call("compare", file, flat, *chosen))
    yield _told("preview", *_call("preview", file, *chosen, "-o", folder / "page.html"))


def _call(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(usdhand, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        return -1, repr(result.exception)
    return result.exit_code, result.output


def _told(verb: str, code: int, said: str, also: str = "") -> Outcome:
    if code == 0:
        return verb, "works", ""
    errors = re.findall(r"Error: (.*?)(?:\n\n|\Z)", said, re.DOTALL)
    why = " ".join((errors[-1] if errors else said[-300:]).split()) + also
    fair = code in (2, 3, 4) and errors and "Traceback" not in said and "unexpected" not in why
    return verb, "refuses" if fair else "WRONG", f"exit {code}: {why}"


def _difference(
    before: dict[str, np.ndarray], output: Path, skeleton: str | None, moved: Collection[str]
) -> str:
    """Say where a result differs from its input.

    Compared are the joints of one skeleton but for those in ``moved``, or all joints and points.
    """
    times: dict[str, list[float]] = {key: [] for key in before if "|" not in key}
    for path, time in (key.split("|") for key in before if "|" in key):
        if path in times:
            times[path].append(float(time))
    with usd_diagnostics():
        after = poses(output, times)
        unit = 100.0 * UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(str(output)))
    for key, a in before.items():
        path = key.split("|")[0]
        if key in times or (skeleton is not None and path != skeleton):
            continue
        if key not in after:
            return f"{key} is not in the result"
        b = after[key]
        if path in times:
            names, others = before[path].tolist(), after[path].tolist()
            kept = [name for name in names if not any(_is_below(name, top) for top in moved)]
            a = a[[names.index(name) for name in kept], 3, :3]
            b = b[[others.index(name) for name in kept], 3, :3]
        off = float(np.abs(a - b).max(initial=0.0)) * unit
        far = float(np.abs(a).max(initial=0.0)) * unit
        if not off <= max(SAME_CM, FLOAT * far):
            return f"{key} is {off:.4g} cm off"
    return ""


def _is_below(joint: str, top: str) -> bool:
    return joint == top or joint.startswith(f"{top}/")


def _fingers(file: Path, skeleton: str) -> set[str]:
    line = ["inspect", str(file), "--skel", skeleton, "--json"]
    result = CliRunner().invoke(usdhand, line)
    if result.exit_code:
        return set()
    [found] = json.loads(result.stdout)["files"]
    hands = (found.get("hands") or {}).values()
    return {joint for hand in hands for joint in hand["joints"].values()}


def _skeletons(file: Path) -> list[str]:
    stage = Usd.Stage.Open(str(file))
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [str(prim.GetPath()) for prim in everything if prim.IsA(UsdSkel.Skeleton)][:3]


def _kind(why: str) -> str:
    """A reason without what is particular to a file."""
    why = re.sub(r"(/[^\s:,;']+)+", "PATH", why)
    return re.sub(r"'[^']*'|-?\d+(\.\d+)?", "X", why)[:170]


if __name__ == "__main__":
    sys.exit(main())
