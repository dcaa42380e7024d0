"""Plots of reduce: what barely moves, what follows what, what it costs (the paper's 2 and 4 to 9).

All take the reductions of one rig, and show the motion of all their clips together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.reduce.curve import error_curve, rig_loss
from usdhand.reduce.errors import pca_rms
from usdhand.reduce.fit import Statistics
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import Relation
from usdhand.reduce.search import errors_by_count
from usdhand.reduce.settings import Fit, ReduceSettings
from usdhand.report.plots import curve, style
from usdhand.report.plots.style import BLACK, BLUE, GREY, LIGHT, ORANGE, SKY, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = (
    "reduce_followers",
    "reduce_histograms",
    "reduce_curves",
    "reduce_errors",
)
MOST_FOLLOWERS, MOST_CURVES = 12, 6
SCATTER_POINTS = 600
SEEN_DEG = 0.01  # a smaller error is not worth a plot
BIN_WIDTHS = (
    1.0,
    2.0,
    5.0,
    10.0,
    20.0,
    50.0,
)  # of ranges in degrees, the first that gives few bars


def figures(
    reductions: Sequence[Reduction], settings: ReduceSettings | None = None
) -> dict[str, Figure]:
    """All plots of a rig by name; those with nothing to show are left out."""
    found = {
        "reduce_followers": followers(reductions),
        "reduce_histograms": histograms(reductions),
        "reduce_curves": curves(reductions),
        "reduce_errors": errors(reductions, settings),
    }
    return {name: figure for name, figure in found.items() if figure is not None}


@styled
def followers(reductions: Sequence[Reduction]) -> Figure | None:
    """Dependent against controlling channels, with the line that replaces them; None of none."""
    rig = reductions[0].rig
    lost = dict(zip(rig.names, _rms(reductions), strict=True))
    linear = sorted((r for r in rig.relations if r.kind == "linear"), key=lambda r: lost[r.name])
    if not linear:
        return None
    shown = style.spread(linear, MOST_FOLLOWERS)
    which = "" if len(shown) == len(linear) else f", {len(shown)} from the best to the worst"
    figure, axes = style.small_multiples(
        f"{len(linear)} of {len(rig.names)} channels follow others linearly{which}",
        len(shown),
        (2.6, 2.3),
        4,
    )
    values = _points(reductions)
    for panel, relation in zip(axes, shown, strict=True):
        _follower(panel, relation, values, connected=len(reductions) == 1)
        panel.set_title(f"RMS error {lost[relation.name]:.1f} deg", fontsize=8)
    return figure


def _follower(
    panel: Axes, relation: Relation, values: Mapping[str, Array], connected: bool
) -> None:
    first, slope = relation.controllers[0], relation.slopes[0]
    others = list(zip(relation.controllers[1:], relation.slopes[1:], strict=True))
    x, y = values[first], values[relation.name] - sum(s * values[c] for c, s in others)
    panel.set_rasterization_zorder(0)  # thousands of points are no outlines for an SVG
    if connected:
        panel.plot(x, y, color=LIGHT, linewidth=0.5, zorder=-2)
    panel.plot(x, y, ".", color=BLUE, markersize=2.5, markeredgewidth=0, zorder=-1)
    ends = np.array([x.min(), x.max()])
    panel.plot(ends, relation.offset + slope * ends, color=ORANGE)
    panel.set_xlabel(f"{first}, deg", fontsize=8)
    without = f"\nless part of {', '.join(c for c, _ in others)}" if others else ""
    panel.set_ylabel(f"{relation.name}, deg{without}", fontsize=8)
    panel.locator_params(nbins=4)


@styled
def histograms(reductions: Sequence[Reduction]) -> Figure:
    """How far channels move, and how alike pairs of them move in the same and opposite sense."""
    rig, statistics = reductions[0].rig, _statistics(reductions)
    pairs = np.triu_indices(len(rig.names), k=1)
    moving = statistics.moving(0.0)
    both = moving[pairs[0]] & moving[pairs[1]]
    correlation = statistics.correlation[pairs][both]
    figure, (widths, same, opposite) = style.new_figure(
        "Ranges of the channels, and distances of their pairs", (9.5, 2.9), 1, 3
    )
    widest = float(statistics.range.max(initial=0.0))
    step = next((s for s in BIN_WIDTHS if widest <= 25 * s), BIN_WIDTHS[-1])
    bins = [step * i for i in range(max(int(np.ceil(widest / step)), 1) + 1)]
    widths.hist(statistics.range, bins, color=BLUE, edgecolor="white")
    widths.set_xlim(left=0)
    widths.locator_params(axis="y", integer=True)
    held = int((~statistics.moving(rig.range_threshold)).sum())
    constant = sum(relation.kind not in ("free", "linear") for relation in rig.relations)
    # A rig of other clips holds what did not move there.
    does = "" if held == constant else f"\nthis rig holds {constant} constant"
    below = f"below {rig.range_threshold:.3g} deg: {held} channels{does}"
    _threshold(widths, rig.range_threshold, below)
    widths.set_title(f"range of {len(rig.names)} channels")
    widths.set_xlabel("range, deg")
    widths.set_ylabel("channels")
    for panel, sign, words in ((same, 1.0, "same"), (opposite, -1.0, "opposite")):
        distance = np.sqrt(2.0 * (1.0 - sign * correlation))
        panel.hist(distance, np.linspace(0, 2, 21).tolist(), color=BLUE, edgecolor="white")
        close = int((distance < rig.rmsd_threshold).sum())
        _threshold(panel, rig.rmsd_threshold, f"below {rig.rmsd_threshold:.3g}: {close} pairs")
        panel.set_title(f"distance of {len(distance)} pairs, {words} direction")
        panel.set_xlabel("RMS deviation of standardised curves")
        panel.set_ylabel("pairs")
        panel.set_xlim(0, 2)
    return figure


def _threshold(panel: Axes, value: float, label: str) -> None:
    panel.margins(y=0.22)
    if value > 0:
        panel.axvline(value, color=ORANGE, label=label)
        panel.legend(loc="upper right", handlelength=1.0)


@styled
def curves(reductions: Sequence[Reduction]) -> Figure | None:
    """Original and reconstructed curves of the channels that lose most; None if nothing is lost.

    Of several clips, each channel is shown in the one where it loses most.
    """
    rig = reductions[0].rig
    lost = np.stack([r.errors.rms for r in reductions])
    lost[:, [relation.kind == "free" for relation in rig.relations]] = 0.0
    worst = lost.max(axis=0)
    order = [int(i) for i in np.argsort(-worst, kind="stable")[:MOST_CURVES] if worst[i] > SEEN_DEG]
    if not order:
        return None
    figure, axes = style.small_multiples(
        f"The {len(order)} channels that reduction changes most", len(order), (4.8, 1.8), 2
    )
    for panel, channel in zip(axes, order, strict=True):
        number = int(lost[:, channel].argmax())
        relation, error = rig.relations[channel], lost[number, channel]
        _curve(panel, reductions[number], relation.name)
        where = f"\nin {reductions[number].clip.name}" if len(reductions) > 1 else ""
        title = f"{relation.name} {_how(relation)}: RMS error {error:.1f} deg{where}"
        panel.set_title(title, fontsize=8)
    for panel in axes[-2:]:
        panel.set_xlabel("seconds")
    lines = axes[0].get_lines()
    figure.legend(lines, ["original", "reduced"], loc="outside upper right", ncols=2)
    return figure


def _curve(panel: Axes, reduction: Reduction, name: str) -> None:
    at = style.sampled(len(reduction.clip))
    seconds = at / reduction.clip.fps
    for channels, colour in ((reduction.source, BLACK), (reduction.reduced, ORANGE)):
        panel.plot(seconds, channels.select([name]).values[at, 0], color=colour)
    panel.set_xlim(0, max(seconds[-1], 1e-3))
    panel.set_ylabel("deg")
    panel.locator_params(axis="y", nbins=4)


def _how(relation: Relation) -> str:
    if relation.kind == "constant":
        return "held constant"
    return "follows " + " and ".join(relation.controllers)


@styled
def errors(reductions: Sequence[Reduction], settings: ReduceSettings | None = None) -> Figure:
    """Errors against the number of free channels: the paper's rules, the best channels, PCA.

    In degrees; of a rig that was fitted to these clips also in millimetres at the fingertips.
    """
    rig, statistics = reductions[0].rig, _statistics(reductions)
    evidence, stacked = reductions[0].evidence, _stacked(reductions)
    counts = np.arange(len(rig.names) + 1)
    title = "What reduction loses, by how many channels stay free"
    size = (6.5, 4.0) if evidence is None else (11.0, 4.2)
    figure, [panel, *others] = style.new_figure(title, size, 1, 1 if evidence is None else 2)
    fits: tuple[tuple[Fit, str, str, float], ...] = (
        ("paper", SKY, "one controller, the paper's fit", 3.5),
        ("least-squares", BLUE, "one controller, least squares", 1.3),
    )
    for fit, colour, label, width in fits:  # often the same: one is drawn on the other
        by_count = errors_by_count(statistics, fit)
        there = np.isfinite(by_count)
        panel.plot(counts[there], by_count[there], color=colour, label=label, linewidth=width)
    bound = [pca_rms(stacked, int(n)) for n in counts]
    panel.plot(counts, bound, "--", color=GREY, label="PCA: the smallest error of any linear model")
    if evidence is not None:
        settings = settings or ReduceSettings()
        by_number = error_curve(evidence, settings.choice, settings.controllers)
        curve.add_best(panel, by_number, "deg")
        curve.add_pca(others[0], by_number, "mm")
        curve.add_best(others[0], by_number, "mm")
        curve.finish(others[0], rig, "mm", rig_loss(rig, evidence).mm)
    curve.finish(panel, rig, "deg", float(np.sqrt(np.mean(_rms(reductions) ** 2))))
    return figure


def _stacked(reductions: Sequence[Reduction]) -> Array:
    """Modelled channels (frames, channels) of all clips."""
    names = reductions[0].rig.names
    return np.concatenate([r.source.select(names).values for r in reductions])


def _points(reductions: Sequence[Reduction]) -> dict[str, Array]:
    """Some values of every modelled channel, evenly spread over every clip."""
    names = reductions[0].rig.names
    parts = []
    for reduction in reductions:
        curves = reduction.source.select(names).values
        at = style.sampled(len(curves), max(SCATTER_POINTS // len(reductions), 2))
        parts.append(curves[at])
    return dict(zip(names, np.concatenate(parts).T, strict=True))


def _rms(reductions: Sequence[Reduction]) -> Array:
    """RMS error (channels,) of every modelled channel over all clips, degrees."""
    squares = [r.errors.rms**2 for r in reductions]
    return np.sqrt(np.average(squares, axis=0, weights=[len(r.clip) for r in reductions]))


def _statistics(reductions: Sequence[Reduction]) -> Statistics:
    return Statistics.of(_stacked(reductions))
