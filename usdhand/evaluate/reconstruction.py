"""How near filled fingers come to the true ones, beside simple alternatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from usdhand.anatomy import SIDES, Channels, Hands, Side, fingertips
from usdhand.anatomy.at_bind import moved_frames
from usdhand.anatomy.channels import all_channels, joint_rotations
from usdhand.display import displayed
from usdhand.fill.assemble import FingerPiece, join
from usdhand.fill.candidates import Candidate, SearchSpace, finger_curves, finger_sources
from usdhand.fill.library import MotionLibrary, Part
from usdhand.fill.method import fill
from usdhand.fill.results import Choice, Filled, FilledPart
from usdhand.fill.settings import FillSettings
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import orientation

# What a fill is compared with. "best candidate" looks at the truth: no choice could do better.
METHODS = ("fill", "nearest", "random", "mean pose", "rest pose", "best candidate")


@displayed()
@dataclass(frozen=True)
class HandError:
    """Error of one hand of one take: means over frames, joints and digits.

    The bind poses that a take starts and ends with do not count: they are no motion of a hand.
    ``degrees`` is the angle between true and filled joint rotation, ``fingertip_mm`` the distance
    of the fingertips in the axes of the palm, ``jerk`` the RMS third derivative in degrees / s^3.
    """

    take: str
    side: Side
    method: str
    degrees: float
    fingertip_mm: float
    jerk: float
    frames: int


def reconstruction_errors(
    clip: Clip,
    hands: Hands,
    library: MotionLibrary,
    settings: FillSettings,
    *,
    sides: Sequence[Side] = SIDES,
    content_hash: str | None = None,
    spaces: Mapping[Part, SearchSpace] | None = None,
) -> list[HandError]:
    """Fill a take whose fingers are known from the rest of a library, and compare."""
    filled = fill(
        clip,
        hands,
        library,
        settings,
        sides=sides,
        replace_motion=True,
        content_hash=content_hash,
        spaces=spaces,
    )
    return [
        error
        for part in filled.parts
        for side in part.part
        for error in _hand_errors(clip, hands, library, filled, part, side)
    ]


def _hand_errors(
    clip: Clip,
    hands: Hands,
    library: MotionLibrary,
    filled: Filled,
    part: FilledPart,
    side: Side,
) -> list[HandError]:
    chosen, space = part.alternatives[0], part.space
    joints = part.joints[part.part.index(side)]
    names = all_channels(side, joints)
    columns = [chosen.names.index(n) for n in names]
    truth = hands.encode(clip).select(names).values
    borders = [0, *chosen.seams, len(clip) - 1]
    spans = list(pairwise(borders))
    used = {int(space.clips[c.segment]) for choice in chosen.choices for c in _considered(choice)}
    sources = finger_sources(library, (side,), [joints], used)
    nearest = []
    best = np.empty_like(truth)
    for (a, b), choice in zip(spans, chosen.choices, strict=True):
        options = finger_curves(
            _considered(choice), space, sources, np.arange(b - a + 1) / clip.fps
        )
        nearest.append(FingerPiece(a, b, options[0]))
        wrong = np.abs(options[1:] - truth[a : b + 1]).mean(axis=(1, 2))
        best[a : b + 1] = options[1 + int(np.argmin(wrong))]
    others = [
        c.hands[side].curves_of(joints)
        for c in library.clips
        if c.name not in filled.left_out
        and side in c.hands
        and set(joints) <= set(c.hands[side].joints)
    ]
    mean = sum(o.sum(axis=0) for o in others) / sum(len(o) for o in others)
    results = {
        "fill": chosen.curves[:, columns],
        "nearest": join(nearest, filled.settings.blend),
        "random": _random_curves(others, len(clip), clip.name),
        "mean pose": np.broadcast_to(mean, truth.shape),
        "rest pose": np.broadcast_to(_rest_curves(clip, hands, names), truth.shape),
        "best candidate": best,
    }
    return [_error(clip, hands, side, names, method, results[method]) for method in METHODS]


def _considered(choice: Choice) -> list[Candidate]:
    """The nearest candidate, then those that could be chosen."""
    return [choice.nearest, *choice.candidates]


def _error(
    clip: Clip, hands: Hands, side: Side, names: tuple[str, ...], method: str, curves: Array
) -> HandError:
    frames, hand = hands.frames[side], hands.character.hands[side]
    only = replace(hands, frames={side: frames})
    other = only.decode(only.encode(clip).replaced(Channels(names, np.array(curves))), clip)
    joints = [i for i, n in enumerate(frames.names) if _channel(side, n) in names]
    true, made = (np.stack(joint_rotations(c, frames), axis=1)[:, joints].T for c in (clip, other))
    angle = rot.angle_between(true, made)
    apart = fingertips(other, hand, frames) - fingertips(clip, hand, frames)
    first, last = moved_frames(clip, frames) or (0, len(clip) - 1)
    counted = slice(first, last + 1)
    jerk = np.diff(curves[counted], n=3, axis=0) * clip.fps**3
    return HandError(
        clip.name,
        side,
        method,
        float(angle[counted].mean()),
        float(10.0 * np.linalg.norm(apart[counted], axis=-1).mean()),
        float(np.sqrt(np.mean(jerk**2))) if len(jerk) else 0.0,
        last + 1 - first,
    )


def _channel(side: Side, joint: str) -> str:
    return all_channels(side, (joint,))[0]


def _rest_curves(clip: Clip, hands: Hands, names: tuple[str, ...]) -> Array:
    """Channels of the hand at the bind pose, (channels,)."""
    local = clip.skeleton.bind_locals
    pose = replace(
        clip,
        rotations=rot.from_matrix(orientation(local[None, :, :3, :3])),
        translations=clip.translations[:1],
        scales=clip.scales[:1],
    )
    return np.asarray(hands.encode(pose).select(names).values[0])


def _random_curves(others: list[Array], frames: int, seed: str) -> Array:
    """Fingers of another take from a random frame on, repeated if it is too short."""
    random = np.random.default_rng(list(seed.encode()))
    other = others[int(random.integers(len(others)))]
    return other[(int(random.integers(len(other))) + np.arange(frames)) % len(other)]
