"""Reading and writing a long take, against the fastest raw loop over usd-core for the same work.

    python benchmarks/usd_io.py [--frames 36000] [--joints 75]

Prints one table; exit code 1 if a limit is exceeded. "Arrays" are the float64 rotations,
translations and (where they are time-sampled) scales of the clip: peak memory is everything that
the process holds beyond its imports, the clip itself included.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

MOST_TIME, MOST_MEMORY = 1.5, 3.0
ROUNDS = 5
SCALES = {"constant": False, "time-sampled": True}
ANIMATION = "/Hero/Anim"


def main() -> int:
    """Run all measurements, each in a process of its own, and print them as a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=36_000)
    parser.add_argument("--joints", type=int, default=75)
    parser.add_argument("--job", nargs=2, metavar=("NAME", "FILE"), help=argparse.SUPPRESS)
    parser.add_argument("--moving-scales", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.job:
        name, file = given.job
        print(json.dumps(JOBS[name](Path(file), given)))
        return 0
    print(f"{given.frames} frames x {given.joints} joints, best of {ROUNDS}")
    print(f"{'':7}{'scales':14}{'raw s':>8}{'ours s':>8}{'ratio':>8}{'memory':>10}{'x arrays':>10}")
    good = True
    with tempfile.TemporaryDirectory() as folder:
        for scales, moving in SCALES.items():
            file = str(Path(folder) / f"{scales}.usdc")

            def job(name: str, file: str = file, moving: bool = moving) -> Any:
                return _subprocess(name, file, moving, given)

            arrays = job("make")
            for verb in ("read", "write"):
                raw, ours = job(f"time-{verb}")
                peak = job(f"memory-{verb}")
                ratio, share = ours / raw, peak / arrays
                good = good and ratio <= MOST_TIME and share <= MOST_MEMORY
                print(
                    f"{verb:7}{scales:14}{raw:8.3f}{ours:8.3f}{ratio:8.2f}"
                    f"{peak / 1e6:7.0f} MB{share:10.2f}"
                )
    print(f"limits: {MOST_TIME} times the raw loop, {MOST_MEMORY} times the arrays")
    return 0 if good else 1


def _subprocess(name: str, file: str, moving: bool, given: argparse.Namespace) -> Any:
    # This process stays small: a child's peak memory starts from its parent's.
    command = [sys.executable, __file__, "--job", name, file]
    command += ["--frames", str(given.frames), "--joints", str(given.joints)]
    command += ["--moving-scales"] if moving else []
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


# -- jobs, each in its own process --------------------------------------------------------------


def make(file: Path, given: argparse.Namespace) -> int:
    """Write a take; returns the bytes of its arrays in float64."""
    import numpy as np
    from pxr import Sdf, Vt

    frames, count = given.frames, given.joints
    joints = ["j0"]
    for j in range(1, count):
        joints.append(f"{joints[(j - 1) // 3]}/j{j}")
    random = np.random.default_rng(1)
    t = np.arange(frames)[:, None, None] / 20.0
    q = np.sin(t * random.uniform(0.2, 1.0, (1, count, 4)) + random.uniform(0, 6, (1, count, 4)))
    q[..., 3] += 3.0
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    wobble = 1.0 + 0.05 * np.sin(t * random.uniform(0.2, 1.0, (1, count, 3)))
    ones = np.ones((1, count, 3))
    values = {
        "rotations": (Sdf.ValueTypeNames.QuatfArray, q),
        "translations": (Sdf.ValueTypeNames.Float3Array, 10.0 * wobble),
        "scales": (Sdf.ValueTypeNames.Half3Array, wobble if given.moving_scales else ones),
    }
    identity = Vt.Matrix4dArray.FromNumpy(np.tile(np.eye(4), (count, 1, 1)))
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    layer.defaultPrim = "Hero"
    layer.timeCodesPerSecond = layer.framesPerSecond = 60.0
    layer.startTimeCode, layer.endTimeCode = 0.0, frames - 1.0
    layer.pseudoRoot.SetInfo("upAxis", "Y")
    layer.pseudoRoot.SetInfo("metersPerUnit", 0.01)
    with Sdf.ChangeBlock():
        for path, kind in (("/Hero", "SkelRoot"), ("/Hero/Skel", "Skeleton")):
            prim = Sdf.CreatePrimInLayer(layer, path)
            prim.specifier, prim.typeName = Sdf.SpecifierDef, kind
        schemas = Sdf.TokenListOp()
        schemas.prependedItems = ["SkelBindingAPI"]
        prim.SetInfo("apiSchemas", schemas)
        for name, value_type, value in (
            ("joints", Sdf.ValueTypeNames.TokenArray, Vt.TokenArray(joints)),
            ("bindTransforms", Sdf.ValueTypeNames.Matrix4dArray, identity),
            ("restTransforms", Sdf.ValueTypeNames.Matrix4dArray, identity),
        ):
            Sdf.AttributeSpec(prim, name, value_type, Sdf.VariabilityUniform).default = value
        binding = Sdf.RelationshipSpec(prim, "skel:animationSource", custom=False)
        binding.targetPathList.explicitItems = [ANIMATION]
        animation = _raw_animation(layer, values)
        tokens = Sdf.AttributeSpec(
            animation, "joints", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
        )
        tokens.default = Vt.TokenArray(joints)
    layer.Export(str(file))
    return sum(v.nbytes for _, v in values.values() if len(v) == frames)


def time_read(file: Path, _: argparse.Namespace) -> tuple[float, float]:
    """Seconds of the raw loop and of ours."""
    from usdhand.formats.usd.read import read_clip

    return _best(lambda: raw_read(file), lambda: read_clip(file))


def time_write(file: Path, _: argparse.Namespace) -> tuple[float, float]:
    """Seconds of the raw loop and of ours, which keeps half of the joints to the bit."""
    write, clip = _writer(file)
    return _best(lambda: raw_write(clip, file.with_name("raw.usdc")), write)


def memory_read(file: Path, _: argparse.Namespace) -> int:
    """Peak bytes of reading."""
    from usdhand.formats.usd.read import read_clip

    before = _peak()
    clip = read_clip(file)
    del clip
    return _peak() - before


def memory_write(file: Path, _: argparse.Namespace) -> int:
    """Peak bytes of reading and writing."""
    before = _peak()
    write, _clip = _writer(file)
    write()
    return _peak() - before


JOBS: dict[str, Callable[[Path, argparse.Namespace], Any]] = {
    "make": make,
    "time-read": time_read,
    "time-write": time_write,
    "memory-read": memory_read,
    "memory-write": memory_write,
}


def raw_read(file: Path) -> list[Any]:
    """Read all samples into float64 arrays, as fast as usd-core does."""
    import numpy as np
    from pxr import Sdf

    layer, arrays = Sdf.Layer.FindOrOpen(str(file)), []
    query = layer.QueryTimeSample
    for name in ("rotations", "translations", "scales"):
        path = Sdf.Path(f"{ANIMATION}.{name}")
        times = layer.ListTimeSamplesForPath(path)
        if not times:
            arrays.append(np.array(layer.GetAttributeAtPath(path).default, dtype=np.float64))
            continue
        array = np.empty((len(times), *np.asarray(query(path, times[0])).shape))
        for i, each in enumerate(times):
            array[i] = np.asarray(query(path, each))
        arrays.append(array)
    return arrays


def raw_write(clip: Any, file: Path) -> None:
    """Write the arrays of a clip, as fast as usd-core does."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    scales = clip.scales if clip.scales.strides[0] else clip.scales[:1]
    types = Sdf.ValueTypeNames
    with Sdf.ChangeBlock():
        _raw_animation(
            layer,
            {
                "rotations": (types.QuatfArray, clip.rotations),
                "translations": (types.Float3Array, clip.translations),
                "scales": (types.Half3Array, scales),
            },
        )
    layer.Export(str(file))


def _raw_animation(layer: Any, values: dict[str, Any]) -> Any:
    import numpy as np
    from pxr import Sdf, Vt

    kinds = {
        "rotations": (np.float32, Vt.QuatfArray.FromNumpy),
        "translations": (np.float32, Vt.Vec3fArray.FromNumpy),
        "scales": (np.float16, Vt.Vec3hArray.FromNumpy),
    }
    prim = Sdf.CreatePrimInLayer(layer, ANIMATION)
    prim.specifier, prim.typeName = Sdf.SpecifierDef, "SkelAnimation"
    for name, (value_type, array) in values.items():
        dtype, make_row = kinds[name]
        attribute, rows = Sdf.AttributeSpec(prim, name, value_type), array.astype(dtype)
        if len(rows) == 1:
            attribute.default = make_row(rows[0])
            continue
        path = attribute.path
        for i, row in enumerate(rows):
            layer.SetTimeSample(path, float(i), make_row(row))
    return prim


def _writer(file: Path) -> tuple[Callable[[], None], Any]:
    from usdhand.formats.usd.read import clip_from_character
    from usdhand.formats.usd.stage import find_character
    from usdhand.formats.usd.write import write_motion

    character = find_character(file)
    clip = clip_from_character(character)
    changed = range(len(clip.skeleton) // 2)
    output = file.with_name("ours.usdc")
    return lambda: write_motion(character, clip, changed, output, force=True), clip


def _best(*jobs: Callable[[], object]) -> tuple[float, ...]:
    """Shortest time of each job, run in turns so that all see the same machine."""
    best = [float("inf")] * len(jobs)
    for _ in range(ROUNDS):
        for i, job in enumerate(jobs):
            start = time.perf_counter()
            job()
            best[i] = min(best[i], time.perf_counter() - start)
    return tuple(best)


def _peak() -> int:
    import numpy  # noqa: F401  (what every job imports is no cost of the job)
    from pxr import Usd, UsdSkel  # noqa: F401

    import usdhand.formats.usd.write  # noqa: F401

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


if __name__ == "__main__":
    sys.exit(main())
