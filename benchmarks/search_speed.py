"""Speed of the exact search, compared with other warping libraries, as a Markdown table.

    python benchmarks/search_speed.py [--quick] [--folder DIR]

Needs the extra ``dev`` (dtaidistance and aeon). Neither offers the type III c warp; they solve
the nearest comparable job, the symmetric warp (any number of stays on either side, no weights) of
the same queries to the same candidates, with the same local cost. Times are the best of several
in one run. 1.2 GB of stored library are written to the folder and removed.
"""

from __future__ import annotations

import argparse
import heapq
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import search_data

from usdhand.search import PackedSegments, SearchIndex, prepare, search

QUERIES = 60


def main() -> None:
    """Measure both kinds of data and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the segments")
    parser.add_argument("--folder", type=Path, help="where to store the library for a while")
    arguments = parser.parse_args()
    full = 36_000 if arguments.quick else 360_000
    load = os.getloadavg()[0]
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {load:.1f} at the start\n")
    print("| what | limit | synthetic | real, tiled |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        columns = []
        for make in (search_data.synthetic, search_data.real):
            library = make(full, seed=0)
            if library is not None:
                columns.append(measure(library, make(QUERIES, seed=1), Path(folder)))
    for (name, limit), _ in columns[0]:
        values = [dict(column)[name, limit] for column in columns]
        print("|", " | ".join([name, limit, *values]), "|")


def measure(
    library: PackedSegments, queries: PackedSegments, folder: Path
) -> list[tuple[tuple[str, str], str]]:
    """Rows ((what, limit), value)."""
    rows: list[tuple[tuple[str, str], str]] = []

    def row(name: str, limit: str, value: str) -> None:
        rows.append(((name, limit), value))
        print(f"  {name}: {value}", file=sys.stderr)

    few = head(library, min(20_000, len(library) // 2))
    ours = seconds_to_search(prepare(few), queries, 5, threads=1) / QUERIES
    theirs = {name: run(few, queries) for name, run in RIVALS.items()}
    row(f"one query of {len(few)} segments, one thread, ms", "", f"{1e3 * ours:.2f}")
    for name, seconds in theirs.items():
        row(f"{name}, ms", "", f"{1e3 * seconds:.0f}")
    row("times faster than the better of them", ">= 75", f"{min(theirs.values()) / ours:.0f}")
    part = seconds_to_search(prepare(head(library, int(len(library) / 3.6))), queries, 7)
    began = time.perf_counter()
    index = prepare(library)
    row(f"prepare {len(library)} segments, s", "", f"{time.perf_counter() - began:.2f}")
    whole = seconds_to_search(index, queries, 7)
    row(f"{QUERIES} queries, {len(library)} segments, all cores, s", "<= 0.5", f"{whole:.3f}")
    row("  time over that of 1/3.6 of the segments", "<= 3.6", f"{whole / part:.2f}")
    used = time.process_time()
    search(index, queries)
    row("  processor time, all cores, s", "", f"{time.process_time() - used:.3f}")
    one = seconds_to_search(index, queries, 5, threads=1)
    row("  time with one thread, s", "", f"{one:.3f}")
    unpruned = seconds_to_search(index, queries, 2, prune=False)
    row("  without lower bounds, s", "<= 5", f"{unpruned:.2f}")
    used = time.process_time()
    search(index, queries, prune=False)
    row("    processor time, all cores, s", "", f"{time.process_time() - used:.2f}")
    store(index, queries, folder)
    del index
    for _ in range(2):  # the second time, files are in memory as after any earlier use
        loaded = probe("load", folder)
    row("  with loading, in a new process, s", "<= 1.5", f"{loaded['seconds']:.2f}")
    row("  memory of that process, MB", "<= 1000", f"{loaded['megabytes']:.0f}")
    cache = folder / "cache"
    row("first use, compiling, s", "<= 10", f"{probe('start', cache)['seconds']:.1f}")
    cached = min(probe("start", cache)["seconds"] for _ in range(3))
    row("first use, cached, s", "<= 0.6", f"{cached:.2f}")
    shutil.rmtree(cache)
    return rows


def head(library: PackedSegments, count: int) -> PackedSegments:
    """The first segments of a library."""
    frames = library.offsets[count]
    return PackedSegments(
        library.features[:frames],
        library.offsets[: count + 1],
        library.ids[:count],
        library.groups[:count],
    )


def seconds_to_search(
    index: SearchIndex,
    queries: PackedSegments,
    times: int,
    threads: int | None = None,
    prune: bool = True,
) -> float:
    """Seconds of the fastest of several searches."""
    seconds = []
    for _ in range(times):
        began = time.perf_counter()
        search(index, queries, threads=threads, prune=prune)
        seconds.append(time.perf_counter() - began)
    return min(seconds)


def with_dtaidistance(library: PackedSegments, queries: PackedSegments) -> float:
    """Seconds a query of the k nearest by dtaidistance, which abandons beyond the k-th best."""
    from dtaidistance import dtw_ndim

    def warp(query: np.ndarray, candidate: np.ndarray, limit: float) -> float:
        return dtw_ndim.distance_fast(query, candidate, max_dist=limit)

    return brute_force(library, queries, warp, lambda segment: segment.astype(np.float64))


def with_aeon(library: PackedSegments, queries: PackedSegments) -> float:
    """Seconds a query of the k nearest by aeon."""
    from aeon.distances import dtw_distance

    def warp(query: np.ndarray, candidate: np.ndarray, _: float) -> float:
        return np.sqrt(dtw_distance(query, candidate))

    return brute_force(library, queries, warp, lambda s: np.ascontiguousarray(s.T, np.float64))


RIVALS = {"dtaidistance distance_fast with max_dist": with_dtaidistance, "aeon": with_aeon}


def brute_force(
    library: PackedSegments,
    queries: PackedSegments,
    warp: Callable[[np.ndarray, np.ndarray, float], float],
    form: Callable[[np.ndarray], np.ndarray],
    k: int = 5,
) -> float:
    """Seconds a query, over a few queries of typical lengths; forming arrays is not counted."""
    segments = [form(library[number]) for number in range(len(library))]
    chosen = np.argsort(queries.lengths)[[10, 20, 30, 40, 50]]
    warp(segments[0], segments[0], np.inf)
    seconds = 0.0
    for number in chosen:
        query, n = form(queries[number]), queries.lengths[number]
        legal = np.flatnonzero((library.lengths * 1.5 >= n) & (library.lengths <= 1.5 * n))
        began = time.perf_counter()
        nearest: list[float] = []
        for candidate in legal:
            limit = -nearest[0] if len(nearest) == k else np.inf
            cost = warp(query, segments[candidate], limit)
            if cost < limit:
                (heapq.heappushpop if len(nearest) == k else heapq.heappush)(nearest, -cost)
        seconds += time.perf_counter() - began
    return seconds / len(chosen)


def store(index: SearchIndex, queries: PackedSegments, folder: Path) -> None:
    """Write an index and queries as plain arrays."""
    for field in fields(SearchIndex):
        np.save(folder / f"{field.name}.npy", getattr(index, field.name))
    np.savez(folder / "queries.npz", features=queries.features, offsets=queries.offsets)


def probe(what: str, folder: Path) -> dict[str, float]:
    """Run a part of `search_probe` in a process of its own."""
    script = Path(__file__).with_name("search_probe.py")
    environment = os.environ | {"PYTHONPATH": str(script.parents[1])}
    if what == "start":
        environment["NUMBA_CACHE_DIR"] = str(folder)
    answer = subprocess.run(
        [sys.executable, script, what, folder],
        check=True, capture_output=True, text=True, env=environment,
    )  # fmt: skip
    return json.loads(answer.stdout)


if __name__ == "__main__":
    main()
