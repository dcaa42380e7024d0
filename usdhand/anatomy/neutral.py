"""Binds that are poses: hands that were bound in a fist or another gesture, and what to do.

Anatomical frames are built at the bind pose, which is a flat or relaxed hand nearly everywhere. A
bent thumb or fist does not tell how far its bones are turned about themselves, so such a bind is
replaced by a pose of the same hand that is neutral.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdhand.anatomy.hand import FINGERS, HandMap
from usdhand.anatomy.palm import Palm, bent_frame, digit_bones, digit_chain
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import compose_trs, decompose_trs, unit

# A bind is a pose if a finger's MCP and PIP together are bent by more than the first, or fingers
# differ by more than the second, or the thumb is as far from that of binds and fingers are bent.
MOST_BENT_DEG, MOST_APART_DEG = 75.0, 50.0
BIND_THUMB = (0.45, 0.50, 0.74)  # toward the palm, to the radial side, along the hand
MOST_OPPOSED_DEG, LEAST_BENT_DEG = 42.0, 5.0
# A frame of a clip is neutral if no finger is bent by more.
FLAT_DEG = 25.0


# Frames that are looked at in all clips together; twice a second would do.
MOST_FRAMES = 400


@dataclass(frozen=True, eq=False)
class Neutral:
    """Local rotations (4,) of joints at a neutral pose, by leaf name, and where they come from."""

    rotations: Mapping[str, Array]
    source: str

    @classmethod
    def of_bind(cls, skeleton: Skeleton, source: str) -> Neutral:
        """The bind pose of a skeleton."""
        turns = decompose_trs(skeleton.bind_locals)[1]
        return cls(dict(zip(skeleton.names, turns, strict=True)), source)

    @classmethod
    def of_frame(cls, clip: Clip, frame: int, source: str) -> Neutral:
        """One frame of a clip."""
        return cls(dict(zip(clip.skeleton.names, clip.rotations[frame], strict=True)), source)


@dataclass(frozen=True, eq=False)
class NeutralBind:
    """A skeleton as a hand is measured on it.

    Attributes
    ----------
    skeleton : with the hand's bind pose replaced where it was a gesture
    is_neutral : False where nothing better was found than a gesture
    note : what was done, in words; "" for a bind that stays as it is
    """

    skeleton: Skeleton
    is_neutral: bool = True
    note: str = ""


def is_posed(skeleton: Skeleton, hand: HandMap) -> bool:
    """Whether a hand is bound in a fist, an opposed thumb or another gesture."""
    bends = finger_bends(skeleton, hand)
    if not len(bends):
        return False
    opposed = len(thumb_bones := digit_bones(skeleton, hand, "Thumb")) > 0 and (
        _opposition(skeleton, hand, thumb_bones[0]) > MOST_OPPOSED_DEG
    )
    return bool(
        bends.max() > MOST_BENT_DEG
        or np.ptp(bends) > MOST_APART_DEG
        or (opposed and bends.mean() > LEAST_BENT_DEG)
    )


def neutral_bind(
    skeleton: Skeleton,
    hand: HandMap,
    clips: Sequence[Clip] = (),
    others: Sequence[Skeleton] = (),
    given: Neutral | None = None,
) -> NeutralBind:
    """A skeleton whose hand is bound in a neutral pose.

    Of the remedies the first that there is: what a user gave, the usual bind of other clips with
    these joints, a flat frame of its motion, the rest pose; else the bind stays as it is.

    Parameters
    ----------
    clips : of this skeleton
    others : skeletons with the same joints and other binds
    given : a pose that is neutral, for posed binds and others alike

    Raises
    ------
    HandNotFoundError
        if the pose that was given lacks a joint of the hand.
    """
    if given is not None and _is_of(skeleton, hand, given):
        found = _rebound(skeleton, hand, given, needed=True)
        return NeutralBind(found, note=f"neutral from {given.source}")
    said = "" if given is None else f"{given.source} is of another rig, so its pose is not used"
    if not is_posed(skeleton, hand):
        return NeutralBind(skeleton, note=said)
    said = f"{said}; " if said else ""
    for neutral in _remedies(skeleton, hand, clips, others):
        found = _rebound(skeleton, hand, neutral)
        if not is_posed(found, hand):
            note = f"{said}the bind pose is a gesture; neutral from {neutral.source}"
            return NeutralBind(found, note=note)
    note = (
        f"{said}the bind pose is a gesture, and no pose of this hand is neutral; name a neutral "
        "clip or pose with --neutral"
    )
    return NeutralBind(skeleton, is_neutral=False, note=note)


def finger_bends(skeleton: Skeleton, hand: HandMap) -> Array:
    """(fingers,) flexion of MCP and PIP together at the bind pose, degrees."""
    palm, bends = Palm.of(skeleton, hand), []
    for digit in FINGERS:
        bones = digit_bones(skeleton, hand, digit)
        if len(bones) < 2:
            continue
        first = skeleton.bind_positions[hand.joints[digit_chain(hand, digit)[0]]]
        above, bend = palm.frame(first - palm.wrist), 0.0
        for bone in bones[:2]:
            x, _, z = above.T @ unit(bone)
            bend += float(np.degrees(np.arctan2(x, z)))
            above = bent_frame(above, bone)
        bends.append(bend)
    return np.array(bends)


def _remedies(
    skeleton: Skeleton, hand: HandMap, clips: Sequence[Clip], others: Sequence[Skeleton]
) -> Iterator[Neutral]:
    usual = [s for s in others if not is_posed(s, hand)]
    if usual:
        binds = [np.round(s.bind_locals, 3).tobytes() for s in usual]
        most, _ = Counter(binds).most_common(1)[0]
        yield Neutral.of_bind(usual[binds.index(most)], "the usual bind of clips with its joints")
    if (flat := _flat_frame(skeleton, hand, clips)) is not None:
        yield flat
    turns = dict(zip(skeleton.names, decompose_trs(skeleton.rest)[1], strict=True))
    yield Neutral(turns, "the rest pose")


def _flat_frame(skeleton: Skeleton, hand: HandMap, clips: Sequence[Clip]) -> Neutral | None:
    """The flattest frame of those that clips start and end with, else of all.

    Many clips start and end in the pose that the rig was made in; a hand that is flat while it
    moves may have its thumb anywhere.
    """
    step = max(1, sum(map(len, clips)) // MOST_FRAMES)
    ends = [(clip, frame) for clip in clips for frame in (0, len(clip) - 1)]
    inside = [(clip, frame) for clip in clips for frame in range(0, len(clip), step)]
    for frames in (ends, inside):
        flat: list[tuple[float, Neutral]] = []
        for clip, frame in frames:
            pose = Neutral.of_frame(clip, frame, f"frame {frame} of {clip.name or 'the clip'}")
            posed = _rebound(skeleton, hand, pose)
            bends = np.abs(finger_bends(posed, hand))
            if bends.max() <= FLAT_DEG and not is_posed(posed, hand):
                flat.append((float(bends.mean()), pose))
        if flat:
            return min(flat, key=lambda found: found[0])[1]
    return None


def _rebound(skeleton: Skeleton, hand: HandMap, neutral: Neutral, needed: bool = False) -> Skeleton:
    """The skeleton with other local rotations at the bind pose, from the wrist outwards."""
    joints = _hand_joints(skeleton, hand)
    missing = [skeleton.names[j] for j in joints if skeleton.names[j] not in neutral.rotations]
    if missing and needed:
        raise HandNotFoundError(
            f"The pose of {neutral.source} has no joint '{missing[0]}', which the {hand.side} hand "
            "needs. Give a clip or pose of a rig with the same joints."
        )
    translations, rotations, scales = decompose_trs(skeleton.bind_locals)
    rotations = rotations.copy()
    for joint in joints:
        if skeleton.names[joint] in neutral.rotations:
            rotations[joint] = neutral.rotations[skeleton.names[joint]]
    local = compose_trs(translations, rotations, scales)
    world = skeleton.bind.copy()
    for joint in joints:
        parent = int(skeleton.parents[joint])
        world[joint] = world[parent] @ local[joint] if parent >= 0 else local[joint]
    return replace(skeleton, bind=world)


def _is_of(skeleton: Skeleton, hand: HandMap, neutral: Neutral) -> bool:
    """Whether a pose has any joint of a hand."""
    return any(skeleton.names[j] in neutral.rotations for j in hand.joints.values())


def _hand_joints(skeleton: Skeleton, hand: HandMap) -> list[int]:
    """Joints that a hand's bind hangs on, below what the wrist and all digits hang off."""
    own = (hand.wrist, *hand.joints.values(), *hand.metacarpals.values(), *hand.tips.values())
    top = skeleton.common_ancestor(own)
    above = set() if top is None else {top, *skeleton.ancestors(top)}
    return [joint for joint in skeleton.with_ancestors(own) if joint not in above]


def _opposition(skeleton: Skeleton, hand: HandMap, bone: Array) -> float:
    """How far a thumb's metacarpal points from where it does at binds, degrees."""
    palm = Palm.of(skeleton, hand)
    seen = np.stack([palm.normal, palm.radial, palm.forward]) @ unit(bone)
    return float(np.degrees(np.arccos(np.clip(seen @ unit(np.array(BIND_THUMB)), -1.0, 1.0))))
