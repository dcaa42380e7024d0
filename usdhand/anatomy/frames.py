"""Anatomical frames: axes on every bone of a hand that do not depend on how the rig was built.

Built from the geometry of the bind pose alone (methods: Wu et al. 2005, ISB recommendation on joint
coordinate systems, part II, adapted to what rigs have). A frame's columns are abduction axis,
flexion axis and long axis of the bone, so that a positive flexion brings the fingertip toward the
palm on both hands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy.hand import DIGITS, HAND_JOINTS, HandMap, Side, digit_joints
from usdhand.anatomy.links import HandLinks, Link, hand_links
from usdhand.anatomy.local_motion import LocalMotion
from usdhand.anatomy.palm import (
    Palm,
    bent_frame,
    bone_direction,
    digit_points,
    frame_of,
    swung_frame,
)
from usdhand.anatomy.thumb import (
    NEUTRAL_PRONATION_DEG,
    Pronation,
    neutral_thumb,
    rolled,
    thumb_pronation,
)
from usdhand.display import displayed
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import unit

# Joints that turn less than this tell nothing about their axis.
LEAST_MOTION_DEG = 1.0


@displayed(
    lambda frames: {
        "side": frames.side,
        "joints": len(frames.names),
        "notes": frames.notes,
    }
)
@dataclass(frozen=True, eq=False)
class HandFrames:
    """Anatomical frames of one hand, as quaternions in the joints' own axes.

    Attributes
    ----------
    names : hand joints in anatomical order, those that the rig has
    joints : (n,) their indices in the skeleton
    references : (n,) the joint that each rotation is measured from: the parent, or where the rig
        has something else there, the joint before it in its digit, its metacarpal or the wrist
    reference_frames : (n, 4) the frame of zero rotation, in the reference joint's axes
    joint_frames : (n, 4) the bone's frame, in its own axes
    palm : (4,) frame of the palm, in the wrist joint's axes
    tips : (digits, 3) position of each digit's tip in the axes of its last joint, cm
    links : what moves with the channels, and what must be moved along
    pronation : of the thumb; None where there is none
    notes : what geometry could not decide, in words
    """

    side: Side
    names: tuple[str, ...]
    joints: NDArray[np.intp]
    references: NDArray[np.intp]
    reference_frames: Array
    joint_frames: Array
    palm: Array
    tips: Array
    links: HandLinks
    pronation: Pronation | None = None
    notes: tuple[str, ...] = ()

    @property
    def digits(self) -> tuple[str, ...]:
        """Digits that have joints, thumb first."""
        return tuple(d for d in DIGITS if any(n.startswith(d) for n in self.names))

    def last_joint(self, digit: str) -> int:
        """Index in the skeleton of the outermost joint of a digit."""
        return int(
            [j for n, j in zip(self.names, self.joints, strict=True) if n.startswith(digit)][-1]
        )


def hand_frames(
    skeleton: Skeleton, hand: HandMap, *clips: Clip, pronation: Pronation | None = None
) -> HandFrames:
    """Build the anatomical frames of a hand at the bind pose.

    Parameters
    ----------
    clips : motion of this skeleton; decides a thumb's flexion axis where geometry cannot, that
        is for a bone that stands on the palm
    pronation : of the rig's thumbs; decided from this hand alone if None

    Raises
    ------
    HandNotFoundError
        if joints that should be apart lie on one spot, so that there are no directions, or the
        joints of a flat rig hang off each other in another order than that of a hand.
    """
    palm = Palm.of(skeleton, hand)
    pronation = pronation or thumb_pronation(skeleton, [hand], clips)
    names = tuple(n for n in HAND_JOINTS if n in hand.joints)
    notes: list[str] = []
    reference_frames, joint_frames, tips = [], [], []
    links = hand_links(skeleton, hand)
    reference_of = dict(links.joints)
    for digit in DIGITS:
        chain = [digit + j for j in digit_joints(digit) if digit + j in hand.joints]
        if not chain:
            continue
        points, tip = digit_points(skeleton, hand, digit, chain)
        if digit == "Thumb":
            above = neutral_thumb(palm)
        else:
            above = palm.frame(bone_direction(skeleton, hand.wrist, points[0] - palm.wrist))
        for name, start, end in zip(chain, points[:-1], points[1:], strict=True):
            j = hand.joints[name]
            bone = bone_direction(skeleton, j, end - start)
            first, reference = name == chain[0], reference_of[j]
            if digit == "Thumb" and not first and palm.is_normal(bone):
                above, note = _frame_from_motion(skeleton, (j, reference), bone, above, clips)
                notes.append(f"{hand.side} {name}: {note}")
            own = bent_frame(above, bone)
            if digit == "Thumb" and first:
                own = rolled(swung_frame(above, bone), pronation.degrees, hand.side)
                above = rolled(above, NEUTRAL_PRONATION_DEG, hand.side)
            reference_frames.append(skeleton.bind_rotations[reference].T @ above)
            joint_frames.append(skeleton.bind_rotations[j].T @ own)
            above = own
        last = hand.joints[chain[-1]]
        tips.append(skeleton.bind_rotations[last].T @ (tip - skeleton.bind_positions[last]))
    return HandFrames(
        hand.side,
        names,
        np.array([hand.joints[n] for n in names], dtype=np.intp),
        np.array([reference_of[hand.joints[n]] for n in names], dtype=np.intp),
        rot.from_matrix(np.array(reference_frames)),
        rot.from_matrix(np.array(joint_frames)),
        rot.from_matrix(skeleton.bind_rotations[hand.wrist].T @ palm.frame(palm.forward)),
        np.array(tips),
        links,
        pronation if any(n.startswith("Thumb") for n in names) else None,
        tuple(notes),
    )


def _frame_from_motion(
    skeleton: Skeleton, link: Link, bone: Array, above: Array, clips: Sequence[Clip]
) -> tuple[Array, str]:
    """Frame of the bone before a joint, turned to the principal axis of the joint's motion.

    Only where there is no other way: frames from motion differ from clip to clip and from rig to
    rig, which is worse than an axis that is somewhat off.
    """
    unknown = "geometry does not give its flexion axis, which is taken from"
    kept = above, f"{unknown} the bone before it"
    rotations = [LocalMotion(c).turn(*link).T for c in clips]
    if sum(map(len, rotations)) < 2:
        return kept
    together = np.concatenate(rotations)
    away = rot.multiply(together, rot.conjugate(rot.mean(together)))
    turns = rot.to_rotation_vector(away) @ skeleton.bind_rotations[link[1]].T
    z = unit(bone)
    turns = turns - np.outer(turns @ z, z)
    axis = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    if np.degrees(np.abs(turns @ axis).max()) < LEAST_MOTION_DEG:
        return kept
    axis = axis * np.sign(axis @ bent_frame(above, bone)[:, 1] or 1.0)
    return frame_of(above[:, 2], axis), f"{unknown} its motion"
