"""Joerg, Hodgins & Safonova 2012 as slow and obvious code, from the paper and methods.md, 2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np

from usdhand.motion.rotations import Array


def segments(
    speed: Sequence[float], threshold: float, shortest: int, longest: int
) -> list[tuple[int, int]]:
    """Cut where the speed crosses the threshold; join what is short, split what is long.

    ``shortest`` and ``longest`` are in frames. The shortest segment is joined first, with its
    shorter neighbour, the earlier one of equal ones.
    """
    last = len(speed) - 1
    borders = [0]
    for frame in range(1, last):
        if (speed[frame] > threshold) != (speed[frame - 1] > threshold):
            borders.append(frame)
    borders.append(last)
    parts = [[a, b] for a, b in pairwise(borders)]
    while len(parts) > 1:
        lengths = [b - a for a, b in parts]
        i = lengths.index(min(lengths))
        if lengths[i] >= shortest:
            break
        neighbours = [j for j in (i - 1, i + 1) if 0 <= j < len(parts)]
        j = min(neighbours, key=lambda n: (lengths[n], n))
        parts[min(i, j)] = [parts[min(i, j)][0], parts[max(i, j)][1]]
        del parts[max(i, j)]
    while any(b - a > longest for a, b in parts):
        i = next(i for i, (a, b) in enumerate(parts) if b - a > longest)
        a, b = parts[i]
        cut = min(range(a + shortest, b - shortest + 1), key=lambda frame: speed[frame])
        parts[i : i + 1] = [[a, cut], [cut, b]]
    return [(a, b) for a, b in parts]


def warps(query_frames: int, frames: int) -> Iterator[tuple[int, ...]]:
    """Every type III c warp: a step of 0, 1 or 2 a frame, no two 0 in a row, ends meet."""
    for steps in product((0, 1, 2), repeat=query_frames - 1):
        twice = any(a == b == 0 for a, b in pairwise(steps))
        starts_still = bool(steps) and steps[0] == 0
        if sum(steps) == frames - 1 and not twice and not starts_still:
            yield tuple(int(x) for x in np.cumsum([0, *steps]))


def segment_cost(query: Array, candidate: Array) -> float:
    """Equation 1 under the best warp, by trying all."""
    return min(
        sum(float(np.sum((query[t] - candidate[j]) ** 2)) for t, j in enumerate(path)) / len(query)
        for path in warps(len(query), len(candidate))
    )


def transition_cost(
    last: Array,
    last_velocity: Array,
    first: Array,
    first_velocity: Array,
    weights: tuple[float, float],
) -> float:
    """Equation 2, of one candidate and the next."""
    total = 0.0
    for i in range(len(last)):
        total += weights[0] * (last[i] - first[i]) ** 2
        total += weights[1] * (last_velocity[i] - first_velocity[i]) ** 2
    return total / len(last)


def all_paths(
    nodes: Sequence[Array], edges: Sequence[Array]
) -> list[tuple[float, tuple[int, ...]]]:
    """Every path with its cost, cheapest first."""
    found = []
    for path in product(*(range(len(n)) for n in nodes)):
        cost = sum(float(n[i]) for n, i in zip(nodes, path, strict=True))
        cost += sum(float(e[i, j]) for e, i, j in zip(edges, path[:-1], path[1:], strict=True))
        found.append((cost, path))
    return sorted(found)


def joined(pieces: Sequence[Array]) -> Array:
    """Section 3.5, of pieces (frames, channels) that begin on the last frame of the one before.

    The offset stays unless its mean is above 5 degrees or its largest above 20; then it is blended
    out linearly over the piece.
    """
    frames = [list(frame) for frame in pieces[0]]
    for piece in pieces[1:]:
        offset = [a - b for a, b in zip(frames[-1], piece[0], strict=True)]
        sizes = [abs(x) for x in offset]
        large = sum(sizes) / len(sizes) > 5.0 or max(sizes) > 20.0
        for t in range(1, len(piece)):
            weight = 1.0 - t / (len(piece) - 1) if large else 1.0
            frames.append([x + weight * d for x, d in zip(piece[t], offset, strict=True)])
    return np.array(frames)
