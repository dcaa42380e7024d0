"""What `search_speed` measures in processes of their own. Prints JSON.

`load FOLDER`: load a stored library and search it: seconds, and the largest memory of the process.
`start FOLDER`: import everything and search a tiny library: seconds.
"""

from __future__ import annotations

import json
import re
import sys
import time
from dataclasses import fields
from pathlib import Path

import numpy as np


def load(folder: Path) -> float:
    """Seconds to load a stored library and search it, everything imported and compiled."""
    from usdhand.search import PackedSegments, SearchIndex, search

    start(folder)
    stored = np.load(folder / "queries.npz")
    names = np.arange(len(stored["offsets"]) - 1)
    queries = PackedSegments(stored["features"], stored["offsets"], names, names.astype(np.int32))
    began = time.perf_counter()
    arrays = [np.load(folder / f"{field.name}.npy", mmap_mode="c") for field in fields(SearchIndex)]
    search(SearchIndex(*arrays), queries)
    return time.perf_counter() - began


def start(_: Path) -> float:
    """Seconds of a first search of next to nothing."""
    began = time.perf_counter()
    from usdhand.search import pack, prepare, search

    segments = pack([np.arange(240.0).reshape(-1, 12)] * 3)
    search(prepare(segments), segments)
    return time.perf_counter() - began


def peak() -> float:
    """Largest memory of this process in MB; `ru_maxrss` would remember that of its parent."""
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1000


if __name__ == "__main__":
    seconds = {"load": load, "start": start}[sys.argv[1]](Path(sys.argv[2]))
    print(json.dumps({"seconds": seconds, "megabytes": peak()}))
