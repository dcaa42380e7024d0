"""The error against the number of free channels, in degrees and millimetres, PCA's beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from usdhand.reduce.curve import CurvePoint, ErrorCurve, Loss, error_curve, rig_loss
from usdhand.reduce.evidence import Takes
from usdhand.reduce.rig import ReducedRig
from usdhand.reduce.settings import ReduceSettings
from usdhand.report.plots import style
from usdhand.report.plots.style import BLACK, GREY, LIGHT, ORANGE, YELLOW, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = ("reduce_errors",)
UNITS = {"deg": "RMS error over all channels, deg", "mm": "RMS error of the fingertips, mm"}


def figures(rig: ReducedRig, evidence: Takes, settings: ReduceSettings) -> dict[str, Figure]:
    """The plot of a fit by name."""
    curve = error_curve(evidence, settings.choice, settings.controllers)
    return {"reduce_errors": draw(rig, evidence, curve)}


@styled
def draw(rig: ReducedRig, evidence: Takes, curve: ErrorCurve) -> Figure:
    """Two panels: degrees and millimetres."""
    figure, panels = style.new_figure(
        "What the best channels lose, by how many stay free", (9.5, 4.0), 1, 2
    )
    for panel, unit in zip(panels, UNITS, strict=True):
        add_pca(panel, curve, unit)
        add_best(panel, curve, unit)
        finish(panel, rig, unit, rig_loss(rig, evidence).by(unit))
    return figure


def add_pca(panel: Axes, curve: ErrorCurve, unit: str) -> None:
    """PCA of the same size, on what was fitted."""
    counts, errors = _known(curve.points, "pca", unit)
    panel.plot(
        counts, errors, "--", color=GREY, label="PCA: the smallest error of any linear model"
    )


def add_best(panel: Axes, curve: ErrorCurve, unit: str) -> None:
    """The best channels by their number, the presets, and the suggested number."""
    parts: tuple[tuple[str, str, str, str], ...] = (
        ("fitted", "-", BLACK, "best channels"),
        ("left_out", "-", YELLOW, "best channels, on takes left out"),
        ("pca_left_out", ":", GREY, "PCA, on takes left out"),
    )
    for name, line, colour, label in parts:
        known, errors = _known(curve.points, name, unit)
        if known:
            panel.plot(known, errors, line, color=colour, label=label)
    places: dict[tuple[int, float], list[str]] = {}
    for preset, (count, loss) in curve.presets.items():
        places.setdefault((count, round(loss.by(unit), 2)), []).append(str(preset))
    for number, (place, presets) in enumerate(places.items()):
        label = "presets 1 to 4" if number == 0 else "_"
        panel.plot(*([x] for x in place), "s", color=BLACK, markersize=4, label=label)
        text, right = ", ".join(presets), place[0] > 0.9 * curve.points[-1].channels
        panel.annotate(
            text,
            place,
            (-3 if right else 3, 3),
            textcoords="offset points",
            fontsize=7,
            ha="right" if right else "left",
        )
    panel.axvline(
        curve.suggested, color=LIGHT, label=f"suggested number: {curve.suggested}", zorder=0
    )


def finish(panel: Axes, rig: ReducedRig, unit: str, own: float) -> None:
    """The rig itself, and what the axes mean."""
    label = f"this rig: {len(rig.free)} free, {own:.2f} {unit}"
    panel.plot([len(rig.free)], [own], "o", color=ORANGE, label=label)
    panel.set_xlim(0, len(rig.names))
    panel.set_ylim(bottom=0)
    panel.set_xlabel("free channels")
    panel.set_ylabel(UNITS[unit])
    panel.legend(loc="upper right")


def _known(points: Sequence[CurvePoint], name: str, unit: str) -> tuple[list[int], list[float]]:
    losses: list[tuple[int, Loss | None]] = [(p.channels, getattr(p, name)) for p in points]
    there = [(count, loss.by(unit)) for count, loss in losses if loss is not None]
    counts, errors = [c for c, _ in there], [e for _, e in there]
    assert np.isfinite(errors).all()
    return counts, errors
