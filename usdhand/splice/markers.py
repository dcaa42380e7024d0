"""Four virtual markers a hand: Majkowska, Zordan & Faloutsos 2006, sections 3 and 4."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.anatomy.hand import HandMap
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit
from usdhand.splice.frozen import bridged, bridged_rotations, frozen_ranges

# How far from the wrist the markers are, as shares of the distance to the middle knuckle and to the
# elbow. They can stand off further than glued ones, and then tell more about rotation.
HALF_BREADTH, ALONG_HAND, ALONG_FOREARM = 0.6, 1.5, 0.8

# What positions are measured from where a rig has no joint above the elbow.
WORLD_ORIGIN = "the room"


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers of one hand at a steady rate.

    Attributes
    ----------
    positions : (frames, 4, 3) thumb's and little finger's side of the wrist, forearm, hand; cm,
        from the origin, in world axes
    wrist : (frames, 3) the wrist from the origin, cm
    forearm : (frames, 3) unit direction of the forearm in the axes of the palm: how the wrist bends
    facing : (frames, 2) level direction x, z to the trunk's left, None without a trunk
    fps : frames a second
    origin : name of the joint that the positions are measured from, or `WORLD_ORIGIN`
    frozen : first and last seconds of what the recording lacks; there the markers are bridged
    """

    positions: Array
    wrist: Array
    forearm: Array
    facing: Array | None
    fps: float
    origin: str
    frozen: tuple[tuple[float, float], ...] = ()

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def palm_length(self) -> float:
        """From the wrist to the middle knuckle: what is far and near for this character."""
        return float(np.linalg.norm(self.positions[0, 3] - self.wrist[0])) / ALONG_HAND

    @property
    def seen(self) -> Array:
        """(frames,) 1, or 0 where the recording lacks something."""
        seconds = np.arange(len(self)) / self.fps
        seen = np.ones(len(self))
        for first, last in self.frozen:
            seen[(seconds >= first - 1e-6) & (seconds <= last + 1e-6)] = 0.0
        return seen


def hand_markers(clip: Clip, hands: Hands, side: Side, fps: float) -> Markers:
    """Markers of one hand at an analysis rate, over the clip's time from its first frame."""
    hand, frames = hands.character.hands[side], hands.frames[side]
    elbow, origin = arm_origin(clip.skeleton, hand)
    pose = forward_kinematics(clip, {j for j in (hand.wrist, elbow, origin) if j is not None})
    count = int(np.floor(clip.duration * fps + 1e-6)) + 1
    at = np.asarray(np.arange(count) * (clip.fps / fps), float)
    shoulder = np.zeros((1, 3)) if origin is None else pose.position(origin)
    places = pose.position(hand.wrist) - shoulder
    arms = pose.position(elbow) - pose.position(hand.wrist)
    palms = rot.multiply(rot.make_continuous(pose.rotation(hand.wrist)), frames.palm)
    frozen = frozen_ranges(_bend(palms, arms), places)
    wrist, to_elbow = (interpolate(bridged(v, frozen), at) for v in (places, arms))
    palm = interpolate_rotations(bridged_rotations(palms, frozen), at)
    scale = _scale(clip, hand.wrist)
    length = scale * _palm_length(clip.skeleton, hand)
    axes = rot.to_matrix(palm)
    radial, along = axes[:, :, 1], axes[:, :, 2]
    positions = np.stack(
        [
            wrist + HALF_BREADTH * length * radial,
            wrist - HALF_BREADTH * length * radial,
            wrist + ALONG_FOREARM * to_elbow,
            wrist + ALONG_HAND * length * along,
        ],
        axis=1,
    )
    return Markers(
        positions,
        wrist,
        _bend(palm, to_elbow),
        _facing(clip, hands, at),
        fps,
        WORLD_ORIGIN if origin is None else clip.skeleton.names[origin],
        tuple((first / clip.fps, last / clip.fps) for first, last in frozen),
    )


def _bend(palm: Array, to_elbow: Array) -> Array:
    """Unit direction (frames, 3) of the forearm in the axes of the palm."""
    distance = np.linalg.norm(to_elbow, axis=-1, keepdims=True)
    direction = -to_elbow / np.where(distance > 1e-9, distance, 1.0)
    return np.asarray(np.einsum("tij,ti->tj", rot.to_matrix(palm), direction))


def resample_markers(markers: Markers, frames: Array, fps: float) -> Markers:
    """Markers at fractional frames, as frames of another rate; the first and last one stay on."""
    return replace(
        markers,
        positions=interpolate(markers.positions, frames),
        wrist=interpolate(markers.wrist, frames),
        forearm=interpolate(markers.forearm, frames),
        facing=None if markers.facing is None else interpolate(markers.facing, frames),
        fps=fps,
        frozen=(),
    )


def arm_origin(skeleton: Skeleton, hand: HandMap) -> tuple[int, int | None]:
    """Joints for the elbow and for the shoulder; where they are missing, the next ones up.

    Without any joint above the elbow there is None: forearms alone move through the room.
    """
    above = skeleton.ancestors(hand.wrist)
    elbow = hand.elbow if hand.elbow is not None else (above[0] if above else hand.wrist)
    if hand.shoulder is not None:
        return elbow, hand.shoulder
    return elbow, next(iter(skeleton.ancestors(elbow)), None)


def _palm_length(skeleton: Skeleton, hand: HandMap) -> float:
    knuckles = [j for n, j in hand.joints.items() if n.endswith("MCP") and n != "ThumbMCP"]
    middle = [hand.joints["MiddleMCP"]] if "MiddleMCP" in hand.joints else knuckles
    places = skeleton.bind_positions
    return float(np.linalg.norm(places[middle].mean(axis=0) - places[hand.wrist]))


def _scale(clip: Clip, joint: int) -> float:
    """Mean size of a joint's axes in the world."""
    line = [joint, *clip.skeleton.ancestors(joint)]
    return float(np.prod(clip.scales[:, line].mean(axis=(0, 2))))


def _facing(clip: Clip, hands: Hands, at: Array) -> Array | None:
    """(frames, 2) level direction that runs from shoulder to shoulder at the bind pose."""
    character = hands.character
    shoulders = {s: h.shoulder for s, h in character.hands.items()}
    left, right = shoulders.get("left"), shoulders.get("right")
    if character.chest is None or left is None or right is None:
        return None
    places = clip.skeleton.bind_positions
    own = clip.skeleton.bind_rotations[character.chest].T @ (places[left] - places[right])
    turned = rot.rotate(forward_kinematics(clip, [character.chest]).rotation(character.chest), own)
    level = interpolate(turned, at)[:, [0, 2]]
    return unit(level)
