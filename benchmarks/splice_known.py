"""How exactly splice aligns pairs whose true alignment is known, compared with simpler methods.

Run: python benchmarks/splice_known.py [--takes FOLDER] [--space] [--seed N]

Pairs are made of real takes, see tests/builders/known_pairs.py. Counted are frames of the body at
which the
wrist moves, relative to the shoulder, faster than 15 cm/s. Errors are in the body's time: how far
the moment that is shown is from the one that should be. Every third take was held out while
settings were chosen. With --space the noise is 3 mm in space instead of 3 mm a coordinate.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(HERE / "tests"))

from builders.known_pairs import NOISE_CM, Pair, known_pair, known_pairs  # noqa: E402

from usdhand.anatomy import Side  # noqa: E402
from usdhand.motion.rotations import Array  # noqa: E402
from usdhand.splice.alignment import Alignment  # noqa: E402
from usdhand.splice.band import Band, pinned_band  # noqa: E402
from usdhand.splice.markers import Markers, hand_markers  # noqa: E402
from usdhand.splice.method import Spliced, splice  # noqa: E402
from usdhand.splice.phases import facing, smoothed, steady_turns  # noqa: E402
from usdhand.splice.settings import PAPER, SpliceSettings  # noqa: E402
from usdhand.splice.timing import align  # noqa: E402

SETTINGS = SpliceSettings()
REAL = HERE.parent / "shared" / "data" / "studiogalt" / "full"
Row = dict[str, list[Array]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--takes", type=Path, default=REAL)
    parser.add_argument("--space", action="store_true")
    parser.add_argument("--seed", type=int, default=1000, help="of warps, turns and noise")
    arguments = parser.parse_args()
    noise = NOISE_CM / np.sqrt(3.0) if arguments.space else NOISE_CM
    errors: dict[str, Row] = {"used for tuning": defaultdict(list), "held out": defaultdict(list)}
    fingers: dict[str, list[float]] = {name: [] for name in errors}
    pairs = known_pairs(arguments.takes)
    for i, (body, hands) in enumerate(pairs):
        pair = known_pair(body, hands, arguments.seed + i, noise)
        part = "held out" if i % 3 == 2 else "used for tuning"
        spliced = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
        for side, alignment in spliced.hands.items():
            for name, error in pair_errors(pair, side, alignment).items():
                errors[part][name].append(error)
        fingers[part].append(finger_error(pair, spliced))
    print(f"{len(pairs)} pairs, noise {10 * noise:.1f} mm a coordinate")
    for part, rows in errors.items():
        print(
            f"\n{part}: {len(fingers[part])} takes, both hands, "
            f"{sum(map(len, rows['linear stretch']))} moving frames; spliced fingers off by "
            f"{np.median(fingers[part]):.2f} deg RMS (median), {max(fingers[part]):.2f} (worst)"
        )
        print(f"{'ms':34}  median     95 %      max  over 100 ms")
        for name, values in rows.items():
            e = 1000.0 * np.abs(np.concatenate(values))
            print(
                f"{name:34}  {np.median(e):6.1f}  {np.percentile(e, 95):7.1f}  {e.max():7.1f}  "
                f"{100 * np.mean(e > 100):8.2f} %"
            )


def pair_errors(pair: Pair, side: Side, alignment: Alignment) -> dict[str, Array]:
    """Errors in seconds at moving frames, for each way to align."""
    body = hand_markers(pair.body, pair.body_hands, side, SETTINGS.fps)
    hand = hand_markers(pair.hands, pair.hand_hands, side, SETTINGS.fps)
    times = np.arange(len(pair.body)) / pair.body.fps
    [axes] = align([(body, hand)], PAPER, (), times)
    turned = facing(hand, steady_turns(body, hand, np.linspace(0, len(hand) - 1, len(body)))[:1])

    warps = {
        "linear stretch": times * (pair.hands.duration / times[-1]),
        "DTW on positions": plain_warp(positions, body, turned, times),
        "DTW on derivative values": plain_warp(derivatives, body, turned, times),
        "pass 1, signs along the 3 axes": axes.phase_warp,
        "pass 1": alignment.phase_warp,
        "full method": alignment.warp[:, 1],
    }
    moving = pair.moving(side)
    return {name: pair.error(warp)[moving] for name, warp in warps.items()}


def positions(markers: Markers) -> Array:
    return _smooth(markers, 0)


def derivatives(markers: Markers) -> Array:
    """Velocities and accelerations, each of unit RMS."""
    both = [_smooth(markers, 1), _smooth(markers, 2)]
    return np.concatenate([d / np.sqrt(np.mean(d**2)) for d in both], axis=1)


def _smooth(markers: Markers, order: int) -> Array:
    curves = smoothed(markers.positions, SETTINGS.smoothing * SETTINGS.fps, order)
    return curves.reshape(len(markers), -1)


def plain_warp(
    features: Callable[[Markers], Array], body: Markers, hand: Markers, times: Array
) -> Array:
    """Seconds of the hand clip by plain DTW in the band of pass 1, mean of matched frames."""
    a, b = features(body), features(hand)
    cost = np.sum((a[:, None] - b[None]) ** 2, axis=-1)
    width = max(SETTINGS.band[0] * len(a), SETTINGS.least_band * SETTINGS.fps)
    path = plain_dtw(cost, pinned_band(((0, 0, 0), (len(a) - 1, len(b) - 1, 0)), width))
    return np.interp(times, np.arange(len(a)) / body.fps, path / hand.fps)


def plain_dtw(cost: Array, band: Band) -> Array:
    n, m = cost.shape
    total = np.full((n + 1, m + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(n):
        for j in range(band.low[i], band.high[i] + 1):
            total[i + 1, j + 1] = cost[i, j] + min(total[i, j], total[i, j + 1], total[i + 1, j])
    matched: list[list[int]] = [[] for _ in range(n)]
    i, j = n, m
    while i > 0 and j > 0:
        matched[i - 1].append(j - 1)
        steps = ((i - 1, j - 1), (i - 1, j), (i, j - 1))
        i, j = min(steps, key=lambda cell: total[cell])
    return np.array([np.mean(columns) for columns in matched])


def finger_error(pair: Pair, spliced: Spliced) -> float:
    """RMS in degrees between the spliced and the true fingers, over the whole take."""
    ours, theirs = pair.body_hands.encode(spliced.clip), pair.source_channels()
    return float(np.sqrt(np.mean((ours.values - theirs.select(ours.names).values) ** 2)))


if __name__ == "__main__":
    main()
