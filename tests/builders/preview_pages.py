"""Pages that tests of the preview look at, made of the samples, and a browser to look with."""

from __future__ import annotations

import base64
import json
import os
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.shared_work import SharedWork
from conftest import REPOSITORY

import usdhand
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.resample import resample

SAMPLES = REPOSITORY / "samples"
GESTURES = SAMPLES / "gestures"
# Software rendering, and nothing that a browser asks the network for on its own.
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


@dataclass(frozen=True)
class Results:
    """Files of fill, splice and reduce, with reports."""

    filled: Path
    fill_report: Path
    spliced: Path
    splice_report: Path
    rig: Path

    @classmethod
    def within(cls, folder: Path) -> Results:
        """The files in a folder that `make_results` filled."""
        names = ("filled.usda", "fill.json", "spliced.usda", "splice.json", "rig.usda")
        return cls(*(folder / name for name in names))


def make_results(folder: Path) -> Results:
    """Run the verbs on short samples."""
    library = folder / "library.usdc"
    run("library", "build", *(GESTURES / f"{n}.usdc" for n in ("ok_01", "ok_02", "big_01")),
        "-o", library, "-q")  # fmt: skip
    made = Results.within(folder)
    run("fill", GESTURES / "ok_03.usdc", "--replace", "--library", library, "--alternatives", "2",
        "-o", made.filled, "--report", made.fill_report, "-q")  # fmt: skip
    run("splice", GESTURES / "ok_03.usdc", GESTURES / "ok_04.usdc", "-o", made.spliced,
        "--pin", "1:1", "--report", made.splice_report, "-q")  # fmt: skip
    run("reduce", GESTURES / "ok_03.usdc", "-o", made.rig, "-q")
    return made


def shared_results(work: SharedWork) -> Results:
    """The same files for all tests of a session, for reading only."""
    return Results.within(work.folder("results", make_results))


def page_data(page: Path) -> dict[str, Any]:
    """The data inside a page."""
    found = re.search(r'id="page-data">(.*?)</script>', page.read_text(encoding="utf-8"), re.S)
    assert found
    return dict(json.loads(found[1]))


def unpacked(document: dict[str, Any]) -> list[np.ndarray]:
    """Arrays of a page, written down slowly: the opposite of `Pack.document`."""
    data = zlib.decompress(base64.b64decode(document["data"]))
    tables, start = [], 0
    for entry in document["arrays"]:
        count, size = entry["rows"] * entry["columns"], int(entry["kind"][1])
        planes = [data[start + k * count : start + (k + 1) * count] for k in range(size)]
        start += count * size
        table = np.empty((entry["rows"], entry["columns"]))
        for column in range(entry["columns"]):
            total = 0
            for row in range(entry["rows"]):
                i = column * entry["rows"] + row
                total = (total + sum(planes[k][i] << 8 * k for k in range(size))) % 256**size
                signed = entry["kind"][0] == "i" and total >= 256**size // 2
                table[row, column] = total - 256**size if signed else total
        tables.append(entry["middle"] + entry["step"] * table)
    assert start == len(data)
    return tables


def joined(files: Sequence[Path], output: Path, seconds: float, fps: float = 60.0) -> Clip:
    """Clips of one character, one after the other: motion that does not repeat itself."""
    clips = [resample(usdhand.read_clip(f), fps) for f in files]
    clips = [c for c in clips if c.skeleton.joints == clips[0].skeleton.joints]

    def along(name: str) -> np.ndarray:
        return np.concatenate([getattr(c, name) for c in clips])[: int(seconds * fps) + 1]

    clip = replace(
        clips[0],
        rotations=rot.make_continuous(along("rotations")),
        translations=along("translations"),
        scales=along("scales"),
    )
    usdhand.write_clip(clip, output)
    return clip


def one_minute(folder: Path) -> Path:
    """A minute of both hands at 60 frames a second."""
    talks = [SAMPLES / "conversations" / f"talk_0{n}_full.usdc" for n in (1, 2)]
    path = folder / "minute.usdc"
    clip = joined([*talks, *sorted(GESTURES.glob("*_0[1-4].usdc"))], path, 60.0)
    assert clip.duration == 60.0
    return path


def chromium() -> tuple[Any, str]:
    """Playwright and the path of a browser; skips the test where there is none."""
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: pip install 'usdhand[test]'"
    )
    path = os.environ.get("USDHAND_CHROMIUM", "/usr/bin/chromium")
    if not Path(path).exists():
        pytest.skip(f"no browser at {path}: set USDHAND_CHROMIUM to Chromium")
    return sync_api.sync_playwright(), path
