"""Segments to measure the search on: synthetic wrists, and real ones tiled with noise."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from usdhand.search import PackedSegments

FPS = 60
SHARED = Path(os.environ.get("USDHAND_SHARED", Path(__file__).resolve().parents[2] / "shared"))
_BLOCK = 1_000_000


def synthetic(count: int, seed: int) -> PackedSegments:
    """Wrists that wander: a slow and a fast (about 1 Hz) part, 12 cm and 29 deg an axis.

    Features are those of the default metric: position in cm and a rotation matrix scaled so that
    a small angle counts in degrees, weighted by 0.5. Segments have 20 to 120 frames, 60 on
    average: 360 000 of them are 100 hours.
    """
    rng = np.random.default_rng(seed)
    offsets = np.concatenate([[0], np.cumsum(rng.triangular(20, 40, 120.9, count).astype(int))])
    features = np.empty((offsets[-1], 12), np.float32)
    for start in range(0, len(features), _BLOCK):
        frames = min(_BLOCK, len(features) - start)
        waves = np.column_stack([_wave(frames, rng) for _ in range(6)])
        features[start : start + frames] = _features(
            12 * waves[:, :3], Rotation.from_rotvec(0.5 * waves[:, 3:]).as_matrix()
        )
    return _packed(features, offsets)


def real(count: int, seed: int) -> PackedSegments | None:
    """Right wrists of the shared takes, again and again with smooth noise; None without data.

    The noise is new for every segment: 3 cm and 6 deg of place, and a tenth of that in motion.
    """
    rng = np.random.default_rng(seed)
    takes = _takes()
    if not takes:
        return None
    lengths = rng.triangular(20, 40, 120.9, count).astype(int)
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    features = np.empty((offsets[-1], 12), np.float32)
    for segment, frames in enumerate(lengths):
        take = takes[rng.integers(len(takes))]
        start = rng.integers(len(take) - frames)
        ramp = np.linspace(-1, 1, frames)[:, None]
        noise = rng.normal(0, 3, 12) + rng.normal(0, 0.3, 12) * ramp
        features[offsets[segment] : offsets[segment + 1]] = take[start : start + frames] + noise
    return _packed(features, offsets)


def _wave(frames: int, rng: np.random.Generator) -> np.ndarray:
    fast = gaussian_filter1d(rng.standard_normal(frames).astype(np.float32), 0.15 * FPS)
    coarse = gaussian_filter1d(rng.standard_normal(frames // 8 + 2), FPS / 8)
    slow = np.interp(np.arange(frames) / 8, np.arange(len(coarse)), coarse)
    return 0.6 * fast / fast.std() + 0.8 * slow / slow.std()


def _features(positions: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    scale = np.sqrt(0.5) * np.degrees(1) / np.sqrt(2)
    return np.hstack([positions, scale * matrices.reshape(-1, 9)]).astype(np.float32)


def _takes() -> list[np.ndarray]:
    files = sorted((SHARED / "data" / "studiogalt" / "full").glob("*.usdc"))
    if not files:
        return []
    from usdhand.formats.usd.read import read_clip
    from usdhand.motion import forward_kinematics
    from usdhand.motion.rotations import to_matrix
    from usdhand.motion.skeleton import leaf_name

    takes = []
    for path in files:
        clip = read_clip(path)
        hand = [leaf_name(joint) for joint in clip.skeleton.joints].index("Hand_R")
        pose = forward_kinematics(clip, [hand], base=0)
        takes.append(_features(pose.position(hand), to_matrix(pose.rotation(hand))))
    return [take for take in takes if len(take) > 240]


def _packed(features: np.ndarray, offsets: np.ndarray) -> PackedSegments:
    names = np.arange(len(offsets) - 1)
    return PackedSegments(features, offsets.astype(np.int64), names, names.astype(np.int32))
