"""Clips as people have them who have arrays and no file."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
from conftest import REPOSITORY

from usdhand.formats.files import read_clip
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Y_UP_FROM_Z_UP, Array

SAMPLES = REPOSITORY / "samples"


def sample(name: str) -> Clip:
    """A sample clip, such as "gestures/ok_01"."""
    return read_clip(SAMPLES / f"{name}.usdc")


def arrays_of(clip: Clip, *, metres_z_up: bool = False, wxyz: bool = False) -> dict[str, Any]:
    """A clip as arguments of `Clip.from_arrays`."""
    skeleton, q, t = clip.skeleton, clip.rotations, clip.translations
    bind, rest, roots = skeleton.bind.copy(), skeleton.rest.copy(), skeleton.parents < 0
    if metres_z_up:
        turn = np.eye(4)
        turn[:3, :3] = Y_UP_FROM_Z_UP.T
        bind, rest[roots] = turn @ bind, turn @ rest[roots]
        q, t = q.copy(), t.copy()
        q[:, roots] = rot.multiply(rot.from_matrix(turn[:3, :3]), q[:, roots])
        t[:, roots] = t[:, roots] @ turn[:3, :3].T
        t = t / 100.0
        for matrices in (bind, rest):
            matrices[:, :3, 3] /= 100.0
    return {
        "joints": list(skeleton.joints),
        "rotations": q[..., [3, 0, 1, 2]] if wxyz else q,
        "quaternions": "wxyz" if wxyz else "xyzw",
        "fps": clip.fps,
        "units": "m" if metres_z_up else "cm",
        "up": "Z" if metres_z_up else "Y",
        "bind": bind,
        "rest": rest,
        "translations": t,
        "scales": clip.scales,
        "name": clip.name,
    }


def in_memory(clip: Clip) -> Clip:
    """The same motion without a file."""
    return Clip.from_arrays(**arrays_of(clip))


def reordered(given: dict[str, Any], order: Array) -> dict[str, Any]:
    """The same arrays with their joints in another order."""
    result = dict(given)
    result["joints"] = [given["joints"][j] for j in order]
    for name in ("rotations", "translations", "scales"):
        result[name] = given[name][:, order]
    for name in ("bind", "rest"):
        result[name] = given[name][order]
    return result


def without_fingers(clip: Clip) -> Clip:
    """The clip without the joints below its wrists, of a sample character."""
    fingers = re.compile("Hand(Thumb|Index|Middle|Ring|Pinky)")
    keep = [j for j, path in enumerate(clip.skeleton.joints) if not fingers.search(path)]
    given = arrays_of(clip)
    return Clip.from_arrays(**reordered(given, np.array(keep)))


def still(clip: Clip) -> Clip:
    """The clip held at its first frame."""
    frames = len(clip)
    return replace(
        clip,
        rotations=np.repeat(clip.rotations[:1], frames, axis=0),
        translations=np.repeat(clip.translations[:1], frames, axis=0),
    )


def first_frame(clip: Clip) -> Clip:
    """The clip's first frame alone."""
    return replace(
        clip,
        rotations=clip.rotations[:1],
        translations=clip.translations[:1],
        scales=clip.scales[:1],
    )


def with_hand(clip: Clip, side: str, digits: str = "Thumb|Index|Middle|Ring|Pinky") -> Clip:
    """The clip with the fingers of one side only, and of these only some digits."""
    other = "Right" if side == "Left" else "Left"
    lost = re.compile(f"{other}Hand\\w|{side}Hand(?!({digits}))\\w")
    keep = [j for j, path in enumerate(clip.skeleton.joints) if not lost.search(path)]
    arrays = arrays_of(clip)
    chosen = {name: arrays[name][:, keep] for name in ("rotations", "translations", "scales")}
    poses = {name: arrays[name][keep] for name in ("bind", "rest")}
    joints = [arrays["joints"][j] for j in keep]
    return Clip.from_arrays(**arrays | chosen | poses | {"joints": joints})
