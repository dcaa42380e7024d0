"""The eight gesture types, as scores.

The types, and what varies between two performances of a type, follow the database of Joerg,
Hodgins and Safonova (2012): pace, height, distance from the body, amplitude, hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .body import SIDES, Array, Body, Vector
from .curves import Track
from .hand import INDEX, SHAPES
from .motion import TRUNK, Score, arm_target

GESTURES = (
    "attention", "big", "doubt_shrug", "ok", "palm_presentation", "small", "turn", "wipe",
)  # fmt: skip
# How differently wrists turn in the same gesture, radians: enough that no single feature tells all.
WRIST_WOBBLE = 0.15
TWO_HANDED = ("big", "doubt_shrug", "small")


@dataclass(frozen=True)
class Variation:
    """What varies between two performances of a gesture.

    Attributes
    ----------
    pace
        Duration of all phases; 1 is a usual tempo, less is faster.
    height, distance
        Where the stroke ends, from -1 (low, close) to 1 (high, far).
    amplitude
        Size of the stroke; 1 is usual.
    hands
        `L`, `R` or `LR`.
    hold
        Length of the hold after the stroke, s, at a usual pace.
    rest
        `sides` or `front`: where the arms rest.
    seed
        For all small irregularities.
    """

    pace: float = 1.0
    height: float = 0.0
    distance: float = 0.0
    amplitude: float = 1.0
    hands: str = "R"
    hold: float = 0.6
    rest: str = "sides"
    seed: int = 0


@dataclass(frozen=True)
class Stage:
    """One phase: new targets for arms, handshapes and trunk, reached in a given time.

    `settle` is the time before the next phase starts.
    """

    name: str
    duration: float
    settle: float
    arms: Mapping[str, Array]
    shapes: Mapping[str, Array]
    trunk: Mapping[str, float] = field(default_factory=dict)
    arc: Vector = (0.0, 0.0, 0.0)


def rest_arm(body: Body, where: str, rng: np.random.Generator) -> Array:
    """Arm values at rest."""
    jitter = rng.normal(0, 0.008, 3)
    if where == "sides":
        wrist = np.array([0.155, -0.95, 0.09]) + jitter
        return arm_target(body, wrist, (0.02, -1.0, 0.16), (-1.0, 0.0, -0.25))
    wrist = np.array([-0.045, -0.74, 0.40]) + jitter
    return arm_target(body, wrist, (-0.75, -0.42, 0.55), (-0.35, -0.55, -0.75), 8.0)


def rest_shape(where: str) -> Array:
    """Handshape at rest."""
    return SHAPES["relaxed" if where == "sides" else "resting"]


def irregular(shape: Array, rng: np.random.Generator, size: float = 1.0) -> Array:
    """A handshape as it comes out this time: the whole hand and each digit differ a little."""
    out = shape.copy()
    curl, spread = rng.normal(0, 2.5), rng.normal(0, 1.2)
    for name, i in INDEX.items():
        digit, joint = name.split("_")
        if digit == "thumb":
            out[i] += size * rng.normal(0, 1.5)
        elif joint in ("mcp", "pip"):
            out[i] += size * (curl * (1.0 if digit != "index" else 0.6) + rng.normal(0, 2.0))
        elif joint == "spread":
            out[i] += size * (spread * (digit != "middle") + rng.normal(0, 0.6))
    for finger in ("index", "middle", "ring", "pinky"):
        change = out[INDEX[f"{finger}_pip"]] - shape[INDEX[f"{finger}_pip"]]
        out[INDEX[f"{finger}_dip"]] += 0.66 * change
    return out


def _mix(a: Array, b: Array, share: float) -> Array:
    return np.asarray(a + share * (b - a))


def stages(body: Body, gesture: str, v: Variation) -> list[Stage]:
    """Preparation, stroke and hold of a gesture; the retraction is the performer's.

    Parameters
    ----------
    body
        Who performs: targets are in arm lengths, but wrists turn only so far.
    gesture
        One of `GESTURES`.
    v
        How it is performed.
    """
    rng = np.random.default_rng([v.seed, GESTURES.index(gesture), 11])
    h, d, a = v.height, v.distance, v.amplitude

    def aim(out: float, up: float, ahead: float, u: Vector, n: Vector,
            swivel: float = 0.0) -> Array:  # fmt: skip
        wrist = np.array([out, up, ahead]) + rng.normal(0, 0.01, 3)
        wobble = rng.normal(0, WRIST_WOBBLE, (2, 3))
        return arm_target(body, wrist, np.array(u) + wobble[0], np.array(n) + wobble[1], swivel)

    def both(value: Array, shift: float = 0.012) -> dict[str, Array]:
        """The same for all hands taking part, never exactly."""
        out = {}
        for side in v.hands:
            out[side] = value.copy()
            out[side][:3] += rng.normal(0, shift, 3)
            out[side][3:6] += rng.normal(0, 2.0, 3)
        return out

    def form(name: str, share: float = 1.0, size: float = 1.0) -> dict[str, Array]:
        loose = SHAPES["relaxed"]
        return {s: irregular(_mix(loose, SHAPES[name], share), rng, size) for s in v.hands}

    turned = {"R": -1.0, "L": 1.0}.get(v.hands, 0.0)
    if gesture == "attention":
        up, ahead = -0.22 + 0.17 * h, 0.56 + 0.10 * d
        u, n = (0.05, 1.0, 0.12), (-0.45, 0.0, 0.9)
        return [
            Stage("preparation", 0.50, 0.0, both(aim(0.12, up - 0.10 * a, ahead - 0.04, u, n)),
                  form("attention", 0.7), {"nod": -2}, (0.05, 0, 0.03)),
            Stage("stroke", 0.28, v.hold, both(aim(0.10, up, ahead + 0.05 * a, u, n)),
                  form("attention"), {"nod": 4 * a, "turn": 2 * turned}),
        ]  # fmt: skip
    if gesture == "big":
        up, ahead = -0.34 + 0.24 * h, 0.56 + 0.09 * d
        u, n = (0.02, 0.22, 1.0), (-1.0, 0.0, 0.05)
        wide = 0.12 + 0.22 * a
        return [
            Stage("preparation", 0.50, 0.0, both(aim(-0.10, up - 0.03, ahead, (-0.12, 0.3, 1), n)),
                  form("big", 0.45), {}, (0.03, 0, 0.02)),
            Stage("stroke", 0.40, v.hold, both(aim(wide, up, ahead, u, n)), form("big"),
                  {"lean": -1.5 * a, "shrug": 2, "nod": -2}, (0, 0.03, 0.04)),
        ]  # fmt: skip
    if gesture == "doubt_shrug":
        up, ahead = -0.50 + 0.12 * h, 0.46 + 0.10 * d
        u, n = (0.60, 0.10, 0.85), (-0.12, 1.0, 0.1)
        return [
            Stage("preparation", 0.42, 0.0, both(aim(0.16, up - 0.04, ahead, (0.3, 0.1, 1), n)),
                  form("doubt_shrug", 0.5), {"nod": 3}, (-0.03, 0, 0.03)),
            Stage("stroke", 0.34, v.hold, both(aim(0.22 + 0.2 * a, up + 0.02, ahead, u, n)),
                  form("doubt_shrug"),
                  {"shrug": 7 + 5 * a, "tilt": rng.choice([-7, 7]), "nod": -3}, (0, -0.03, 0)),
        ]  # fmt: skip
    if gesture == "ok":
        up, ahead = -0.24 + 0.18 * h, 0.58 + 0.10 * d
        u, n = (0.10, 0.95, 0.35), (-0.35, -0.25, 0.9)
        return [
            Stage("preparation", 0.52, 0.0, both(aim(0.08, up - 0.06 * a, ahead - 0.05, u, n)),
                  form("ok", 0.75, 0.4), {}, (0.05, 0, 0.02)),
            Stage("stroke", 0.26, v.hold, both(aim(0.06, up, ahead + 0.05 * a, u, n)),
                  form("ok", 1.0, 0.25), {"nod": 5 * a, "turn": 2 * turned}),
        ]  # fmt: skip
    if gesture == "palm_presentation":
        up, ahead = -0.50 + 0.15 * h, 0.56 + 0.10 * d
        u, n = (0.20, 0.12, 1.0), (-0.30, 1.0, 0.0)
        return [
            Stage("preparation", 0.46, 0.0, both(aim(0.0, up + 0.03, ahead - 0.14 * a,
                  (-0.1, 0.2, 1), (-0.8, 0.6, 0))), form("palm_presentation", 0.5), {},
                  (0.0, 0, 0.02)),
            Stage("stroke", 0.34, v.hold, both(aim(0.12 + 0.06 * a, up, ahead + 0.06 * a, u, n)),
                  form("palm_presentation"), {"lean": 2 * a, "turn": 3 * turned, "nod": 2},
                  (0, -0.03, 0)),
        ]  # fmt: skip
    if gesture == "small":
        up, ahead = -0.42 + 0.20 * h, 0.56 + 0.10 * d
        if len(v.hands) == 1:
            u, n = (-0.25, 0.45, 0.9), (-0.9, -0.1, 0.35)
            return [
                Stage("preparation", 0.50, 0.0, both(aim(0.06, up - 0.05 * a, ahead - 0.05, u, n)),
                      form("small_pinch", 0.55), {}, (0.04, 0, 0.02)),
                Stage("stroke", 0.26, v.hold, both(aim(0.02, up + 0.05, ahead, u, n)),
                      form("small_pinch", 1.0, 0.5), {"lean": 2, "nod": 5}),
            ]  # fmt: skip
        # The gap between the hands does not depend on how broad the shoulders are.
        arm = body.length("L_forearm") + body.length("L_hand")
        inward = body.zero["L_arm"][0] / arm
        u, n = (-0.30, 0.22, 1.0), (-1.0, -0.05, -0.25)
        return [
            Stage("preparation", 0.48, 0.0, both(aim(0.22 + 0.12 * a - inward, up - 0.03,
                  ahead - 0.03, u, n)), form("small", 0.5), {}, (0.03, 0, 0.02)),
            Stage("stroke", 0.30, v.hold, both(aim(0.20 + 0.03 * a - inward, up, ahead, u, n),
                  0.006), form("small"), {"lean": 2.5, "nod": 5}),
        ]  # fmt: skip
    if gesture == "turn":
        up, ahead = -0.36 + 0.18 * h, 0.54 + 0.09 * d
        base = aim(0.10, up, ahead, (0.02, 0.35, 1.0), (-1.0, 0.0, 0.0))
        plan = [("preparation", 0.48, 0.0, 15), ("stroke", 0.36, 0.05, 62), ("stroke", 0.36, 0.05,
                -48), ("stroke", 0.34, v.hold, 40)]  # fmt: skip
        out = []
        for number, (name, duration, settle, angle) in enumerate(plan):
            target = base.copy()
            target[3] = np.clip(target[3] + angle * (0.6 + 0.4 * a), -78, 78)
            target[0] += 0.0005 * angle
            shapes = form("turn", 1.0 if number else 0.6)
            for s in shapes:  # fingers open as the palm turns up
                shapes[s][5:] -= 0.10 * angle * np.tile([1, 0, 0, 0.8, 0.5], 4)
            out.append(Stage(name, duration, settle, both(target, 0.004), shapes,
                             {"tilt": 2 * turned * (number % 2)}))  # fmt: skip
        return out
    if gesture == "wipe":
        up, ahead = -0.48 + 0.16 * h, 0.56 + 0.08 * d
        n, wide = (0.0, -1.0, 0.08), 0.20 + 0.20 * a
        return [
            Stage("preparation", 0.52, 0.0, both(aim(-0.26, up + 0.04, ahead, (-0.25, 0.1, 1), n,
                  -12)), form("wipe", 0.8), {"turn": -2 * turned}, (0.0, 0.03, 0.02)),
            Stage("stroke", 0.42, v.hold, both(aim(wide, up, ahead - 0.02, (0.5, 0.1, 1), n)),
                  form("wipe"), {"turn": 5 * turned * a, "look": -2 * turned}, (0, 0, 0.07)),
        ]  # fmt: skip
    raise ValueError(f"unknown gesture {gesture!r}")


class Performer:
    """Writes gestures, beats and rests into a score, one after the other."""

    def __init__(self, body: Body, seed: int, rest: str = "sides", sway: float = 0.0) -> None:
        self.body, self.rest = body, rest
        self.rng = np.random.default_rng([seed, 21])
        arms = {s: Track(rest_arm(body, rest, self.rng)) for s in SIDES}
        fingers = {s: Track(irregular(rest_shape(rest), self.rng)) for s in SIDES}
        self.score = Score(arms, fingers, Track(np.zeros(len(TRUNK))), seed, sway)
        self.time = 0.0

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.time += seconds

    def move(self, stage: Stage, pace: float = 1.0) -> None:
        """Go through one phase of a gesture."""
        start, duration = self.time, stage.duration * pace
        for side, target in stage.arms.items():
            lag = 0.03 * self.rng.random()
            distance = np.linalg.norm(target[:3] - self.score.arms[side].last[:3])
            arc = np.zeros(7)
            arc[:3] = np.array(stage.arc) * min(1.0, float(distance) * 2)
            self.score.arms[side].to(start + lag, start + duration + lag, target, arc)
        for side, target in stage.shapes.items():
            # Hands take their shape on the way, and are ready a little before the arm.
            begin = start + self.rng.uniform(0.0, 0.12) * duration
            self.score.fingers[side].to(begin, start + 0.92 * duration, target)
        idle = [s for s in SIDES if s not in stage.arms]
        for side in idle:
            near = self.score.arms[side].last.copy()
            near[:3] += self.rng.normal(0, 0.006, 3)
            near[3:6] += self.rng.normal(0, 1.5, 3)
            self.score.arms[side].to(start + 0.05, start + duration + 0.15, near)
            curl = irregular(rest_shape(self.rest), self.rng, 0.9)
            self.score.fingers[side].to(start + 0.05, start + duration + 0.2, curl)
        values = np.array([stage.trunk.get(name, 0.0) for name in TRUNK])
        self.score.trunk.to(start - 0.02, start + 1.15 * duration, values)
        self.time += duration + stage.settle * pace

    def beats(self, sides: str, count: int, size: float) -> None:
        """Small taps of the hand in time with speech."""
        for number in range(count):
            down = number % 2 == 0
            arms, shapes = {}, {}
            for s in sides:
                arms[s] = self.score.arms[s].last.copy()
                arms[s][1] += (-1 if down else 0.85) * size
                arms[s][4] += (1 if down else -0.85) * 80 * size
                shapes[s] = irregular(self.score.fingers[s].last, self.rng, 0.35)
            nod = {"nod": 2.0 * down}
            self.move(Stage("beat", 0.24 + 0.08 * self.rng.random(), 0.02, arms, shapes, nod))

    def retract(self, sides: str, pace: float, rest: str | None = None) -> None:
        """Bring the arms back to rest."""
        self.rest = rest or self.rest
        arms = {s: rest_arm(self.body, self.rest, self.rng) for s in sides}
        shapes = {s: irregular(rest_shape(self.rest), self.rng) for s in sides}
        self.move(Stage("retraction", 0.58, 0.0, arms, shapes, {}, (0.04, 0, 0.03)), pace)

    def gesture(self, name: str, variation: Variation) -> None:
        """Preparation, stroke and hold."""
        for stage in stages(self.body, name, variation):
            self.move(stage, variation.pace)


def single(body: Body, gesture: str, variation: Variation) -> tuple[Score, float]:
    """One gesture from rest to rest.

    Returns
    -------
    tuple
        The score, and its length in seconds.
    """
    performer = Performer(body, variation.seed, variation.rest)
    performer.wait(0.1)
    performer.gesture(gesture, variation)
    performer.retract(variation.hands, variation.pace)
    performer.wait(0.13)
    return performer.score, performer.time


def variations(gesture: str, count: int, seed: int) -> list[Variation]:
    """A spread of ways to perform a gesture: slow and fast, high and low, near and far."""
    rng = np.random.default_rng([seed, GESTURES.index(gesture)])
    usual = "LR" if gesture in TWO_HANDED else "R"
    out = []
    for i in range(count):
        v = Variation(
            pace=float((0.70, 1.03)[i % 2] * rng.uniform(0.93, 1.07)),
            height=float((-0.5, 0.5)[i // 2 % 2] + rng.uniform(-0.2, 0.2)),
            distance=float((-0.5, 0.5)[i // 4 % 2] + rng.uniform(-0.3, 0.3)),
            amplitude=float(rng.uniform(0.7, 1.3)),
            hands=usual,
            hold=float(rng.uniform(0.35, 0.65)),
            rest="front" if i in (2, 5) else "sides",
            seed=int(rng.integers(1 << 30)),
        )
        if i in (3, 6) and gesture in ("attention", "ok", "palm_presentation", "turn", "wipe"):
            v = replace(v, hands="L")
        if i in (1, 6) and gesture == "small":
            v = replace(v, hands="R")
        if i == 5 and gesture in ("palm_presentation", "turn", "wipe"):
            v = replace(v, hands="LR")
        out.append(v)
    return out
