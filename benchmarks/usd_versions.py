"""See that results of every kind open and evaluate equally in other versions of USD.

    python benchmarks/usd_versions.py [--versions 24.3 24.8 25.11] [--blender PYTHON]

Writes results with this usdhand, asks UsdSkel for joints and skinned points (`usd_poses.py`), with
this USD and with each other version, and prints the largest difference; exit code 1 if one is
above 0.01 mm or a file does not open. Versions are installed by pip into a folder that is deleted
afterwards; Blender brings its own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

SAMPLES = Path(__file__).parent.parent / "samples"
FULL, BODY = (SAMPLES / "conversations" / f"talk_01_{kind}.usdc" for kind in ("full", "body"))
POSES = Path(__file__).with_name("usd_poses.py")
SAME_CM = 1e-3


def main() -> int:
    """Write results, evaluate them in all versions and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--versions", nargs="*", default=["24.3", "24.8", "25.11"])
    parser.add_argument("--blender", default=os.environ.get("USDHAND_BLENDER_PYTHON"))
    given = parser.parse_args()
    good = True
    with tempfile.TemporaryDirectory() as folder:
        files = results(Path(folder))
        own = evaluated([sys.executable], None, files, Path(folder, "own.npz"))
        for version in given.versions:
            target = Path(folder, version)
            install = [
                "install",
                "--quiet",
                "--no-deps",
                "--target",
                target,
                f"usd-core=={version}",
            ]
            subprocess.run([sys.executable, "-m", "pip", *install], check=True)
            found = evaluated([sys.executable], target, files, Path(folder, f"{version}.npz"))
            good &= compared(f"usd-core {version}", own, found)
        if given.blender:
            found = evaluated(
                [given.blender], None, files, Path(folder, "blender.npz"), "--blender"
            )
            good &= compared("Blender", own, found)
    return not good


def results(folder: Path) -> list[Path]:
    """One result of each kind and format."""
    library = folder / "library.usdc"
    _usdhand("library", "build", SAMPLES / "gestures", "-o", library)
    made = [library]
    for suffix in ("usda", "usdc", "usdz"):
        rig, full, flat, filled, spliced, made_of_glb = (
            folder / f"{name}.{suffix}"
            for name in ("rig", "full", "flat", "fill", "splice", "gltf")
        )
        _usdhand("reduce", FULL, "-o", rig)
        _usdhand("expand", rig, "-o", full)
        _usdhand("convert", FULL, "--up", "Z", "--scale", 2, "-o", flat)
        _usdhand("fill", BODY, "--library", library, "--alternatives", 2, "-o", filled)
        _usdhand("splice", BODY, FULL, "-o", spliced)
        _usdhand("convert", FULL, "-o", folder / f"{suffix}.glb")
        _usdhand("convert", folder / f"{suffix}.glb", "-o", made_of_glb)
        made += [rig, full, flat, filled, spliced, made_of_glb]
    return made


def evaluated(
    python: Sequence[str], pxr: Path | None, files: Sequence[Path], target: Path, *more: str
) -> dict[str, np.ndarray]:
    """What another USD makes of files."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if pxr:
        env["PYTHONPATH"] = str(pxr)
    subprocess.run([*python, POSES, target, *files, *more], env=env, check=True)
    with np.load(target) as arrays:
        return dict(arrays)


def compared(name: str, own: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    """Print how two versions differ and return whether they agree."""
    missing = own.keys() ^ other.keys()
    numbers = [key for key in own.keys() & other.keys() if own[key].dtype.kind == "f"]
    worst = max((float(np.abs(own[key] - other[key]).max()), key) for key in numbers)
    agrees = not missing and worst[0] <= SAME_CM
    lost = f"; only in one: {sorted(missing)[:3]}" if missing else ""
    print(f"{name:16}{len(numbers)} arrays, at most {worst[0]:.2g} cm apart ({worst[1]}){lost}")
    return agrees


def _usdhand(*arguments: object) -> None:
    line = [sys.executable, "-m", "usdhand", *map(str, arguments), "-q", "--force"]
    subprocess.run(line, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


if __name__ == "__main__":
    sys.exit(main())
