"""How long filling a ten-minute body at 60 frames a second takes, from a file to a file.

Run: python benchmarks/fill_body.py [--takes FOLDER] [--minutes 10] [--fps 60]

The body is the takes one after the other, often enough; the library is the takes. Every step is
timed on its own, then `usdhand fill` as a whole in a process of its own: once when numba may have
to compile, once as always after that.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import usdhand
from usdhand.fill.settings import FillSettings
from usdhand.formats.usd.library import read_library, write_library
from usdhand.motion import rotations as rot
from usdhand.motion.resample import resample
from usdhand.verbs.fill import fill_fingers, write_filled
from usdhand.verbs.library import build_library

HERE = Path(__file__).resolve().parent.parent
REAL = HERE.parent / "shared" / "data" / "studiogalt" / "full"


def main() -> None:
    """Make the body and the library, and time everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--takes", type=Path, default=REAL if REAL.is_dir() else HERE / "samples" / "gestures"
    )
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--fps", type=float, default=60.0)
    arguments = parser.parse_args()
    takes = sorted(arguments.takes.glob("*.usdc"))
    with tempfile.TemporaryDirectory() as folder:
        body, library = Path(folder, "long_body.usdc"), Path(folder, "library.usdc")
        long_body(takes, 60.0 * arguments.minutes, arguments.fps, body)
        steps(takes, body, library, Path(folder))
        whole(body, library, Path(folder))


def long_body(takes: Sequence[Path], seconds: float, fps: float, output: Path) -> None:
    """Write takes one after the other as one motion of the first one's character."""
    read = [usdhand.read_clip(take) for take in takes]
    alike = [resample(c, fps) for c in read if c.skeleton.joints == read[0].skeleton.joints]
    clips = alike * int(np.ceil(seconds / sum(clip.duration for clip in alike)))
    count = round(seconds * fps)

    def all_of(name: str) -> Any:
        return np.concatenate([getattr(clip, name) for clip in clips])[:count]

    body = replace(
        clips[0],
        rotations=rot.make_continuous(all_of("rotations")),
        translations=all_of("translations"),
        scales=all_of("scales"),
    )
    usdhand.write_clip(body, output, flatten=True)


def steps(takes: Sequence[Path], body: Path, library: Path, folder: Path) -> None:
    """Time the steps one by one."""

    def timed(label: str, work: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        result = work()
        print(f"{label:28}{time.perf_counter() - start:8.2f} s")
        return result

    built = timed("build the library", lambda: build_library(takes, library)).library
    timed("write it", lambda: write_library(built, library))
    motions = timed("read the library", lambda: read_library(library))
    clip = timed("read the body", lambda: usdhand.read_clip(body))
    timed("fill, first time", lambda: fill_fingers(clip, motions, replace_motion=True))
    filled = timed("fill, compiled", lambda: fill_fingers(clip, motions, replace_motion=True))
    timed("write", lambda: write_filled(filled, folder / "filled.usdc"))
    three = FillSettings(alternatives=3)
    timed(
        "fill, 3 alternatives",
        lambda: fill_fingers(clip, motions, three, replace_motion=True),
    )
    print(f"{len(clip)} frames, {len(clip.skeleton)} joints, {len(motions.clips)} clips, segments: "
          f"{[len(p.alternatives[0].choices) for p in filled.parts]}")  # fmt: skip


def whole(body: Path, library: Path, folder: Path) -> None:
    """Time `usdhand fill` as a user calls it."""
    command = [sys.executable, "-m", "usdhand", "fill", str(body), "--library", str(library)]
    for label in ("usdhand fill, first run", "usdhand fill"):
        start = time.perf_counter()
        output = folder / f"{label.replace(' ', '_')}.usdc"
        subprocess.run([*command, "-o", str(output), "--replace", "-q"], check=True)
        print(f"{label:28}{time.perf_counter() - start:8.2f} s")


if __name__ == "__main__":
    main()
