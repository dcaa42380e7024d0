"""Plots of evaluate: how well arms tell fingers (the paper's figures 7 and 8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from usdhand.evaluate.agreement import Agreement
from usdhand.evaluate.reconstruction import METHODS, HandError
from usdhand.report.evaluate import evaluation_result
from usdhand.report.plots import style
from usdhand.report.plots.style import BLACK, BLUE, GREY, ORANGE, SKY, YELLOW, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES = ("evaluate_features", "evaluate_confusion", "evaluate_fingers")


def figures(agreements: Sequence[Agreement], errors: Sequence[HandError]) -> dict[str, Figure]:
    """All plots of an evaluation by name; those of what was not measured are left out."""
    found = {}
    if agreements:
        found["evaluate_features"] = features(agreements)
        found["evaluate_confusion"] = confusion(max(agreements, key=lambda a: a.share))
    if errors:
        found["evaluate_fingers"] = fingers(errors)
    return found


@styled
def features(agreements: Sequence[Agreement]) -> Figure:
    """Share of the nearest segments that have the same label, by what is compared."""
    best = max(agreements, key=lambda a: a.share)
    figure, [panel] = style.new_figure(
        f"How often the nearest segments are the same gesture ({best.segments} segments)",
        (7.5, 1.0 + 0.27 * len(agreements)),
    )
    shares = [100.0 * a.share for a in agreements]
    colours = [ORANGE if a is best else BLUE for a in agreements]
    bars = panel.barh([a.metric for a in agreements], shares, color=colours, height=0.7)
    panel.bar_label(bars, fmt="%.0f %%", padding=3, fontsize=8)
    panel.invert_yaxis()
    panel.set_xlim(0, 100)
    panel.set_xlabel("same label among the nearest, %")
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)
    return figure


@styled
def confusion(agreement: Agreement) -> Figure:
    """Which labels the nearest segments of each label have."""
    count = len(agreement.labels)
    many = count > 16
    size = (0.32 if many else 0.48) * count
    figure, [panel] = style.new_figure(
        f"Labels found by {agreement.metric}, % of the nearest", (size + 2.4, size + 1.9)
    )
    percent = 100.0 * agreement.confusion
    panel.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for (row, column), value in np.ndenumerate(percent):
        if many and value < 0.5:
            continue
        colour = "white" if value > 55 else BLACK if value >= 0.5 else GREY
        panel.text(column, row, f"{value:.0f}", ha="center", va="center", color=colour, fontsize=8)
    names = [label.replace("_", " ") for label in agreement.labels]
    panel.set_xticks(range(count), names, rotation=40, ha="right", rotation_mode="anchor")
    panel.set_yticks(range(count), names)
    panel.set_xlabel("label found")
    panel.set_ylabel("label of the segment")
    panel.tick_params(length=0)
    panel.spines[:].set_visible(False)
    return figure


@styled
def fingers(errors: Sequence[HandError]) -> Figure:
    """Mean errors of filled fingers beside the alternatives; a dot is a take."""
    means = evaluation_result([], errors)["reconstruction"]
    takes = len({e.take for e in errors})
    figure, axes = style.new_figure(
        f"How far fingers are from the true ones, {takes} takes (dots) and their means",
        (10.5, 3.8),
        1,
        2,
        sharey=True,
    )
    height = 0.8 / len(means)
    rows = np.arange(len(METHODS), dtype=np.float64)
    units = (("degrees", "joint rotations, deg"), ("fingertip_mm", "fingertips, mm"))
    for panel, (key, label) in zip(axes, units, strict=True):
        most = 0.0
        for number, (side, colour) in enumerate(zip(means, (SKY, YELLOW), strict=False)):
            values = [means[side][method][key] for method in METHODS]
            at = rows + height * (number - (len(means) - 1) / 2)
            panel.barh(at, values, height, color=colour, label=f"{side} hand")
            own = [
                [getattr(e, key) for e in errors if (e.side, e.method) == (side, m)]
                for m in METHODS
            ]
            dots = [(x, y) for xs, y in zip(own, at, strict=True) for x in xs]
            panel.plot(
                *zip(*dots, strict=True),
                ".",
                color=BLACK,
                markersize=2.5,
                markeredgewidth=0,
                alpha=0.6,
                rasterized=True,
            )
            for value, y in zip(values, at, strict=True):
                panel.text(
                    1.0,
                    y,
                    f"{value:.1f}",
                    transform=panel.get_yaxis_transform(),
                    ha="right",
                    va="center",
                    fontsize=7.5,
                )
            most = max(most, *(x for x, _ in dots))
        panel.set_xlim(0, 1.13 * most or 1.0)
        panel.set_xlabel(f"mean error of {label}")
        panel.tick_params(axis="y", length=0)
    axes[0].set_yticks(rows, METHODS)
    axes[0].invert_yaxis()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure
