"""Which nodes of an FBX scene are joints, what they are called, and which belong together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from usdhand.errors import InputError, UsageError
from usdhand.formats.fbx.scene import Sampled, Scene
from usdhand.formats.suffixes import CHOOSE_ANIMATION
from usdhand.problems import Problem

LIMBS = 3  # joints that a chain needs to be a limb


@dataclass(frozen=True)
class FbxSkeleton:
    """One skeleton of a scene: a name for it, its joints as nodes and as full paths.

    Joints come depth first, as in the file; ``above`` are the nodes over the roots. ``name`` is ""
    where it is the only one.
    """

    name: str
    nodes: tuple[int, ...]
    joints: tuple[str, ...]
    above: tuple[int, ...]
    problems: tuple[Problem, ...] = ()

    def moves(self, moved: frozenset[int]) -> bool:
        """Whether any of these nodes moves it."""
        return not moved.isdisjoint((*self.nodes, *self.above))


def find_skeleton(scene: Scene, skel: str | None, moved: frozenset[int]) -> FbxSkeleton:
    """Return the skeleton of this name, or the only one, or the only one that can be meant.

    Of several, those with ``moved`` nodes are preferred, then those that have limbs.

    Raises
    ------
    InputError
        if there are no joints.
    UsageError
        if there are several skeletons and none is chosen, or not this one.
    """
    joints, problems = _joint_nodes(scene, moved)
    rigs = [_rig(scene, nodes, joints) for nodes in _groups(scene, joints)]
    names = unique(rig.name for rig in rigs)
    rigs = [
        replace(rig, name=name, problems=problems) for name, rig in zip(names, rigs, strict=True)
    ]
    if skel is not None:
        chosen = [r for r in rigs if skel == r.name] or [r for r in rigs if skel in r.joints]
        if len(chosen) != 1:
            raise UsageError(f"{scene.path}: no skeleton '{skel}'. There is {_listed(names)}.")
    else:
        chosen = _likely(rigs, moved)
        if len(chosen) > 1:
            listed = _listed([r.name for r in chosen])
            raise UsageError(f"{scene.path} has several skeletons: {listed}. Choose: --skel NAME")
    [rig] = chosen
    return rig if len(rigs) > 1 else replace(rig, name="")


def find_take(scene: Scene, animation: str | None) -> Sampled:
    """Return the take of this name, or the only one with keys, sampled.

    Raises
    ------
    InputError
        if nothing is animated.
    UsageError
        if there are several and none is chosen, or not this one.
    """
    names = keyed_takes(scene)
    if not names:
        raise InputError(f"{scene.path}: nothing is animated{_emptiness(scene)}.")
    if animation is None and len(names) > 1:
        listed = _listed(names)
        raise UsageError(f"{scene.path} has several animations: {listed}. {CHOOSE_ANIMATION}")
    if animation is not None and animation not in names:
        raise UsageError(f"{scene.path}: no animation '{animation}'. There is {_listed(names)}.")
    if scene.sampled is None:
        raise InputError(f"{scene.path}: two animations are called '{animation}'. Rename one.")
    return scene.sampled


def keyed_takes(scene: Scene) -> tuple[str, ...]:
    """Names of the takes that have keys."""
    return tuple(take.name for take in scene.takes if take.moved)


def unique(names: Iterable[str]) -> list[str]:
    """The same names, numbered from the second on where one comes again."""
    found: list[str] = []
    taken = set[str]()
    counts = Counter[str]()
    for name in names:
        fresh = name
        while fresh in taken:
            counts[name] += 1
            fresh = f"{name}_{counts[name]}"
        taken.add(fresh)
        found.append(fresh)
    return found


def _joint_nodes(scene: Scene, moved: frozenset[int]) -> tuple[frozenset[int], tuple[Problem, ...]]:
    """Limbs, bones of skins and what lies between; without any, nulls that move and those below."""
    bones = {i for i, kind in enumerate(scene.kinds) if kind == "BONE"} | scene.skinned
    problems: tuple[Problem, ...] = ()
    if not bones:
        nulls = {i for i, k in enumerate(scene.kinds) if k in ("EMPTY", "UNKNOWN") and i}
        carried = set(moved)
        for node in sorted(nulls):  # parents come first
            if int(scene.parents[node]) in carried:
                carried.add(node)
        bones = nulls & carried or nulls
        message = "the file has no limb nodes: null objects are read as joints"
        problems = (Problem("no-limbs", message, severity="note"),)
    bones.discard(0)
    if not bones:
        raise InputError(f"{scene.path}: there is no skeleton{_emptiness(scene)}.")
    between = set[int]()
    for bone in bones:
        line = []
        node = int(scene.parents[bone])
        while node > 0 and node not in bones and node not in between:
            line.append(node)
            node = int(scene.parents[node])
        if node > 0:
            between.update(line)
    return frozenset(bones | between), problems


def _groups(scene: Scene, joints: frozenset[int]) -> list[list[int]]:
    """Roots that belong together: those under one null; what stands free stands alone."""
    groups: dict[int, list[int]] = {}
    for node in sorted(joints):
        above = int(scene.parents[node])
        if above not in joints:
            groups.setdefault(above if above > 0 else -node, []).append(node)
    return list(groups.values())


def _rig(scene: Scene, roots: Sequence[int], joints: frozenset[int]) -> FbxSkeleton:
    children: dict[int, list[int]] = {}
    for node in sorted(joints):
        children.setdefault(int(scene.parents[node]), []).append(node)
    nodes: list[int] = []
    paths: list[str] = []
    above: list[int] = []
    node = int(scene.parents[roots[0]])
    while node > 0:
        above.append(node)
        node = int(scene.parents[node])
    waiting = _named(scene, roots, "")
    while waiting:
        node, path = waiting.pop()
        nodes.append(node)
        paths.append(path)
        waiting += _named(scene, children.get(node, []), path + "/")
    name = scene.names[above[0]] if above else paths[0]
    return FbxSkeleton(name or "skeleton", tuple(nodes), tuple(paths), tuple(above))


def _named(scene: Scene, nodes: Sequence[int], prefix: str) -> list[tuple[int, str]]:
    """Nodes and paths, the last first."""
    names = unique(scene.names[node].replace("/", "_") or "unnamed" for node in nodes)
    return [(n, prefix + name) for n, name in zip(nodes, names, strict=True)][::-1]


def _likely(rigs: list[FbxSkeleton], moved: frozenset[int]) -> list[FbxSkeleton]:
    """Rigs that may be meant: each preference holds only while some rig fulfils it."""
    rigs = [rig for rig in rigs if rig.moves(moved)] or rigs
    return [rig for rig in rigs if len(rig.nodes) >= LIMBS] or rigs


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def _emptiness(scene: Scene) -> str:
    """What to add where a file seems empty, which files of unknown versions do."""
    if len(scene.names) > 1:
        return ""
    return f", because nothing in it is known of FBX version {scene.version / 1000:g}"
