"""A UsdSkel character read into a Clip: centimetres, seconds, Y up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdSkel

from usdhand.errors import InputError
from usdhand.formats.usd.poses import AuthoredPoses, authored_poses, local_matrices, placed_skeleton
from usdhand.formats.usd.samples import Samples, read_samples
from usdhand.formats.usd.stage import Character, find_character
from usdhand.formats.usd.world import World, world_above, world_problems
from usdhand.motion import Clip, Origin, Problem, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.motion.resample import interpolate, interpolate_rotations
from usdhand.motion.rotations import Array

UNIT_NORM_TOLERANCE = 1e-6  # of the squared norm: what rounding to float32 leaves
STEADY_TOLERANCE = 1e-3  # frames: how far samples may lie off a steady grid
SLOWEST_NATIVE_FPS = 12.0  # sparser samples are keys of curves, not frames
FASTEST_TIME_CODES = 240.0  # above, time codes are ticks rather than frames


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


@dataclass(frozen=True, eq=False)
class FileMotion:
    """Motion as the file has it: its own units, axes and signs, a row a frame.

    ``times`` (frames,) are time codes; constant curves are views of one row.
    """

    joints: tuple[str, ...]
    parents: NDArray[np.intp]
    times: Array
    rotations: Array
    translations: Array
    scales: Array
    poses: AuthoredPoses
    problems: tuple[Problem, ...]


def read_file_motion(character: Character) -> FileMotion:
    """Read the animation of a character without moving it to the world; see `read_clip`."""
    prim = character.animation
    if prim is None:
        raise InputError(
            f"{character.path}: no animation is bound to {character.skeleton.GetPath()}. "
            "Bind a SkelAnimation with skel:animationSource."
        )
    joints = _joints(character)
    parents = parents_from_paths(joints)
    problems = [*character.problems, *world_problems(character.skeleton)]
    animation = UsdSkel.Animation(prim)
    target = _joint_targets(character, animation, joints, problems)
    scale = world_above(character).scale
    poses, missing = authored_poses(character, len(joints), scale)
    problems += missing
    neutral = poses.neutral_locals(parents)
    neutral_translations = neutral[:, :3, 3] / scale

    rotations = read_samples(
        animation.GetRotationsAttr(), 4, target, rot.from_matrix(neutral[:, :3, :3])
    )
    if rotations is None:
        raise InputError(f"{character.path}: {prim.GetPath()} has no rotations.")
    translations = read_samples(animation.GetTranslationsAttr(), 3, target, neutral_translations)
    scales = read_samples(animation.GetScalesAttr(), 3, target, np.ones((len(joints), 3)))
    if translations is None:
        problems.append(
            Problem(
                "missing-translations",
                "the animation has no translations, so USD shows the rest pose; the rotations are "
                "read all the same, with the rest pose's translations",
                str(prim.GetPath()),
            )
        )
        translations = Samples(np.empty(0), neutral_translations[None])
    if scales is None:
        problems.append(
            Problem("missing-scales", "the animation has no scales", str(prim.GetPath()))
        )
        scales = Samples(np.empty(0), np.ones((1, len(joints), 3)))
    _check_numbers(character, rotations, translations, scales, joints)
    times = _frame_times(character, (rotations, translations, scales), problems)
    return FileMotion(
        joints,
        parents,
        times,
        _at_times(rotations, times, interpolate_rotations),
        _at_times(translations, times, interpolate),
        _at_times(scales, times, interpolate),
        poses,
        tuple(problems),
    )


def clip_from_character(character: Character) -> Clip:
    """Read the motion of a character that was found on a stage; see `read_clip`."""
    motion = read_file_motion(character)
    times = motion.times
    world = world_above(character, times)
    q, t = _place(rot.make_continuous(motion.rotations), motion.translations, motion.parents, world)
    skeleton, repaired = placed_skeleton(
        motion.joints, motion.parents, motion.poses, world, local_matrices(q[0], t[0])
    )
    step = float(times[1] - times[0]) if len(times) > 1 else 1.0
    origin = replace(
        _origin(character, world),
        first_time_code=float(times[0]),
        time_codes_per_frame=step,
        animation_path=str(character.animation.GetPath()),
    )
    fps = origin.time_codes_per_second / step
    problems = (*motion.problems, *repaired)
    return Clip(skeleton, q, t, motion.scales, fps, character.path.stem, origin, problems)


def bind_pose_clip(character: Character) -> Clip:
    """Return one frame of a character at its bind pose, whether it is animated or not."""
    joints = _joints(character)
    parents = parents_from_paths(joints)
    world = world_above(character)
    poses, missing = authored_poses(character, len(joints), world.scale)
    local = poses.bind_locals(parents)
    q, t = _place(
        rot.from_matrix(local[None, :, :3, :3]), local[None, :, :3, 3] / world.scale, parents, world
    )
    skeleton, repaired = placed_skeleton(joints, parents, poses, world, local_matrices(q[0], t[0]))
    problems = (*character.problems, *world_problems(character.skeleton), *missing, *repaired)
    origin = _origin(character, world)
    fps = origin.time_codes_per_second
    return Clip(skeleton, q, t, np.ones_like(t), fps, character.path.stem, origin, problems)


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


def _joint_targets(
    character: Character,
    animation: UsdSkel.Animation,
    joints: tuple[str, ...],
    problems: list[Problem],
) -> NDArray[np.intp]:
    listed = [str(token) for token in animation.GetJointsAttr().Get() or ()]
    index = {joint: i for i, joint in enumerate(joints)}
    target = np.array([index.get(joint, -1) for joint in listed], dtype=np.intp)
    where = str(animation.GetPath())
    if not len(target) or (target < 0).all():
        raise InputError(
            f"{character.path}: {where} animates none of the {len(joints)} joints of "
            f"{character.skeleton.GetPath()}."
        )
    unknown = [joint for joint in listed if joint not in index]
    if unknown:
        problems.append(
            Problem(
                "unknown-joints",
                f"{len(unknown)} animated joints are not in the skeleton, e.g. '{unknown[0]}'",
                where,
            )
        )
    if len(set(listed)) < len(joints):
        still = len(joints) - len(set(listed) & set(joints))
        if still:
            problems.append(
                Problem("fewer-joints", f"{still} joints are not animated and stay at rest", where)
            )
    return target


def _check_numbers(
    character: Character,
    rotations: Samples,
    translations: Samples,
    scales: Samples,
    joints: tuple[str, ...],
) -> None:
    """Refuse values that are no motion; bring quaternions to unit length in place."""

    def refuse(samples: Samples, bad: NDArray[np.bool_], what: str) -> None:
        frame, joint = (int(i) for i in np.argwhere(bad)[0])
        at = f"time code {samples.times[frame]:g}" if len(samples.times) else "the default value"
        raise InputError(
            f"{character.path}: {what} of joint '{joints[joint]}' at {at} "
            f"({int(bad.sum())} such values). Repair or export the animation again."
        )

    norms = np.einsum("tji,tji->tj", rotations.values, rotations.values)
    if not np.isfinite(norms).all():
        refuse(rotations, ~np.isfinite(norms), "not-a-number in the rotation")
    if norms.min() < 1e-6:
        refuse(rotations, norms < 1e-6, "zero-length quaternion in the rotation")
    if np.abs(norms - 1.0).max() > UNIT_NORM_TOLERANCE:
        rotations.values[:] /= np.sqrt(norms)[..., None]
    for samples, name in ((translations, "translation"), (scales, "scale")):
        if not np.isfinite(samples.values.sum()):
            refuse(samples, ~np.isfinite(samples.values).all(axis=2), f"not-a-number in the {name}")


def _frame_times(
    character: Character, samples: tuple[Samples, ...], problems: list[Problem]
) -> Array:
    """Time codes of the clip's frames: the file's own where they are steady, else a steady grid."""
    authored = [s.times for s in samples if len(s.times)]
    stage = character.stage
    if not authored:
        return np.array([stage.GetStartTimeCode()])
    times = np.unique(np.concatenate(authored).round(9))
    if len(times) == 1:
        return times
    per_second = stage.GetTimeCodesPerSecond()
    frame = 1.0 if per_second <= FASTEST_TIME_CODES else per_second / stage.GetFramesPerSecond()
    step = (times[-1] - times[0]) / (len(times) - 1)
    steady = np.abs(np.diff(times) - step).max() < STEADY_TOLERANCE * step
    if steady and per_second / step >= SLOWEST_NATIVE_FPS:
        return np.asarray(times)
    shortest = float(np.diff(times).min())
    on_grid = np.abs((times - times[0]) / shortest - np.round((times - times[0]) / shortest)).max()
    if on_grid < STEADY_TOLERANCE and frame / 20 <= shortest < frame:
        frame = shortest
    problems.append(
        Problem(
            "resampled",
            f"{len(times)} samples are not a steady sequence of frames: read every {frame:g} time "
            "codes, interpolated as USD does",
        )
    )
    count = int(np.floor((times[-1] - times[0]) / frame + 1e-6)) + 1
    return np.asarray(times[0] + frame * np.arange(count))


def _at_times(
    samples: Samples, times: Array, interpolation: Callable[[Array, Array], Array]
) -> Array:
    if not len(samples.times):
        return np.broadcast_to(samples.values[0], (len(times), *samples.values.shape[1:]))
    if len(samples.times) == len(times) and np.allclose(samples.times, times, rtol=0, atol=1e-6):
        return samples.values
    frames = np.interp(times, samples.times, np.arange(len(samples.times)))
    return interpolation(samples.values, frames)


def _place(q: Array, t: Array, parents: NDArray[np.intp], world: World) -> tuple[Array, Array]:
    """Translations in cm, and the root joints moved by what stands above them."""
    if world.scale != 1.0:
        constant = t.strides[0] == 0  # a broadcast view of one pose
        t = np.broadcast_to(t[0] * world.scale, t.shape) if constant else t * world.scale
    if np.allclose(world.rotation, np.eye(3)) and np.allclose(world.translation, 0.0):
        return q, t
    q, t = (a if a.flags.writeable else a.copy() for a in (q, t))
    roots = np.flatnonzero(parents < 0)
    above = rot.from_matrix(world.rotation)[:, None]
    q[:, roots] = rot.multiply(above, q[:, roots])
    t[:, roots] = rot.rotate(above, t[:, roots]) + world.translation[:, None]
    return q, t
