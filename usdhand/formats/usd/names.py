"""Joint names that USD does not take as prim names, and the nearest ones that it does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from pxr import Sdf, Usd, Vt

from usdhand.motion import Skeleton

ORIGINALS, ALIASES = "usdhand:jointNames", "usdhand:jointAliases"


def legal_name(name: str) -> str:
    """Nearest name that USD takes as a prim: ``mixamorig:Hips`` -> ``mixamorig_Hips``."""
    legal = re.sub(r"\W", "_", name)
    return legal if Sdf.Path.IsValidIdentifier(legal) else f"_{legal}"


def illegal_names(joints: Iterable[str]) -> list[str]:
    """Parts of joint paths that are no legal prim names, each once."""
    names = dict.fromkeys(part for joint in joints for part in joint.split("/"))
    return [name for name in names if not Sdf.Path.IsValidIdentifier(name)]


def legal_skeleton(skeleton: Skeleton) -> Skeleton:
    """Return a skeleton whose joints are legal USD paths, its own names kept as ``originals``.

    Joints whose names become the same below one parent are told apart by a number.
    """
    if not illegal_names(skeleton.joints) and len(set(skeleton.joints)) == len(skeleton):
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
    return replace(skeleton, joints=joints, originals=skeleton.originals or skeleton.names)


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
