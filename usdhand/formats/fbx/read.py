"""An FBX character read into a Clip: centimetres, seconds, Y up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from usdhand.errors import InputError
from usdhand.formats.fbx.pose import bind_matrices, joint_locals, right_handed
from usdhand.formats.fbx.scene import Sampled, Scene, load_scene
from usdhand.formats.fbx.skeletons import FbxSkeleton, find_skeleton, find_take, keyed_takes
from usdhand.formats.reading import DEFAULT, Reading
from usdhand.motion import Clip, Origin, Skeleton, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.motion.timing import DEFAULT_FPS
from usdhand.motion.transforms import compose_trs, to_y_up
from usdhand.problems import Problem


def read_clip(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read the motion of one character.

    Parameters
    ----------
    path : an .fbx file, binary or ASCII
    reading : the skeleton where there are several, and the animation (stack, take) where several
        have keys; units and up axis other than the file says

    Returns
    -------
    Clip
        sampled at the file's frame rate, with everything odd or guessed in ``problems``.

    Raises
    ------
    InputError
        if the file cannot be read, has no skeleton or no motion, or ufbx is missing.
    UsageError
        if there are several skeletons or animations and none is chosen.
    """
    scene = _meant(load_scene(path, reading.animation), reading)
    sampled = find_take(scene, reading.animation)
    take = sampled.take
    rig = find_skeleton(scene, reading.skel, take.moved)
    if not rig.moves(take.moved):
        name = rig.name or rig.joints[0]
        raise InputError(f"{path}: the animation '{take.name}' does not move '{name}'.")
    local, odd = joint_locals(scene, rig.nodes, sampled.transforms)
    skeleton = _skeleton(scene, rig)
    origin = replace(
        _origin(scene, rig),
        animation_path=take.name,
        time_codes_per_second=sampled.fps,
        first_time_code=sampled.first,
        clock=sampled.first / sampled.fps,
    )
    problems = (
        *rig.problems,
        *_scene_problems(scene, rig),
        *odd,
        *_time_problems(scene, rig, sampled),
    )
    return Clip(
        skeleton,
        rot.make_continuous(local.rotations),
        local.translations,
        local.scales,
        sampled.fps,
        path.stem,
        origin,
        problems,
    )


def read_character(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read a character that may have no motion: a clip of one frame at its bind pose.

    Raises the same errors as `read_clip`, except for what concerns its animations.
    """
    scene = _meant(load_scene(path, sample=False), reading)
    moved = frozenset[int]().union(*(take.moved for take in scene.takes))
    rig = find_skeleton(scene, reading.skel, moved)
    problems = (*rig.problems, *_scene_problems(scene, rig))
    return Clip.at_bind_pose(_skeleton(scene, rig), path.stem, _origin(scene, rig), problems)


def animation_names(path: Path) -> tuple[str, ...]:
    """Names of the animations (stacks, takes) of a file that have keys.

    Raises InputError if the file cannot be read.
    """
    return keyed_takes(load_scene(path, sample=False))


def _meant(scene: Scene, reading: Reading) -> Scene:
    """The scene with the units and axes that the user says."""
    unit = scene.cm_per_unit if reading.cm_per_unit is None else reading.cm_per_unit
    if not 1e-6 < unit < 1e9:
        raise InputError(f"{scene.path}: one unit is {unit:g} cm, which is not plausible.")
    axes = scene.axes if reading.up is None else to_y_up(reading.up)
    says_axes = scene.says_axes or reading.up is not None
    return right_handed(replace(scene, cm_per_unit=unit, says_axes=says_axes), axes)


def _skeleton(scene: Scene, rig: FbxSkeleton) -> Skeleton:
    rest, _ = joint_locals(scene, rig.nodes, scene.rest)
    return Skeleton(
        rig.joints,
        parents_from_paths(rig.joints),
        bind_matrices(scene, rig.nodes, rest),
        compose_trs(rest.translations[0], rest.rotations[0]),
    )


def _origin(scene: Scene, rig: FbxSkeleton) -> Origin:
    return Origin(
        path=scene.path,
        skeleton_path=rig.name,
        time_codes_per_second=scene.fps or DEFAULT_FPS,
        cm_per_unit=scene.cm_per_unit,
        up_axis="Z" if abs(scene.axes[1, 2]) > 0.5 else "Y",
    )


def _scene_problems(scene: Scene, rig: FbxSkeleton) -> Iterator[Problem]:
    if not scene.says_axes:
        yield Problem("guessed-up-axis", "the file does not say which axis is up: Y is assumed")
    if scene.bind.keys().isdisjoint(rig.nodes):
        message = "the file has no bind pose: the transforms of the nodes are used instead"
        yield Problem("missing-bind", message, severity="note")


def _time_problems(scene: Scene, rig: FbxSkeleton, sampled: Sampled) -> Iterator[Problem]:
    take = sampled.take
    still = sum(node not in take.moved for node in rig.nodes)
    if still:
        message = f"{still} joints are not animated and keep their rest transform"
        yield Problem("fewer-joints", message, take.name, "note")
    if sampled.by_keys:
        message = (
            f"the animation should last from {take.begin:g} to {take.end:g} s, but its keys "
            f"from {take.first_key:g} to {take.last_key:g} s: the times of the keys are used"
        )
        yield Problem("take-span", message, take.name)
    if scene.fps is None:
        message = f"the file does not say its frame rate: {sampled.fps:g} is derived from its keys"
        yield Problem("guessed-fps", message, take.name)
    elif take.key_spacing > 0 and take.key_spacing * sampled.fps < 0.75:
        message = (
            f"keys are {1 / take.key_spacing:.4g} a second, but the file plays {sampled.fps:g} "
            "frames a second: keys between frames are skipped"
        )
        yield Problem("dense-keys", message, take.name)
