"""Pass 1: phases of the motion matched by the signs of its derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array
from usdhand.splice.band import Band
from usdhand.splice.markers import Markers, resample_markers
from usdhand.splice.settings import Align, Directions, SignRule
from usdhand.splice.warps import EXACT, monotone, whittaker_smoothed

WINDOW = 5  # frames of the window that a turn about the vertical is fitted to
TURNS = 32
WAITING = 3  # rows at an end that share a column, beyond which the hand clip is not only slow there
STEADY_S = 2.0  # standard deviation of the time over which performers keep their direction
WIDE = 12.0  # frames of a Gaussian beyond which running means do as well

# How far, in seconds, the path may still move once the hand clip is in the body's time.
NEAR_S = 1 / 3
# Seconds by which a match is shifted to see whether that costs anything: what a frame is evidence
# for; the cost that counts as full evidence; the share that every frame has.
SHIFT_S, FULL_EVIDENCE, LEAST_EVIDENCE = 0.1, 60.0, 0.02
# How much a warp resists bending, beside a frame of full evidence.
STIFFNESS = 500.0

# Of the noise of white noise's derivatives only as much is a dead zone, in their RMS.
MOST_NOISE_ZONE = 0.3

_NO_TURN = np.zeros((1, 2, 1), np.float32), np.zeros((2, 1, 1), np.float32)


@dataclass(frozen=True, eq=False)
class WarpPath:
    """What pass 1 matched: columns ``first`` to ``last`` (rows,) of every row, and their cost."""

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    cost: int

    @property
    def middle(self) -> Array:
        """(rows,) middle of the columns of each row."""
        return np.asarray((self.first + self.last) / 2.0)

    @property
    def open_ended(self) -> Array:
        """(rows,) the middle, but as if either clip went on where the other one begins or ends.

        Frames of the hand clip before the body's first have no partner, and where the hand clip
        has not begun it is to come at its usual speed: so smoothing finds no bend at the ends.
        """
        warp, rows = self.middle, np.arange(len(self.first))
        warp[0], warp[-1] = self.last[0], self.first[-1]
        begun = int(np.argmax(self.last > self.first[0]))
        done = len(warp) - 1 - int(np.argmax(self.first[::-1] < self.last[-1]))
        if WAITING < begun <= done:
            warp[:begun] = warp[begun] - (begun - rows[:begun])
        if begun <= done < len(warp) - 1 - WAITING:
            warp[done + 1 :] = warp[done] + (rows[done + 1 :] - done)
        return warp


def phase_path(
    body: Markers,
    hand: Markers,
    band: Band,
    rule: SignRule,
    align: Align = "local",
) -> WarpPath:
    """Least-cost path through a band under the sign cost, both hands at the same rate."""
    from usdhand.dtw import phases as phase_dtw

    turns = phase_dtw.turn_angles(TURNS) if align == "local" else np.zeros(1)
    if align == "trunk":
        body, hand = (in_trunk_axes(m) for m in (body, hand))
    ours = derivative_signs(body, rule, np.zeros(1))
    theirs = derivative_signs(hand, rule, turns)
    windows = [_windows(m, rule.smoothing, phase_dtw.BLOCK) for m in (body, hand)]
    centred = windows[0] - windows[0].mean(axis=2, keepdims=True)
    first, last, cost = phase_dtw.phase_path(
        ours[0],
        theirs,
        np.ascontiguousarray(centred, np.float32),
        np.ascontiguousarray(windows[1].transpose(1, 2, 0), np.float32),
        band.low,
        band.high,
        rule.rest_signs,
    )
    return WarpPath(first, last, int(cost))


def path_with_steady_turns(
    body: Markers,
    hand: Markers,
    path: WarpPath,
    band: Band,
    rule: SignRule,
) -> WarpPath:
    """The least-cost path near another one, with turns that change as slowly as performers do.

    A turn that is fitted to five frames of small markers is as noisy as they are. Along a path,
    all frames within `STEADY_S` can tell it.

    Parameters
    ----------
    band : of the new path; the old one must be within
    """
    from usdhand.dtw import phases as phase_dtw

    turned = facing(body, -steady_turns(body, hand, path.middle))
    ours, theirs = (derivative_signs(m, rule, np.zeros(1)) for m in (turned, hand))
    first, last, cost = phase_dtw.phase_path(
        ours[0], theirs, *_NO_TURN, band.low, band.high, rule.rest_signs
    )
    return WarpPath(first, last, int(cost))


def rematched(
    body: Markers,
    hand: Markers,
    warp: Array,
    freedom: Array,
    rule: SignRule,
    align: Align = "local",
) -> Array:
    """Warp (rows,) in columns, matched again with the hand clip in the time that the warp gives it.

    Now that both clips are smoothed over the same part of the motion, smoothing moves no phase of
    one against the other. Where a shift would cost nothing, as where the hand rests, the warp takes
    its course from the frames around.

    Parameters
    ----------
    freedom : (rows,) body frames by which the warp may move, 0: not at all
    """
    from usdhand.dtw import phases as phase_dtw

    rows = np.arange(len(body))
    ours, theirs = (
        derivative_signs(m, rule, np.zeros(1))
        for m in align_about_vertical(body, resample_markers(hand, warp, body.fps), align)
    )
    reach = np.minimum(freedom, NEAR_S * body.fps).astype(np.int64)
    low = np.maximum.accumulate(np.maximum(rows - reach, 0))
    high = np.minimum.accumulate(np.minimum(rows + reach, rows[-1])[::-1])[::-1]
    first, last, cost = phase_dtw.phase_path(ours[0], theirs, *_NO_TURN, low, high, rule.rest_signs)
    path = WarpPath(first, last, int(cost))
    weights = _evidence(ours[0], theirs[0], path.middle, SHIFT_S * body.fps)
    weights[[0, -1]] = 1.0
    weights[(warp < 0.0) | (warp > len(hand) - 1.0)] = LEAST_EVIDENCE
    weights[freedom == 0] = EXACT
    matched = np.interp(path.open_ended, rows, warp)
    return monotone(whittaker_smoothed(matched, weights, STIFFNESS * (body.fps / 60.0) ** 4))


def align_about_vertical(body: Markers, hand: Markers, align: Align) -> tuple[Markers, Markers]:
    """Both markers, of as many frames, in axes that they share."""
    if align == "trunk":
        return in_trunk_axes(body), in_trunk_axes(hand)
    turns = steady_turns(body, hand, np.arange(len(body), dtype=np.float64))
    return facing(body, -turns), hand


def _evidence(
    ours: NDArray[np.uint64], theirs: NDArray[np.uint64], path: Array, shift: float
) -> Array:
    """(rows,) 0 to 1: by how much the signs would differ more if the path were shifted."""
    from usdhand.dtw.phases import sign_costs

    def costs(by: float) -> Array:
        columns = np.clip(np.rint(path + by), 0, theirs.shape[1] - 1).astype(np.int64)
        return np.asarray(sign_costs(ours, theirs, columns), np.float64)

    more = smoothed((costs(shift) + costs(-shift)) / 2 - costs(0.0), shift / 2)
    return np.clip(more / FULL_EVIDENCE, LEAST_EVIDENCE, 1.0)


def steady_turns(body: Markers, hand: Markers, path: Array) -> Array:
    """(rows,) radians by which the hand clip turns onto the body along a path, equation (7)."""
    at = np.clip(np.rint(path), 0, len(hand) - 1).astype(np.intp)
    p = body.positions - body.positions.mean(axis=1, keepdims=True)
    q = hand.positions[at]
    (px, pz), (qx, qz) = ((v[..., 0], v[..., 2]) for v in (p, q))
    cosine = np.sum(px * qx + pz * qz, axis=1)
    sine = np.sum(px * qz - pz * qx, axis=1)
    both = smoothed(np.stack([cosine, sine], axis=1), STEADY_S * body.fps)
    return np.asarray(np.arctan2(both[:, 1], both[:, 0]))


def smoothed(curve: Array, deviation: float, order: int = 0) -> Array:
    """Gaussian smoothing (or its derivative) along axis 0, the deviation in frames."""
    from scipy.ndimage import gaussian_filter1d, uniform_filter1d

    if order == 0 and deviation > WIDE:
        width = 2 * round(deviation) + 1  # three running means of it are as wide
        for _ in range(3):
            curve = uniform_filter1d(curve, width, axis=0, mode="nearest")
        return np.asarray(curve)
    return np.asarray(gaussian_filter1d(curve, deviation, axis=0, order=order, mode="nearest"))


def derivative_signs(markers: Markers, rule: SignRule, turns: Array) -> NDArray[np.uint64]:
    """Signs of velocity and acceleration after turns about the vertical, as bits.

    Returns
    -------
    (turns, 2, frames) words: bits of the signs that are positive, and of those that are negative
    """
    from usdhand.dtw.phases import signs_along

    result = np.zeros((len(turns), 2, len(markers)), np.uint64)
    axes = sign_axes(rule.directions, markers.positions.shape[1])
    along = np.stack([_about_vertical(axes, -turn) for turn in turns]).astype(np.float32)
    deviation = rule.smoothing * markers.fps
    noise = _noise_of(markers.positions) if rule.noise_zone else 0.0
    for order in (1, 2):
        derivative = smoothed(markers.positions, deviation, order)
        rms = np.sqrt(3.0 * np.mean(derivative**2))
        noisy = rule.noise_zone * noise * _noise_gain(deviation, order)
        limit = max(rule.dead_zone * rms, min(noisy, MOST_NOISE_ZONE * rms))
        by_frame = np.ascontiguousarray(np.moveaxis(derivative, 0, 2), np.float32)
        signs_along(by_frame, along, float(limit), result)
    return result


def _noise_of(curves: Array) -> float:
    """Standard deviation of white noise on smooth curves (frames, ...), from third differences."""
    if len(curves) < 4:
        return 0.0
    third = np.abs(np.diff(curves, 3, axis=0))
    return float(np.median(third) / 0.6745 / np.sqrt(20.0))


def _noise_gain(deviation: float, order: int) -> float:
    """Standard deviation of a Gaussian derivative of white noise, beside that of the noise."""
    if order == 1:
        return float(np.sqrt(1.0 / (4.0 * np.sqrt(np.pi) * deviation**3)))
    return float(np.sqrt(3.0 / (8.0 * np.sqrt(np.pi) * deviation**5)))


def sign_axes(directions: Directions, markers: int = 4) -> Array:
    """(markers, axes, 3) unit directions along which the signs of a marker are taken.

    ``axes`` are the paper's x, y and z. With ``spread`` every marker has eight directions, turned
    by another angle about the vertical: markers of a hand mostly move alike, so that their signs
    along the same axes change together and say less about when. Still nothing but signs. Eight
    markers, those of both hands, have four directions each, so that there are as many signs.
    """
    if directions == "axes":
        return np.tile(np.eye(3), (markers, 1, 1))
    half = np.sqrt(0.5)
    axes = np.array(
        [
            *np.eye(3),
            [half, 0, half],
            [half, half, 0],
            [half, -half, 0],
            [0, half, half],
            [0, -half, half],
        ]
    )
    turns = [np.radians(a) for a in (0.0, 45.0, 22.5, 67.5)]
    if markers == 4:
        return np.stack([_about_vertical(axes, turn) for turn in turns])
    parts = axes[[0, 1, 2, 4]], axes[[3, 6, 5, 1]]
    return np.stack([_about_vertical(parts[k % 2], turns[k % 4]) for k in range(markers)])


def in_trunk_axes(markers: Markers) -> Markers:
    """Markers in axes that turn with the trunk."""
    assert markers.facing is not None
    return facing(markers, np.arctan2(markers.facing[:, 1], markers.facing[:, 0]))


def facing(markers: Markers, angles: Array) -> Markers:
    """Markers turned about the vertical by ``angles`` (frames,) in radians."""
    return replace(markers, positions=_about_vertical(markers.positions, angles[:, None]))


def _about_vertical(v: Array, angle: Array | float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([c * x + s * z, y, c * z - s * x], axis=-1)


def _windows(markers: Markers, smoothing: float, block: int) -> Array:
    """(blocks, 2, 20) level coordinates of the markers in five frames about each block's middle."""
    positions = smoothed(markers.positions, smoothing * markers.fps)
    middles = np.arange(0, len(markers), block) + block // 2
    frames = np.clip(middles[:, None] + np.arange(WINDOW) - WINDOW // 2, 0, len(markers) - 1)
    level = positions[frames][..., [0, 2]]  # blocks, window, markers, 2
    return np.moveaxis(level.reshape(len(middles), -1, 2), 1, 2)
