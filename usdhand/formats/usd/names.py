"""Joint names that USD does not take as prim names, and the nearest ones that it does."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd, Vt

from usdhand.motion import Skeleton, parents_from_paths
from usdhand.problems import Problem, counted, listed

ORIGINALS, ALIASES = "usdhand:jointNames", "usdhand:jointAliases"


def legal_name(name: str) -> str:
    """Nearest name that USD takes as a prim: ``mixamorig:Hips`` -> ``mixamorig_Hips``."""
    legal = re.sub(r"\W", "_", name)
    return legal if Sdf.Path.IsValidIdentifier(legal) else f"_{legal}"


def illegal_names(joints: Iterable[str]) -> list[str]:
    """Parts of joint paths that are no legal prim names, each once."""
    paths = (joint.removeprefix("/") for joint in joints)  # absolute ones are legal
    names = dict.fromkeys(part for path in paths for part in path.split("/"))
    return [name for name in names if not Sdf.Path.IsValidIdentifier(name)]


def name_problems(joints: Sequence[str], where: str) -> Iterator[Problem]:
    """What is odd about the paths of joints and about their order."""
    illegal = illegal_names(joints)
    if illegal:
        message = (
            f"{len(illegal)} joint names are not legal in USD, e.g. '{illegal[0]}': other "
            f"programs may lose these joints; '{legal_name(illegal[0])}' would be legal"
        )
        yield Problem("illegal-joint-name", message, where)
    yield from order_problems(joints, where)
    absolute = [joint for joint in joints if joint.startswith("/")]
    if absolute:
        message = (
            f"{counted(len(absolute), 'joint has', 'joints have')} an absolute path, "
            f"e.g. '{absolute[0]}': UsdSkel takes that, other programs may not; 'usdhand convert' "
            "makes it relative"
        )
        yield Problem("absolute-joints", message, where)


def order_problems(joints: Sequence[str], where: str) -> Iterator[Problem]:
    """Tell joints that come before their parents."""
    parents = parents_from_paths(joints)
    late = [joints[int(j)] for j in np.flatnonzero(parents > np.arange(len(joints)))]
    if late:
        message = (
            "joints are listed before their parents, so UsdSkel refuses the skeleton: "
            f"{listed(late)}. 'usdhand convert' puts them in order"
        )
        yield Problem("joint-order", message, where)


def legal_skeleton(skeleton: Skeleton) -> Skeleton:
    """Return a skeleton whose joints are legal, relative USD paths.

    Joints whose names become the same below one parent are told apart by a number. Where names
    change, the skeleton's own ones are kept as ``originals``.
    """
    absolute = any(joint.startswith("/") for joint in skeleton.joints)
    legal = not illegal_names(skeleton.joints) and len(set(skeleton.joints)) == len(skeleton)
    if legal and not absolute:
        return skeleton
    paths: dict[int, str] = {}
    taken: set[str] = set()
    for j in skeleton.order:
        parent = int(skeleton.parents[j])
        above = f"{paths[parent]}/" if parent >= 0 else ""
        name = legal_name(skeleton.names[j])
        path, number = above + name, 1
        while path in taken:
            number += 1
            path = f"{above}{name}_{number}"
        taken.add(path)
        paths[j] = path
    joints = tuple(paths[j] for j in range(len(skeleton)))
    renamed = replace(skeleton, joints=joints)
    kept = skeleton.originals or (() if renamed.names == skeleton.names else skeleton.names)
    return replace(renamed, originals=kept)


def author_names(skeleton: Usd.Prim, names: Skeleton) -> None:
    """Keep the names that joints had in another format as custom attributes."""
    for attribute, values in ((ORIGINALS, names.originals), (ALIASES, names.aliases)):
        if values:
            skeleton.CreateAttribute(
                attribute, Sdf.ValueTypeNames.TokenArray, True, Sdf.VariabilityUniform
            ).Set(Vt.TokenArray(list(values)))


def with_names(skeleton: Skeleton, prim: Usd.Prim) -> Skeleton:
    """Return a skeleton with the other names that `author_names` wrote on its prim, if any."""

    def names(attribute: str) -> tuple[str, ...]:
        values = tuple(str(name) for name in prim.GetAttribute(attribute).Get() or ())
        return values if len(values) == len(skeleton) else ()

    return replace(skeleton, originals=names(ORIGINALS), aliases=names(ALIASES))
