"""Pairs with a known alignment under conditions of studios, made of real takes with two-bone IK.

The hand clip is the take with smaller arms (two-bone IK, so that its joints turn by other angles),
retimed by a smooth random warp, turned about the vertical, and noisy. Conditions add rests, pauses,
dropouts, drift and so on. Every frame of both clips has the moment of the take that it shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from builders.known_pairs import MOVING_CM_S, arms_only, shown_at, smaller, turned
from builders.two_bones import with_wrist_at, wrist_from_shoulder
from scipy.ndimage import gaussian_filter1d

from usdhand import find_hands, read_clip
from usdhand.anatomy import Hands, Side
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array

PALM_CM = 8.0


@dataclass(frozen=True)
class Condition:
    """What is done to a take.

    Attributes
    ----------
    size : of the hand clip's motion about the shoulder
    compressed : whether about its mean instead
    scaled : whether the whole arm is as small, so that joints turn as those of the body
    noise_cm : RMS of the hand clip's noise in each coordinate
    slow_noise : whether it has frequencies of up to some 4 Hz only
    body_noise_cm : white noise of the body
    drift_cm : RMS of a slow drift of the hand clip
    warp_hz : the fastest change of the hand clip's speed, which is 0.5 to 2 of the body's
    gaps : frozen frames of the hand clip, .1 to .4 s each
    spikes : frames of the hand clip at which a wrist jumps away
    pause : seconds for which the body, and the hand clip, pause at a slow moment
    mid_stroke : whether they pause in the fastest one instead
    rest : seconds of rest at both ends of the body, and of the hand clip
    repeats : how often the gesture is made
    apart : seconds by which the left hand of the hand clip lags behind the right one
    part : "elbow" if the hand clip has forearms only
    sides : hands that the hand clip has
    """

    name: str
    size: float = 0.5
    compressed: bool = False
    scaled: bool = False
    noise_cm: float = 0.3
    slow_noise: bool = False
    body_noise_cm: float = 0.0
    drift_cm: float = 0.0
    warp_hz: float = 0.5
    fps: float = 60.0
    gaps: int = 0
    spikes: int = 0
    pause: tuple[float, float] = (0.0, 0.0)
    mid_stroke: bool = False
    rest: tuple[float, float] = (0.0, 0.0)
    repeats: int = 1
    apart: float = 0.0
    part: str | None = None
    sides: tuple[Side, ...] = ("left", "right")


_HALF_ARMS = (
    Condition("half arms"),
    Condition("half arms, slow drift of 3 cm", drift_cm=3.0),
    Condition("half arms, three frozen gaps", gaps=3, noise_cm=0.1),
    Condition("half arms, pause only in the body", pause=(0.8, 0.0)),
    Condition("half arms, rest at the body's ends", rest=(1.5, 0.0)),
    Condition("half arms, rest at the hand clip's ends", rest=(0.0, 1.0)),
    Condition("half arms, slow noise of 5 mm", noise_cm=0.5, slow_noise=True),
)
CONDITIONS = (
    *(replace(c, scaled=True) for c in _HALF_ARMS),
    Condition("IK, half about the shoulder"),
    Condition("slow drift of 3 cm", drift_cm=3.0),
    Condition("IK, half about its mean", compressed=True),
    Condition("three frozen gaps", gaps=3, noise_cm=0.1),
    Condition("pause only in the body", pause=(0.8, 0.0)),
    Condition("pause only in the hand clip", pause=(0.0, 0.8)),
    Condition("pause mid-stroke in the body", pause=(0.5, 0.0), mid_stroke=True),
    Condition("rest at the body's ends", rest=(1.5, 0.0)),
    Condition("rest at the hand clip's ends", rest=(0.0, 1.0)),
    Condition("slow noise of 5 mm", noise_cm=0.5, slow_noise=True),
    Condition("both clips noisy, 3 mm", body_noise_cm=0.3),
    Condition("spikes", spikes=4, noise_cm=0.1),
    Condition("warp of 0.2 Hz", warp_hz=0.2),
    Condition("warp of 1 Hz", warp_hz=1.0),
    Condition("warp of 2 Hz", warp_hz=2.0),
    Condition("hand clip at 24 fps", fps=24.0),
    Condition("hand clip at 30 fps", fps=30.0),
    Condition("hand clip at 120 fps", fps=120.0),
    Condition("a gesture three times", repeats=3),
    Condition("forearms only", part="elbow"),
    Condition("one hand", sides=("right",)),
    Condition("hands 30 ms out of step", apart=0.03),
    Condition("hands 80 ms out of step", apart=0.08),
)


@dataclass(frozen=True, eq=False)
class ConditionPair:
    """A body, a hand clip, and per side the moment of the take (s) that every frame shows."""

    name: str
    body: Clip
    hands: Clip
    body_hands: Hands
    hand_hands: Hands
    body_source: Array
    hand_source: dict[Side, Array]
    moving: dict[Side, Array]

    def error(self, side: Side, warp: Array) -> Array:
        """(body frames,) seconds of the take by which a warp is off."""
        times = np.arange(len(self.hands)) / self.hands.fps
        return np.asarray(np.interp(warp, times, self.hand_source[side]) - self.body_source)

    def true_warp(self, side: Side) -> Array:
        """(body frames,) seconds of the hand clip, those of its last frame in a pause of it."""
        source, times = self.hand_source[side], np.arange(len(self.hands)) / self.hands.fps
        return np.interp(self.body_source, source + 1e-9 * np.arange(len(source)), times)


def condition_pair(condition: Condition, file: Path, seed: int) -> ConditionPair:
    """One pair; the seed decides the warp, turn, noise, and where things happen."""
    random = np.random.default_rng(seed)
    take = read_clip(file)
    hands = find_hands(take)
    if condition.repeats > 1:
        take = repeated(take, condition.repeats)
    length = take.duration
    speeds = {s: _speed(take, hands, s) for s in hands.frames}
    at = _pause_moment(sum(speeds.values()), take.fps, condition.mid_stroke)
    body_source = with_waits(
        np.arange(len(take)) / take.fps, take.fps, condition.rest[0], at, condition.pause[0]
    )
    warped = hand_times(random, length, condition.fps, condition.warp_hz)
    hand_source = with_waits(warped, condition.fps, condition.rest[1], at, condition.pause[1])
    body = shown_at(take, body_source, take.fps)
    if condition.body_noise_cm:
        body = _disturbed(body, hands, random, condition.body_noise_cm)
    source: dict[Side, Array] = dict.fromkeys(hands.frames, hand_source)
    other = shown_at(take, hand_source, condition.fps)
    if condition.apart:
        source["left"] = np.clip(
            np.interp(
                np.arange(len(hand_source)) / condition.fps - condition.apart,
                np.arange(len(hand_source)) / condition.fps,
                hand_source,
            ),
            0.0,
            length,
        )
        other = _with_arm_of(other, shown_at(take, source["left"], condition.fps), hands, "left")
    other = _performed(other, hands, condition, random)
    if condition.gaps:
        other = _frozen(other, hands, condition.gaps, random)
    if condition.part:
        roots = [getattr(hands.character.hands[s], condition.part) for s in condition.sides]
        other = arms_only(other, roots)
    other = replace(turned(other, random), name=f"{take.name}_hands")
    rate = np.gradient(body_source) * take.fps
    moving = {
        s: (np.interp(body_source, np.arange(len(take)) / take.fps, v) > MOVING_CM_S) & (rate > 0.5)
        for s, v in speeds.items()
        if s in condition.sides
    }
    return ConditionPair(
        take.name,
        body,
        other,
        hands,
        find_hands(other, sides=condition.sides),
        body_source,
        {s: source[s] for s in condition.sides},
        moving,
    )


def hand_times(random: np.random.Generator, length: float, fps: float, fastest: float) -> Array:
    """(frames,) seconds of the take that a hand clip shows, its speed from 0.5 to 2."""
    seconds = np.arange(int(4 * length * fps)) / fps
    waves = sum(
        np.sin(2 * np.pi * (seconds * random.uniform(0.3, 1.0) * fastest + random.uniform()))
        for _ in range(3)
    )
    speed = 2.0 ** np.clip(np.asarray(waves) / 1.5, -1.0, 1.0)
    shows = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / (2 * fps))])
    return np.asarray(shows[shows <= length])


def with_waits(source: Array, fps: float, rest: float, at: float, pause: float) -> Array:
    """Moments that are shown, with a rest at both ends and a pause where ``at`` is shown."""
    k = int(np.searchsorted(source, at))
    ends, held = round(rest * fps), round(pause * fps)
    return np.concatenate(
        [
            np.full(ends, source[0]),
            source[:k],
            np.full(held, source[min(k, len(source) - 1)]),
            source[k:],
            np.full(ends, source[-1]),
        ]
    )


def repeated(clip: Clip, times: int) -> Clip:
    """The clip several times over, with half a second from its end to its beginning."""
    between = round(0.5 * clip.fps)
    share = (1 - np.cos(np.linspace(0, np.pi, between + 2)[1:-1])) / 2
    # Frames beyond the last one are between it and the first.
    ends = replace(
        clip,
        rotations=clip.rotations[[-1, 0]],
        translations=clip.translations[[-1, 0]],
        scales=clip.scales[[-1, 0]],
    )
    q = interpolate_rotations(rot.make_continuous(ends.rotations), share)
    t, s = interpolate(ends.translations, share), interpolate(ends.scales, share)
    parts_q = [clip.rotations, *[q, clip.rotations] * (times - 1)]
    return replace(
        clip,
        rotations=rot.make_continuous(np.concatenate(parts_q)),
        translations=np.concatenate([clip.translations, *[t, clip.translations] * (times - 1)]),
        scales=np.concatenate([clip.scales, *[s, clip.scales] * (times - 1)]),
    )


def _speed(clip: Clip, hands: Hands, side: Side) -> Array:
    wrist = wrist_from_shoulder(clip, hands, side)
    velocity = gaussian_filter1d(wrist, 0.03 * clip.fps, axis=0, order=1) * clip.fps
    return np.asarray(np.linalg.norm(velocity, axis=-1))


def _pause_moment(speed: Array, fps: float, fast: bool) -> float:
    """The slowest (or fastest) moment of the middle part that moves."""
    moving = np.flatnonzero(speed > MOVING_CM_S)
    first, last = moving[0], moving[-1]
    inner = speed[first : last + 1]
    third = len(inner) // 4
    part = inner[third : len(inner) - third]
    k = np.argmax(part) if fast else np.argmin(part)
    return float((first + third + int(k)) / fps)


def _noise(
    random: np.random.Generator, frames: int, fps: float, rms: float, slow: bool, width: int = 3
) -> Array:
    white = random.normal(size=(frames, width))
    if not slow:
        return np.asarray(rms * white)
    smooth = gaussian_filter1d(white, 0.05 * fps, axis=0)
    return np.asarray(rms * smooth / np.sqrt(np.mean(smooth**2)))


def _performed(clip: Clip, hands: Hands, condition: Condition, random: np.random.Generator) -> Clip:
    """The clip as another performance of its arms: size, noise, drift and spikes."""
    n, fps = len(clip), clip.fps
    size, share = (1.0, 0.5) if condition.scaled else (condition.size, 1.0)
    for side in hands.frames:
        wrist = wrist_from_shoulder(clip, hands, side)
        centre = wrist.mean(axis=0) if condition.compressed else np.zeros(3)
        wrist = centre + size * (wrist - centre)
        wrist = wrist + _noise(random, n, fps, condition.noise_cm, condition.slow_noise) / share
        if condition.drift_cm:
            drift = gaussian_filter1d(random.normal(size=(n, 3)), 0.7 * fps, axis=0)
            wrist = wrist + condition.drift_cm / share * drift / np.sqrt(np.mean(drift**2))
        for _ in range(condition.spikes):
            wrist[random.integers(1, n - 1)] += random.normal(scale=5.0, size=3)
        turn = condition.noise_cm / PALM_CM
        wobble = _noise(random, n, fps, turn, condition.slow_noise)
        clip = with_wrist_at(clip, hands, side, wrist, wobble)
    return smaller(clip, hands) if condition.scaled else clip


def _disturbed(clip: Clip, hands: Hands, random: np.random.Generator, rms: float) -> Clip:
    for side in hands.frames:
        wrist = wrist_from_shoulder(clip, hands, side) + _noise(
            random, len(clip), clip.fps, rms, False
        )
        wobble = _noise(random, len(clip), clip.fps, rms / PALM_CM, False)
        clip = with_wrist_at(clip, hands, side, wrist, wobble)
    return clip


def _below(clip: Clip, joint: int) -> list[int]:
    return [j for j in range(len(clip.skeleton)) if joint in (j, *clip.skeleton.ancestors(j))]


def _with_arm_of(clip: Clip, other: Clip, hands: Hands, side: Side) -> Clip:
    shoulder = hands.character.hands[side].shoulder
    assert shoulder is not None
    q = clip.rotations.copy()
    arm = _below(clip, shoulder)
    q[:, arm] = other.rotations[:, arm]
    return replace(clip, rotations=rot.make_continuous(q))


def _frozen(clip: Clip, hands: Hands, gaps: int, random: np.random.Generator) -> Clip:
    """Arms and fingers of both sides keep a pose for a while, then are where they should be."""
    q = clip.rotations.copy()
    for side in hands.frames:
        shoulder = hands.character.hands[side].shoulder
        assert shoulder is not None
        arm = _below(clip, shoulder)
        for _ in range(gaps):
            long = round(random.uniform(0.1, 0.4) * clip.fps)
            first = int(random.integers(2, len(clip) - long - 2))
            q[first : first + long, arm] = q[first : first + 1, arm]
    return replace(clip, rotations=q)
