"""The hand clip's fingers, and wrist if wanted, at the warped times on the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdhand.anatomy import Channels, HandFrames, Hands, Side
from usdhand.anatomy.channels import carry_followers, decode, encode
from usdhand.errors import UsageError
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array
from usdhand.splice.frozen import bridged_smoothly
from usdhand.splice.markers import arm_origin
from usdhand.splice.phases import smoothed

# Places within the time of one body frame at which a hand clip that runs faster is averaged.
WITHIN_FRAME = np.array([-1.0, 0.0, 1.0]) / 3.0
# Changes of the warp's speed, as a share of the usual speed, that show as a jolt of the fingers.
SPEED_JUMP = 0.5
JUMP_SMOOTHING_FRAMES = 2.0


def fingers_along(
    hand_clip: Clip,
    hand_frames: HandFrames,
    names: Sequence[str],
    warp: Array,
    exact: Array | None = None,
    frozen: Sequence[tuple[float, float]] = (),
) -> Channels:
    """The fingers that the hand clip has at the warp's times, of those channels that it has.

    Parameters
    ----------
    warp : (body frames,) seconds of the hand clip from its first frame
    exact : (body frames,) whether a frame shows this very moment, and nothing of those around it
    frozen : first and last seconds of the hand clip between which fingers that rest are bridged
    """
    other = encode(hand_clip, hand_frames)
    theirs = frozenset(other.names)
    names = tuple(name for name in names if name in theirs)
    times = _times_within(warp, exact) * hand_clip.fps
    ranges = [(round(a * hand_clip.fps), round(b * hand_clip.fps)) for a, b in frozen]
    curves = bridged_smoothly(other.select(names).values, ranges)
    taken = np.mean([interpolate(curves, t) for t in times], axis=0)
    return Channels(names, _smooth_at_speed_jumps(taken, warp, exact))


def with_fingers(body: Clip, frames: HandFrames, taken: Channels) -> Clip:
    """The body with these channels; others are left alone."""
    return decode(encode(body, frames).replaced(taken), body, frames)


def wrist_along(
    hand_clip: Clip, hands: Hands, side: Side, warp: Array, exact: Array | None = None
) -> Array:
    """The rotation (body frames, 4) of the palm relative to the forearm at the warp's times.

    Raises
    ------
    UsageError
        if the clip has no joint above the wrist, so that nothing tells how the wrist bends.
    """
    _check_forearm(hand_clip, hands, side)
    bends = _palm_to_forearm(hand_clip, hands, side)
    times = _times_within(warp, exact) * hand_clip.fps
    taken = rot.mean(np.stack([interpolate_rotations(bends, t) for t in times]))
    return rot.make_continuous(taken)


def _check_forearm(clip: Clip, hands: Hands, side: Side) -> None:
    wrist = hands.character.hands[side].wrist
    if clip.skeleton.parents[wrist] < 0:
        raise UsageError(
            f"{clip.name}: the {side} wrist, '{clip.skeleton.joints[wrist]}', has no "
            "forearm, so its bend is unknown. Splice the fingers alone (--wrist body)."
        )


def with_wrist(body: Clip, hands: Hands, side: Side, taken: Array) -> Clip:
    """The body with rotations (frames, 4) of the palm relative to the forearm.

    Raises
    ------
    UsageError
        if the body has no joint above the wrist.
    """
    _check_forearm(body, hands, side)
    wrist = hands.character.hands[side].wrist
    parent = int(body.skeleton.parents[wrist])
    elbow, _ = arm_origin(body.skeleton, hands.character.hands[side])
    pose = forward_kinematics(body, dict.fromkeys([elbow, parent]))
    forearm = rot.multiply(pose.rotation(elbow), forearm_frame(body.skeleton, hands, side))
    palm = rot.multiply(forearm, taken)
    world = rot.multiply(palm, rot.conjugate(hands.frames[side].palm))
    rotations = body.rotations.copy()
    rotations[:, wrist] = rot.make_continuous(
        rot.multiply(rot.conjugate(pose.rotation(parent)), world)
    )
    return carry_followers(body, body.with_rotations(rotations), hands.frames[side])


def forearm_frame(skeleton: Skeleton, hands: Hands, side: Side) -> Array:
    """Frame (4,) of the forearm in the elbow's axes: the palm's, swung to it at the bind pose."""
    hand = hands.character.hands[side]
    elbow, _ = arm_origin(skeleton, hand)
    axes = rot.from_matrix(skeleton.bind_rotations)
    palm = rot.multiply(axes[hand.wrist], hands.frames[side].palm)
    along = skeleton.bind_positions[hand.wrist] - skeleton.bind_positions[elbow]
    length = np.linalg.norm(along)
    if length > 1e-6:
        now = rot.rotate(palm, np.array([0.0, 0.0, 1.0]))
        palm = rot.multiply(rot.between_vectors(now, along / length), palm)
    return rot.multiply(rot.conjugate(axes[elbow]), palm)


def _palm_to_forearm(clip: Clip, hands: Hands, side: Side) -> Array:
    hand = hands.character.hands[side]
    elbow, _ = arm_origin(clip.skeleton, hand)
    pose = forward_kinematics(clip, dict.fromkeys([elbow, hand.wrist]))
    forearm = rot.multiply(pose.rotation(elbow), forearm_frame(clip.skeleton, hands, side))
    palm = rot.multiply(pose.rotation(hand.wrist), hands.frames[side].palm)
    return rot.make_continuous(rot.multiply(rot.conjugate(forearm), palm))


def _times_within(warp: Array, exact: Array | None) -> Array:
    """(3, frames) times of the hand clip that fall on every body frame.

    The average over several matched frames is the paper's median for what varies smoothly.
    """
    frames = np.arange(len(warp))
    times = np.stack([np.interp(frames + w, frames, warp) for w in WITHIN_FRAME])
    return times if exact is None else np.where(exact, warp, times)


def _smooth_at_speed_jumps(curves: Array, warp: Array, exact: Array | None) -> Array:
    """Curves smoothed where, and only where, the speed of the warp jumps at no exact pin."""
    bend = np.abs(np.diff(warp, n=2, prepend=warp[:1], append=warp[-1:]))
    bend[[0, -1]] = 0.0
    usual = max((warp[-1] - warp[0]) / max(len(warp) - 1, 1), 1e-9)
    jumps = (bend > SPEED_JUMP * usual).astype(np.float64)
    if not jumps.any():
        return curves
    share = np.minimum(1.0, 6.0 * smoothed(jumps, JUMP_SMOOTHING_FRAMES))
    if exact is not None:
        share = np.where(exact, 0.0, share)
    return np.asarray(curves + share[:, None] * (smoothed(curves, JUMP_SMOOTHING_FRAMES) - curves))
