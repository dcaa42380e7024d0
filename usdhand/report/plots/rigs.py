"""A rig as a picture of the hands: which channels are free, and what follows them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from usdhand.anatomy.channels import is_flexion
from usdhand.anatomy.hand import DIGITS
from usdhand.motion.rotations import Array
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.report.plots import style
from usdhand.report.plots.style import BLACK, BLUE, GREY, LIGHT, ORANGE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = ("rig_hands",)
# Of a right hand seen from its back: where each digit starts, its direction in degrees, its bones.
SHAPE = {
    "Thumb": ((-1.1, 0.9), 140.0, (1.3, 1.0)),
    "Index": ((-0.9, 3.1), 97.0, (1.6, 1.0)),
    "Middle": ((0.0, 3.3), 90.0, (1.8, 1.1)),
    "Ring": ((0.85, 3.0), 84.0, (1.6, 1.0)),
    "Pinky": ((1.6, 2.5), 76.0, (1.2, 0.8)),
}
TIP = 0.7  # length of the last bone
SIZES = {"free": 9.0, "linear": 6.0, "constant": 4.0}
COLOURS = {"free": ORANGE, "linear": BLUE, "constant": LIGHT}
APART = 0.34  # of the three channels of one joint


def figures(rig: ReducedRig) -> dict[str, Figure]:
    """The picture by its name."""
    return {"rig_hands": hands(rig)}


@styled
def hands(rig: ReducedRig) -> Figure:
    """Both hands from the back: free channels, what follows them most, and what is constant.

    Lines lead from dependent channels to their strongest controllers. Flexions are discs, twists
    and spreads diamonds.
    """
    figure, [panel] = style.new_figure(
        f"{len(rig.free)} of {len(rig.names)} channels are free, the others follow", (9.5, 5.2)
    )
    at = {name: _place(name) for name in rig.names}
    for side in sorted({name[:2] for name in rig.names}):
        _outline(panel, side)
    for relation in rig.relations:
        if relation.controllers:
            lead = relation.controllers[_strongest(rig, relation)]
            told = 0.5 if relation.told is None else relation.told
            panel.annotate(
                "",
                at[relation.name],
                at[lead],
                arrowprops={
                    "arrowstyle": "-",
                    "color": GREY,
                    "alpha": 0.15 + 0.6 * told,
                    "linewidth": 0.8,
                    "connectionstyle": "arc3,rad=0.15",
                },
            )
    for relation in rig.relations:
        x, y = at[relation.name]
        panel.plot(
            [x],
            [y],
            "o" if is_flexion(relation.name) else "D",
            color=COLOURS[relation.kind],
            markersize=SIZES[relation.kind],
            markeredgecolor=BLACK if relation.kind == "free" else "white",
            markeredgewidth=0.6,
        )
    for kind, label in (("free", "free"), ("linear", "follows"), ("constant", "constant")):
        panel.plot([], [], "o", color=COLOURS[kind], markersize=SIZES[kind], label=label)
    panel.plot([], [], "D", color=GREY, markersize=6, label="twist or spread")
    panel.legend(loc="lower center", ncols=4)
    panel.set_aspect("equal")
    panel.set_axis_off()
    return figure


def _strongest(rig: ReducedRig, relation: Relation) -> int:
    """Which controller moves a channel most: by its slope and its own motion, where known."""
    std = {r.name: r.std for r in rig.relations}
    pairs = zip(relation.controllers, relation.slopes, strict=True)
    return int(np.argmax([abs(slope) * (std[c] or 1.0) for c, slope in pairs]))


def _joints(digit: str) -> Array:
    """(4, 2) three joints and the tip of a digit of the right hand."""
    start, angle, lengths = SHAPE[digit]
    direction = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    along = np.cumsum([0.0, *lengths, TIP])
    return np.asarray(np.array(start) + along[:, None] * direction)


def _on_side(points: Array, side: str) -> Array:
    """Right hands stand right, left ones are their mirror."""
    sign = 1.0 if side == "ri" else -1.0
    return np.asarray(points * [sign, 1.0] + [3.6 * sign, 0.0])


def _place(channel: str) -> tuple[float, float]:
    """Where a channel is drawn: at its joint, the three of a joint side by side."""
    joint = channel[2:-1]
    digit = next(d for d in DIGITS if joint.startswith(d))
    order: Sequence[str] = ("CMC", "MCP", "IP") if digit == "Thumb" else ("MCP", "PIP", "DIP")
    points = _joints(digit)
    number = order.index(joint.removeprefix(digit))
    along = points[number + 1] - points[number]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    shift = 0.0 if is_flexion(channel) else APART * (1.0 if channel[-1] == "x" else -1.0)
    x, y = _on_side((points[number] + shift * across)[None], channel[:2])[0]
    return float(x), float(y)


def _outline(panel: Axes, side: str) -> None:
    for digit in DIGITS:
        points = np.concatenate([[[0.0, 0.0]], _joints(digit)])
        x, y = _on_side(points, side).T
        panel.plot(x, y, color=LIGHT, linewidth=9.0, solid_capstyle="round", zorder=0)
    x, y = _on_side(np.array([[0.0, -0.5]]), side)[0]
    panel.text(x, y - 0.3, "right" if side == "ri" else "left", ha="center", fontsize=9)
