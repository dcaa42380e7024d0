"""What each verb makes of a clip, and judging in world space what it has written."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from builders.every_format import talk
from conftest import REPOSITORY
from oracles.usdskel import joint_worlds

import usdhand as api
from usdhand.fill.library import MotionLibrary
from usdhand.motion import Clip, Origin, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.verbs.expand import expand

VERBS = ("reduce", "expand", "fill", "splice", "write_clip")
NEAR_CM, NEAR_DEG = 1e-3, 1e-3  # a hundredth of a millimetre


def small_library(folder: Path) -> MotionLibrary:
    clips = sorted((REPOSITORY / "samples" / "gestures").glob("*.usdc"))[::7]
    return api.build_library(clips, folder / "library.usdc").library


@dataclass
class Result:
    """A clip as a verb made it, and how it is written."""

    clip: Clip
    write: Callable[..., object]


def channels_scaled(clip: Clip, factor: float) -> Clip:
    hands = api.find_hands(clip)
    channels = hands.encode(clip)
    return hands.decode(channels.replaced(replace(channels, values=factor * channels.values)), clip)


def result_of(verb: str, clip: Clip, library: MotionLibrary, folder: Path) -> Result:
    if verb == "write_clip":
        made = channels_scaled(clip, 0.5)
        return Result(made, lambda output, **options: api.write_clip(made, output, **options))
    if verb == "fill":
        filled = api.fill_fingers(clip, library, replace_motion=True)
        assert filled.changed
        return Result(filled.clips[0], lambda o, **options: api.write_filled(filled, o, **options))
    if verb == "splice":
        spliced = api.splice_hands(clip, talk())
        return Result(spliced.clip, lambda o, **options: api.write_spliced(spliced, o, **options))
    [reduction] = api.reduce_hands([clip])
    if verb == "reduce":
        return Result(reduction.motion, lambda o, **more: api.write_rig(reduction, o, **more))
    rig = folder / "expanded.rig.usdc"
    api.write_rig(reduction, rig, force=True)
    expanded = expand(rig)
    return Result(expanded, lambda output, **options: api.write_clip(expanded, output, **options))


def in_memory(clip: Clip) -> Clip:
    """The clip as if it had been made of arrays, with nothing said of time codes."""
    return replace(clip, source=None, origin=Origin(), problems=())


def assert_shows(path: Path, meant: Clip, left_out: Collection[int] = ()) -> Clip:
    """Read back, and by UsdSkel's own evaluation, a file shows this clip in world space.

    ``left_out`` are joints below others that are scaled: in USD, scales have half precision.
    """
    found = api.read_clip(path)
    assert len(found) == len(meant)
    assert found.times == pytest.approx(meant.times, abs=1e-6)
    joints = [j for j in range(len(meant.skeleton)) if j not in left_out]
    pose = forward_kinematics(meant)
    own = forward_kinematics(found)
    worlds = joint_worlds(path, found.origin.skeleton_path, found.time_codes)
    u, _, vt = np.linalg.svd(worlds[..., :3, :3])
    shown = (own.positions, own.rotations), (worlds[..., :3, 3], rot.from_matrix(u @ vt))
    for positions, rotations in shown:
        assert np.abs(pose.positions - positions)[:, joints].max() < NEAR_CM
        assert rot.angle_between(pose.rotations, rotations)[:, joints].max() < NEAR_DEG
    return found


def bend_to_palm(clip: Clip, positions: np.ndarray) -> np.ndarray:
    """(hands,) mean way of the fingertips from their knuckles out of the palm, cm."""
    found = []
    for side, hand in api.find_hands(clip).character.hands.items():
        index, pinky = (positions[:, hand.joints[f"{d}MCP"]] for d in ("Index", "Pinky"))
        wrist = positions[:, hand.wrist]
        normal = np.cross(index - wrist, pinky - wrist) * (1.0 if side == "right" else -1.0)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        for digit in ("Index", "Middle", "Ring", "Pinky"):
            way = positions[:, hand.tips[digit]] - positions[:, hand.joints[f"{digit}MCP"]]
            found.append(np.einsum("ti,ti->t", way, normal).mean())
    return np.array(found)
