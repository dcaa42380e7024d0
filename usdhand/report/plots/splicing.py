"""Plots of splice: the path through the costs, and curves (the paper's figures 2 and 4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy import SIDES, Channels, Hands, Side
from usdhand.anatomy.channels import is_flexion
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.report.plots import style
from usdhand.report.plots.style import BLACK, GREY, ORANGE, SKY, styled
from usdhand.splice.alignment import Alignment
from usdhand.splice.markers import Markers, hand_markers
from usdhand.splice.method import Spliced
from usdhand.splice.phases import derivative_signs, facing, in_trunk_axes, steady_turns
from usdhand.splice.settings import SpliceSettings
from usdhand.splice.timing import first_band

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = tuple(f"splice_{plot}_{side}" for plot in ("path", "curves") for side in SIDES)
CELLS = 250  # of the costs shown, along each axis at most
BAND_POINTS = 200


def figures(
    spliced: Spliced,
    body: Clip,
    hand_clip: Clip,
    body_hands: Hands,
    hand_hands: Hands,
    settings: SpliceSettings,
) -> dict[str, Figure]:
    """All plots of a spliced body by name; a hand that follows the other one has no path.

    Parameters
    ----------
    body, hand_clip, body_hands, hand_hands, settings : what `splice` was given
    """
    found = {}
    for side, alignment in spliced.hands.items():
        ours = hand_markers(body, body_hands, side, settings.fps)
        theirs = hand_markers(hand_clip, hand_hands, side, settings.fps)
        if alignment.taken_from is None:
            found[f"splice_path_{side}"] = path(side, alignment, ours, theirs, settings)
        fingers = hand_hands.encode(hand_clip), body_hands.encode(spliced.clip)
        found[f"splice_curves_{side}"] = curves(
            side, alignment, (ours, theirs), fingers, (hand_clip.fps, body.fps)
        )
    return found


@styled
def path(
    side: Side, alignment: Alignment, ours: Markers, theirs: Markers, settings: SpliceSettings
) -> Figure:
    """Costs of matching all moments of both clips, the band, the pins and the path.

    Parameters
    ----------
    ours, theirs : markers of the body and of the hand clip
    """
    shown = common_part(alignment)
    rows, columns, costs = cost_grid(ours, theirs, alignment, settings, shown)
    figure, [panel] = style.new_figure(
        f"{side.capitalize()} hand: which moments belong together", (6.4, 5.6)
    )
    image = panel.pcolormesh(rows, columns, costs.T, cmap="gray", rasterized=True)
    figure.colorbar(image, ax=panel, label="cost of a match (dark: similar)", shrink=0.8, pad=0.01)
    band = first_band(len(ours), len(theirs), settings, alignment.pins)
    at = style.sampled(len(ours), BAND_POINTS)
    seconds, low, high = at / ours.fps, band.low[at] / theirs.fps, band.high[at] / theirs.fps
    for outer, edge in ((0.0, low), (len(theirs) / theirs.fps, high)):
        panel.fill_between(seconds, outer, edge, color="white", alpha=0.6, linewidth=0)
    panel.plot(seconds, low, color=SKY, linewidth=1.2, label="band")
    panel.plot(seconds, high, color=SKY, linewidth=1.2)
    warp = alignment.warp[style.sampled(len(alignment.warp))].T
    panel.plot(*warp, color="white", linewidth=3.5)
    panel.plot(*warp, color=ORANGE, linewidth=1.8, label="path")
    if alignment.pins:
        body, hand, slack = np.array([(p.body, p.hand, p.tolerance) for p in alignment.pins]).T
        panel.errorbar(
            body,
            hand,
            slack,
            fmt="o",
            color=BLACK,
            markerfacecolor="white",
            markersize=5,
            zorder=4,
            label="pin",
            clip_on=False,
        )
    panel.set_xlim(*shown[0])
    panel.set_ylim(*shown[1])
    panel.set_xlabel("body, seconds")
    panel.set_ylabel("hand clip, seconds")
    figure.legend(loc="outside lower right", ncols=3)
    return figure


def common_part(alignment: Alignment) -> tuple[tuple[float, float], tuple[float, float]]:
    """First and last seconds of the body and of the hand clip where the hand clip is played."""
    body, hand = alignment.warp.T
    before, after = np.flatnonzero(hand > hand[0]), np.flatnonzero(hand < hand[-1])
    if not len(before):
        return (float(body[0]), float(body[-1])), (float(hand[0]), float(hand[0]) + 1.0)
    first, last = max(int(before[0]) - 1, 0), min(int(after[-1]) + 1, len(body) - 1)
    return (float(body[first]), float(body[last])), (float(hand[first]), float(hand[last]))


def cost_grid(
    ours: Markers,
    theirs: Markers,
    alignment: Alignment,
    settings: SpliceSettings,
    shown: tuple[tuple[float, float], tuple[float, float]],
) -> tuple[Array, Array, Array]:
    """Costs of pass 1 with its steady turns, averaged over blocks of frames.

    Parameters
    ----------
    shown : first and last seconds of the body and of the hand clip

    Returns
    -------
    rows, columns : borders of the blocks in seconds of the body and of the hand clip
    costs : (row blocks, column blocks) mean squared difference of the signs, equation (6)
    """
    if settings.align == "trunk":
        pair = in_trunk_axes(ours), in_trunk_axes(theirs)
    else:
        times = np.arange(len(ours)) / ours.fps
        warp = np.interp(times, *alignment.warp.T) * theirs.fps
        pair = facing(ours, -steady_turns(ours, theirs, warp)), theirs
    blocks, borders = [], []
    for markers, (start, end) in zip(pair, shown, strict=True):
        words = derivative_signs(markers, settings.rule(settings.smoothing), np.zeros(1))
        first, last = int(start * markers.fps), int(np.ceil(end * markers.fps))
        signs = _signs(words[0][:, first : last + 1])
        edges = np.linspace(0, len(signs), min(len(signs), CELLS) + 1).round().astype(np.intp)
        counts = np.diff(edges)[:, None]
        mean = np.add.reduceat(signs, edges[:-1]) / counts
        squares = np.add.reduceat(signs**2, edges[:-1]).sum(axis=1, keepdims=True) / counts
        blocks.append((mean, squares))
        borders.append(np.asarray((first + edges - 0.5) / markers.fps, np.float64))
    (a, aa), (b, bb) = blocks
    return borders[0], borders[1], np.asarray(aa + bb.T - 2.0 * a @ b.T)


def _signs(words: NDArray[np.uint64]) -> Array:
    """Signs (frames, 64) as -1, 0 and 1, of words (2, frames) of bits."""
    bits = np.unpackbits(
        np.ascontiguousarray(words).view(np.uint8).reshape(*words.shape, 8), axis=2
    )
    positive, negative = bits.astype(np.float64)
    return np.asarray(positive - negative)


@styled
def curves(
    side: Side,
    alignment: Alignment,
    markers: tuple[Markers, Markers],
    fingers: tuple[Channels, Channels],
    rates: tuple[float, float],
) -> Figure:
    """Wrists and fingers of both clips, each in its own time and then in the body's.

    Parameters
    ----------
    markers : of the body and of the hand clip
    fingers : channels of the hand clip, and of the body with its fingers
    rates : their frames a second
    """
    ours, theirs = markers
    (begin, end), (hand_begin, hand_end) = common_part(alignment)
    body_at = np.arange(begin, end, 1 / ours.fps)
    hand_at = np.arange(hand_begin, hand_end, 1 / theirs.fps)
    warp = np.interp(body_at, *alignment.warp.T)
    moving = _most_moving(alignment.channels, fingers[0])
    other = alignment.taken_from
    follows = f", which follows the {other} one" if other else ""
    rows = [("wrist's height\nfrom its mean, cm", _height), ("bend of the wrist,\ndeg", _bend)]
    figure, axes = style.new_figure(
        f"{side.capitalize()} hand{follows}: both clips before and after alignment",
        (10.5, 1.0 + 1.6 * (len(rows) + bool(moving))),
        len(rows) + bool(moving),
        2,
        sharex="col",
        sharey="row",
    )
    for before, after, (label, measure) in zip(axes[::2], axes[1::2], rows, strict=False):
        body, hand = (_at(measure(m), m.fps, at) for m, at in ((ours, body_at), (theirs, hand_at)))
        if measure is _height:  # performers stand and reach differently
            body, hand = body - body.mean(), hand - hand.mean()
        _line(before, body_at - begin, body, BLACK, "body")
        _line(before, hand_at - hand_begin, hand, ORANGE, "hand clip")
        _line(after, body_at, body, BLACK, "body")
        _line(after, body_at, np.interp(warp, hand_at, hand), ORANGE, "hand clip")
        before.set_ylabel(label)
    if moving:
        taken = [c.select([moving]).values[:, 0] for c in fingers]
        _line(axes[-2], hand_at - hand_begin, _at(taken[0], rates[0], hand_at), ORANGE, "hand clip")
        _line(axes[-1], body_at, _at(taken[1], rates[1], body_at), ORANGE, "hand clip")
        axes[-2].set_ylabel(f"{moving},\ndeg")
    for panel in axes[1::2]:
        for pin in alignment.pins:
            panel.axvline(pin.body, color=GREY, linewidth=0.8, linestyle=":")
    axes[0].set_title("before: each clip in its own time")
    dotted = " (dotted: pins)" if alignment.pins else ""
    axes[1].set_title(f"after: in the time of the body{dotted}")
    axes[-2].set_xlabel("seconds of each clip, from its first that is used")
    axes[-1].set_xlabel("seconds of the body")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return figure


def _at(values: Array, fps: float, seconds: Array) -> Array:
    return np.interp(seconds, np.arange(len(values)) / fps, values)


def _line(panel: Axes, seconds: Array, values: Array, colour: str, label: str) -> None:
    at = style.sampled(len(values))
    panel.plot(seconds[at], values[at], color=colour, label=label, linewidth=1.1)
    panel.margins(x=0)
    panel.locator_params(axis="y", nbins=4)


def _height(markers: Markers) -> Array:
    return np.asarray(markers.wrist[:, 1])


def _bend(markers: Markers) -> Array:
    """Angle between forearm and palm, degrees: what the paper's pass 2 compares."""
    return np.degrees(np.arccos(np.clip(markers.forearm[:, 2], -1.0, 1.0)))


def _most_moving(names: Sequence[str], channels: Channels) -> str | None:
    """The flexion that moves furthest."""
    flexions = [name for name in names if is_flexion(name)]
    if not flexions:
        return None
    return flexions[int(np.ptp(channels.select(flexions).values, axis=0).argmax())]
