"""Sheets of rendered hands: a column a file, a row a frame."""

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[2]
ADA_HAND = tuple(f"RightHand{name}" for name in ("", "Middle1", "Index1", "Pinky1"))
BEN_HAND = ("hand_r", "middle_01_r", "index_01_r", "pinky_01_r")


@dataclass(frozen=True)
class Column:
    """A file to render: its title, and the bones of its right hand."""

    title: str
    file: Path
    hand: tuple[str, ...] = ADA_HAND


def render(columns: Sequence[Column], frames: Sequence[int], scale: float) -> list[list[Any]]:
    """Images, a row a frame; needs USDHAND_BLENDER_PYTHON, a Python that has bpy."""
    folder = Path(tempfile.mkdtemp())
    shots = [
        {
            "file": str(column.file),
            "frame": frame,
            "hand": column.hand,
            "scale": scale,
            "out": str(folder / f"{row}-{number}.png"),
        }
        for row, frame in enumerate(frames)
        for number, column in enumerate(columns)
    ]
    (folder / "shots.json").write_text(json.dumps(shots), encoding="utf-8")
    script = Path(__file__).with_name("render.py")
    python = os.environ["USDHAND_BLENDER_PYTHON"]
    subprocess.run([python, str(script), str(folder / "shots.json")], check=True)
    return [
        [plt.imread(folder / f"{row}-{number}.png") for number in range(len(columns))]
        for row in range(len(frames))
    ]


def sheet(
    columns: Sequence[Column], frames: Sequence[int], fps: float, scale: float = 0.26
) -> tuple[Any, Any]:
    """Figure with the images, and axes below them for curves."""
    images = render(columns, frames, scale)
    rows = len(frames)
    figure = plt.figure(figsize=(11, 3.2 * rows + 1.9), dpi=90)
    heights = (*[3.0] * rows, 1.9)
    grid = figure.add_gridspec(
        rows + 1, len(columns), height_ratios=heights, hspace=0.04, wspace=0.03
    )
    for row, frame in enumerate(frames):
        for number, column in enumerate(columns):
            axes = figure.add_subplot(grid[row, number])
            axes.imshow(images[row][number])
            axes.axis("off")
            if row == 0:
                axes.set_title(column.title, fontsize=12)
            if number == 0:
                axes.text(10, 28, f"{(frame - 1) / fps:.1f} s", fontsize=10, color="#222222")
    return figure, figure.add_subplot(grid[rows, :])
