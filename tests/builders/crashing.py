"""A crate that crashes USD, and the commands that write something."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from builders.in_memory import in_memory, sample

import usdhand
from usdhand.motion.editing import trim

SIZE_OF_FIRST_VALUE = 97  # a byte of it in a crate, after the header of 88 bytes


def short_clip() -> usdhand.Clip:
    """Three frames of a sample, without its file."""
    clip = sample("gestures/ok_01")
    return replace(in_memory(trim(clip, clip.time_code(0), clip.time_code(2))), name="s")


def crashing(path: Path) -> Path:
    """Write a crate on which USD crashes; skip where this USD does not."""
    usdhand.write_new(short_clip(), path)
    data = bytearray(path.read_bytes())
    data[SIZE_OF_FIRST_VALUE] = 1
    path.write_bytes(data)
    read = "import sys, usdhand; usdhand.read_character(sys.argv[1])"
    if subprocess.run([sys.executable, "-c", read, path], capture_output=True).returncode >= 0:
        pytest.skip("this version of USD does not crash on the file")
    return path


def writers(folder: Path, samples: Path) -> dict[str, tuple[list[str], str]]:
    """Commands that write, and the file that each writes into ``folder``."""
    clip = samples / "gestures" / "ok_01.usdc"
    library, textured = folder / "library.usdc", samples / "characters" / "ada.usdc"
    clips = [samples / "gestures" / f"{name}.usdc" for name in ("ok_01", "ok_02", "big_01")]
    made = [
        *(("convert", clip, f"c.{suffix}") for suffix in ("usda", "usdc", "usdz", "bvh", "glb")),
        ("convert", textured, "t.usdz"),
        ("reduce", clip, "r.usda"),
        ("reduce", clip, "r.usdc", "--flatten"),
        ("fill", clip, "f.usdc", "--library", library, "--replace"),
        ("splice", clip, clips[1], "s.usda"),
        ("library", "build", *clips, "l.usdc", "--jobs", "2"),
        ("preview", clip, "p.html"),
    ]
    commands: dict[str, tuple[list[str], str]] = {}
    for parts in made:
        names = [str(p) for p in parts]
        at = next(i for i, n in enumerate(names) if "/" not in n and "." in n)
        output = names[at]
        names[at : at + 1] = ["-o", str(folder / output), "--force"]
        commands[f"{names[0]} {output}"] = names, output
    return commands
