"""A BVH file read into a Clip: centimetres, seconds, Y up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from usdhand.errors import InputError, UsageError
from usdhand.formats.bvh.file import BvhFile, parse_file
from usdhand.formats.bvh.hierarchy import Hierarchy
from usdhand.formats.bvh.motion import local_motion, local_translations
from usdhand.formats.bvh.pose import choose_bind, posed_skeleton
from usdhand.formats.guess import guess_units, guess_up
from usdhand.formats.reading import DEFAULT, Reading
from usdhand.motion import Clip, Origin, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import IDENTITY, Y_UP_FROM_Z_UP, Array
from usdhand.problems import Problem, counted, listed

LOOKED_AT = 40  # frames that the up axis is guessed from
# Joints times frames that need as much memory as any motion; more only if most joints move.
PLENTY = 10_000_000
STILL_JOINTS = 4  # joints a channel, at most, beyond that
NEAR_ZERO = 0.25  # of the OFFSET
COLLAPSED = 0.5  # of all joints, with positions near zero: no body has that pose


def read_clip(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read a BVH file.

    The channels of a joint turn it in their order, the first outermost; its position channels stand
    in place of its OFFSET, or are added to it (`Reading.positions`). End Sites are joints named
    after the one that they end, ``Head_End``. The bind pose is the one of all channels zero; where
    no body stands in that, the first frame in which it does. What the file does not say is guessed,
    and said in ``problems``.

    Parameters
    ----------
    reading : ``skel`` is one of several ROOTs, without it all together are one skeleton;
        ``animation`` is None or the file's stem; units and up axis are guessed if they are None

    Raises
    ------
    InputError
        if the file is damaged or has no motion, naming the line.
    UsageError
        if the skeleton or animation is not in the file.
    """
    if reading.animation not in (None, *animation_names(path)):
        raise UsageError(f"{path} has one animation, '{path.stem}', and no '{reading.animation}'.")
    clip = _posed(path, reading)
    if not len(clip):
        raise InputError(f"{path} has no motion: it has no frames or no channels.")
    return clip


def read_character(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read a BVH file that may have no motion: a clip of one frame at its bind pose.

    Parameters and errors are those of `read_clip`.
    """
    clip = _posed(path, reading)
    rest = clip.skeleton.rest[None]
    translations = rest[:, :, :3, 3].copy()
    return replace(
        clip,
        rotations=rot.from_matrix(rest[:, :, :3, :3]),
        translations=translations,
        scales=np.ones_like(translations),
    )


def animation_names(path: Path) -> tuple[str, ...]:
    """Names of the animations in a file: one, the file's stem."""
    return (path.stem,)


def _posed(path: Path, reading: Reading) -> Clip:
    """The motion, which may have no frames, with its bind pose."""
    file = _chosen(parse_file(path), reading.skel, path)
    cm_per_unit: float | None = reading.cm_per_unit
    up: str | None = reading.up
    hierarchy, rows = file.hierarchy, file.rows
    _check_size(path, hierarchy, len(rows))
    rotations, translations = local_motion(hierarchy, rows)
    near = _near_zero(hierarchy, translations) if reading.positions is None else []
    collapsed = len(near) > COLLAPSED * len(hierarchy.joints)
    if reading.positions == "add" or collapsed:
        translations = local_translations(hierarchy, rows, added=True)
    problems = [*file.problems, *_channel_problems(hierarchy, near, collapsed)]
    if cm_per_unit is None:
        cm_per_unit, guessed = guess_units(hierarchy.offsets, hierarchy.parents, hierarchy.names)
        problems.append(guessed)
    zero = _zero_pose(hierarchy)
    clip = replace(
        zero,
        rotations=rotations,
        translations=translations,
        scales=np.broadcast_to(1.0, translations.shape),
        fps=file.fps,
        name=path.stem,
    )
    if up is None:
        up, guessed = guess_up([_positions(zero), _positions(clip)], hierarchy.names)
        problems.append(guessed)
    zero, clip = (_placed(c, cm_per_unit, up) for c in (zero, clip))
    skeleton, odd = choose_bind(zero, clip)
    origin = Origin(
        path=path,
        animation_path=path.stem,
        time_codes_per_second=file.fps,
        cm_per_unit=cm_per_unit,
        up_axis=up,
    )
    return replace(clip, skeleton=skeleton, origin=origin, problems=(*problems, *odd))


def _chosen(file: BvhFile, skel: str | None, path: Path) -> BvhFile:
    """One of several ROOTs, if one is named."""
    hierarchy = file.hierarchy
    roots = [int(j) for j in np.flatnonzero(hierarchy.parents < 0)]
    if skel is None or len(roots) == 1:
        return file
    named = [j for j in roots if hierarchy.joints[j] == skel]
    if not named:
        names = ", ".join(hierarchy.joints[j] for j in roots)
        raise UsageError(f"{path} has no ROOT '{skel}'; it has {names}.")
    part, columns = hierarchy.below(named[0])
    return replace(file, hierarchy=part, rows=file.rows[:, columns])


def _check_size(path: Path, hierarchy: Hierarchy, frames: int) -> None:
    joints = len(hierarchy.joints)
    if joints * frames > PLENTY and joints > STILL_JOINTS * hierarchy.width:
        raise InputError(
            f"{path}: {joints} joints with {hierarchy.width} channels in {frames} frames are not "
            "plausible."
        )


def _zero_pose(hierarchy: Hierarchy) -> Clip:
    """One frame, all channels zero; positions are the OFFSETs."""
    q = np.tile(IDENTITY, (1, len(hierarchy.joints), 1))
    t = hierarchy.offsets[None]
    skeleton = posed_skeleton(hierarchy.joints, hierarchy.parents, q[0], t[0])
    return Clip(skeleton, q, t, np.ones_like(t), 1.0)


def _positions(clip: Clip) -> Array:
    """World positions of all joints at some frames spread over a clip."""
    if not len(clip):
        return np.empty((0, len(clip.skeleton), 3))
    frames = np.unique(np.linspace(0, len(clip) - 1, LOOKED_AT).astype(int))
    some = replace(
        clip,
        rotations=clip.rotations[frames],
        translations=clip.translations[frames],
        scales=clip.scales[frames],
    )
    return forward_kinematics(some).positions


def _placed(clip: Clip, cm_per_unit: float, up: str) -> Clip:
    """In centimetres and Y up: what turns the axes is part of the roots' rotations."""
    translations = clip.translations if cm_per_unit == 1.0 else clip.translations * cm_per_unit
    if up == "Y":
        return replace(clip, translations=translations)
    translations = translations.copy()
    roots = clip.skeleton.parents < 0
    axes = rot.from_matrix(Y_UP_FROM_Z_UP)
    rotations = clip.rotations.copy()
    rotations[:, roots] = rot.make_continuous(rot.multiply(axes, rotations[:, roots]))
    translations[:, roots] = rot.rotate(axes, translations[:, roots])
    return replace(clip, rotations=rotations, translations=translations)


def _near_zero(hierarchy: Hierarchy, translations: Array) -> list[int]:
    """Inner joints whose positions stay near zero, far from the OFFSET that they replace."""
    found = []
    offsets = np.linalg.norm(hierarchy.offsets, axis=-1)
    for joint, channels in enumerate(hierarchy.channels):
        if len(translations) and any(kind == "position" for kind, _ in channels):
            usual = float(np.median(np.linalg.norm(translations[:, joint], axis=-1)))
            if usual < NEAR_ZERO * offsets[joint]:
                found.append(joint)
    return found


def _channel_problems(
    hierarchy: Hierarchy, near_zero: Sequence[int], collapsed: bool
) -> Iterator[Problem]:
    scaled = [
        name
        for name, channels in zip(hierarchy.names, hierarchy.channels, strict=True)
        if any(kind == "scale" for kind, _ in channels)
    ]
    if scaled:
        have = counted(len(scaled), "joint has", "joints have")
        message = f"{have} scale channels, not read: {listed(scaled)}"
        yield Problem("scale-channels", message)
    if near_zero:
        done = (
            "they are added to it, since the body would collapse to a point otherwise. If that is "
            "wrong, give --positions replace"
            if collapsed
            else "the program that wrote them may have meant them as additions to it. If so, give "
            "--positions add"
        )
        joints = counted(len(near_zero), "joint")
        message = f"positions of {joints} stay near zero, far from the OFFSET that they replace: "
        where = listed([hierarchy.joints[j] for j in near_zero])
        yield Problem("near-zero-positions", message + done, where)
