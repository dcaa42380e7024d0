"""Pass 2 is kept where it holds: what bends, palms and paths say of each other's timing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.motion.rotations import Array
from usdhand.splice.phases import smoothed
from usdhand.splice.refine import KINDS, MarkerPair, evidence, row_differences, stepped
from usdhand.splice.settings import Align

# Pass 1 stays if with pass 2 the third kind differs more, by this much in logarithms of squares;
# around a moment pass 2 has less weight as soon as it does, and none if it does by so much.
WORSE, NONE_LEFT = 0.02, 0.1
AROUND_S = 1.0


def trust(
    pairs: Sequence[MarkerPair], first: Sequence[Array], freedom: Array, align: Align
) -> Array:
    """(rows,) from 0, where pass 1 is to stay, to 1, where pass 2 holds, for hands of one timing.

    Cross-validation: a timing from two kinds of comparison is right if it makes the third one,
    which it does not know, agree better than pass 1 did. Where differences are of the performance,
    as with noise of several frames, pass 2 fits them, and the third kind agrees less.

    Parameters
    ----------
    first : warps (rows,) of pass 1 in hand clip frames, of every hand
    freedom : (rows,) hand clip frames by which a warp may move
    """
    whole, near = [], []
    for pair, warp in zip(pairs, first, strict=True):
        around = AROUND_S * pair[0].fps
        found = [evidence(*pair, warp, align, kinds=[k]) for k in range(KINDS)]
        for kind in range(KINDS):
            moved = stepped(
                warp, freedom, [e for k, e in enumerate(found) if k != kind], pair[0].fps
            )
            after, before = (row_differences(*pair, w, align, [kind]) for w in (moved, warp))
            whole.append(_log_ratio(after.mean(), before.mean()))
            near.append(_log_ratio(smoothed(after, around), smoothed(before, around)))
    if np.mean(whole) > WORSE:
        return np.zeros(len(freedom))
    return np.asarray(1.0 - np.clip(np.mean(near, axis=0) / NONE_LEFT, 0.0, 1.0))


def _log_ratio(after: Array, before: Array) -> Array:
    """Where hardly anything differs, in what is noise anyway, there is no difference."""
    return np.asarray(np.log(np.maximum(after, 1.0) / np.maximum(before, 1.0)))
