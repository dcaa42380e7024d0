"""The picture of fill: a body without finger motion, filled, and the true fingers.

usage: USDHAND_BLENDER_PYTHON=PYTHON_WITH_BPY python docs/pictures/make_fill.py (and matplotlib)
"""

import tempfile
from pathlib import Path

import numpy as np
from sheet import ROOT, Column, sheet

import usdhand

TALKS = ROOT / "samples" / "conversations"
FRAMES = (235, 330, 405)
CHANNELS = ("riMiddlePIPy", "riIndexMCPy")


def main() -> None:
    """Build a library, fill, render and plot."""
    folder = Path(tempfile.mkdtemp())
    clips = sorted((ROOT / "samples" / "gestures").glob("*.usdc"))
    library = usdhand.build_library(clips, folder / "library.usdc").library
    body = usdhand.read_clip(TALKS / "talk_01_body.usdc")
    filled = usdhand.fill_fingers(body, library)
    usdhand.write_filled(filled, folder / "filled.usdc")
    truth = usdhand.read_clip(TALKS / "talk_01_full.usdc")
    columns = [
        Column("body clip: fingers still", TALKS / "talk_01_body.usdc"),
        Column("filled from 64 gestures", folder / "filled.usdc"),
        Column("true fingers", TALKS / "talk_01_full.usdc"),
    ]
    figure, axes = sheet(columns, FRAMES, body.fps)
    seconds = np.arange(len(body)) / body.fps
    for number, name in enumerate(CHANNELS):
        for clip, style, label in (
            (filled.clips[0], "-", f"{name} filled"),
            (truth, "--", "true"),
        ):
            curve = usdhand.find_hands(clip).encode(clip).select([name]).values
            axes.plot(seconds, curve, f"C{number}", ls=style, lw=1.2, label=label)
    axes.set_xlim(0, seconds[-1])
    axes.set_ylim(top=85)
    axes.set_xlabel("seconds")
    axes.set_ylabel("degrees")
    axes.legend(ncol=4, fontsize=9, loc="upper center", frameon=False)
    figure.savefig(ROOT / "docs" / "pictures" / "fill.png", bbox_inches="tight")


if __name__ == "__main__":
    main()
