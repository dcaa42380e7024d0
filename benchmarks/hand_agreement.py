"""How well channels mean the same on every rig: off-axis shares, agreement of two rigs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from usdhand import find_hands, read_clip
from usdhand.anatomy.channels import Channels, Hands
from usdhand.anatomy.hand import FINGERS, SIDE_PREFIX, Side
from usdhand.evaluate.compare import find_lag
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

# Two files agree about a thumb if it turns the same way against the forearm within this.
SAME_SOURCE_DEG = 1.0


def off_axis_shares(takes: Sequence[Channels]) -> list[tuple[Any, ...]]:
    """Rows of hinge joint, left share, right share of the variance that is not flexion."""
    variance: dict[str, Array] = defaultdict(lambda: np.zeros(3))
    for channels in takes:
        for name, curve in zip(channels.names, channels.values.T, strict=True):
            variance[name[:-1]]["xyz".index(name[-1])] += curve.var()
    joints = ["ThumbMCP", "ThumbIP", *(f + j for f in FINGERS for j in ("PIP", "DIP"))]

    def share(joint: str) -> str:
        v = variance[joint]
        off = 1.0 - v[2 if "Thumb" in joint else 1] / v.sum() if v.sum() > 0 else 0.0
        return f"{100 * off:.1f} %"

    return [(j, share("le" + j), share("ri" + j)) for j in joints if "le" + j in variance]


def agreement_of_rigs(folder: Path, other: Path) -> list[tuple[Any, ...]]:
    """Rows of channel group, number of hands, median and worst RMS difference of a channel."""
    groups: dict[str, list[float]] = defaultdict(list)
    hands: dict[str, int] = defaultdict(int)
    for path in sorted(other.glob("*.usd*")):
        clips = [read_clip(folder / path.name), read_clip(path)]
        found = [find_hands(c) for c in clips]
        channels = [h.encode(c) for c, h in zip(clips, found, strict=True)]
        spans = aligned(channels[0], channels[1], clips[0].fps)
        a, b = (c.values[s] for c, s in zip(channels, spans, strict=True))
        rms = dict(zip(channels[0].names, np.sqrt(np.mean((b - a) ** 2, axis=0)), strict=True))
        for side in found[0].frames:
            thumbs = [thumb(c, h, side)[s] for c, h, s in zip(clips, found, spans, strict=True)]
            same = rot.angle_between(*thumbs).max() < SAME_SOURCE_DEG
            kind = "thumb, where the files agree" if same else "thumb, where the files differ"
            hands["four fingers"] += 1
            hands[kind] += 1
            for name, value in rms.items():
                if name.startswith(SIDE_PREFIX[side]):
                    groups[kind if "Thumb" in name else "four fingers"].append(float(value))
    return [
        (kind, hands[kind], f"{np.median(v):.3f}", f"{max(v):.3f}")
        for kind, v in sorted(groups.items())
    ]


def aligned(a: Channels, b: Channels, fps: float) -> tuple[slice, slice]:
    """Frames of both that show the same moment, by the fingers' lag."""
    fingers = [i for i, n in enumerate(a.names) if "Thumb" not in n]
    lag = find_lag(a.values[:, fingers], b.values[:, fingers], fps) or 0.0
    first, second = max(0, -round(lag * fps)), max(0, round(lag * fps))
    count = min(len(a.values) - first, len(b.values) - second)
    return slice(first, first + count), slice(second, second + count)


def thumb(clip: Clip, hands: Hands, side: Side) -> Array:
    """(frames, 3, 4) rotations of the thumb's joints relative to the forearm."""
    hand = hands.character.hands[side]
    assert hand.elbow is not None
    joints = [hand.elbow, *(hand.joints["Thumb" + j] for j in ("CMC", "MCP", "IP"))]
    world = forward_kinematics(clip, joints).rotations
    return rot.multiply(rot.conjugate(world[:, :1]), world[:, 1:])
