"""How long reducing ten minutes at 60 frames a second takes, beside reading the file.

    python benchmarks/reduce_speed.py [CLIP] [--frames 36000] [--repeat 3]

The clip's motion is repeated with slow noise on every joint of both hands, so that all 50 channels
move. Peers in the same run: scipy's Rotation for taking quaternions apart into Euler angles and
putting them together again, and numpy's singular value decomposition for a PCA of the same curves.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from usdhand import find_hands, read_clip
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate_rotations
from usdhand.reduce.evidence import gather
from usdhand.reduce.method import apply_rig, fit_rig, fit_to
from usdhand.reduce.settings import PRESETS, Target

SAMPLE = Path(__file__).resolve().parent.parent / "samples" / "gestures" / "ok_01.usdc"
NOISE_DEG = 1.0


def long_clip(clip: Clip, frames: int) -> Clip:
    """The clip there and back again until it is long enough, with slow noise."""
    there = np.arange(len(clip))
    order = np.resize(np.concatenate([there, there[-2:0:-1]]), frames)
    joints = [j for f in find_hands(clip).frames.values() for j in f.joints]
    random = np.random.default_rng(0)
    vectors = np.radians(NOISE_DEG) * random.normal(size=(frames // 30 + 2, len(joints), 3))
    angle = np.linalg.norm(vectors, axis=-1)
    keys = rot.from_axis_angle(vectors / angle[..., None], angle)
    rotations = clip.rotations[order]
    rotations[:, joints] = rot.multiply(
        rotations[:, joints], interpolate_rotations(keys, np.arange(frames) / 30.0)
    )
    return replace(
        clip,
        rotations=rot.make_continuous(rotations),
        translations=clip.translations[order],
        scales=np.broadcast_to(clip.scales[0], (frames, *clip.scales.shape[1:])),
        fps=60.0,
    )


def timed(repeat: int, work: Callable[[], Any]) -> tuple[float, Any]:
    """Least time in seconds of several runs, and the result.

    Time of all processors for this process, since what else runs does not count in it.
    """
    best, result = np.inf, None
    for _ in range(repeat):
        start = time.process_time()
        result = work()
        best = min(best, time.process_time() - start)
    return best, result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clip", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("--frames", type=int, default=36_000)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    clip = long_clip(read_clip(arguments.clip), arguments.frames)
    repeat = arguments.repeat

    frames_s, hands = timed(repeat, lambda: find_hands(clip))
    encode_s, source = timed(repeat, lambda: hands.encode(clip))
    target = Target(PRESETS[4])
    fit_s, rig = timed(repeat, lambda: fit_rig([clip], [hands], target, sources=[source]))
    evidence_s, evidence = timed(repeat, lambda: gather([(clip, hands, source)]))
    asked = Target(free_channels=15)
    best_s, _ = timed(repeat, lambda: fit_to(evidence, asked, "least-squares"))
    few_s, _ = timed(repeat, lambda: fit_to(evidence, asked, "least-squares", 3))
    largest = Target(max_error=1.0)
    error_s, _ = timed(repeat, lambda: fit_to(evidence, largest, "least-squares"))
    apply_s, reduction = timed(repeat, lambda: apply_rig(rig, clip, hands, source))
    decode_s, _ = timed(repeat, lambda: reduction.motion)
    total = frames_s + encode_s + fit_s + apply_s + decode_s

    joints = np.concatenate([f.joints for f in hands.frames.values()])
    q = clip.rotations[:, joints].reshape(-1, 4)
    take_s, euler = timed(repeat, lambda: Rotation.from_quat(q).as_euler("YXZ"))
    put_s, _ = timed(repeat, lambda: Rotation.from_euler("YXZ", euler).as_quat())
    curves = source.select(rig.names).values
    pca_s, _ = timed(1, lambda: np.linalg.svd(curves - curves.mean(axis=0), full_matrices=False))

    print(
        f"{len(clip)} frames, {len(clip.skeleton)} joints, {len(source)} angles, "
        f"{len(rig.names)} modelled channels, {len(rig.free)} free; seconds of "
        f"processor, best of {repeat}\n"
    )
    print("| step | s |\n|---|---|")
    for name, seconds in (
        ("find hands and frames", frames_s),
        ("encode", encode_s),
        ("fit (preset 4)", fit_s),
        ("of that, gather covariances, fingertips' Jacobians, spectra", evidence_s),
        ("choose the 15 best channels instead", best_s),
        ("the same with at most 3 controllers", few_s),
        ("choose the fewest with an error of at most 1 degree instead", error_s),
        ("apply, errors in degrees and mm", apply_s),
        ("decode the reduced motion", decode_s),
        ("**all**", total),
    ):
        print(f"| {name} | {seconds:.3f} |")
    print("\n| against | peer, s | ours / peer |\n|---|---|---|")
    print(f"| scipy Rotation.as_euler, same joints | {take_s:.3f} | {encode_s / take_s:.2f} |")
    print(f"| scipy Rotation.from_euler, same joints | {put_s:.3f} | {decode_s / put_s:.2f} |")
    print(f"| numpy SVD of the modelled channels | {pca_s:.3f} | {fit_s / pca_s:.2f} |")
    chosen_s = evidence_s + best_s
    print(
        f"\nGathering and choosing the 15 best channels take {chosen_s:.3f} s, encoding "
        f"{encode_s:.3f} s."
    )


if __name__ == "__main__":
    main()
