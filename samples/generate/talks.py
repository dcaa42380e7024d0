"""Conversations: gestures one after the other, with pauses and beats; and hands filmed alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .body import SIDES, Array, Body, Pose, axis_angle
from .curves import Track
from .gestures import GESTURES, TWO_HANDED, Performer, Variation
from .motion import Score, perform


def conversation(body: Body, seconds: float, seed: int, sway: float = 0.0) -> tuple[Score, float]:
    """Gestures in sequence, for about the given time.

    Every gesture type comes up before one comes again. Some gestures follow each other without
    a rest, some holds carry beats.

    Returns
    -------
    tuple
        The score, and its length in seconds.
    """
    rng = np.random.default_rng([seed, 31])
    performer = Performer(body, seed, "front" if seed % 2 else "sides", sway)
    performer.wait(0.5)
    deck: list[str] = []
    busy = ""
    while performer.time < seconds - 2.0:
        if not deck:
            deck = [str(g) for g in rng.permutation(GESTURES)]
        name = deck.pop()
        hands = "LR" if name in TWO_HANDED else ("L" if rng.random() < 0.2 else "R")
        if name == "small" and rng.random() < 0.3:
            hands = "R"
        v = Variation(
            pace=float(rng.uniform(0.85, 1.2)),
            height=float(rng.uniform(-0.9, 0.9)),
            distance=float(rng.uniform(-0.9, 0.9)),
            amplitude=float(rng.uniform(0.7, 1.25)),
            hands=hands,
            hold=float(rng.uniform(0.2, 0.6)),
            rest=performer.rest,
            seed=int(rng.integers(1 << 30)),
        )
        dropped = "".join(s for s in busy if s not in hands)
        if dropped:  # a hand that is not needed goes down while the other one speaks
            performer.retract(dropped, 0.9)
        performer.gesture(name, v)
        busy = hands
        if rng.random() < 0.45:
            performer.beats(hands, int(rng.integers(2, 4)), float(rng.uniform(0.025, 0.045)))
        if rng.random() < 0.6:
            performer.retract(hands, v.pace, str(rng.choice(["sides", "front", "front"])))
            performer.wait(float(rng.uniform(0.2, 1.0)))
            busy = ""
    if busy:
        performer.retract(busy, 1.0)
    performer.wait(0.4)
    return performer.score, performer.time


@dataclass(frozen=True)
class Excerpt:
    """Part of a conversation, as hands filmed in another session.

    Attributes
    ----------
    name
        Of the file.
    start, end
        Seconds in the conversation.
    stretch
        Length relative to the conversation's.
    wobble
        Largest shift in time on the way, s.
    amplitude
        Size of the wrists' motion relative to the conversation's.
    sides
        `LR` or `R`.
    """

    name: str
    start: float
    end: float
    stretch: float
    wobble: float
    amplitude: float
    sides: str = "LR"

    def times(self, rate: float) -> Array:
        """The conversation's time at each frame: increasing and smooth."""
        length = (self.end - self.start) * self.stretch
        s = np.arange(int(length * rate)) / (length * rate)
        bend = np.sin(2 * np.pi * s) + 0.5 * np.sin(4 * np.pi * s + 0.7) - 0.5 * np.sin(0.7)
        return np.asarray(self.start + (self.end - self.start) * s + self.wobble / 1.5 * bend)


def smaller(score: Score, amplitude: float, seed: int) -> Score:
    """The same score with smaller arm motions about a comfortable place, by other muscles.

    Parameters
    ----------
    score
        What to perform.
    amplitude
        1 leaves the size as it is.
    seed
        For all small irregularities.
    """
    home = np.array([0.05, -0.55, 0.45])

    def shrink(value: Array) -> Array:
        out = value.copy()
        out[:3] = home + amplitude * (value[:3] - home)
        return out

    arms = {}
    for s in SIDES:
        old = score.arms[s]
        moves = [
            replace(m, target=shrink(m.target), arc=None if m.arc is None else amplitude * m.arc)
            for m in old.moves
        ]
        arms[s] = Track(shrink(old.first), moves)
    return replace(score, arms=arms, seed=seed)


def turned(pose: Pose, degrees: float) -> Pose:
    """A pose turned about the vertical through the hips' first position."""
    turn = axis_angle(np.array([0.0, 1.0, 0.0]), degrees)
    pivot = pose.hips[0]
    hips = pivot + (pose.hips - pivot) @ turn.T
    return Pose({j: turn @ r for j, r in pose.turn.items()}, hips)


def hands_take(body: Body, score: Score, excerpt: Excerpt, seed: int, rate: float) -> Pose:
    """The pose behind a clip of hands alone: smaller, in other time, turned by 40 degrees."""
    take = smaller(score, excerpt.amplitude, seed)
    return turned(perform(body, take, excerpt.times(rate)), 40.0)
