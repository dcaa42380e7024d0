"""Seconds to read and write a BVH file of 20000 frames and 75 joints: ours and other readers.

    python benchmarks/bvh_speed.py [--peers PYTHON] [--frames 20000] [--repeat 5]

PYTHON is an interpreter that has some of the packages bvh, bvhio, bvhsdk, bvhtoolbox, pybvh and
upc-pymotion. Reader after reader takes its turn, several times over, each in a process of its own
that reads the file three times: the first time with all that is imported and compiled on first use
(ours from a disk cache), then without. What is timed is the whole parse, motion as an array;
`read_clip` is ours with quaternions, units, axes and bind pose. All use one thread, so processor
time compares them even on a busy machine.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from usdhand.formats.bvh.pose import posed_skeleton
from usdhand.formats.bvh.write import write_clip
from usdhand.motion import Clip
from usdhand.motion import rotations as rot

JOINTS = 75
ROOT = Path(__file__).resolve().parent.parent

# Functions that return the angles of all joints in all frames, in degrees, as one array.
OURS = {
    "usdhand, parse": """
def read(path):
    from pathlib import Path
    from usdhand.formats.bvh.file import parse_file
    return parse_file(Path(path)).rows[:, 3:]
""",
    "usdhand, read_clip": """
def read(path):
    from pathlib import Path
    from usdhand.formats.bvh.read import read_clip
    return read_clip(Path(path)).rotations
""",
}
PEERS = {
    "pybvh": """
def read(path):
    import pybvh
    return pybvh.read_bvh_file(path).joint_angles
""",
    "pymotion": """
def read(path):
    from pymotion.io.bvh import BVH
    file = BVH()
    file.load(path)
    return file.data["rotations"]
""",
    "bvhsdk": """
def read(path):
    import bvhsdk, numpy
    file = bvhsdk.ReadFile(path)
    return numpy.array([joint.rotation for joint in file.getlistofjoints()])
""",
    "bvh": """
def read(path):
    import numpy
    from bvh import Bvh
    return numpy.array(Bvh(open(path).read()).frames, float)[:, 3:]
""",
    "bvhtoolbox": """
def read(path):
    import numpy
    from bvhtoolbox import Bvh
    return numpy.array(Bvh(open(path).read()).frames, float)[:, 3:]
""",
    "bvhio": """
def read(path):
    import bvhio, numpy
    root = bvhio.readAsBvh(path).Root
    return numpy.array([[list(k.Rotation) for k in j.Keyframes] for j, *_ in root.layout()])
""",
}
HARNESS = """
import json, sys, time
wall, cpu = [], []
for _ in range(3):
    begun = time.perf_counter(), time.process_time()
    values = read(sys.argv[1])
    wall.append(time.perf_counter() - begun[0])
    cpu.append(time.process_time() - begun[1])
print(json.dumps({
    "first": wall[0], "again": min(wall[1:]), "cpu": min(cpu[1:]),
    "shape": list(values.shape), "total": float(abs(values).sum()),
}))
"""
SLOW_S = 1.5  # readers that take longer have one turn


def long_clip(frames: int) -> Clip:
    """A tree of chains that wander: every value of every channel is another one."""
    random = np.random.default_rng(0)
    parents = np.array([-1] + [j - 1 if j % 6 else j // 2 for j in range(1, JOINTS)], dtype=np.intp)
    paths: list[str] = []
    for j, parent in enumerate(parents):
        paths.append(f"J{j}" if parent < 0 else f"{paths[parent]}/J{j}")
    offsets = random.normal(size=(JOINTS, 3)) * 6.0
    skeleton = posed_skeleton(tuple(paths), parents, np.tile(rot.IDENTITY, (JOINTS, 1)), offsets)
    vectors = np.cumsum(random.normal(size=(frames, JOINTS, 3)) * 0.02, axis=0)
    angle = np.linalg.norm(vectors, axis=-1)
    q = rot.make_continuous(rot.from_axis_angle(vectors / angle[..., None], angle))
    t = np.tile(offsets, (frames, 1, 1))
    t[:, 0] += np.cumsum(random.normal(size=(frames, 3)), axis=0)
    return Clip(skeleton, q, t, np.broadcast_to(1.0, t.shape), 120.0)


def measured(python: str, code: str, path: Path) -> dict[str, Any] | None:
    """Seconds, shape and sum of what was read; None if the package is not there."""
    done = subprocess.run(
        [python, "-c", code + HARNESS, str(path)],
        capture_output=True, text=True, check=False, cwd=ROOT,
    )  # fmt: skip
    if done.returncode:
        print(done.stderr.strip().splitlines()[-1], file=sys.stderr)
        return None
    found: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peers", metavar="PYTHON", default=sys.executable)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.bvh"
        clip = long_clip(arguments.frames)
        begun = time.perf_counter()
        write_clip(clip, path)
        written = time.perf_counter() - begun
        size = path.stat().st_size / 1e6
        print(
            f"{arguments.frames} frames, {JOINTS} joints, {size:.0f} MB; written in {written:.2f} s"
        )
        readers = {name: (sys.executable, code) for name, code in OURS.items()}
        readers |= {name: (arguments.peers, code) for name, code in PEERS.items()}
        runs: dict[str, list[dict[str, Any]]] = {}
        for turn in range(arguments.repeat):
            for name, (python, code) in readers.items():
                if turn and (name not in runs or runs[name][0]["cpu"] > SLOW_S):
                    continue
                found = measured(python, code, path)
                if found is not None:
                    runs.setdefault(name, []).append(found)
    ours = min(run["cpu"] for run in runs["usdhand, parse"])
    print("\n| reader | first, s | again, s | processor, s | times ours | read | sum of values |")
    print("|---" * 7 + "|")
    for name, turns in runs.items():
        first, again, cpu = (min(run[key] for run in turns) for key in ("first", "again", "cpu"))
        print(
            f"| {name} | {first:.3f} | {again:.3f} | {cpu:.3f} | {cpu / ours:.1f} "
            f"| {turns[0]['shape']} | {turns[0]['total']:.6g} |"
        )


if __name__ == "__main__":
    main()
