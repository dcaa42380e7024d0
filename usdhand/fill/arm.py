"""What the arm does: the motion that finger motion is inferred from, the same for every rig.

Everything is in anatomical axes: x to the character's left, y up, z forward at the bind pose, and
the palm's own frame for the hand. Positions are in centimetres of a body of reference height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.errors import InputError
from usdhand.motion import Clip, Pose, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit
from usdhand.rigs.height import REFERENCE_HEIGHT_CM, body_height

# No joint is farther from its parent, and no wrist, at reference height, farther from the hips:
# damaged files have such values, and nothing can be measured beside them.
FARTHEST_JOINT_CM = 1e7
FARTHEST_WRIST_CM = 1e4
# An arm whose joints move and turn less than this is still.
STILL_ARM_CM, STILL_ARM_TURN = 0.1, 0.005


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """One arm over time, relative to the hips and to the chest; all (frames, ...).

    Attributes
    ----------
    hips_position, chest_position : wrist in the axes of hips and chest, cm at reference height
    shoulder_position : wrist from the shoulder in the axes of the chest, likewise
    elbow_position : elbow from the shoulder in the axes of the chest, likewise
    hips_shoulder, hips_elbow : shoulder and elbow in the axes of the hips, likewise
    hips_palm, chest_palm : the palm's rotation in the axes of hips and chest, (frames, 4)
    upper_arm, forearm : rotations away from the bind pose in the axes of the hips, (frames, 4)
    wrist : direction of the forearm in the axes of the palm, (frames, 3): how the wrist bends
    """

    hips_position: Array
    chest_position: Array
    shoulder_position: Array
    elbow_position: Array
    hips_shoulder: Array
    hips_elbow: Array
    hips_palm: Array
    chest_palm: Array
    upper_arm: Array
    forearm: Array
    wrist: Array


def arm_motion(clip: Clip, hands: Hands, side: Side) -> ArmMotion:
    """Motion of one arm; joints that a rig lacks are replaced by the next ones up the body.

    Raises
    ------
    InputError
        if a joint is where no body can have one.
    """
    character, hand = hands.character, hands.character.hands[side]
    _check_translations(clip, [hand.wrist, *clip.skeleton.ancestors(hand.wrist)])
    top = clip.skeleton.ancestors(hand.wrist)
    outermost = top[-1] if top else hand.wrist
    hips = character.hips if character.hips is not None else outermost
    chest = character.chest if character.chest is not None else hips
    elbow = hand.elbow if hand.elbow is not None else (top[0] if top else hand.wrist)
    shoulder = hand.shoulder if hand.shoulder is not None else chest
    pose = forward_kinematics(clip, list({hips, chest, shoulder, elbow, hand.wrist}))
    axes = body_axes(clip.skeleton, hands)
    to_hips, to_chest = (
        rot.conjugate(rot.multiply(pose.rotation(j), _body_axes_in_joint(clip.skeleton, j, axes)))
        for j in (hips, chest)
    )
    palm = rot.multiply(pose.rotation(hand.wrist), hands.frames[side].palm)
    wrist = pose.position(hand.wrist)
    direction = wrist - pose.position(elbow)
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    direction = direction / np.where(length > 1e-6, length, 1.0)
    scale = REFERENCE_HEIGHT_CM / body_height(clip.skeleton, hands.character)
    farthest = scale * float(np.abs(wrist - pose.position(hips)).max())
    if not farthest < FARTHEST_WRIST_CM:
        raise InputError(
            f"{clip.origin.path or clip.name}: joint {clip.skeleton.joints[hand.wrist]} goes "
            f"{farthest:.3g} cm away from the hips; its translations or scales, or those above it, "
            "are damaged."
        )
    return ArmMotion(
        hips_position=scale * rot.rotate(to_hips, wrist - pose.position(hips)),
        chest_position=scale * rot.rotate(to_chest, wrist - pose.position(chest)),
        shoulder_position=scale * rot.rotate(to_chest, wrist - pose.position(shoulder)),
        elbow_position=scale * rot.rotate(to_chest, pose.position(elbow) - pose.position(shoulder)),
        hips_shoulder=scale * rot.rotate(to_hips, pose.position(shoulder) - pose.position(hips)),
        hips_elbow=scale * rot.rotate(to_hips, pose.position(elbow) - pose.position(hips)),
        hips_palm=rot.make_continuous(rot.multiply(to_hips, palm)),
        chest_palm=rot.make_continuous(rot.multiply(to_chest, palm)),
        upper_arm=_away_from_bind(clip.skeleton, pose, shoulder, to_hips, axes),
        forearm=_away_from_bind(clip.skeleton, pose, elbow, to_hips, axes),
        wrist=rot.rotate(rot.conjugate(palm), direction),
    )


def _check_translations(clip: Clip, joints: Sequence[int]) -> None:
    away = np.abs(clip.translations[:, joints]).max(axis=2)
    frame, worst = np.unravel_index(int(np.argmax(np.nan_to_num(away, nan=np.inf))), away.shape)
    if not away[frame, worst] < FARTHEST_JOINT_CM:
        raise InputError(
            f"{clip.origin.path or clip.name}: joint {clip.skeleton.joints[joints[int(worst)]]} is "
            f"{away[frame, worst]:.3g} cm from its parent at {frame / clip.fps:.2f} s; its "
            "translations are damaged."
        )


def is_still(arm: ArmMotion) -> bool:
    """Whether nothing of an arm moves."""
    return all(
        bool(
            np.ptp(values, axis=0).max()
            < (STILL_ARM_TURN if values.shape[1] == 4 else STILL_ARM_CM)
        )
        for values in (arm.hips_position, arm.chest_position, arm.hips_palm, arm.chest_palm)
    )


def mirrored(arm: ArmMotion) -> ArmMotion:
    """Motion of the other arm that looks the same in a mirror.

    Body axes are mirrored in x; of the palm's own axes, the flexion axis, which points to the
    thumb's side on one hand and away from it on the other.
    """
    body, palm = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, 1.0])

    def of_palm(q: Array) -> Array:
        matrices = body[:, None] * rot.to_matrix(q) * palm
        return rot.make_continuous(rot.from_matrix(matrices))

    def of_bone(q: Array) -> Array:
        return np.asarray(q * np.array([1.0, -1.0, -1.0, 1.0]))

    return ArmMotion(
        hips_position=arm.hips_position * body,
        chest_position=arm.chest_position * body,
        shoulder_position=arm.shoulder_position * body,
        elbow_position=arm.elbow_position * body,
        hips_shoulder=arm.hips_shoulder * body,
        hips_elbow=arm.hips_elbow * body,
        hips_palm=of_palm(arm.hips_palm),
        chest_palm=of_palm(arm.chest_palm),
        upper_arm=of_bone(arm.upper_arm),
        forearm=of_bone(arm.forearm),
        wrist=arm.wrist * palm,
    )


def body_axes(skeleton: Skeleton, hands: Hands) -> Array:
    """Rotation (4,) of the character's axes at the bind pose: left, up, forward as x, y, z."""
    found = {
        side: hand.wrist if hand.shoulder is None else hand.shoulder
        for side, hand in hands.character.hands.items()
    }
    up = np.array([0.0, 1.0, 0.0])
    if len(found) == 2:
        left = skeleton.bind_positions[found["left"]] - skeleton.bind_positions[found["right"]]
    elif hands.character.chest is not None:
        [(side, shoulder)] = found.items()
        outward = skeleton.bind_positions[shoulder] - skeleton.bind_positions[hands.character.chest]
        left = outward if side == "left" else -outward
    else:
        return rot.IDENTITY
    left = left - up * (left @ up)
    if np.linalg.norm(left) < 1e-6:
        return rot.IDENTITY
    left = unit(left)
    return rot.from_matrix(np.stack([left, up, np.cross(left, up)], axis=1))


def _away_from_bind(
    skeleton: Skeleton, pose: Pose, joint: int, to_hips: Array, axes: Array
) -> Array:
    turned = rot.multiply(pose.rotation(joint), _body_axes_in_joint(skeleton, joint, axes))
    return rot.make_continuous(rot.multiply(to_hips, turned))


def _body_axes_in_joint(skeleton: Skeleton, joint: int, axes: Array) -> Array:
    """The body's axes in a joint's own axes, (4,)."""
    return rot.multiply(rot.conjugate(rot.from_matrix(skeleton.bind_rotations[joint])), axes)
