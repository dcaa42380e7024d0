"""Pairs of a body and a hand clip whose true alignment is known, made of real takes.

The hand clip is the same take on another rig where there is one, retimed by a smooth random warp
(local speed 0.5 to 2), half as large about the shoulder, turned about the vertical, with noise of
3 mm in every coordinate of elbow and wrist and as much as that turns a palm, at another frame rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from builders.clips import frames_of

from usdhand import find_hands, read_clip
from usdhand.anatomy import Channels, Hands, Side
from usdhand.evaluate.compare import find_lag
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array

NOISE_CM = 0.3
PALM_CM = 8.0
FRAME_RATES = (50.0, 72.0, 100.0, 120.0)
MOVING_CM_S = 15.0


@dataclass(frozen=True, eq=False)
class Pair:
    name: str
    body: Clip
    hands: Clip
    body_hands: Hands
    hand_hands: Hands
    source: Clip  # the hand clip before it was changed, in the body's time
    truth: Array  # (body frames,) seconds of the hand clip from its first frame

    def error(self, warp: Array) -> Array:
        """(body frames,) seconds of the body's time by which a warp is off."""
        body_seconds = np.arange(len(self.body)) / self.body.fps
        shown = np.interp(warp, self.truth, body_seconds)
        return np.asarray(shown - body_seconds)

    def source_channels(self) -> Channels:
        """True fingers of the body: those of the hand clip before it was changed."""
        return find_hands(self.source).encode(self.source)

    def moving(self, side: Side) -> Array:
        """Frames at which the wrist moves, relative to the shoulder, faster than 15 cm/s."""
        from scipy.ndimage import gaussian_filter1d

        hand = self.body_hands.character.hands[side]
        assert hand.shoulder is not None
        pose = forward_kinematics(self.body, [hand.wrist, hand.shoulder]).positions
        velocity = gaussian_filter1d(pose[:, 0] - pose[:, 1], 0.03 * self.body.fps, axis=0, order=1)
        speed = np.linalg.norm(velocity, axis=-1) * self.body.fps
        return np.asarray(speed > MOVING_CM_S)


def known_pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Body and hand files: the other rig's take where there is one, else the same."""
    mini = folder.parent / "mini"
    bodies = sorted(folder.glob("*.usdc"))
    return [(b, mini / b.name if (mini / b.name).exists() else b) for b in bodies]


def known_pair(body_file: Path, hand_file: Path, seed: int, noise_cm: float = NOISE_CM) -> Pair:
    """Make one pair; the seed decides the warp, turn, noise and frame rate."""
    body, source = read_clip(body_file), read_clip(hand_file)
    body_hands, source_hands = find_hands(body), find_hands(source)
    if hand_file != body_file:
        body, source = _trimmed(body, source, body_hands, source_hands)
    random = np.random.default_rng(seed)
    fps = float(random.choice(FRAME_RATES))
    truth = random_warp(random, len(body), body.fps)
    hands = smaller(retimed(source, truth, fps), source_hands)
    hands = noisy(turned(hands, random), source_hands, random, noise_cm)
    hands = replace(hands, name=f"{body.name}_hands")
    return Pair(body.name, body, hands, body_hands, find_hands(hands), source, truth)


def random_warp(random: np.random.Generator, frames: int, fps: float) -> Array:
    """(frames,) seconds, with a local speed that wanders smoothly between 0.5 and 2."""
    seconds = np.arange(frames) / fps
    waves = np.zeros(frames)
    for _ in range(3):
        waves += np.sin(2 * np.pi * (seconds * random.uniform(0.2, 0.8) + random.uniform()))
    speed = 2.0 ** np.clip(waves / 1.5, -1.0, 1.0)
    steps = np.concatenate([[0.0], (speed[1:] + speed[:-1]) / (2 * fps)])
    return np.asarray(np.cumsum(steps))


def retimed(clip: Clip, truth: Array, fps: float) -> Clip:
    """The clip such that its frame t is shown at second truth[t], sampled at another rate."""
    count = int(np.floor(truth[-1] * fps + 1e-6)) + 1
    at = np.interp(np.arange(count) / fps, truth, np.arange(len(truth)))
    return _at_frames(clip, at, fps)


def shown_at(clip: Clip, source: Array, fps: float) -> Clip:
    """The clip's moments (frames,) in seconds, one a frame of another rate."""
    return _at_frames(clip, source * clip.fps, fps)


def _at_frames(clip: Clip, at: Array, fps: float) -> Clip:
    """The clip at these of its frames, whole or not, one a frame of another rate."""
    origin = replace(clip.origin, time_codes_per_frame=clip.origin.time_codes_per_second / fps)
    return replace(
        clip,
        rotations=interpolate_rotations(clip.rotations, at),
        translations=interpolate(clip.translations, at),
        scales=interpolate(clip.scales, at),
        fps=fps,
        origin=origin,
    )


def smaller(clip: Clip, hands: Hands) -> Clip:
    """Half the size from the shoulders on."""
    scales = clip.scales.copy()
    for hand in hands.character.hands.values():
        scales[:, hand.shoulder] *= 0.5
    return replace(clip, scales=scales)


def turned(clip: Clip, random: np.random.Generator) -> Clip:
    angle = np.radians(random.uniform(20.0, 90.0)) * random.choice([-1.0, 1.0])
    turn = rot.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
    roots = np.flatnonzero(clip.skeleton.parents < 0)
    q, t = clip.rotations.copy(), clip.translations.copy()
    q[:, roots] = rot.multiply(turn, q[:, roots])
    t[:, roots] = rot.rotate(turn, t[:, roots])
    return replace(clip, rotations=q, translations=t)


def noisy(clip: Clip, hands: Hands, random: np.random.Generator, noise_cm: float) -> Clip:
    """White noise in each coordinate of elbows and wrists, and as much of it on the palms."""
    q, t = clip.rotations.copy(), clip.translations.copy()
    for hand in hands.character.hands.values():
        assert hand.elbow is not None
        world = forward_kinematics(clip).rotations
        noise = random.normal(scale=noise_cm, size=(2, len(clip), 3))
        for joint, moved in ((hand.elbow, noise[0]), (hand.wrist, noise[1] - noise[0])):
            parent = world[:, int(clip.skeleton.parents[joint])]
            t[:, joint] += rot.rotate(rot.conjugate(parent), moved) / 0.5
        wobble = random.normal(scale=noise_cm / PALM_CM, size=(len(clip), 3))
        half = np.concatenate([wobble / 2, np.ones((len(clip), 1))], axis=-1)
        q[:, hand.wrist] = rot.normalize(rot.multiply(q[:, hand.wrist], half))
    return replace(clip, rotations=q, translations=t)


def with_other_axes(clip: Clip, seed: int) -> Clip:
    """The same motion on a rig of which every joint has other axes, at bind and rest too."""
    skeleton = clip.skeleton
    turn = rot.normalize(np.random.default_rng(seed).normal(size=(len(skeleton), 4)))
    above = np.where((skeleton.parents >= 0)[:, None], turn[skeleton.parents], rot.IDENTITY)
    after, before = (np.tile(np.eye(4), (len(skeleton), 1, 1)) for _ in range(2))
    after[:, :3, :3] = rot.to_matrix(turn)
    before[:, :3, :3] = rot.to_matrix(rot.conjugate(above))
    rotations = rot.multiply(rot.multiply(rot.conjugate(above), clip.rotations), turn)
    return replace(
        clip,
        skeleton=replace(skeleton, bind=skeleton.bind @ after, rest=before @ skeleton.rest @ after),
        rotations=rot.make_continuous(rotations),
        translations=rot.rotate(rot.conjugate(above), clip.translations),
    )


def arms_only(clip: Clip, joints: Sequence[int]) -> Clip:
    """The clip with these joints and all below them; they move through the room."""
    skeleton = clip.skeleton
    keep = [j for j in range(len(skeleton)) if {j, *skeleton.ancestors(j)}.intersection(joints)]
    index = {j: k for k, j in enumerate(keep)}
    parents = np.array([index.get(int(skeleton.parents[j]), -1) for j in keep])
    paths: list[str] = []
    for j, parent in zip(keep, parents, strict=True):
        name = skeleton.names[j]
        paths.append(name if parent < 0 else f"{paths[parent]}/{name}")
    q, t, s = (v[:, keep].copy() for v in (clip.rotations, clip.translations, clip.scales))
    rest = skeleton.rest[keep].copy()
    pose = forward_kinematics(clip, dict.fromkeys(joints))
    for joint in joints:
        k = index[joint]
        q[:, k] = rot.make_continuous(pose.rotation(joint))
        t[:, k], rest[k] = pose.position(joint), skeleton.bind[joint]
        s[:, k] *= clip.scales[:, skeleton.ancestors(joint)].prod(axis=1)
    rig = Skeleton(tuple(paths), parents, skeleton.bind[keep], rest)
    return replace(clip, skeleton=rig, rotations=q, translations=t, scales=s)


def _trimmed(a: Clip, b: Clip, hands_a: Hands, hands_b: Hands) -> tuple[Clip, Clip]:
    """Both clips over the frames that show the same, by the lag of their fingers."""
    first, second = natural_offset(a, b, hands_a, hands_b)
    count = min(len(a) - first, len(b) - second)
    return _cut(a, first, count), _cut(b, second, count)


def natural_offset(a: Clip, b: Clip, hands_a: Hands, hands_b: Hands) -> tuple[int, int]:
    """First frames of two recordings of one take that show the same."""
    one, other = hands_a.encode(a), hands_b.encode(b)
    names = [n for n in one.names if n in other.names and "Thumb" not in n]
    lag = find_lag(one.select(names).values, other.select(names).values, a.fps) or 0.0
    shift = round(lag * a.fps)
    return max(0, -shift), max(0, shift)


def _cut(clip: Clip, first: int, count: int) -> Clip:
    o = clip.origin
    start = replace(o, first_time_code=o.first_time_code + first * o.time_codes_per_frame)
    return replace(frames_of(clip, slice(first, first + count)), origin=start)
