"""The picture at the top of the README: a clip, its reduced rig, the rig on another character.

usage: USDHAND_BLENDER_PYTHON=PYTHON_WITH_BPY python docs/pictures/make_reduce.py (and matplotlib)
"""

import tempfile
from pathlib import Path

import numpy as np
from sheet import BEN_HAND, ROOT, Column, sheet

import usdhand

CLIP = ROOT / "samples" / "conversations" / "talk_01_full.usdc"
BEN = ROOT / "samples" / "characters" / "ben.usdc"
FRAMES = (155, 330, 405)
CHANNELS = ("riRingMCPy", "riMiddlePIPy")


def main() -> None:
    """Reduce, expand, render and plot."""
    folder = Path(tempfile.mkdtemp())
    rig, ben = folder / "rig.usdc", folder / "ben.usdc"
    clip = usdhand.read_clip(CLIP)
    [reduction] = usdhand.reduce_hands([clip])
    usdhand.write_rig(reduction, rig)
    usdhand.write_clip(usdhand.expand_onto(rig, BEN), ben)
    free, total = len(reduction.rig.free), len(reduction.rig.names)
    columns = [
        Column(f"original: {total} channels", CLIP),
        Column(f"reduced: {free} channels", rig),
        Column("the same rig on another character", ben, BEN_HAND),
    ]
    figure, axes = sheet(columns, FRAMES, clip.fps)
    seconds = np.arange(len(clip)) / clip.fps
    for number, name in enumerate(CHANNELS):
        relation = next(r for r in reduction.rig.relations if r.name == name)
        colour = f"C{number}"
        before = reduction.source.select([name]).values
        after = reduction.reduced.select([name]).values
        label = f"{relation.slopes[0]:+.2f} {relation.controllers[0]} {relation.offset:+.1f}"
        axes.plot(seconds, before, colour, lw=1.4, label=name)
        axes.plot(seconds, after, colour, ls="--", lw=1, label=label)
    axes.set_xlim(0, seconds[-1])
    axes.set_ylim(top=68)
    axes.set_xlabel("seconds")
    axes.set_ylabel("degrees")
    axes.legend(ncol=4, fontsize=9, loc="upper center", frameon=False)
    figure.savefig(ROOT / "docs" / "pictures" / "reduce.png", bbox_inches="tight")
    print(f"{free} of {total} channels")


if __name__ == "__main__":
    main()
