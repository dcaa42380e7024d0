"""The picture at the top of the README: a clip, its reduced rig, the rig on another character.

usage: USDHAND_BLENDER_PYTHON=PYTHON_WITH_BPY python docs/pictures/make_reduce.py (and matplotlib)
"""

import json
import os
import subprocess
import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from usdhand import api

ROOT = Path(__file__).resolve().parents[2]
CLIP = ROOT / "samples" / "conversations" / "talk_01_full.usdc"
BEN = ROOT / "samples" / "characters" / "ben.usdc"
FRAMES = (155, 330, 405)
CHANNELS = ("riRingMCPy", "riMiddlePIPy")


def main() -> None:
    """Reduce, expand, render and plot."""
    folder = Path(tempfile.mkdtemp())
    clip = api.read_clip(CLIP)
    [reduction] = api.reduce_hands([clip])
    api.write_rig(reduction, folder / "rig.usdc")
    on_ben = api.expand_onto(folder / "rig.usdc", BEN)
    api.write_clip(on_ben, folder / "ben.usdc")
    free, total = len(reduction.rig.free), len(reduction.rig.names)
    ada_hand = [f"RightHand{name}" for name in ("", "Middle1", "Index1", "Pinky1")]
    ben_hand = ["hand_r", "middle_01_r", "index_01_r", "pinky_01_r"]
    columns = [
        (f"original: {total} channels", CLIP, ada_hand),
        (f"reduced: {free} channels", folder / "rig.usdc", ada_hand),
        ("the same rig on another character", folder / "ben.usdc", ben_hand),
    ]
    shots = [
        {
            "file": str(file),
            "frame": frame,
            "hand": hand,
            "scale": 0.26,
            "out": str(folder / f"{row}{column}.png"),
        }
        for row, frame in enumerate(FRAMES)
        for column, (_, file, hand) in enumerate(columns)
    ]
    (folder / "shots.json").write_text(json.dumps(shots), encoding="utf-8")
    script = Path(__file__).with_name("render.py")
    python = os.environ["USDHAND_BLENDER_PYTHON"]
    subprocess.run([python, str(script), str(folder / "shots.json")], check=True)

    figure = plt.figure(figsize=(11, 11.5), dpi=90)
    grid = figure.add_gridspec(4, 3, height_ratios=(3, 3, 3, 1.9), hspace=0.04, wspace=0.03)
    for row, frame in enumerate(FRAMES):
        for column, (title, *_) in enumerate(columns):
            axes = figure.add_subplot(grid[row, column])
            axes.imshow(plt.imread(folder / f"{row}{column}.png"))
            axes.axis("off")
            if row == 0:
                axes.set_title(title, fontsize=12)
            if column == 0:
                axes.text(10, 28, f"{(frame - 1) / clip.fps:.1f} s", fontsize=10, color="#222222")
    axes = figure.add_subplot(grid[3, :])
    before = reduction.hands.encode(clip)
    seconds = np.arange(len(clip)) / clip.fps
    for number, name in enumerate(CHANNELS):
        relation = next(r for r in reduction.rig.relations if r.name == name)
        colour = f"C{number}"
        axes.plot(seconds, before.select([name]).values, colour, lw=1.4, label=name)
        label = f"{relation.slopes[0]:+.2f} {relation.controllers[0]} {relation.offset:+.1f}"
        after = reduction.reduced.select([name]).values
        axes.plot(seconds, after, colour, ls="--", lw=1, label=label)
    axes.set_xlim(0, seconds[-1])
    axes.set_xlabel("seconds")
    axes.set_ylabel("degrees")
    axes.set_ylim(top=68)
    axes.legend(ncol=4, fontsize=9, loc="upper center", frameon=False)
    figure.savefig(ROOT / "docs" / "pictures" / "reduce.png", bbox_inches="tight")
    print(f"{free} of {total} channels")


if __name__ == "__main__":
    main()
