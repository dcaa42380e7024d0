"""One anatomical motion on rigs that are built in different ways: what channels must not notice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from builders.rigs import HAND, METACARPALS, Joint, Parents, Places, parents, places

from usdhand.anatomy.channels import Channels, all_channels, decode
from usdhand.anatomy.frames import HandFrames, hand_frames
from usdhand.anatomy.hand import DIGITS, SIDES, HandMap, Side
from usdhand.motion import Clip, Skeleton, forward_kinematics, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array

Index = Mapping[Joint, int]
Turns = Mapping[Joint, Array]  # (frames, 4) by how much a joint's part of the body has turned


def random_rotations(random: np.random.Generator, *shape: int) -> Array:
    """Uniformly distributed unit quaternions (..., 4)."""
    return rot.normalize(random.normal(size=(*shape, 4)))


def skeleton(
    above: Parents | None = None, at: Places | None = None, axes: int | None = None
) -> tuple[Skeleton, dict[Joint, int]]:
    """Rig with these joints; with ``axes`` (a seed) every joint has random axes and rest."""
    above, at = above or parents(), at or places()

    def path(joint: Joint) -> str:
        side, role = joint
        parent = above[joint]
        return (f"{path(parent)}/" if parent else "") + f"{side or 'mid'}{role}"

    joints = list(above)
    order = parents_from_paths([path(j) for j in joints])
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    rest = bind.copy()
    bind[:, :3, 3] = [at[j] for j in joints]
    if axes is not None:
        random = np.random.default_rng(axes)
        bind[:, :3, :3] = rot.to_matrix(random_rotations(random, len(joints)))
        rest[:, :3, :3] = rot.to_matrix(random_rotations(random, len(joints)))
    paths = tuple(path(j) for j in joints)
    return Skeleton(paths, order, bind, rest), {j: i for i, j in enumerate(joints)}


def hand_map(index: Index, side: Side) -> HandMap:
    """The map of a hand whose joints are known."""
    return HandMap(
        side,
        index[side, "wrist"],
        {n: index[side, n] for n in HAND if (side, n) in index},
        {m[:-10]: index[side, m] for m in METACARPALS if (side, m) in index},
        {d: index[side, d + "Tip"] for d in DIGITS if (side, d + "Tip") in index},
        elbow=index.get((side, "elbow")),
    )


def frames_of(rig: Skeleton, index: Index, side: Side, *clips: Clip) -> HandFrames:
    return hand_frames(rig, hand_map(index, side), *clips)


def at_bind(rig: Skeleton, frames: int = 1) -> Clip:
    """A clip that stays in the bind pose."""
    bind, parent = rig.bind, rig.parents
    local = np.array(
        [b if p < 0 else np.linalg.inv(bind[p]) @ b for b, p in zip(bind, parent, strict=True)]
    )
    q = rot.from_matrix(local[:, :3, :3])
    return Clip(
        rig,
        np.tile(q, (frames, 1, 1)),
        np.tile(local[:, :3, 3], (frames, 1, 1)),
        np.ones((frames, len(rig), 3)),
        30.0,
    )


def random_turns(frames: int, seed: int) -> dict[Joint, Array]:
    """A smooth motion of arms, wrists and all hand joints, the same gesture on both sides."""
    rig, index = skeleton()
    clip = at_bind(rig, frames)
    for side in SIDES:
        f = frames_of(rig, index, side)
        clip = decode(
            Channels(all_channels(side, f.names), gesture(frames, len(f.names), seed)), clip, f
        )
    rotations = clip.rotations.copy()
    arm = np.cumsum(0.1 * np.random.default_rng(seed).normal(size=(frames, 2, 3)), axis=0)
    for i, role in enumerate(("elbow", "wrist")):
        angle = np.linalg.norm(arm[:, i], axis=-1)
        q = rot.from_axis_angle(arm[:, i] / angle[:, None], angle)
        rotations[:, index["left", role]] = q
        rotations[:, index["right", role]] = mirrored(q)
    pose = forward_kinematics(replace(clip, rotations=rotations))
    moving = [(s, r) for s in SIDES for r in ("elbow", "wrist", *HAND)]
    return {joint: pose.rotation(index[joint]) for joint in moving}


def gesture(frames: int, joints: int, seed: int) -> Array:
    """Angles (frames, 3 joints) in degrees, well away from gimbal lock."""
    random = np.random.default_rng(seed)
    speed, phase = random.uniform(0.05, 0.3, (2, 3 * joints))
    return (
        60.0
        * random.uniform(-1, 1, 3 * joints)
        * np.sin(np.arange(frames)[:, None] * speed + 20 * phase)
    )


def mirrored(q: Array) -> Array:
    """Rotations (..., 4) as seen in a mirror across the x axis."""
    return q * np.array([1.0, -1.0, -1.0, 1.0])


def moved(rig: Skeleton, index: Index, turns: Turns, above: Parents | None = None) -> Clip:
    """The clip that turns the parts of the body this way, whatever the joints' axes.

    ``above`` says whom a joint without a turn of its own moves with.
    """
    above = {**parents(), **(above or {})}
    frames = len(next(iter(turns.values())))
    still = np.tile(rot.IDENTITY, (frames, 1))
    world = np.empty((frames, len(rig), 4))
    for joint, i in index.items():
        part: Joint | None = joint
        while part is not None and part not in turns:
            part = above[part]
        turn = still if part is None else turns[part]
        world[:, i] = rot.multiply(turn, rot.from_matrix(rig.bind_rotations[i]))
    local = world.copy()
    for i, p in enumerate(rig.parents):
        if p >= 0:
            local[:, i] = rot.multiply(rot.conjugate(world[:, p]), world[:, i])
    return at_bind(rig, frames).with_rotations(rot.make_continuous(local))
