"""Plots of fill: where the motion is cut and which way was chosen (the paper's figures 4 and 3)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from usdhand.anatomy import Hands
from usdhand.fill.arm import arm_motion
from usdhand.fill.library import ARM_FPS, MotionLibrary, Part, at_arm_rate
from usdhand.fill.results import Filled, FilledPart
from usdhand.fill.segment import wrist_speed
from usdhand.motion import Clip
from usdhand.report.plots import style
from usdhand.report.plots.style import BLACK, BLUE, GREY, ORANGE, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = tuple(
    f"fill_{plot}_{of}" for plot in ("speed", "graph") for of in ("left", "right", "both")
)
ROW_S, MOST_ROWS = 12.0, 5
MOST_LAYERS = 8


def figures(filled: Filled, body: Clip, hands: Hands, library: MotionLibrary) -> dict[str, Figure]:
    """All plots of a filled body by name.

    Parameters
    ----------
    body, hands : what was filled, and its hands
    """
    found = {}
    for part in filled.parts:
        of = part.part[0] if len(part.part) == 1 else "both"
        found[f"fill_speed_{of}"] = speed(part, body, hands)
        found[f"fill_graph_{of}"] = graph(part, library)
    return found


@styled
def speed(part: FilledPart, body: Clip, hands: Hands) -> Figure:
    """Speed of the wrist (of two, the faster one) and the borders of the segments.

    Of a long clip, the first minute.
    """
    cutting, choices = part.space.segmentation, part.alternatives[0].choices
    arms = [at_arm_rate(arm_motion(body, hands, side), body.fps) for side in part.part]
    speeds = [wrist_speed(a.hips_position, ARM_FPS, cutting.smoothing) for a in arms]
    fastest = np.max(speeds, axis=0)
    seconds = np.arange(len(fastest)) / ARM_FPS
    end = float(seconds[-1])
    shown = min(end, ROW_S * MOST_ROWS)
    rows = max(1, int(np.ceil(shown / ROW_S - 1e-9)))
    which = "" if shown == end else f", the first {shown:.0f} of {end:.0f} s"
    figure, axes = style.new_figure(
        f"{_of(part.part, 'wrist')}: speed, and where it is cut into segments{which}",
        (9.5, 0.9 + 1.5 * rows),
        rows,
        sharey=True,
    )
    borders = [c.start for c in choices] + [choices[-1].end]
    for row, panel in enumerate(axes):
        first, last = row * shown / rows, (row + 1) * shown / rows
        inside = (seconds >= first - 1 / ARM_FPS) & (seconds <= last + 1 / ARM_FPS)
        own = [b for b in borders if first <= b <= last]
        panel.vlines(own, 0, 1, BLUE, linewidth=0.8, transform=panel.get_xaxis_transform())
        panel.axhline(cutting.speed, color=ORANGE, linewidth=0.9, linestyle="--")
        panel.plot(seconds[inside], fastest[inside], color=BLACK)
        panel.set_xlim(first, max(last, first + 1e-3))
        panel.set_ylim(bottom=0)
        panel.set_ylabel("cm/s")
    axes[-1].set_xlabel("seconds")
    lines = [axes[0].lines[1], axes[0].collections[0], axes[0].lines[0]]
    labels = [
        "speed relative to the hips",
        "border of segments",
        f"threshold, {cutting.speed:g} cm/s",
    ]
    figure.legend(lines, labels, loc="outside lower right", ncols=3)
    return figure


@styled
def graph(part: FilledPart, library: MotionLibrary) -> Figure:
    """Candidates of the first segments, the costs of both kinds, and the path that was chosen."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import ListedColormap, LogNorm

    choices = part.alternatives[0].choices[:MOST_LAYERS]
    layers, edges = part.network.layers[: len(choices)], part.network.edges[: len(choices) - 1]
    most, total = max(len(x.costs) for x in layers), len(part.alternatives[0].choices)
    which = "" if len(choices) == total else f", the first {len(choices)} of {total} segments"
    figure, [panel] = style.new_figure(
        f"{_of(part.part, 'hand')}: the cheapest path through the candidates{which}",
        (max(1.4 * len(choices), 6.0) + 1.0, 1.2 + 0.72 * most),
    )
    starts = [
        (x, i, j) for x, e in enumerate(edges) for i in range(len(e)) for j in range(e.shape[1])
    ]
    if starts:
        costs = np.array([edges[x][i, j] for x, i, j in starts])
        least, greatest = np.quantile(costs, (0.05, 0.95)) + np.array([1e-6, 2e-6])
        dearest_first = np.argsort(-costs, kind="stable")
        lines = LineCollection(
            [[(x, i), (x + 1, j)] for x, i, j in (starts[n] for n in dearest_first)],
            array=costs[dearest_first],
            cmap=ListedColormap([str(grey) for grey in np.linspace(0.35, 0.93, 64)]),
            norm=LogNorm(least, greatest, clip=True),
            linewidths=0.7,
            zorder=1,
        )
        panel.add_collection(lines)
        bar = figure.colorbar(lines, ax=panel, shrink=0.7, pad=0.01, extend="both")
        bar.set_label("transition cost")
        bar.ax.minorticks_off()
        steps = [m * 10.0**e for e in range(-6, 9) for m in (1, 2, 5)]
        ticks = [t for t in steps if least <= t <= greatest]
        bar.set_ticks(ticks, labels=[f"{t:g}" for t in ticks])
    chosen = [c.chosen for c in choices]
    panel.plot(range(len(choices)), chosen, color=ORANGE, linewidth=2.5, zorder=2)
    for x, (a, b) in enumerate(pairwise(chosen)):
        cost = f"{edges[x][a, b]:.3g}"
        _label(panel, x + 0.5, (a + b) / 2, cost, ORANGE, "white", 7)
    names = [library.clips[i].name for i in part.space.clips]
    short = style.shortened(
        [names[candidate.segment] for choice in choices for candidate in choice.candidates], 17
    )
    for x, (choice, layer) in enumerate(zip(choices, layers, strict=True)):
        for y, (candidate, cost) in enumerate(zip(choice.candidates, layer.costs, strict=True)):
            own = y == choice.chosen
            start = part.space.firsts[candidate.segment] / ARM_FPS
            text = f"{short[names[candidate.segment]]}\n{start:.1f} s, cost {cost:.3g}"
            _label(panel, x, y, text, ORANGE if own else GREY, "#fdebdc" if own else "white", 6.5)
    panel.set_xlim(-0.5, len(choices) - 0.5)
    panel.set_ylim(most - 0.5, -0.5)
    panel.set_xticks(
        range(len(choices)), [f"{c.start:.2f} to\n{c.end:.2f} s" for c in choices], fontsize=7.5
    )
    panel.set_yticks([])
    panel.spines[["left", "bottom"]].set_visible(False)
    panel.tick_params(length=0)
    panel.set_xlabel(
        "segment of the body; in the boxes: clip and second of the library, and segment cost"
    )
    return figure


def _label(panel: Axes, x: float, y: float, text: str, edge: str, face: str, size: float) -> None:
    panel.text(
        x,
        y,
        text,
        ha="center",
        va="center",
        fontsize=size,
        zorder=3,
        bbox={"boxstyle": "round,pad=0.3", "facecolor": face, "edgecolor": edge, "linewidth": 0.8},
    )


def _of(part: Part, noun: str) -> str:
    return f"Both {noun}s" if len(part) == 2 else f"{part[0].capitalize()} {noun}"
