"""A clip as the page needs it: bones with thickness, quantised motion, channel angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdhand.anatomy import Hands, Side
from usdhand.anatomy.hand import digit_joints
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.rotations import Array
from usdhand.problems import counted
from usdhand.report.preview.pack import Pack

if TYPE_CHECKING:
    from usdhand.formats.usd.skins import Skin
    from usdhand.reduce.rig import Relation

HAND_LENGTH = 18.0  # cm of the hand that thicknesses are given for
FINGER_RADIUS, PALM_RADIUS = 0.55, 0.4
BODY_RADIUS_SHARE = (0.10, 0.8, 3.2)  # of the bone's length; least and most, cm


@dataclass(frozen=True, eq=False)
class Lane:
    """One motion on the page.

    Attributes
    ----------
    hands : None where the character has none; ``notes`` say why
    shown : whether it is seen when the page opens
    relations : how a reduced rig in the file makes each channel
    warps : side -> (frames,) seconds of another clip that each frame shows
    retime : side -> (n, 2) seconds of the page and of this clip that belong together
    """

    name: str
    clip: Clip
    hands: Hands | None
    alternative: str = ""
    shown: bool = True
    skins: tuple[Skin, ...] = ()
    relations: tuple[Relation, ...] = ()
    warps: Mapping[Side, Array] = field(default_factory=dict)
    retime: Mapping[Side, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def lane_data(lane: Lane, pack: Pack, max_frames: int) -> dict[str, Any]:
    """A lane as plain data, its arrays put into ``pack``; a note says if it was decimated."""
    clip = lane.clip
    every = -(-len(clip) // max_frames)
    kept = slice(None, None, every)
    notes = list(lane.notes)
    if every > 1:
        notes.append(
            f"long clip: the page has every {_ordinal(every)} of {len(clip)} frames "
            f"({clip.fps / every:.3g} a second) and interpolates between them"
        )
    if clip.shears:
        notes.append(f"the page does not show the shear of {counted(len(clip.shears), 'joint')}")
    drawn = _drawn(clip.skeleton, lane.hands)
    positions = forward_kinematics(clip).positions[:: max(every, len(clip) // 600)]
    data: dict[str, Any] = {
        "name": lane.name,
        "alternative": lane.alternative,
        "shown": lane.shown,
        "fps": clip.fps / every,
        "file_fps": clip.fps,
        "frames": len(clip),
        "first_time_code": clip.origin.first_time_code,
        "time_codes_per_frame": clip.origin.time_codes_per_frame,
        "duration": clip.duration,
        "joints": list(clip.skeleton.names),
        "parents": clip.skeleton.parents.tolist(),
        "order": list(clip.skeleton.order),
        "rotations": [pack.rotations(clip.rotations[kept, j]) for j in _joints(clip)],
        "translations": [pack.curve(clip.translations[kept, j]) for j in _joints(clip)],
        "scales": {str(j): pack.curve(clip.scales[kept, j]) for j in sorted(scaled_joints(clip))},
        "bones": _bones(clip, lane.hands, drawn, positions),
        "view": _view(clip, lane.hands, drawn, positions),
        "hands": {},
        "meshes": [_mesh(skin, pack) for skin in lane.skins],
        "retime": {side: warp.round(4).tolist() for side, warp in lane.retime.items()},
        "relations": {r.name: _relation(r) for r in lane.relations},
        "notes": notes,
    }
    if lane.hands is not None:
        channels = lane.hands.encode(clip).select(lane.hands.model_names)
        curves = {
            n: pack.curve(channels.values[kept, i, None]) for i, n in enumerate(channels.names)
        }
        data["hands"] = {
            side: {
                "wrist": lane.hands.character.hands[side].wrist,
                "palm": frames.palm.tolist(),
                "size": _hand_length(clip.skeleton, lane.hands, side),
                "channels": {n: c for n, c in curves.items() if n[:2] == side[:2]},
            }
            for side, frames in lane.hands.frames.items()
        }
    return data


def _joints(clip: Clip) -> range:
    return range(len(clip.skeleton))


def _ordinal(number: int) -> str:
    return {2: "2nd", 3: "3rd"}.get(number, f"{number}th")


def _relation(relation: Relation) -> str:
    if relation.kind == "free":
        return "free"
    if relation.kind == "constant":
        return f"constant {relation.offset:.1f}\N{DEGREE SIGN}"
    terms = zip(relation.slopes, relation.controllers, strict=True)
    words = " ".join(f"{slope:+.2f} \N{MULTIPLICATION SIGN} {name}" for slope, name in terms)
    return f"= {words} {relation.offset:+.1f}\N{DEGREE SIGN}".replace("= +", "= ")


def _hand_length(skeleton: Skeleton, hands: Hands, side: Side) -> float:
    """Length of the longest digit from the wrist, cm, straightened."""
    own, frames = hands.character.hands[side], hands.frames[side]
    lengths = []
    for digit, tip in zip(frames.digits, frames.tips, strict=True):
        chain = [own.wrist, *(j for n, j in own.joints.items() if n.startswith(digit))]
        steps = np.diff(skeleton.bind_positions[chain], axis=0)
        lengths.append(np.linalg.norm(steps, axis=1).sum() + np.linalg.norm(tip))
    return float(max(lengths))


def _bones(
    clip: Clip, hands: Hands | None, drawn: Sequence[int], positions: Array
) -> list[dict[str, Any]]:
    """Bones from a joint to a point in its axes: {joint, to, radius, part, child, loose}.

    Loose ones end wherever their child is, which does not hang off the joint; of ``to`` only the
    length is theirs.
    """
    skeleton = clip.skeleton
    offsets = clip.translations.mean(axis=0)
    own, along = _hand_joints(skeleton, hands), _along_digits(skeleton, hands)
    tall = float(np.ptp(positions[:, drawn, 1].mean(axis=0))) or 1.0
    bones = []
    for child in drawn:
        loose = child in along
        parent = along.get(child, int(skeleton.parents[child]))
        apart = np.linalg.norm(positions[:, child] - positions[:, parent], axis=1).mean()
        offset = np.array([0.0, apart, 0.0]) if loose else offsets[child]
        length = float(np.linalg.norm(offset))
        if parent not in drawn or length < 1e-3 * min(tall, 100.0):
            continue
        part, radius = own.get(child, ("body", 0.0))
        if part == "body":
            share, least, most = BODY_RADIUS_SHARE
            radius = float(np.clip(share * length, least, most)) * min(tall / 150.0, 1.0)
        bones.append(_bone(parent, offset, radius, part, child) | {"loose": loose})
    starts = {bone["joint"] for bone in bones}
    for side, frames in (hands.frames if hands else {}).items():
        size = _hand_length(skeleton, hands, side) / HAND_LENGTH if hands else 1.0
        for digit, tip in zip(frames.digits, frames.tips, strict=True):
            last = frames.last_joint(digit)
            if not skeleton.children[last] and last not in starts:
                bones.append(_bone(last, tip, FINGER_RADIUS * size, side, last))
    return bones


def _bone(joint: int, to: Array, radius: float, part: str, child: int) -> dict[str, Any]:
    return {
        "joint": joint,
        "to": [round(float(x), 4) for x in to],
        "radius": round(radius, 4),
        "part": part,
        "child": child,
        "loose": False,
    }


def _hand_joints(skeleton: Skeleton, hands: Hands | None) -> dict[int, tuple[str, float]]:
    """Joints of the hands and all below them -> side and radius of the bone that leads there."""
    found: dict[int, tuple[str, float]] = {}
    for side in hands.frames if hands else ():
        assert hands is not None
        own = hands.character.hands[side]
        size = _hand_length(skeleton, hands, side) / HAND_LENGTH
        firsts = {j for n, j in own.joints.items() if n.endswith("MCP") and "Thumb" not in n}
        palm = {*firsts, *own.metacarpals.values(), own.joints.get("ThumbCMC", -1)}
        parts = {*own.joints.values(), *own.metacarpals.values(), *own.tips.values()}
        for joint in range(len(skeleton)):
            if joint in parts or not {own.wrist, *parts}.isdisjoint(skeleton.ancestors(joint)):
                radius = PALM_RADIUS if joint in palm else FINGER_RADIUS
                found[joint] = (side, radius * size)
    return found


def _along_digits(skeleton: Skeleton, hands: Hands | None) -> dict[int, int]:
    """Joints of digits -> the one before, the wrist for the first, where they hang off another."""
    found: dict[int, int] = {}
    for own in hands.character.hands.values() if hands else ():
        for digit in own.digits:
            joints = [
                j for n in digit_joints(digit) if (j := own.joints.get(digit + n)) is not None
            ]
            before = [own.metacarpals[digit]] if digit in own.metacarpals else []
            after = [own.tips[digit]] if digit in own.tips else []
            for above, joint in pairwise([own.wrist, *before, *joints, *after]):
                if above not in skeleton.ancestors(joint):
                    found[joint] = above
    return found


def _drawn(skeleton: Skeleton, hands: Hands | None) -> tuple[int, ...]:
    """Joints of the body: none above the hips, nor of trees that have neither hips nor a hand.

    A bone from a root on the floor is none, and targets of eyes and feet are no body.
    """
    if hands is None:
        return tuple(range(len(skeleton)))
    hips = hands.character.hips
    own = [] if hips is None else [hips]
    for hand in hands.character.hands.values():
        own += [hand.wrist, *hand.joints.values(), *hand.metacarpals.values(), *hand.tips.values()]
    above = set() if hips is None else set(skeleton.ancestors(hips))
    roots = {(joint, *skeleton.ancestors(joint))[-1] for joint in own}
    return tuple(
        joint
        for joint in range(len(skeleton))
        if (joint, *skeleton.ancestors(joint))[-1] in roots and joint not in above
    )


def _view(
    clip: Clip, hands: Hands | None, drawn: Sequence[int], positions: Array
) -> dict[str, Any]:
    """Where a camera for the whole body looks: middle and size of the motion, and the front."""
    body = positions[:, drawn]
    low, high = body.min(axis=(0, 1)), body.max(axis=(0, 1))
    one = np.ptp(body[0], axis=0)
    reach = float(np.linalg.norm(one))
    travels = float(np.linalg.norm((high - low)[[0, 2]])) > 1.8 * reach
    follow = _middle_joint(clip, hands) if travels else None
    size = max(reach if travels else float((high - low).max()), 1.0)
    above = 0.1 * size  # heads are higher than their joints
    return {
        "centre": [float(x) for x in (low + high) / 2 + [0.0, above / 2, 0.0]],
        "size": size + above,
        "floor": float(low[1]),
        "follow": follow,
        "yaw": _facing(hands, positions) if hands else 0.0,
    }


def _middle_joint(clip: Clip, hands: Hands | None) -> int:
    hips = hands.character.hips if hands else None
    return clip.skeleton.order[0] if hips is None else hips


def _facing(hands: Hands, positions: Array) -> float:
    """Angle about Y by which the character is turned away from +Z, radians."""
    pair = hands.character.hands
    if len(pair) < 2:
        return 0.0
    ends = {s: _or(m.shoulder, m.wrist) for s, m in pair.items()}
    across = (positions[:, ends["left"]] - positions[:, ends["right"]]).mean(axis=0)
    if np.linalg.norm(across[[0, 2]]) < 1e-6:
        return 0.0
    return float(np.arctan2(-across[2], across[0]))


def _or(joint: int | None, other: int) -> int:
    return other if joint is None else joint


def _mesh(skin: Skin, pack: Pack) -> dict[str, Any]:
    return {
        "name": skin.name,
        "points": pack.curve(skin.points),
        "triangles": pack.integers(skin.triangles),
        "joints": pack.integers(skin.joints),
        "weights": pack.integers(_shares(skin.weights)),
        "inverse_bind": np.swapaxes(skin.inverse_bind, 1, 2).round(6).reshape(-1).tolist(),
        "colour": [round(x, 4) for x in skin.colour],
    }


def _shares(weights: Array) -> NDArray[np.intp]:
    """Weights as whole 255ths that sum to 255 a point."""
    whole = np.floor(weights * 255).astype(np.intp)
    whole[:, 0] += 255 - whole.sum(axis=1)
    return whole


def unshown(skins: Sequence[Skin], max_points: int) -> str | None:
    """Say why the meshes of a character are left out; None if they are small enough."""
    points = sum(len(s.points) for s in skins)
    if points <= max_points:
        return None
    return f"the mesh is not shown: {points} points, more than {max_points}"
