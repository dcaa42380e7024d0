"""How well the thumb's axes fit: flexion at MCP and IP, and what 25 channels lose at its tip.

Run: python benchmarks/thumb_axes.py CLIP_OR_FOLDER...

Clips of one skeleton are one row and are measured with common axes. The share of flexion is its
root mean square relative to that of the whole rotation away from the mean, over all hands whose
thumb moves by more than a degree: the median hand, and the tenth of them that has the least. The
loss is the mean distance between the tip of the thumb and where the papers' 25 channels put it,
the other 20 held at their mean.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from usdhand import find_hands, read_clip
from usdhand.anatomy.channels import Channels, Hands, encode
from usdhand.anatomy.hand import SIDE_PREFIX
from usdhand.errors import UsdHandError
from usdhand.formats.suffixes import FORMATS, USD_SUFFIXES
from usdhand.motion import Clip

MOVES_DEG = 1.0


def flexion_shares(hands: Hands, clip: Clip) -> list[tuple[str, float]]:
    """Joint and share of flexion of each thumb's hinges that move."""
    found = []
    for frames in hands.frames.values():
        channels = encode(clip, frames)
        curves = dict(zip(channels.names, channels.values.T, strict=True))
        for joint in ("ThumbMCP", "ThumbIP"):
            name = SIDE_PREFIX[frames.side] + joint
            if name + "z" in curves:
                spread = [float(np.std(curves[name + letter])) for letter in "xyz"]
                if np.linalg.norm(spread) > MOVES_DEG:
                    found.append((joint, spread[2] / float(np.linalg.norm(spread))))
    return found


def tip_losses(hands: Hands, clip: Clip) -> list[float]:
    """Mean distance in mm of each thumb's tip from where the 25 channels alone put it."""
    channels = hands.encode(clip)
    held = [name not in hands.model_names for name in channels.names]
    values = channels.values.copy()
    values[:, held] = values[:, held].mean(axis=0)
    modelled = hands.fingertips(clip, Channels(channels.names, values))
    away = np.linalg.norm(modelled - hands.fingertips(clip, channels), axis=-1)
    digits = [digit for frames in hands.frames.values() for digit in frames.digits]
    return [10.0 * float(away[:, i].mean()) for i, d in enumerate(digits) if d == "Thumb"]


def rigs_of(paths: Sequence[Path]) -> list[list[Clip]]:
    """Clips by the skeleton that they share."""
    found: dict[tuple[str, ...], list[Clip]] = defaultdict(list)
    for path in paths:
        try:
            clip = read_clip(path)
        except UsdHandError:
            continue
        found[clip.skeleton.joints].append(clip)
    return list(found.values())


def row(clips: Sequence[Clip]) -> tuple[str, ...] | None:
    """One line of the table; None where no thumb moves."""
    shares: dict[str, list[float]] = defaultdict(list)
    losses: list[float] = []
    for clip in clips:
        hands = find_hands(clip, others=clips)
        moving = flexion_shares(hands, clip)
        for joint, share in moving:
            shares[joint].append(share)
        losses += tip_losses(hands, clip)
    if not shares:
        return None
    name = f"{hands.character.convention} ({clips[0].name}, {len(clips)} clips)"
    pronation = hands.pronation
    assert pronation is not None
    parts = [
        f"{100 * np.median(v):.0f} % ({100 * np.quantile(v, 0.1):.0f} %)"
        for v in (shares[joint] or [np.nan] for joint in ("ThumbMCP", "ThumbIP"))
    ]
    turned = f"{pronation.degrees:g}, by {pronation.witness}"
    return name, turned, *parts, f"{np.mean(losses):.1f}"


def main() -> None:
    """Print a row for every rig."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", nargs="+", help="files and folders")
    given = [Path(c) for c in parser.parse_args().clips]
    suffixes = (*USD_SUFFIXES, *FORMATS)
    files = [f for g in given for f in ([g] if g.is_file() else sorted(g.iterdir()))]
    print("| rig | pronation | MCP flexion | IP flexion | loss at the tip, mm |")
    print("|---|---|---|---|---|")
    for clips in rigs_of([f for f in files if f.suffix in suffixes]):
        if cells := row(clips):
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
