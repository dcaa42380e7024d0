"""Pass 2: the timing inside the phases, from how the wrist bends and how the hand moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit
from usdhand.splice.markers import Markers, resample_markers
from usdhand.splice.phases import align_about_vertical, smoothed
from usdhand.splice.settings import Align
from usdhand.splice.warps import EXACT, monotone, whittaker_smoothed

MarkerPair = tuple[Markers, Markers]

# Standard deviations of Gaussians in seconds: the least of what is compared; of the mean that
# positions and directions are compared around, as performers stand and reach differently; of the
# time over which they move with the same amplitude; and of that over which they differ by as much.
SMOOTHING_S, AROUND_S, AMPLITUDE_S, NOISE_S = 0.033, 1.0, 0.75, 0.33
# Borders of the bands that motion is split into, as standard deviations in seconds.
BANDS_S = (SMOOTHING_S, 0.09, 0.25, 0.7)
# Differences below these, in radians and lengths of the palm, are no smaller noise.
LEAST_ANGLE, LEAST_PATH = np.radians(1.0), 0.005
# Bends, palms and paths.
KINDS = 3
# Of their squares, at least this share is in a band.
LEAST_SHARE = 0.05
# Differences are white noise if those of the slowest band have less than this many times the power
# of those of the fastest one: 0.5 to 3 where noise is white, 10 to 700 for other performances.
WHITE_FACTOR = 4.0


@dataclass(frozen=True)
class Stage:
    """Rounds of the linearised problem.

    Attributes
    ----------
    rounds : more change the median error by less than 0.1 ms
    stiffness : how much a warp at 60 frames a second resists bending
    bands : borders of the bands that are compared, seconds; one: all that is slower
    tether : seconds by which the warp before is typically off; None: as told
    """

    rounds: int
    stiffness: float
    bands: Sequence[float]
    tether: float | None = None


STAGES = (
    Stage(4, 300.0, BANDS_S[:1]),
    Stage(6, 200.0, BANDS_S, 0.1),
)
# Of one hand after a timing of both.
OWN_STAGES = (Stage(3, 3000.0, BANDS_S, 0.05),)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a comparison says about a warp.

    Attributes
    ----------
    information : (rows,) 1 / frames^2: inverse of the squared error of the timing of a frame
    pull : (rows,) information times the frames by which the warp should move
    """

    information: Array
    pull: Array


def refined(
    pairs: Sequence[MarkerPair],
    warp: Array,
    freedom: Array,
    align: Align,
    tether: float,
    stages: Sequence[Stage] = STAGES,
) -> Array:
    """Warp (rows,) of pass 1 moved to where hands are most alike, by a part of a frame.

    The paper compares the angle between the palms with the forearms aligned, which is the one
    between the forearms in the axes of the palms and needs no alignment. Where a wrist hardly
    bends this tells nothing, so that the palm's directions and the wrist's path count as well.
    Each has the weight of how well it agrees there, and a warp is bent no more than that allows:
    what hardly changes, or differs anyway, has none. Only the first round weighs by how well it
    agrees on the whole, since then a lag would pass for a difference.

    The second stage splits what is compared into bands. Slow differences, as of performers who
    reach further, are few independent samples, and what is fast is not outweighed by them.

    Parameters
    ----------
    pairs : body and hand clip's markers of every hand that has this timing
    freedom : (rows,) hand clip frames by which the warp may move, 0: not at all
    tether : frames by which pass 1 is typically off
    """
    fps = pairs[0][0].fps
    least = np.maximum.accumulate(warp - freedom)
    most = np.minimum.accumulate((warp + freedom)[::-1])[::-1]
    for stage in stages:
        own = tether if stage.tether is None else stage.tether * pairs[0][1].fps
        held = np.where(freedom > 0, 1.0 / own**2, EXACT)
        moved = np.zeros(len(warp))
        for again in range(stage.rounds):
            now = monotone(warp + moved)
            found = [evidence(*p, now, align, stage.bands, again > 0) for p in pairs]
            moved = _stepped(found, moved, held, stage.stiffness * (fps / 60.0) ** 4, warp)
            moved = np.clip(moved, least - warp, most - warp)
        warp = np.clip(monotone(warp + moved), least, most)
    return warp


def stepped(warp: Array, freedom: Array, found: Sequence[Evidence], fps: float) -> Array:
    """The warp (rows,) after one step of the last stage."""
    stage = STAGES[-1]
    assert stage.tether is not None
    held = np.where(freedom > 0, 1.0 / (stage.tether * fps) ** 2, EXACT)
    stiffness = stage.stiffness * (fps / 60.0) ** 4
    moved = _stepped(found, np.zeros(len(warp)), held, stiffness, warp)
    return monotone(warp + np.clip(moved, -freedom, freedom))


def _stepped(
    found: Sequence[Evidence], moved: Array, held: Array, stiffness: float, warp: Array
) -> Array:
    """By how much a warp should move, from what was found where it has moved already."""
    information = np.sum([e.information for e in found], axis=0)
    weights = information + held
    wanted = (information * moved + np.sum([e.pull for e in found], axis=0)) / weights
    return whittaker_smoothed(wanted, weights, stiffness, warp)


def evidence(
    body: Markers,
    hand: Markers,
    warp: Array,
    align: Align,
    bands: Sequence[float] = BANDS_S,
    local: bool = True,
    kinds: Sequence[int] = range(KINDS),
) -> Evidence:
    """What the motion of a hand says about a warp (rows,) in hand clip frames.

    Parameters
    ----------
    bands : borders of the bands that are compared, seconds
    local : whether differences count as noise where they are, or on the whole
    kinds : of bends, palms and paths, which are compared
    """
    fps = body.fps
    slope = np.maximum(np.gradient(warp), 0.1)[:, None]
    seen = body.seen * np.interp(warp, np.arange(len(hand)), hand.seen)
    information, pull = np.zeros(len(body)), np.zeros(len(body))
    pair = align_about_vertical(body, resample_markers(hand, warp, fps), align)
    for ours, theirs, least in _compared(*pair, kinds):
        for band in _bands(ours, theirs, bands, fps):
            change, apart = np.gradient(band.ours, axis=0) / slope, band.ours - band.theirs
            squares = _dot(apart, apart) / apart.shape[1]
            usual = float(np.median(squares[seen > 0.5])) if (seen > 0.5).any() else 0.0
            noise = np.full(len(squares), max(usual, least**2 * band.share))
            if local:
                noise = np.maximum(noise, smoothed(squares, band.alike_s * fps))
            weight = seen * band.independent / noise
            information += weight * _dot(change, change)
            pull += weight * _dot(change, apart)
    return Evidence(information, pull)


@dataclass(frozen=True, eq=False)
class _Scale:
    """Curves of both hands in one band.

    ``independent`` samples of noise a frame, the ``share`` of white noise's squares that is in the
    band, and the seconds over which hands differ by as much.
    """

    ours: Array
    theirs: Array
    independent: float
    share: float
    alike_s: float


def _bands(ours: Array, theirs: Array, borders: Sequence[float], fps: float) -> list[_Scale]:
    """Curves split into bands; one band if they differ by white noise anyway."""
    rate = 1.0 / borders[0]
    whole = _Scale(ours, theirs, rate / (2.0 * np.sqrt(np.pi) * fps), 1.0, NOISE_S)
    if len(borders) == 1:
        return [whole]
    lows = [[_smoother(c, borders[0], b, fps) for b in borders] for c in (ours, theirs)]
    found, levels = [], []
    for k, (fine, coarse) in enumerate(pairwise(borders)):
        rate = 1.0 / fine - 1.0 / coarse
        a, b = (low[k] - low[k + 1] for low in lows)
        levels.append(float(np.median(_dot(a - b, a - b))) / rate)
        share = max(rate * borders[0], LEAST_SHARE)
        independent = rate / (2.0 * np.sqrt(np.pi) * fps)
        found.append(_Scale(a, b, independent, share, max(NOISE_S, coarse)))
    return [whole] if levels[-1] < WHITE_FACTOR * levels[0] else found


def differences(body: Markers, hand: Markers, warp: Array, align: Align) -> Array:
    """(3,) mean squared differences of bends, palms and paths along a warp (rows,)."""
    found = _squares(body, hand, warp, align)
    return np.array([max(float(squares.mean()), least**2) for squares, least in found])


def row_differences(
    body: Markers, hand: Markers, warp: Array, align: Align, kinds: Sequence[int] = range(KINDS)
) -> Array:
    """(rows,) squared differences of bends, palms and paths, in those that are no smaller noise."""
    found = _squares(body, hand, warp, align, kinds)
    return np.asarray(np.sum([squares / least**2 for squares, least in found], axis=0))


def _squares(
    body: Markers,
    hand: Markers,
    warp: Array,
    align: Align,
    kinds: Sequence[int] = range(KINDS),
) -> Iterator[tuple[Array, float]]:
    pair = align_about_vertical(body, resample_markers(hand, warp, body.fps), align)
    for ours, theirs, least in _compared(*pair, kinds):
        yield _dot(ours - theirs, ours - theirs) / ours.shape[1], least


def _smoother(curve: Array, before: float, after: float, fps: float) -> Array:
    """A curve that is smoothed, smoothed more: standard deviations before and after, seconds."""
    return smoothed(curve, np.sqrt(after**2 - before**2) * fps) if after > before else curve


def _compared(
    body: Markers, hand: Markers, kinds: Sequence[int]
) -> Iterator[tuple[Array, Array, float]]:
    """Curves (rows, n) of both hands in the same axes and time, and differences that are noise."""
    fps = body.fps

    def around(curve: Array) -> Array:
        return np.asarray(curve - smoothed(curve, AROUND_S * fps))

    if 0 in kinds:
        ours, theirs = (around(unit(smoothed(m.forearm, SMOOTHING_S * fps))) for m in (body, hand))
        yield ours, theirs, LEAST_ANGLE
    positions = [smoothed(m.positions, SMOOTHING_S * fps) for m in (body, hand)]
    wrists = [(p[:, 0] + p[:, 1]) / 2 for p in positions]
    if 1 in kinds:
        palms = (unit(p[:, [0, 3]] - w[:, None]) for p, w in zip(positions, wrists, strict=True))
        ours, theirs = (around(p.reshape(len(p), -1)) for p in palms)
        yield ours, theirs, LEAST_ANGLE
    if 2 in kinds:
        ours, theirs = (around(w) for w in wrists)
        both = np.stack([_dot(ours, theirs), _dot(theirs, theirs)], axis=1)
        both = np.maximum(smoothed(both, AMPLITUDE_S * fps), 1e-9)
        yield ours, theirs * (both[:, :1] / both[:, 1:]), LEAST_PATH * body.palm_length


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("ti,ti->t", a, b))
