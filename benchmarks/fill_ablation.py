"""What each part of fill contributes, as Markdown tables for the documentation.

    python benchmarks/fill_ablation.py --data FOLDER [--other FOLDER]

FOLDER holds takes with fingers. Settings are compared on two thirds of them; every third take by
name is held out for the final comparison. Each take is filled from all others. OTHER holds takes
of another rig, filled from FOLDER and the reverse.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from usdhand import read_clip
from usdhand.evaluate.reconstruction import HandError
from usdhand.fill.library import MotionLibrary
from usdhand.fill.settings import PAPER, PAPER_SEGMENTATION, FillSettings
from usdhand.motion import Clip
from usdhand.verbs.evaluate import measure_library
from usdhand.verbs.library import build_library

SIDES = ("right", "left")
DEFAULT = FillSettings()
VARIANTS: tuple[tuple[str, FillSettings], ...] = (
    ("the paper's settings (`--preset paper`)", PAPER),
    ("... chordal instead of Euler", replace(PAPER, metric="chordal")),
    ("... and from shoulder and elbow, with the wrist's bend", replace(PAPER, metric="arm")),
    ("... and costs scaled to the same average", replace(PAPER, metric="arm", scaled=True)),
    ("... and short segments", replace(DEFAULT, pool=0, blend="linear", repeat_weight=0.0)),
    ("... and smooth seams, no piece twice", replace(DEFAULT, pool=0)),
    ("... and agreement of the neighbours: **the default**", DEFAULT),
    ("default, segments as the paper's", replace(DEFAULT, segmentation=PAPER_SEGMENTATION)),
    ("default, Euler metric", replace(DEFAULT, metric="euler")),
    ("default, k = 1", replace(DEFAULT, k=1)),
    ("default, k = 10", replace(DEFAULT, k=10)),
    ("default, no transition costs", replace(DEFAULT, transition_weight=0.0)),
    ("default, transition costs doubled", replace(DEFAULT, transition_weight=1.0)),
    ("default, pieces may repeat at once", replace(DEFAULT, repeat_weight=0.0)),
    ("default, both hands as one (`--couple`)", replace(DEFAULT, couple=True)),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--other", type=Path)
    arguments = parser.parse_args()
    files = sorted(arguments.data.glob("*.usd*"))
    library = build(files, arguments.data)
    clips = [read_clip(f) for f in files]
    held = clips[2::3]
    tuned = [c for c in clips if c not in held]
    print(f"**Settings**, {len(tuned)} takes, each from the other {len(clips) - 1}.\n")
    table([(name, errors_of(library, arguments.data, tuned, s)) for name, s in VARIANTS], "fill")
    compare(f"{len(held)} held-out takes", library, arguments.data, held)
    if arguments.other:
        others = sorted(arguments.other.glob("*.usd*"))
        other = build(others, arguments.other)
        name, theirs = arguments.data.name, arguments.other.name
        compare(
            f"`{theirs}` takes from the `{name}` library",
            library,
            arguments.data,
            [read_clip(f) for f in others],
        )
        compare(f"`{name}` takes from the `{theirs}` library", other, arguments.other, clips)


def build(files: Sequence[Path], folder: Path) -> MotionLibrary:
    return build_library(files, folder / "library.usdc", keep=math.inf).library  # no file beside


def errors_of(
    library: MotionLibrary, folder: Path, takes: Sequence[Clip], settings: FillSettings
) -> list[HandError]:
    errors, left = measure_library(library, folder, settings, takes=takes)
    for clip in left:
        print(f"left out: {clip.path}: {clip.reason}")
    return errors


def compare(title: str, library: MotionLibrary, folder: Path, takes: Sequence[Clip]) -> None:
    default = errors_of(library, folder, takes, DEFAULT)
    paper = errors_of(library, folder, takes, PAPER)
    print(f"\n**{title[0].upper()}{title[1:]}**.\n")
    rows = [("**default**", default, "fill"), ("paper", paper, "fill")]
    rows += [
        (method, default, method)
        for method in ("nearest", "random", "mean pose", "rest pose", "best candidate")
    ]
    head()
    for name, errors, method in rows:
        row(name, errors, method)


def table(rows: Sequence[tuple[str, list[HandError]]], method: str) -> None:
    head()
    for name, errors in rows:
        row(name, errors, method)


def head() -> None:
    print("| | right: deg | tips mm | jerk | left: deg | tips mm | jerk |")
    print("|---|---|---|---|---|---|---|")


def row(name: str, errors: Sequence[HandError], method: str) -> None:
    cells = []
    for side in SIDES:
        own = [e for e in errors if e.side == side and e.method == method]
        weights = [e.frames for e in own]
        for values, form in (
            ([e.degrees for e in own], "{:.2f}"),
            ([e.fingertip_mm for e in own], "{:.1f}"),
            ([e.jerk for e in own], "{:.2g}"),
        ):
            cells.append(form.format(np.average(values, weights=weights)))
    print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
