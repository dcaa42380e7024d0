"""A UsdSkel character read into a Clip: centimetres, seconds, Y up."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdSkel

from usdhand.errors import InputError
from usdhand.formats.usd.bindings import unapplied_bindings, why_nothing_is_bound
from usdhand.formats.usd.clock import clock_at
from usdhand.formats.usd.curves import (
    Finish,
    Tracks,
    finish_rotations,
    finish_vectors,
    frame_timing,
    joint_targets,
    read_curve,
    type_problems,
)
from usdhand.formats.usd.damage import first_line, refuses_damage, usd_diagnostics
from usdhand.formats.usd.names import name_problems, with_names
from usdhand.formats.usd.poses import authored_poses, placed_skeleton
from usdhand.formats.usd.samples import Track, steady
from usdhand.formats.usd.stage import Character, find_character
from usdhand.formats.usd.world import World, world_above, world_problems
from usdhand.motion import Clip, Origin, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.motion.clip import shears_of
from usdhand.motion.plausible import check_clip
from usdhand.motion.rotations import Array
from usdhand.motion.timing import FASTEST_FPS, SLOWEST_FPS
from usdhand.motion.transforms import compose_trs, decompose, with_even_signs
from usdhand.problems import Problem, counted

LATEST_TIME_CODE = 1e12


def read_clip(path: str | Path, skel: str | None = None) -> Clip:
    """Read the motion of one character.

    Parameters
    ----------
    path : a .usd, .usda, .usdc or .usdz file
    skel : path or name of the skeleton where there are several

    Returns
    -------
    Clip
        with everything that is odd about the file in ``problems``.

    Raises
    ------
    InputError
        if the file, skeleton or animation cannot be used.
    UsageError
        if there are several skeletons and none is chosen.
    """
    return clip_from_character(find_character(Path(path), skel))


def read_character(path: str | Path, skel: str | None = None) -> Clip:
    """Read a character that may have no motion: a clip of one frame at its bind pose.

    Raises the same errors as `read_clip`, except for a missing animation.
    """
    return bind_pose_clip(find_character(Path(path), skel))


@refuses_damage
def clip_from_character(character: Character) -> Clip:
    """Read the motion of a character that was found on a stage; see `read_clip`."""
    return _checked(_animated_clip, character)


def motion_or_pose(character: Character) -> tuple[Clip, bool]:
    """A character's motion, or its bind pose where it has none; and whether it moves."""
    if character.animation is None:
        return bind_pose_clip(character), False
    return clip_from_character(character), True


@refuses_damage
def bind_pose_clip(character: Character) -> Clip:
    """Return one frame of a character at its bind pose, whether it is animated or not."""
    return _checked(_still_clip, character)


def _checked(read: Callable[[Character], Clip], character: Character) -> Clip:
    """Read a clip; what USD prints on the way are problems of it."""
    with usd_diagnostics() as messages:
        clip = read(character)
    check_clip(clip, character.path)
    said = (Problem("usd", first_line(message)) for message in messages)
    return replace(clip, problems=(*clip.problems, *said))


def _animated_clip(character: Character) -> Clip:
    if character.animation is None:
        raise InputError(f"{character.path}: {why_nothing_is_bound(character.skeleton)}")
    animation = UsdSkel.Animation(character.animation)
    joints = _joints(character)
    parents = parents_from_paths(joints)
    targets = _targets(character, animation, joints)
    tracks = Tracks.of(animation, len(targets))
    _check_times(character, tracks)
    timing, resampled = frame_timing(character.stage, tracks.times)
    times = timing.times
    world = world_above(character.skeleton, times)
    poses, missing = authored_poses(character, len(joints), world.scale)
    neutral = decompose(poses.neutral_locals(parents))
    rotations, translations, scales = _curves(
        tracks.at(times), joints, targets, neutral, world.scale, len(times)
    )
    rotations, scales = with_even_signs(rotations, scales)
    q, t = _place(rotations, translations, parents, world)
    shears = shears_of(neutral[3])
    shears = {j: shear for j, shear in shears.items() if j not in targets}
    first = _matrices(t[0], q[0], scales[0], shears)
    skeleton, repaired = placed_skeleton(joints, parents, poses, world, first)
    skeleton = with_names(skeleton, character.skeleton)
    origin = replace(
        _origin(character, world),
        first_time_code=timing.start,
        time_codes_per_frame=timing.step,
        animation_path=str(animation.GetPath()),
    )
    clock, unread = clock_at(character.stage, timing.start)
    origin = replace(origin, clock=clock)
    problems = (
        *character.problems,
        *unapplied_bindings(character.skeleton),
        *name_problems(joints, str(character.skeleton.GetPath())),
        *world_problems(character.skeleton, times),
        *_animation_problems(animation, joints, targets, tracks),
        *missing,
        *resampled,
        *repaired,
        *unread,
    )
    if not SLOWEST_FPS <= timing.fps <= FASTEST_FPS:
        raise InputError(
            f"{character.path}: {timing.fps:g} frames a second are not plausible; check "
            f"timeCodesPerSecond ({origin.time_codes_per_second:g})."
        )
    name = character.path.stem
    return Clip(skeleton, q, t, scales, timing.fps, name, origin, problems, character, shears)


def _check_times(character: Character, tracks: Tracks) -> None:
    """Refuse time codes that cannot be meant, before frames are counted with them."""
    for times in tracks.times:
        if len(times) and not max(abs(times[0]), abs(times[-1])) < LATEST_TIME_CODE:
            raise InputError(
                f"{character.path}: the animation has time codes from {times[0]:g} to "
                f"{times[-1]:g}, which are not plausible."
            )


def _still_clip(character: Character) -> Clip:
    joints = _joints(character)
    parents = parents_from_paths(joints)
    world = world_above(character.skeleton)
    poses, missing = authored_poses(character, len(joints), world.scale)
    moved, turned, scales, sheared = decompose(poses.bind_locals(parents)[None])
    q, t = _place(turned, moved.copy(), parents, world)
    shears = shears_of(sheared[0])
    first = _matrices(t[0], q[0], scales[0], shears)
    skeleton, repaired = placed_skeleton(joints, parents, poses, world, first)
    skeleton = with_names(skeleton, character.skeleton)
    problems = (
        *character.problems,
        *name_problems(joints, str(character.skeleton.GetPath())),
        *world_problems(character.skeleton),
        *missing,
        *repaired,
    )
    origin = _origin(character, world)
    fps = origin.time_codes_per_second
    name = character.path.stem
    return Clip(skeleton, q, t, scales, fps, name, origin, problems, character, shears)


def _matrices(t: Array, q: Array, scales: Array, shears: Mapping[int, Array]) -> Array:
    """Joint-to-parent matrices (joints, 4, 4) of one frame."""
    found = compose_trs(t, q, scales)
    for joint, shear in shears.items():
        found[joint, :3, :3] = found[joint, :3, :3] @ shear
    return found


def _targets(
    character: Character, animation: UsdSkel.Animation, joints: tuple[str, ...]
) -> NDArray[np.intp]:
    targets = joint_targets(animation, joints)
    where = f"{character.path}: {animation.GetPath()}"
    if not (targets >= 0).any():
        raise InputError(
            f"{where} animates none of the {counted(len(joints), 'joint')} of "
            f"{character.skeleton.GetPath()}."
        )
    if not animation.GetRotationsAttr().HasAuthoredValue():
        raise InputError(f"{where} has no rotations.")
    return targets


def _curves(
    tracks: Tracks,
    joints: tuple[str, ...],
    targets: NDArray[np.intp],
    neutral: tuple[Array, Array, Array, Array],
    unit: float,
    frames: int,
) -> tuple[Array, Array, Array]:
    """Rotations, translations in cm and scales, the neutral pose where there are none.

    What does not move is a view of one row for all frames.
    """
    moved, turned, scaled, _ = neutral

    def curve(track: Track | None, unmoved: Array, finish: Finish, unit: float = 1.0) -> Array:
        if track is None:
            values = unmoved[None]
        else:
            values = read_curve(track, joints, targets, unmoved / unit, finish)
        return (
            values
            if len(values) == frames
            else np.broadcast_to(values[0], (frames, *unmoved.shape))
        )

    return (
        curve(tracks.rotations, turned, finish_rotations),
        curve(tracks.translations, moved, finish_vectors(unit), unit),
        curve(tracks.scales, scaled, finish_vectors(1.0)),
    )


def _animation_problems(
    animation: UsdSkel.Animation,
    joints: tuple[str, ...],
    targets: NDArray[np.intp],
    tracks: Tracks,
) -> Iterator[Problem]:
    where = str(animation.GetPath())
    unknown = np.flatnonzero(targets < 0)
    if len(unknown):
        example = animation.GetJointsAttr().Get()[int(unknown[0])]
        message = f"{len(unknown)} animated joints are not in the skeleton, e.g. '{example}'"
        yield Problem("unknown-joints", message, where)
    still = len(joints) - len(np.unique(targets[targets >= 0]))
    if still:
        message = f"{still} joints are not animated and keep their rest transform"
        yield Problem("fewer-joints", message, where, "note")
    yield from type_problems(tracks, where)
    so = "so USD shows the rest pose; the rotations are read all the same"
    if tracks.translations is None:
        yield Problem("missing-translations", f"the animation has no translations, {so}", where)
    if tracks.scales is None:
        yield Problem("missing-scales", f"the animation has no scales, {so}", where)


def _origin(character: Character, world: World) -> Origin:
    stage = character.stage
    return Origin(
        path=character.path,
        skeleton_path=str(character.skeleton.GetPath()),
        time_codes_per_second=stage.GetTimeCodesPerSecond(),
        first_time_code=stage.GetStartTimeCode(),
        cm_per_unit=world.scale,
        up_axis=str(UsdGeom.GetStageUpAxis(stage)),
    )


def _joints(character: Character) -> tuple[str, ...]:
    tokens = UsdSkel.Skeleton(character.skeleton).GetJointsAttr().Get()
    joints = tuple(str(token) for token in tokens or ())
    where = f"{character.path}: {character.skeleton.GetPath()}"
    if not joints:
        raise InputError(f"{where} lists no joints.")
    if len(set(joints)) != len(joints):
        double = next(j for j in joints if joints.count(j) > 1)
        raise InputError(f"{where} lists the joint '{double}' twice.")
    return joints


def _place(q: Array, t: Array, parents: NDArray[np.intp], world: World) -> tuple[Array, Array]:
    """Root joints moved by what stands above them, in place where the arrays allow it."""
    if np.allclose(world.rotation, np.eye(3)) and np.allclose(world.translation, 0.0):
        return q, t
    roots = np.flatnonzero(parents < 0)
    above = rot.from_matrix(world.rotation)[:, None]
    turned = rot.make_continuous(rot.multiply(above, q[:, roots]))
    moved = rot.rotate(above, t[:, roots]) + world.translation[:, None]
    return _with_roots(q, roots, turned), _with_roots(t, roots, moved)


def _with_roots(values: Array, roots: NDArray[np.intp], moved: Array) -> Array:
    if values.strides[0] == 0 and steady(moved):  # a view of one value stays one
        row = values[:1].copy()
        row[:, roots] = moved[:1]
        return np.broadcast_to(row[0], values.shape)
    values = values if values.flags.writeable else values.copy()
    values[:, roots] = moved
    return values
