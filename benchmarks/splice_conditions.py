"""How exactly splice aligns under conditions of studios, beside simpler methods.

Run: python benchmarks/splice_conditions.py [--part PART] [--takes N] [--only WORD] [--fast]

Pairs are made of real takes with two-bone IK, see tests/builders/splice_conditions.py. Counted are
frames of the body at which the wrist moves, relative to the shoulder, faster than 15 cm/s. Errors
are in the take's time: how far the moment that is shown is from the one that should be. Every
third take was held out while settings were chosen. With --fast only both passes of splice are run.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from splice_known import REAL, derivatives, plain_warp, positions

HERE = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(HERE / "tests"))

from builders.splice_conditions import CONDITIONS, ConditionPair, condition_pair  # noqa: E402

from usdhand.anatomy import Side  # noqa: E402
from usdhand.motion.rotations import Array  # noqa: E402
from usdhand.splice.alignment import Alignment  # noqa: E402
from usdhand.splice.markers import hand_markers  # noqa: E402
from usdhand.splice.method import splice  # noqa: E402
from usdhand.splice.phases import facing, steady_turns  # noqa: E402
from usdhand.splice.settings import PAPER, SpliceSettings  # noqa: E402
from usdhand.splice.timing import align  # noqa: E402

SETTINGS = SpliceSettings()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=["tuned", "held-out"], default="held-out")
    parser.add_argument("--takes", type=int, default=14)
    parser.add_argument("--only", default="")
    parser.add_argument("--fast", action="store_true")
    arguments = parser.parse_args()
    files = [
        f
        for i, f in enumerate(sorted(REAL.glob("*.usdc")))
        if (i % 3 == 2) == (arguments.part == "held-out")
    ]
    files = files[:: max(1, len(files) // arguments.takes)][: arguments.takes]
    print(f"{arguments.part}, {len(files)} takes; ms: median / 95 % / max / share over 100")
    for number, condition in enumerate(CONDITIONS):
        if arguments.only not in condition.name:
            continue
        errors: dict[str, list[Array]] = defaultdict(list)
        for k, file in enumerate(files):
            pair = condition_pair(condition, file, 1000 * (number + 1) + k)
            spliced = splice(pair.body, pair.hands, pair.body_hands, pair.hand_hands)
            for side, alignment in spliced.hands.items():
                if pair.moving[side].sum() < 10:
                    continue
                warps = {"pass 1": alignment.phase_warp, "full method": alignment.warp[:, 1]}
                if not arguments.fast:
                    warps = other_warps(pair, side, alignment) | warps
                for name, warp in warps.items():
                    errors[name].append(pair.error(side, warp)[pair.moving[side]])
        print(f"{condition.name}: {sum(map(len, errors['pass 1']))} frames")
        for name, values in errors.items():
            e = 1000.0 * np.abs(np.concatenate(values))
            print(
                f"  {name:26} {np.median(e):6.1f} / {np.percentile(e, 95):6.1f} / {e.max():6.1f} / "
                f"{100 * np.mean(e > 100):5.2f} %",
                flush=True,
            )


def other_warps(pair: ConditionPair, side: Side, alignment: Alignment) -> dict[str, Array]:
    """Seconds of the hand clip (body frames,) by simpler ways to align."""
    body = hand_markers(pair.body, pair.body_hands, side, SETTINGS.fps)
    hand = hand_markers(pair.hands, pair.hand_hands, side, SETTINGS.fps)
    times = alignment.warp[:, 0]
    turned = facing(hand, steady_turns(body, hand, np.linspace(0, len(hand) - 1, len(body)))[:1])
    return {
        "linear stretch": times * (pair.hands.duration / times[-1]),
        "DTW on positions": plain_warp(positions, body, turned, times),
        "DTW on derivative values": plain_warp(derivatives, body, turned, times),
        "DTW on signs, 3 axes": align([(body, hand)], PAPER, (), times)[0].phase_warp,
    }


if __name__ == "__main__":
    main()
