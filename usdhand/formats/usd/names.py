"""Joint names that USD does not take as prim names, and the nearest ones that it does."""

from __future__ import annotations

import re
from collections.abc import Iterable

from pxr import Sdf


def legal_name(name: str) -> str:
    """Nearest name that USD takes as a prim: ``mixamorig:Hips`` -> ``mixamorig_Hips``."""
    legal = re.sub(r"\W", "_", name)
    return legal if legal and not legal[0].isdigit() else f"_{legal}"


def illegal_names(joints: Iterable[str]) -> list[str]:
    """Parts of joint paths that are no legal prim names, each once."""
    names = dict.fromkeys(part for joint in joints for part in joint.split("/"))
    return [name for name in names if not Sdf.Path.IsValidIdentifier(name)]
