"""Finger joints for a body that has none: those of another character, scaled to the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdhand.anatomy import Hands, Side
from usdhand.anatomy.hand import DIGITS, HandMap, digit_joints
from usdhand.display import displayed
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.motion.transforms import affine, rigid, unit
from usdhand.rigs import Conventions, load_conventions
from usdhand.rigs.body import body_of, joint_points
from usdhand.rigs.conventions import METACARPALS, TIPS
from usdhand.rigs.fingerless import FingerlessArms, finger_names, fingerless_arms, own_digits
from usdhand.rigs.height import body_height

# A joint below the wrist tells the hand's direction if it is this far away, in forearms, and not
# further off the forearm's direction than this: hands are straight at bind poses, props are not.
LEAST_REACH = 0.1
MOST_BENT_DEG = 50.0
# A hand that points to where the character looks within this has its thumb inside, not in front.
UNDECIDED_SINE = 0.35


@dataclass(frozen=True, eq=False)
class HandShape:
    """The joints of a hand at its bind pose in the axes of its palm, parents first.

    Attributes
    ----------
    roles : "IndexMCP", "IndexMetacarpal", "ThumbTip", ...
    parents : role -> role of its parent, "" for the wrist
    positions : (n, 3) from the wrist, cm
    rotations : (n, 3, 3)
    forearm : its length, cm; None if there is no elbow
    height : of the character, cm
    """

    side: Side
    roles: tuple[str, ...]
    parents: Mapping[str, str]
    positions: Array
    rotations: Array
    forearm: float | None
    height: float


@displayed(
    lambda grafted: {
        "clip": grafted.clip.name,
        **{side: f"{len(joints)} joints" for side, joints in grafted.added.items()},
    }
)
@dataclass(frozen=True, eq=False)
class Grafted:
    """A clip with finger joints added, and which ones: paths by hand."""

    clip: Clip
    added: Mapping[Side, tuple[str, ...]]


def add_finger_joints(
    clip: Clip,
    donor: Skeleton,
    donor_hands: Hands,
    conventions: Conventions | None = None,
    sides: Sequence[Side] = ("left", "right"),
) -> Grafted:
    """Give a body the finger joints of another character, at rest, at the end of its joints.

    The hand is scaled by the ratio of the forearms (of the heights where there is none), put to
    the body's wrist along the hand, and turned so that the thumb is where it is in bind poses:
    toward where the character faces. If the donor lacks a hand, its other hand is mirrored.

    Raises
    ------
    HandNotFoundError
        if no arm without fingers is found on these sides.
    """
    return graft_hands(clip, hand_shapes(donor, donor_hands), conventions, sides)


def graft_hands(
    clip: Clip,
    shapes: Mapping[Side, HandShape],
    conventions: Conventions | None = None,
    sides: Sequence[Side] = ("left", "right"),
    *,
    replace_fingers: bool = False,
) -> Grafted:
    """Give a body hands of these shapes; see `add_finger_joints`.

    A whole digit that the body has stays the only one of its kind, unless fingers are replaced:
    then another one is added beside it.
    """
    conventions = conventions or load_conventions()
    arms = fingerless_arms(clip.skeleton, conventions)
    wanted = [side for side in sides if arms and side in arms.character.hands]
    if arms is None or not wanted:
        raise HandNotFoundError(
            f"{clip.origin.path or clip.name}: no wrist without fingers was found to add finger "
            'joints to. Name the wrists in a file ([left] wrist = "...") and pass it with --map.'
        )
    added: dict[Side, tuple[str, ...]] = {}
    for side in wanted:
        shape = _shape_of(shapes, side)
        kept = {} if replace_fingers else own_digits(clip.skeleton, arms, side)
        roles = [role for role in shape.roles if not role.startswith(tuple(kept))]
        names = finger_names(clip.skeleton, arms, side, roles, conventions)
        before = len(clip.skeleton)
        clip = _with_hand(clip, arms, shape, names)
        added[side] = clip.skeleton.joints[before:]
    return Grafted(clip, added)


def hand_shape(skeleton: Skeleton, hands: Hands, side: Side) -> HandShape:
    """A character's hand at its bind pose; the other one mirrored where it has only one."""
    return _shape_of(hand_shapes(skeleton, hands), side)


def hand_shapes(skeleton: Skeleton, hands: Hands) -> dict[Side, HandShape]:
    """A character's hands at its bind pose."""
    return {side: _own_shape(skeleton, hands, side) for side in hands.frames}


def _shape_of(shapes: Mapping[Side, HandShape], side: Side) -> HandShape:
    if side in shapes:
        return shapes[side]
    other = next(iter(shapes.values()))
    mirror = np.array([1.0, -1.0, 1.0])  # across the palm: flexion axes point the other way
    turned = -mirror[:, None] * other.rotations
    return replace(other, side=side, positions=other.positions * mirror, rotations=turned)


def _own_shape(skeleton: Skeleton, hands: Hands, side: Side) -> HandShape:
    hand, frames = hands.character.hands[side], hands.frames[side]
    palm = skeleton.bind_rotations[hand.wrist] @ rot.to_matrix(frames.palm)
    places = dict(hand.joints)
    places |= {METACARPALS[d]: j for d, j in hand.metacarpals.items() if d in METACARPALS}
    places |= {TIPS[d]: j for d, j in hand.tips.items()}
    joints: dict[str, int] = {}
    parents: dict[str, str] = {}
    for digit in DIGITS:
        above = ""
        chain = (METACARPALS.get(digit, ""), *(digit + j for j in digit_joints(digit)), TIPS[digit])
        for role in chain:
            if role in places:
                joints[role], parents[role] = places[role], above
                above = role
    indices = list(joints.values())
    positions = (skeleton.bind_positions[indices] - skeleton.bind_positions[hand.wrist]) @ palm
    rotations = palm.T @ skeleton.bind_rotations[indices]
    return HandShape(
        side,
        tuple(joints),
        parents,
        positions,
        rotations,
        _forearm(skeleton, hand),
        body_height(skeleton, hands.character),
    )


def _with_hand(
    clip: Clip, arms: FingerlessArms, shape: HandShape, names: Mapping[str, str]
) -> Clip:
    """The clip with the joints of ``names`` behind its own, unmoved."""
    skeleton, hand = clip.skeleton, arms.character.hands[shape.side]
    palm = palm_of(skeleton, arms, shape.side)
    size = _size(skeleton, arms, shape)
    wrist = skeleton.bind[hand.wrist]
    # Joints stand in the wrist's space, whose scale (of an exporter's root joint) they must undo;
    # it is negative where something above mirrors.
    scale = float(np.cbrt(np.linalg.det(wrist[:3, :3])))
    joints, parents = list(skeleton.joints), skeleton.parents.tolist()
    bind, rest = list(skeleton.bind), list(skeleton.rest)
    index = {"": hand.wrist}
    for role, position, turn in zip(shape.roles, shape.positions, shape.rotations, strict=True):
        above = shape.parents[role]
        while above not in index:  # a metacarpal that has no name here
            above = shape.parents[above]
        if role not in names:
            continue
        world = affine(scale * palm @ turn, wrist[:3, 3] + size * palm @ position)
        parent = index[above]
        index[role] = len(joints)
        joints.append(f"{joints[parent]}/{names[role]}")
        parents.append(parent)
        bind.append(world)
        rest.append(rigid(np.linalg.inv(bind[parent]) @ world))
    local = np.array(rest[len(skeleton) :])
    return replace(
        clip,
        skeleton=_extended(skeleton, joints, parents, np.array(bind), np.array(rest)),
        rotations=_followed(clip.rotations, rot.from_matrix(local[:, :3, :3])),
        translations=_followed(clip.translations, local[:, :3, 3]),
        scales=_followed(clip.scales, np.ones((len(local), 3))),
    )


def palm_of(skeleton: Skeleton, arms: FingerlessArms, side: Side) -> Array:
    """Frame (3, 3) of a palm without fingers at the bind pose: abduction, flexion, long axis.

    The long axis goes to a joint below the wrist if there is one, else on along the forearm.
    """
    hand = arms.character.hands[side]
    points = joint_points(skeleton)
    body = body_of(skeleton, points, [h.wrist for h in arms.character.hands.values()])
    wrist = points[hand.wrist]
    below = sorted(skeleton.descendants(hand.wrist))
    thumbs = [j for j in below if "thumb" in skeleton.joints[j].lower()]
    top = hand.elbow if hand.elbow is not None else int(skeleton.parents[hand.wrist])
    forearm = wrist - points[top] if top >= 0 else np.zeros(3)
    length = float(np.linalg.norm(forearm))
    forward = unit(forearm)
    ends = [points[j] - wrist for j in below if j not in thumbs]
    ends = [e for e in ends if np.linalg.norm(e) > LEAST_REACH * length]
    if ends:
        end = unit(max(ends, key=lambda e: float(np.linalg.norm(e))))
        if not length or end @ forward > np.cos(np.radians(MOST_BENT_DEG)):
            forward = end
    if not forward.any():
        raise HandNotFoundError(
            f"Joint '{skeleton.joints[hand.wrist]}' has no bone before or after it at the bind "
            "pose, so the direction of the hand is unknown. The bind transforms are probably "
            "missing."
        )

    def across(v: Array) -> Array:
        return np.asarray(v - forward * (v @ forward))

    left = _to_the_left(points, arms, side, forward)
    facing = across(unit(np.cross(left, body.up)))
    inward = across(-left if side == "left" else left)
    radial = facing if np.linalg.norm(facing) > UNDECIDED_SINE else inward
    for thumb in thumbs:  # the outermost that stands off says it better
        away = across(points[thumb] - wrist)
        if np.linalg.norm(away) > 0.5 * LEAST_REACH * length:
            radial = away
    radial = unit(radial)
    flexion = radial if side == "right" else -radial
    return np.stack([np.cross(flexion, forward), flexion, forward], axis=1)


def _to_the_left(points: Array, arms: FingerlessArms, side: Side, forward: Array) -> Array:
    """Direction (3,) to the character's left, from both arms or from one and the body."""
    tops = {
        s: points[h.shoulder if h.shoulder is not None else h.wrist]
        for s, h in arms.character.hands.items()
    }
    if len(tops) == 2:
        return unit(tops["left"] - tops["right"])
    chest = arms.character.chest
    out = forward if chest is None else tops[side] - points[chest]
    return unit(out if side == "left" else -out)


def _size(skeleton: Skeleton, arms: FingerlessArms, shape: HandShape) -> float:
    """How many times larger the body is than the character of the hand."""
    own = _forearm(skeleton, arms.character.hands[shape.side])
    if own and shape.forearm:
        return own / shape.forearm
    return body_height(skeleton, arms.character) / shape.height


def _forearm(skeleton: Skeleton, hand: HandMap) -> float | None:
    if hand.elbow is None:
        return None
    points = skeleton.bind_positions
    return float(np.linalg.norm(points[hand.wrist] - points[hand.elbow])) or None


def _extended(
    skeleton: Skeleton, joints: list[str], parents: list[int], bind: Array, rest: Array
) -> Skeleton:
    more = len(joints) - len(skeleton)
    return replace(
        skeleton,
        joints=tuple(joints),
        parents=np.array(parents, dtype=np.intp),
        bind=bind,
        rest=rest,
        aliases=(*skeleton.aliases, *[""] * more) if skeleton.aliases else (),
        originals=(*skeleton.originals, *joints[-more:]) if skeleton.originals else (),
    )


def _followed(values: Array, still: Array) -> Array:
    """Curves (frames, joints, n) with joints behind them that do not move."""
    if values.strides[0] == 0:  # a view of one value stays one
        row = np.concatenate([values[0], still])
        return np.broadcast_to(row, (len(values), *row.shape))
    more = np.broadcast_to(still, (len(values), *still.shape))
    return np.concatenate([values, more], axis=1)
