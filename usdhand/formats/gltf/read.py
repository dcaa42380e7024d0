"""A glTF, VRM or VRMA character read into a Clip: centimetres, seconds, Y up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdhand.errors import InputError
from usdhand.formats.gltf.characters import GltfCharacter, find_character
from usdhand.formats.gltf.curves import choose, moved_nodes, names_of, read_curves
from usdhand.formats.gltf.document import Document, read_document, unused
from usdhand.formats.gltf.nodes import Tree, read_tree
from usdhand.formats.gltf.placement import Motion, Space, find_placement, placed, sampled
from usdhand.formats.gltf.poses import bind_matrices
from usdhand.formats.gltf.vrm import Humanoid, read_humanoid
from usdhand.formats.reading import DEFAULT, Reading
from usdhand.motion import Clip, Origin, Skeleton
from usdhand.motion.timing import DEFAULT_FPS, MOST_FRAMES, Timing, find_timing
from usdhand.motion.transforms import compose_trs, to_y_up
from usdhand.problems import Problem, counted

CM_PER_UNIT = 100.0
MOST_VALUES = 20_000_000  # frames times joints: 55 minutes of 100 joints at 60 fps
MOST_PATH_LETTERS = 20_000_000


def read_clip(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read the motion of one character.

    Parameters
    ----------
    path : a .glb, .gltf, .vrm or .vrma file
    reading : the skeleton and the animation where there are several; units and axes that are not
        metres and Y up, as glTF has them

    Raises
    ------
    InputError
        if the file is damaged or has no character or animation.
    UsageError
        if there are several and none is chosen.
    """
    with np.errstate(all="ignore"):  # whatever is no number is refused by name
        return _animated(_scene(path, reading))


def read_character(path: Path, reading: Reading = DEFAULT) -> Clip:
    """Read a character that may have no motion: a clip of one frame at its bind pose.

    Raises the same errors as `read_clip`, except for a missing animation.
    """
    with np.errstate(all="ignore"):
        return _still(_scene(path, reading))


def animation_names(path: Path) -> tuple[str, ...]:
    """Names of the animations that move nodes, as ``animation`` takes them.

    Raises
    ------
    InputError
        if the file is damaged.
    """
    document = read_document(path)
    return tuple(names_of(document, moved_nodes(document)).values())


@dataclass(frozen=True, eq=False)
class _GltfScene:
    """A file, the character chosen in it, and how else it is read."""

    reading: Reading
    document: Document
    tree: Tree
    humanoid: Humanoid
    moving: dict[int, set[int]]  # by the number of the animation
    character: GltfCharacter

    @property
    def nodes(self) -> list[int]:
        return list(self.character.nodes)

    @property
    def parents(self) -> NDArray[np.intp]:
        place = {node: joint for joint, node in enumerate(self.nodes)}
        above = [place.get(int(self.tree.parents[node]), -1) for node in self.nodes]
        return np.array(above, dtype=np.intp)

    @property
    def space(self) -> Space:
        """Units and axes that the file is read in."""
        cm = self.reading.cm_per_unit
        return Space(CM_PER_UNIT if cm is None else cm, to_y_up(self.reading.up or "Y"))

    @property
    def origin(self) -> Origin:
        """Where its clip comes from, but for its animation and time."""
        return Origin(
            path=self.document.path,
            skeleton_path="" if self.character.alone else self.character.names[0],
            cm_per_unit=self.space.unit,
            up_axis=self.reading.up or "Y",
        )


def _scene(path: Path, reading: Reading) -> _GltfScene:
    document = read_document(path)
    tree, humanoid = read_tree(document), read_humanoid(document)
    moving = moved_nodes(document)
    moved: set[int] = set().union(*moving.values())
    character = find_character(document, tree, humanoid, moved, reading.skel)
    return _GltfScene(reading, document, tree, humanoid, moving, character)


def _animated(scene: _GltfScene) -> Clip:
    document, tree, nodes, parents = scene.document, scene.tree, scene.nodes, scene.parents
    names = names_of(document, scene.moving)
    number = choose(document.path, names, scene.reading.animation)
    name = names[number]
    above = {node for joint in np.flatnonzero(parents < 0) for node in tree.above(nodes[joint])}
    curves, problems = read_curves(
        document, document.lists["animations"][number], above | set(nodes)
    )
    if not curves:
        raise InputError(
            f"{document.path}: the animation '{name}' moves none of the "
            f"{counted(len(nodes), 'joint')} of '{scene.character.names[0]}'."
        )
    timing = find_timing([curve.times for curve in curves.values()])
    if timing.count > MOST_FRAMES:
        raise InputError(
            f"{document.path}: its keys from {timing.start:g} to {timing.keys[-1]:g} s would make "
            f"more than {MOST_FRAMES} frames. Check the key times."
        )
    if timing.count * len(nodes) > MOST_VALUES:
        raise InputError(
            f"{document.path}: {timing.count} frames of {counted(len(nodes), 'joint')} are not "
            "plausible. "
            "Check the key times."
        )
    motion = Motion(curves, timing)
    q, t, s = sampled(tree, nodes, motion)
    placement, found = find_placement(tree, nodes, parents, s, motion, scene.space)
    rotations, translations, scales = placed(q, t, s, parents, placement)
    origin = replace(
        scene.origin,
        animation_path=name,
        time_codes_per_second=timing.fps,
        first_time_code=_first_frame(timing),
    )
    skeleton, missing = _skeleton(scene)
    guess = _guess(timing)
    guessed = (Problem("guessed-fps", guess, name, "note"),) if guess else ()
    return Clip(
        skeleton,
        rotations,
        translations,
        scales,
        timing.fps,
        document.path.stem,
        origin,
        tuple(dict.fromkeys((*problems, *found, *missing, *guessed))),
    )


def _still(scene: _GltfScene) -> Clip:
    skeleton, problems = _skeleton(scene)
    origin = replace(scene.origin, time_codes_per_second=DEFAULT_FPS)
    return Clip.at_bind_pose(skeleton, scene.document.path.stem, origin, problems)


def _skeleton(scene: _GltfScene) -> tuple[Skeleton, tuple[Problem, ...]]:
    """Joints with their bind pose, and as rest pose the default transforms of the nodes."""
    tree, nodes, parents = scene.tree, scene.nodes, scene.parents
    space, pose = scene.space, Motion({})
    q, t, s = sampled(tree, nodes, pose)
    placement, odd = find_placement(tree, nodes, parents, s, pose, space)
    q, t, _ = placed(q, t, s, parents, placement)
    rest = compose_trs(t[0], q[0])
    bind, problems = bind_matrices(scene.document, tree, scene.character, parents)
    bind[:, :3] = space.axes @ bind[:, :3]
    bind[:, :3, 3] *= space.unit
    bones = scene.humanoid.bones
    if bones:
        named = counted(len(bones), "joint is named as a bone", "joints are named as bones")
        message = f"{named} of a {scene.humanoid.version} humanoid"
        problems += (Problem("humanoid", message, severity="note"),)
    aliases = tuple(bones.get(node, "") for node in nodes) if bones else ()
    return Skeleton(_joint_paths(scene), parents, bind, rest, aliases), (*odd, *problems)


def _joint_paths(scene: _GltfScene) -> tuple[str, ...]:
    """Full paths of the joints; of siblings with one name the later ones get a number."""
    paths: list[str] = []
    taken: dict[str, int] = {}
    letters = 0
    for node, parent in zip(scene.nodes, scene.parents, strict=True):
        holder = f"{paths[parent]}/" if parent >= 0 else ""
        path = unused(holder + scene.tree.name(node), taken)
        paths.append(path)
        letters += len(path)
        if letters > MOST_PATH_LETTERS:
            scene.tree.elements[node].refuse("has too long a name, or too many joints above it")
    return tuple(paths)


def _first_frame(timing: Timing) -> float:
    frame = timing.start * timing.fps
    return float(round(frame)) if abs(frame - round(frame)) < 1e-2 else frame


def _guess(timing: Timing) -> str:
    """What to tell people about the frame rate, "" where nothing was guessed."""
    fps = f"{timing.fps:g} frames a second"
    return {
        "steady": "",
        "one key": f"one key does not define a frame rate: {fps} are assumed",
        "rounded": f"key times are rounded: read as {fps}",
        "sparse": f"keys are sparse: read at {fps}, which fits all of them",
        "uneven": f"{len(timing.keys)} key times do not fit any frame rate: resampled at {fps}",
    }[timing.rhythm]
