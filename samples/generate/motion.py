"""From a score (who moves what, when) to a pose at any time.

Everything is a smooth function of time, so that a score can be sampled at any rate and under any
time warp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from .body import (
    DISTAL,
    MIRROR,
    PALMAR,
    SIDES,
    Array,
    Body,
    Pose,
    Vector,
    axis_angle,
    mirrored,
    unit,
)
from .curves import Track, Wander
from .hand import CHANNELS, INDEX, LIMITS, bend_bones

# Columns of an arm track: the wrist seen from the shoulder (outward, up, forward, in arm
# lengths), then supination, wrist flexion, radial deviation and elbow swivel in degrees.
ARM = ("out", "up", "forward", "supination", "flexion", "deviation", "swivel")
# Columns of a trunk track, degrees: shoulders up, lean forward, lean and turn left, then the
# head: nod, turn left, tilt left.
TRUNK = ("shrug", "lean", "side", "turn", "nod", "look", "tilt")
WRIST_LIMITS = np.array([[-85.0, 85.0], [-65.0, 65.0], [-32.0, 20.0]])
# Where the elbow points when nothing else is asked for: down, back and a little outward.
ELBOW_POLE = np.array([0.42, -0.6, -0.68])
FOREARM_SHARE = 0.5  # of supination goes to the forearm joint, the rest to the wrist


@dataclass
class Score:
    """All that one performer does in one clip.

    Attributes
    ----------
    arms, fingers
        Tracks by side; see `ARM` and `hand.CHANNELS`.
    trunk
        See `TRUNK`.
    seed
        For everything that is not planned.
    sway
        How far the hips shift from foot to foot, cm.
    liveliness
        Scales all noise; 0 is a statue.
    """

    arms: dict[str, Track]
    fingers: dict[str, Track]
    trunk: Track
    seed: int
    sway: float = 0.0
    liveliness: float = 1.0


def frame(long: Array, hinge: Array) -> Array:
    """Rotation from the zero pose of the left arm to a bone and its elbow hinge."""
    return np.stack([long, -hinge, np.cross(long, -hinge)], axis=-1)


def two_bones(root: Array, goal: Array, upper: float, lower: float, pole: Array) -> Array:
    """Middle joint of a two-bone chain, bent toward `pole`."""
    line = goal - root
    reach = np.linalg.norm(line, axis=-1, keepdims=True)
    axis = line / reach
    along = (upper**2 - lower**2 + reach**2) / (2 * reach)
    height = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    side = unit(pole - np.sum(pole * axis, axis=-1, keepdims=True) * axis)
    return np.asarray(root + along * axis + height * side)


def solve_arm(body: Body, shoulder: Array, chest: Array, arm: Array) -> dict[str, Array]:
    """Rotations of a left arm that puts its wrist where an arm track says.

    Parameters
    ----------
    body
        Whose arm it is.
    shoulder
        Shoulder positions, (frames, 3).
    chest
        Rotations in which the track's directions are meant, (frames, 3, 3).
    arm
        Values of the track, (frames, 7).
    """
    upper, lower = body.length("L_forearm"), body.length("L_hand")
    reach = (upper + lower) * arm[:, :3]
    far = np.linalg.norm(reach, axis=-1, keepdims=True)
    reach = reach * np.minimum(1.0, 0.992 * (upper + lower) / far)
    goal = shoulder + (chest @ reach[..., None])[..., 0]
    axis = unit(goal - shoulder)
    pole = (chest @ ELBOW_POLE[:, None])[..., 0]
    swing = Rotation.from_rotvec(np.radians(arm[:, 6:7]) * axis)
    elbow = two_bones(shoulder, goal, upper, lower, swing.apply(pole))
    long, fore = unit(elbow - shoulder), unit(goal - elbow)
    hinge = unit(np.cross(long, fore))
    forearm = frame(fore, hinge)
    share = axis_angle(DISTAL, -FOREARM_SHARE * arm[:, 3])
    rest = axis_angle(DISTAL, -(1 - FOREARM_SHARE) * arm[:, 3])
    wrist = axis_angle(np.cross(DISTAL, PALMAR), arm[:, 4]) @ axis_angle(-PALMAR, -arm[:, 5])
    return {
        "arm": frame(long, hinge),
        "forearm": forearm @ share,
        "hand": forearm @ share @ rest @ wrist,
    }


def arm_target(
    body: Body,
    wrist: Vector,
    fingers: Vector,
    palm: Vector,
    swivel: float = 0.0,
) -> Array:
    """Values of an arm track that put a left hand somewhere, pointing and facing somewhere.

    Parameters
    ----------
    body
        Whose arm it is.
    wrist
        Wrist from shoulder: outward, up, forward, in arm lengths.
    fingers, palm
        Directions the fingers point in and the palm faces, in the same axes.
    swivel
        Preferred elbow swivel, degrees; it gives way where the wrist could not turn so far.
    """
    u = unit(np.array(fingers, dtype=float))
    n = np.array(palm, dtype=float)
    n = unit(n - (n @ u) * u)
    goal = np.stack([u, -n, np.cross(u, -n)], axis=-1)
    best, best_cost = np.zeros(7), np.inf
    for extra in np.arange(-45.0, 46.0, 3.0):
        arm = np.array([*wrist, 0.0, 0.0, 0.0, swivel + extra])
        forearm = solve_arm(body, np.zeros((1, 3)), np.eye(3)[None], arm[None])["forearm"][0]
        x, z, y = Rotation.from_matrix(forearm.T @ goal).as_euler("XZY", degrees=True)
        arm[3:6] = -x, -z, -y
        inside = np.clip(arm[3:6], WRIST_LIMITS[:, 0], WRIST_LIMITS[:, 1])
        comfort = np.abs(arm[3:6]) / np.array([70.0, 45.0, 25.0])
        cost = float(np.sum((arm[3:6] - inside) ** 2) + 8 * np.sum(comfort**2) + (extra / 12) ** 2)
        if cost < best_cost:
            arm[3:6] = inside
            best, best_cost = arm, cost
    return best


def _trunk(score: Score, t: Array, arms: dict[str, Array]) -> dict[str, Array]:
    rng = np.random.default_rng([score.seed, 1])
    noise = Wander.make(rng, score.liveliness * np.array([0.3, 0.5, 0.6, 0.7, 0.8, 1.0, 0.7]), 0.5)
    shrug, lean, side, yaw, nod, look, tilt = (score.trunk.at(t) + noise.at(t)).T
    breath = np.sin(2 * np.pi * (0.27 * t + rng.uniform()))
    # The chest follows the hands a little; shoulders rise with a raised arm.
    out = {s: arms[s][:, 0] for s in SIDES}
    raised = {s: np.clip(arms[s][:, 1] + 0.95, 0, 1.2) for s in SIDES}
    ahead = {s: arms[s][:, 2] for s in SIDES}
    yaw = yaw + 5.0 * (ahead["R"] - ahead["L"]) + 3.0 * (out["L"] - out["R"])
    side = side + 2.0 * (raised["R"] - raised["L"])
    lean = lean + 1.5 * (ahead["L"] + ahead["R"]) - 1.5
    x, y, z = np.eye(3)

    def bend(forward: Array, turn: Array, left: Array) -> Array:
        return axis_angle(y, turn) @ axis_angle(x, forward) @ axis_angle(z, -left)

    # Where the legs do not move with them, the hips must not turn: the feet would slide.
    free = float(score.sway > 0)
    turn = {"hips": bend(0.1 * free * lean, 0.1 * free * yaw, -0.3 * free * side)}
    for number, gain in ((1, 0.2), (2, 0.5), (3, 0.9)):
        inhale = 0.5 * breath * (number == 3)
        turn[f"spine{number}"] = bend(gain * lean - inhale, gain * yaw, gain * side)
    # The head stays on whom one talks to.
    turn["neck"] = bend(0.4 * lean + 0.5 * nod, 0.5 * yaw + 0.5 * look, 0.5 * side + 0.5 * tilt)
    turn["head"] = bend(0.1 * lean + nod, 0.25 * yaw + look, 0.2 * side + tilt)
    for s in SIDES:
        up = 5.0 * raised[s] + shrug + 0.5 * breath
        local = axis_angle(z, up) @ axis_angle(y, -8.0 * ahead[s])
        local = local if s == "L" else mirrored(local)
        turn[f"{s}_clavicle"] = turn["spine3"] @ local
    return turn


def _legs(body: Body, turn: dict[str, Array], hips: Array) -> dict[str, Array]:
    out = {}
    for s in SIDES:
        zero = {j: body.zero[f"{s}_{j}"] for j in ("thigh", "shin", "foot", "toe")}
        top = hips + turn["hips"] @ (zero["thigh"] - body.zero["hips"])
        ankle = np.broadcast_to(zero["foot"], top.shape)
        upper = float(np.linalg.norm(zero["shin"] - zero["thigh"]))
        lower = float(np.linalg.norm(zero["foot"] - zero["shin"]))
        pole = np.broadcast_to(np.array([0.0, 0.0, 1.0]), top.shape)
        knee = two_bones(top, ankle, upper, lower, pole)
        for name, a, b, start, stop in [
            ("thigh", top, knee, "thigh", "shin"), ("shin", knee, ankle, "shin", "foot"),
        ]:  # fmt: skip
            straight = np.broadcast_to(unit(zero[stop] - zero[start]), top.shape)
            out[f"{s}_{name}"] = _least_turn(straight, unit(b - a))
        for name in ("foot", "toe"):
            out[f"{s}_{name}"] = np.broadcast_to(np.eye(3), turn["hips"].shape)
    return out


def _least_turn(a: Array, b: Array) -> Array:
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, np.sum(a * b, axis=-1, keepdims=True))
    vector = np.where(sine > 1e-12, axis * angle / np.maximum(sine, 1e-12), 0.0)
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _body(body: Body, score: Score, t: Array) -> tuple[dict[str, Array], Array]:
    arms = {}
    for i, s in enumerate(SIDES):
        rng = np.random.default_rng([score.seed, 2, i])
        size = score.liveliness * np.array([0.004, 0.004, 0.004, 1.0, 1.0, 0.6, 0.8])
        arms[s] = score.arms[s].at(t) + Wander.make(rng, size, 0.8).at(t)
    turn = _trunk(score, t, arms)
    rng = np.random.default_rng([score.seed, 3])
    shift = Wander.make(rng, score.sway * np.array([1.0, 0.0, 0.4]), 0.35).at(t)
    # Standing on bent legs by a hair keeps the knees from locking as the hips sway.
    hips = body.zero["hips"] + np.array([0.0, -0.6, 0.0]) + shift
    hips[:, 1] -= 0.02 * np.sum(shift**2, axis=1)
    turn |= _legs(body, turn, hips)
    offset = {s: body.zero[f"{s}_arm"] - body.zero[f"{s}_clavicle"] for s in SIDES}
    for s in SIDES:
        shoulder = turn[f"{s}_clavicle"] @ offset[s]
        chest = turn["spine3"]
        if s == "R":
            shoulder, chest = shoulder @ MIRROR, mirrored(chest)
        for joint, value in solve_arm(body, shoulder, chest, arms[s]).items():
            turn[f"{s}_{joint}"] = value if s == "L" else mirrored(value)
    return turn, hips


def _drag(body: Body, score: Score, t: Array) -> dict[str, CubicSpline]:
    """How the hands accelerate toward their palms (m/s2): fingers lag behind."""
    grid = np.arange(t.min() - 0.5, t.max() + 0.5, 1 / 60)
    turn, hips = _body(body, score, grid)
    fill = {j: turn[j] if j in turn else turn[f"{j[0]}_hand"] for j in body.zero}
    at = Pose(fill, hips).positions(body)
    out = {}
    for s in SIDES:
        speed = np.gradient(at[f"{s}_middle1"], 1 / 60, axis=0)
        push = gaussian_filter1d(np.gradient(speed, 1 / 60, axis=0), 2.5, axis=0) / 100
        palm = turn[f"{s}_hand"] @ PALMAR
        out[s] = CubicSpline(grid, np.sum(push * palm, axis=-1))
    return out


def finger_angles(score: Score, side: str, t: Array, drag: CubicSpline) -> Array:
    """Finger angles of one hand over time, (frames, 25), degrees.

    The thumb, the index finger and the spread are free; the ring finger follows the middle finger
    in part, the little finger follows the ring finger late; far joints follow middle ones.
    """
    rng = np.random.default_rng([score.seed, 4, SIDES.index(side)])
    delay, pace = np.zeros(len(CHANNELS)), np.ones(len(CHANNELS))
    lead = rng.choice([-1.0, 1.0])  # the little finger leads or lags
    late = {"thumb": rng.uniform(-0.02, 0.06), "index": rng.uniform(0, 0.05)}
    for step, finger in enumerate(("middle", "ring", "pinky"), 1):
        late[finger] = 0.01 + lead * 0.025 * step + rng.uniform(-0.005, 0.01)
    for name, i in INDEX.items():
        digit, joint = name.split("_")
        delay[i] = late[digit] + {"pip": 0.015, "dip": 0.03, "ip": 0.03}.get(joint, 0.0)
        pace[i] = rng.uniform(0.92, 1.12) if joint != "dip" else pace[i - 1]
    angles = score.fingers[side].at(t, delay, pace)
    size = np.zeros(len(CHANNELS))
    for name, i in INDEX.items():
        joint = name.split("_")[1]
        size[i] = {"mcp": 1.5, "pip": 1.6, "dip": 1.3, "spread": 0.7, "roll": 0.25,
                   "across": 1.2, "palmar": 1.0, "oppose": 1.0, "ip": 1.3}[joint]  # fmt: skip
    noise = Wander.make(rng, score.liveliness * size, 0.9)
    now, before = noise.at(t), noise.at(t, 0.05)
    drift = np.zeros_like(now)
    for joint in ("mcp", "pip", "spread", "roll"):
        m, r, p = (INDEX[f"{f}_{joint}"] for f in ("middle", "ring", "pinky"))
        drift[:, INDEX[f"index_{joint}"]] = now[:, INDEX[f"index_{joint}"]]
        drift[:, m] = now[:, m]
        drift[:, r] = 0.7 * before[:, m] + 0.5 * now[:, r]
        drift[:, p] = 0.8 * (0.7 * noise.at(t, 0.1)[:, m] + 0.5 * before[:, r]) + 0.4 * now[:, p]
    for finger in ("index", "middle", "ring", "pinky"):
        i = INDEX[f"{finger}_dip"]
        drift[:, i] = 0.6 * drift[:, INDEX[f"{finger}_pip"]] + now[:, i]
    drift[:, :5] = now[:, :5]
    lag = 7.0 * np.tanh(drag(t - 0.04) / 12.0) * score.liveliness
    for name, i in INDEX.items():
        gain = {"mcp": -1.0, "pip": -0.5, "dip": -0.35, "palmar": -0.3}.get(name.split("_")[1], 0)
        drift[:, i] += gain * lag * (0.6 if name.startswith("thumb") else 1.0)
    # Soft limits: a hard clip would show as a jerk.
    low, high = LIMITS.T
    middle, half = (low + high) / 2, (high - low) / 2
    scaled = (angles + drift - middle) / half
    knee = 0.9
    over = np.abs(scaled) - knee
    soft = np.sign(scaled) * (knee + (1 - knee) * np.tanh(np.maximum(over, 0) / (1 - knee)))
    return np.asarray(np.where(over > 0, soft, scaled) * half + middle)


def perform(body: Body, score: Score, t: Array) -> Pose:
    """The whole body at some times.

    Parameters
    ----------
    body
        Who performs.
    score
        What.
    t
        Times in seconds.
    """
    turn, hips = _body(body, score, t)
    drag = _drag(body, score, t)
    for s in SIDES:
        hand = turn[f"{s}_hand"] if s == "L" else mirrored(turn[f"{s}_hand"])
        angles = finger_angles(score, s, t, drag[s])
        for joint, value in bend_bones(body, hand, angles).items():
            turn[f"{s}_{joint}"] = value if s == "L" else mirrored(value)
    return Pose(turn, hips)
