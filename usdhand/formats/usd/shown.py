"""What a person wants to see of a file: its alternatives, its warps, the kinds of its channels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pxr import Usd

from usdhand.anatomy.hand import SIDES, Side
from usdhand.formats.usd.animation import VARIANT_SET
from usdhand.formats.usd.damage import refuses_damage
from usdhand.formats.usd.read import bind_pose_clip, clip_from_character
from usdhand.formats.usd.rig import read_rig_on, rig_prims
from usdhand.formats.usd.skins import Skin, read_skins
from usdhand.formats.usd.stage import Character, find_character
from usdhand.formats.usd.warp import SCOPE_NAME
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.reduce.rig import ReducedRig


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """One motion of a file.

    Attributes
    ----------
    alternative : name of the variant that it is, "" where the file has no alternatives
    skins : meshes on the skeleton
    warps : side -> (frames,) seconds of the hand clip that each frame shows
    rig : the relations of a reduced hand rig in the file
    notes : what could not be read, in words
    """

    clip: Clip
    alternative: str = ""
    skins: tuple[Skin, ...] = ()
    warps: Mapping[Side, Array] = field(default_factory=dict)
    rig: ReducedRig | None = None
    notes: tuple[str, ...] = ()


@refuses_damage
def read_shown(
    path: str | Path, skel: str | None = None, *, skins: bool = True
) -> list[ShownMotion]:
    """Read a file's motion, every alternative of `fill` on its own, the selected one first.

    A character without motion is one frame of its bind pose. The clips have no source, since the
    stage shows another variant afterwards.

    Raises the same errors as `usdhand.formats.usd.read.read_character`.
    """
    character = find_character(Path(path), skel)
    if character.animation is None:
        clips = {"": bind_pose_clip(character)}
    else:
        clips = {name: clip_from_character(c) for name, c in _alternatives(character)}
    clips = {name: replace(clip, source=None) for name, clip in clips.items()}
    rig = _rig(character)
    surfaces, notes = read_skins(character) if skins else ((), ())
    return [
        ShownMotion(clip, name, surfaces, _warps(character, clip), rig, notes)
        for name, clip in clips.items()
    ]


def _alternatives(character: Character) -> Iterator[tuple[str, Character]]:
    """The character with each variant selected in turn; nothing is changed in any file."""
    stage, animation = character.stage, character.animation
    variants = animation.GetVariantSet(VARIANT_SET) if animation else None
    names = variants.GetVariantNames() if variants else []
    if animation is None or variants is None or len(names) < 2:
        yield "", character
        return
    path = animation.GetPath()
    selected = variants.GetVariantSelection()
    for name in sorted(names, key=lambda n: n != selected):
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            variants.SetVariantSelection(name)
        yield name, replace(character, animation=stage.GetPrimAtPath(path))


def _warps(character: Character, clip: Clip) -> dict[Side, Array]:
    scope = character.stage.GetPrimAtPath(character.root.GetPath().AppendChild(SCOPE_NAME))
    found: dict[Side, Array] = {}
    for side in SIDES:
        attribute = scope.GetAttribute(f"usdhand:warp:{side}") if scope else None
        if attribute and (attribute.GetNumTimeSamples() or attribute.ValueMightBeTimeVarying()):
            found[side] = np.array([attribute.Get(t) for t in clip.time_codes.tolist()], float)
    return found


def _rig(character: Character) -> ReducedRig | None:
    if next(rig_prims(character.stage), None) is None:
        return None
    return read_rig_on(character.stage, character.path, str(character.skeleton.GetPath()))
