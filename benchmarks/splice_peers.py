"""Time and memory of other packages' DTW on what benchmarks/splice_speed.py wrote: run by it.

    python benchmarks/splice_peers.py PACKAGE FILE

Each package aligns the velocities and accelerations of four markers (24 numbers a frame) in the
band of splice's pass 1, and gives the path. Prints seconds, after a short run so that nothing is
compiled, and MB of peak memory above that of the clips. Needs the package alone, not usdhand.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable

import numpy as np

SHARE = 0.3  # of the clip's length that the band is wide
Run = Callable[[np.ndarray, np.ndarray, int], object]


def main() -> None:
    package, file = sys.argv[1:]
    with np.load(file) as data:
        a, b = data["body"], data["hand"]
    run = PEERS[package]()
    run(a[:100].copy(), b[:100].copy(), 15)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    run(a, b, int(SHARE * len(a) / 2))
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(seconds, (peak - before) / 1e3)


def dtw_python() -> Run:
    import dtw

    def run(a: np.ndarray, b: np.ndarray, radius: int) -> object:
        window = {"window_size": radius}
        return dtw.dtw(a, b, "euclidean", "symmetric1", "sakoechiba", window).index1

    return run


def dtaidistance() -> Run:
    from dtaidistance import dtw_ndim

    return lambda a, b, radius: dtw_ndim.warping_path(a, b, window=radius, use_c=True)


def tslearn() -> Run:
    from tslearn.metrics import dtw_path

    return lambda a, b, radius: dtw_path(a, b, "sakoe_chiba", sakoe_chiba_radius=radius)


def aeon() -> Run:
    from aeon.distances import dtw_alignment_path

    return lambda a, b, radius: dtw_alignment_path(a.T.copy(), b.T.copy(), window=radius / len(a))


PEERS: dict[str, Callable[[], Run]] = {
    "dtw-python": dtw_python,
    "dtaidistance": dtaidistance,
    "tslearn": tslearn,
    "aeon": aeon,
}

if __name__ == "__main__":
    main()
