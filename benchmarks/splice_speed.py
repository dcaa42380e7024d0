"""Time and memory of aligning one hand: 3000 and 36000 frames, and the paper's 569.

Run: python benchmarks/splice_speed.py [--takes FOLDER] [--peer] [--peers PYTHON ...]

The motion is real takes one after the other, often enough; the hand clip is the same motion with a
smooth warp. With --peer, pass 1 as the paper prints it is timed at 3000 frames: a numpy cost matrix
and dtw-python (GPL, not a dependency). With --peers, other packages' DTW is timed at 3000 and 36000
frames with the interpreters given, with limits on memory and time, see benchmarks/splice_peers.py.
Every length and package runs in a process of its own, whose peak memory above that of the clips is
measured. Times include everything from the markers to both passes.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from splice_peers import PEERS

import usdhand
from usdhand.splice.band import pinned_band
from usdhand.splice.markers import Markers, hand_markers
from usdhand.splice.phases import smoothed
from usdhand.splice.settings import SpliceSettings
from usdhand.splice.timing import align_hands

HERE = Path(__file__).resolve().parent.parent
REAL = HERE.parent / "shared" / "data" / "studiogalt" / "full"
SETTINGS = SpliceSettings()
PEER_GB, PEER_SECONDS = 8, 300


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--takes", type=Path, default=REAL if REAL.is_dir() else HERE / "samples" / "gestures"
    )
    parser.add_argument("--peer", action="store_true")
    parser.add_argument("--peers", metavar="PYTHON", nargs="+", default=[])
    arguments = parser.parse_args()
    takes = markers_of(arguments.takes)
    print("frames  seconds  cells of pass 1  ns per cell  peak MB in addition to the clips")
    seconds: dict[int, float] = {}
    context = multiprocessing.get_context("spawn")
    for frames in (569, 3000, 36000):
        with context.Pool(1) as pool:
            seconds[frames], cells, memory = pool.apply(measured, (takes, frames))
        per_cell = 1e9 * seconds[frames] / cells
        print(f"{frames:6d}  {seconds[frames]:7.3f}  {cells:15d}  {per_cell:9.2f}  {memory:8.0f}")
    if arguments.peer:
        theirs = peer_seconds(*pair(takes, 3000))
        print(
            f"numpy cost matrix and dtw-python at 3000 frames: {theirs:.2f} s, "
            f"{theirs / seconds[3000]:.0f} times as long"
        )
    if arguments.peers:
        print(f"others, within {PEER_GB} GB and {PEER_SECONDS} s:")
        for frames in (3000, 36000):
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "derivatives.npz"
                body, hand = (derivatives(m) for m in pair(takes, frames))
                np.savez(file, body=body, hand=hand)
                for package in PEERS:
                    print(f"{frames:6d}  {package:12}  {peer(package, file, arguments.peers)}")


def derivatives(markers: Markers) -> np.ndarray:
    """(frames, 24) velocities and accelerations, each of unit RMS."""
    deviation = SETTINGS.smoothing * SETTINGS.fps
    both = [smoothed(markers.positions, deviation, k).reshape(len(markers), -1) for k in (1, 2)]
    return np.concatenate([d / np.sqrt(np.mean(d**2)) for d in both], axis=1)


def peer(package: str, file: Path, interpreters: list[str]) -> str:
    """What a package needs, or why it does not finish."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (PEER_GB * 2**30, PEER_GB * 2**30))

    for python in interpreters:
        command = [python, str(HERE / "benchmarks" / "splice_peers.py"), package, str(file)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=PEER_SECONDS, preexec_fn=limit
            )
        except subprocess.TimeoutExpired:
            return f"not done after {PEER_SECONDS} s"
        if done.returncode == 0:
            seconds, memory = map(float, done.stdout.split()[-2:])
            return f"{seconds:.3f} s, {memory:.0f} MB in addition to the clips"
        if "MemoryError" in done.stderr:
            return f"out of memory at {PEER_GB} GB"
        if "ModuleNotFoundError" not in done.stderr:
            return f"failed: {done.stderr.strip().splitlines()[-1]}"
    return "not installed"


def markers_of(folder: Path) -> list[Markers]:
    found = []
    for path in sorted(folder.glob("*.usdc")):
        clip = usdhand.read_clip(path)
        hands = usdhand.find_hands(clip)
        if "right" in hands.frames:
            found.append(hand_markers(clip, hands, "right", SETTINGS.fps))
    return found


def pair(takes: list[Markers], frames: int) -> tuple[Markers, Markers]:
    """Two marker motions of that many frames, the second a warp of the first."""
    order = np.random.default_rng(0).choice(len(takes), size=1 + frames // 100)
    body = replace(
        takes[0],
        **{
            name: np.concatenate([getattr(takes[k], name) for k in order])[:frames]
            for name in ("positions", "wrist", "forearm")
        },
    )
    noise = np.random.default_rng(1).normal(size=frames)
    warp = np.cumsum(np.maximum(1.0 + 6.0 * smoothed(noise, 30.0), 0.5))
    at = np.rint(warp * (frames - 1) / warp[-1]).astype(int)
    hand = replace(
        body, positions=body.positions[at], wrist=body.wrist[at], forearm=body.forearm[at]
    )
    return body, hand


def measured(takes: list[Markers], frames: int) -> tuple[float, int, float]:
    """Seconds, cells of pass 1, and MB of peak memory above what the clips take."""
    short = pair(takes, 300)
    align_hands([short], SETTINGS, (), np.arange(300) / SETTINGS.fps)  # compiled
    body, hand = pair(takes, frames)
    band = pinned_band(((0, 0, 0), (frames - 1, frames - 1, 0)), SETTINGS.band[0] * frames)
    before = peak_mb()
    best = np.inf
    for _ in range(1 if frames > 10000 else 5):
        start = time.process_time()
        align_hands([(body, hand)], SETTINGS, (), np.arange(frames) / SETTINGS.fps)
        best = min(best, time.process_time() - start)
    return best, band.cells, peak_mb() - before


def peak_mb() -> float:
    scale = 1e6 if sys.platform == "darwin" else 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale


def peer_seconds(body: Markers, hand: Markers) -> float:
    """Seconds that pass 1 as printed takes with a numpy cost matrix and dtw-python."""
    import dtw

    start = time.process_time()
    window = {"window_size": int(SETTINGS.band[0] * len(body) / np.sqrt(2))}
    dtw.dtw(
        sign_costs(body, hand),
        step_pattern="symmetric1",
        window_type="slantedband",
        window_args=window,
    )
    return time.process_time() - start


def sign_costs(body: Markers, hand: Markers) -> np.ndarray:
    """Costs (rows, columns) of equations (6) and (7) in numpy."""
    deviation = SETTINGS.smoothing * SETTINGS.fps
    windows = []
    for markers in (body, hand):
        positions = smoothed(markers.positions, deviation)[..., [0, 2]].astype(np.float32)
        padded = np.pad(positions, ((2, 2), (0, 0), (0, 0)), mode="edge")
        five = np.stack([padded[k : k + len(markers)] for k in range(5)], axis=1)
        five = five - five.mean(axis=(1, 2), keepdims=True)
        windows.append(five.reshape(len(markers), -1, 2))
    (px, pz), (qx, qz) = (np.moveaxis(w, 2, 0) for w in windows)
    cosine, sine = px @ qx.T + pz @ qz.T, px @ qz.T - pz @ qx.T
    length = np.hypot(cosine, sine)
    cosine, sine = cosine / length, sine / length
    total = np.zeros(length.shape)
    for order in (1, 2):
        p, q = (smoothed(m.positions, deviation, order).astype(np.float32) for m in (body, hand))
        limits = [SETTINGS.dead_zone * np.sqrt(np.mean(np.sum(v**2, axis=-1))) for v in (p, q)]
        for k in range(4):
            x, y, z = q[:, k].T
            turned = cosine * x + sine * z, np.broadcast_to(y, total.shape), cosine * z - sine * x
            for axis, theirs in enumerate(turned):
                ours = signs(p[:, k, axis], limits[0])[:, None]
                total += (ours - signs(theirs, limits[1])) ** 2
    return total


def signs(values: np.ndarray, limit: float) -> np.ndarray:
    return (values > limit).astype(np.float32) - (values < -limit)


if __name__ == "__main__":
    main()
