"""A whole UsdSkel character made from a clip that came from another format, or from memory."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand.errors import InputError
from usdhand.formats.usd.add_joints import joint_tokens
from usdhand.formats.usd.animation import author_animation
from usdhand.formats.usd.names import author_names, legal_name, legal_skeleton
from usdhand.formats.usd.stage import Character, compose
from usdhand.motion import Clip, Skeleton
from usdhand.motion.editing import counted_in_frames, recounted
from usdhand.motion.rotations import Y_UP_FROM_Z_UP, Array
from usdhand.motion.transforms import affine

METERS_PER_UNIT = 0.01


def legal_clip(clip: Clip) -> Clip:
    """Return a clip whose joints have legal USD names and come after their parents."""
    order = np.array(clip.skeleton.order)
    if (
        not np.array_equal(order, np.arange(len(order)))
        and (clip.skeleton.parents >= np.arange(len(order))).any()
    ):
        clip = _reordered(clip, order)
    return replace(clip, skeleton=legal_skeleton(clip.skeleton))


def as_on_stage(clip: Clip, character: Character) -> Clip:
    """Return a clip with its joints named, and its time counted, as on a character's stage.

    It may have more joints, behind those of the character.

    Raises
    ------
    InputError
        if its joints are others.
    """
    own = joint_tokens(character)
    for skeleton in (clip.skeleton, legal_skeleton(clip.skeleton)):
        if skeleton.joints[: len(own)] == own:
            named = replace(clip, skeleton=skeleton)
            return recounted(named, character.stage.GetTimeCodesPerSecond())
    raise InputError(
        f"{character.path}: the clip '{clip.name}' does not have the joints of "
        f"{character.skeleton.GetPath()}, which it is to be written over. Without a source "
        "(dataclasses.replace(clip, source=None)) it is written as a character of its own."
    )


def character_of(clip: Clip, *, up: str = "Y", animated: bool = True) -> Character:
    """Return a stage in memory with a clip's character on it: centimetres, the clip's time codes.

    A SkelRoot as default prim, below it a Skeleton with bind and rest transforms, and, if the clip
    is ``animated``, a SkelAnimation with rotations, translations and scales of all joints.
    """
    origin = clip.origin
    if not math.isclose(origin.time_codes_per_frame * clip.fps, origin.time_codes_per_second):
        clip = counted_in_frames(clip)  # made in memory, with nothing said of time codes
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = compose(layer)
    root = Sdf.Path.absoluteRootPath.AppendChild(legal_name(clip.name or "Character"))
    _describe(stage, clip, up, animated)
    prim = UsdSkel.Root.Define(stage, root).GetPrim()
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    stage.SetDefaultPrim(prim)
    skeleton = _define_skeleton(stage, root.AppendChild("Skeleton"), clip.skeleton, up)
    UsdSkel.BindingAPI.Apply(prim)
    character = Character(stage, clip.origin.path or Path(clip.name), skeleton, None)
    if not animated:
        return character
    motion = root.AppendChild("Motion")
    author_animation(layer, motion, character, clip, range(len(clip.skeleton)))
    UsdSkel.BindingAPI(skeleton).CreateAnimationSourceRel().SetTargets([motion])
    return replace(character, animation=stage.GetPrimAtPath(motion))


def gf_matrices(matrices: Array) -> Vt.Matrix4dArray:
    """USD's row-vector matrices of (n, 4, 4) column-vector ones."""
    return Vt.Matrix4dArray([Gf.Matrix4d(m.T.tolist()) for m in matrices])


def _describe(stage: Usd.Stage, clip: Clip, up: str, animated: bool) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if up == "Z" else UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, METERS_PER_UNIT)
    stage.SetTimeCodesPerSecond(clip.origin.time_codes_per_second)
    stage.SetFramesPerSecond(clip.fps)
    if animated:
        stage.SetStartTimeCode(float(clip.time_codes[0]))
        stage.SetEndTimeCode(float(clip.time_codes[-1]))


def _define_skeleton(stage: Usd.Stage, path: Sdf.Path, source: Skeleton, up: str) -> Usd.Prim:
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    bind, rest = source.bind.copy(), source.rest.copy()
    if up == "Z":
        turn = affine(Y_UP_FROM_Z_UP.T, np.zeros(3))
        roots = source.parents < 0
        bind, rest[roots] = turn @ bind, turn @ rest[roots]
    skeleton.CreateJointsAttr(Vt.TokenArray(list(source.joints)))
    skeleton.CreateBindTransformsAttr(gf_matrices(bind))
    skeleton.CreateRestTransformsAttr(gf_matrices(rest))
    prim = skeleton.GetPrim()
    UsdSkel.BindingAPI.Apply(prim)
    author_names(prim, source)
    return prim


def _reordered(clip: Clip, order: Array) -> Clip:
    """The same clip with its joints in another order."""
    source = clip.skeleton
    place = np.argsort(order)
    parents = np.where(source.parents[order] < 0, -1, place[source.parents[order]])

    def some(names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(names[j] for j in order) if names else ()

    skeleton = Skeleton(
        tuple(source.joints[j] for j in order),
        parents,
        source.bind[order],
        source.rest[order],
        some(source.aliases),
        some(source.originals),
    )
    return replace(
        clip,
        skeleton=skeleton,
        rotations=clip.rotations[:, order],
        translations=clip.translations[:, order],
        scales=clip.scales[:, order],
        shears={int(place[j]): shear for j, shear in clip.shears.items()},
    )
