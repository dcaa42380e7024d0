"""Clips of any length, gesturing or holding one pose, on a body with two hands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from builders.moving_hands import at_bind
from builders.rigs import build, known_rigs

from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

GESTURE_S = 1.3  # about: no two are alike


def long_clip(seconds: float, *, fps: float = 6.0, seed: int = 0, name: str = "long") -> Clip:
    """Arms that wave and fingers that curl, never the same for long."""
    clip = still_clip(seconds, fps=fps, name=name)
    joints = _joints(clip)
    rotations = clip.rotations.copy()
    random = np.random.default_rng(seed)
    for joint in joints:
        about = rot.from_matrix(np.eye(3))
        for axis in np.eye(3)[:2]:
            angle = _waves(random, len(clip), fps)
            about = rot.multiply(about, rot.from_axis_angle(axis, angle))
        rotations[:, joint] = rot.multiply(rotations[:, joint], about)
    return clip.with_rotations(rotations)


def still_clip(seconds: float, *, fps: float = 6.0, name: str = "still") -> Clip:
    """Nothing moves at all."""
    rig, _ = build(known_rigs()["mixamo"])
    one, count = at_bind(rig), round(seconds * fps) + 1
    return replace(
        one,
        rotations=np.broadcast_to(one.rotations, (count, *one.rotations.shape[1:])),
        translations=np.broadcast_to(one.translations, (count, *one.translations.shape[1:])),
        scales=np.broadcast_to(one.scales, (count, *one.scales.shape[1:])),
        fps=fps,
        name=name,
    )


def followed_by(first: Clip, *others: Clip) -> Clip:
    """Clips of one skeleton and rate, one after the other."""
    clips = (first, *others)
    return replace(
        first,
        rotations=np.concatenate([clip.rotations for clip in clips]),
        translations=np.concatenate([clip.translations for clip in clips]),
        scales=np.concatenate([clip.scales for clip in clips]),
    )


def _joints(clip: Clip) -> list[int]:
    """Elbows, wrists and fingers, in the order of the skeleton."""
    words = ("ForeArm", "Hand")
    return [j for j, n in enumerate(clip.skeleton.names) if any(w in n for w in words)]


def _waves(random: np.random.Generator, frames: int, fps: float) -> Array:
    """(frames,) radians between about -0.6 and 0.6."""
    seconds = np.arange(frames) / fps
    speeds = random.uniform(0.6, 1.6, 3) * 2 * np.pi / GESTURE_S / 2
    return np.asarray(sum(0.2 * np.sin(s * seconds + random.uniform(0, 6)) for s in speeds))
