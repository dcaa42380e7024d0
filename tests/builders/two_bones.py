"""Arms whose hands are taken elsewhere: two-bone inverse kinematics on clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit


def wrist_from_shoulder(clip: Clip, hands: Hands, side: Side) -> Array:
    """(frames, 3) cm."""
    hand = hands.character.hands[side]
    assert hand.shoulder is not None
    pose = forward_kinematics(clip, [hand.wrist, hand.shoulder])
    return np.asarray(pose.position(hand.wrist) - pose.position(hand.shoulder))


def with_wrist_at(
    clip: Clip, hands: Hands, side: Side, wrist: Array, wobble: Array | None = None
) -> Clip:
    """The clip with one wrist elsewhere; bones keep their lengths, the palm its direction.

    Parameters
    ----------
    wrist : (frames, 3) cm from the shoulder in world axes, as near to that as the arm reaches
    wobble : (frames, 3) radians by which the palm turns besides
    """
    hand = hands.character.hands[side]
    shoulder, elbow, end = hand.shoulder, hand.elbow, hand.wrist
    assert shoulder is not None
    assert elbow is not None
    pose = forward_kinematics(clip, dict.fromkeys([shoulder, elbow, end]))
    upper = pose.position(elbow) - pose.position(shoulder)
    lower = pose.position(end) - pose.position(elbow)
    a, b = (np.linalg.norm(v, axis=-1, keepdims=True) for v in (upper, lower))
    distance = np.linalg.norm(wrist, axis=-1, keepdims=True)
    distance = np.clip(distance, np.abs(a - b) + 0.5, a + b - 0.05)
    along = unit(wrist)
    side_way = unit(upper - along * np.sum(upper * along, axis=-1, keepdims=True))
    cosine = (a**2 + distance**2 - b**2) / (2.0 * a * distance)
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    new_upper = a * (cosine * along + sine * side_way)
    new_lower = distance * along - new_upper
    world = {j: pose.rotation(j) for j in (shoulder, elbow, end)}
    world[shoulder] = rot.multiply(
        rot.between_vectors(unit(upper), unit(new_upper)), world[shoulder]
    )
    world[elbow] = rot.multiply(rot.between_vectors(unit(lower), unit(new_lower)), world[elbow])
    if wobble is not None:
        half = np.concatenate([wobble / 2, np.ones((len(clip), 1))], axis=-1)
        world[end] = rot.normalize(rot.multiply(half, world[end]))
    moved = clip
    for joint in (shoulder, elbow, end):  # from the trunk to the hand
        parent = int(clip.skeleton.parents[joint])
        above = forward_kinematics(moved, [parent]).rotation(parent)
        q = moved.rotations.copy()
        q[:, joint] = rot.make_continuous(rot.multiply(rot.conjugate(above), world[joint]))
        moved = replace(moved, rotations=q)
    return moved
