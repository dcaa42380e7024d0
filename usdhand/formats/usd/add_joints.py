"""Joints added to a skeleton behind its own, as opinions over it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pxr import Gf, Sdf, UsdSkel, Vt

from usdhand.formats.usd.names import ALIASES, ORIGINALS, legal_skeleton
from usdhand.formats.usd.stage import Character
from usdhand.formats.usd.world import World, world_above
from usdhand.motion import Skeleton
from usdhand.motion.rotations import Array


def joint_tokens(character: Character) -> tuple[str, ...]:
    """Joints of a character's Skeleton on its stage."""
    return tuple(str(j) for j in UsdSkel.Skeleton(character.skeleton).GetJointsAttr().Get() or ())


def author_joints(layer: Sdf.Layer, character: Character, skeleton: Skeleton) -> None:
    """Author the joints that ``skeleton`` has beyond those in its file.

    The file's own joints, whose order meshes refer to by number, keep their places and their
    matrices to the bit.
    """
    prim = UsdSkel.Skeleton(character.skeleton)
    own = joint_tokens(character)
    more = range(len(own), len(skeleton))
    if not more:
        return
    world = world_above(character.skeleton)
    rest = prim.GetRestTransformsAttr().Get()
    bind = prim.GetBindTransformsAttr().Get()
    local = _in_units(skeleton.rest, world.scale)
    if rest is None or len(rest) != len(own):
        roots = skeleton.parents < 0
        local[roots] = _below(skeleton.rest[roots], world)
        all_rest = local
    else:
        all_rest = np.concatenate([_matrices(rest), local[len(own) :]])
    if bind is None or len(bind) != len(own):
        all_bind = _below(skeleton.bind, world)
    else:
        # From the wrist's own matrix, in whatever space the exporter wrote it.
        all_bind = np.concatenate([_matrices(bind), np.empty((len(more), 4, 4))])
        for j in more:
            all_bind[j] = all_bind[skeleton.parents[j]] @ local[j]
    types = Sdf.ValueTypeNames
    spec = Sdf.CreatePrimInLayer(layer, character.skeleton.GetPath())
    _set(spec, "joints", types.TokenArray, Vt.TokenArray(list(skeleton.joints)))
    for name, values, authored in (
        ("restTransforms", all_rest, rest),
        ("bindTransforms", all_bind, bind),
    ):
        matrices = [Gf.Matrix4d(m.T.tolist()) for m in values]
        if authored is not None and len(authored) == len(own):
            matrices[: len(own)] = list(authored)
        _set(spec, name, types.Matrix4dArray, Vt.Matrix4dArray(matrices))
    if names := prim.GetJointNamesAttr().Get():
        own_names = [str(name) for name in names]
        added = [skeleton.names[j] for j in more]
        _set(spec, "jointNames", types.TokenArray, Vt.TokenArray([*own_names, *added]))
    for name, kept in ((ORIGINALS, skeleton.originals), (ALIASES, skeleton.aliases)):
        if kept:
            _set(spec, name, types.TokenArray, Vt.TokenArray(list(kept)), custom=True)


def author_legal_names(
    layer: Sdf.Layer, character: Character, skeleton: Skeleton, animation: Sdf.Path
) -> None:
    """Rename joints that USD does not take as prims, on a Skeleton that gains joints.

    As they are, USD sees no hierarchy in them, so that the joints added would hang off nothing. The
    Skeleton keeps their own names beside (`author_names`); the new animation and the meshes that
    list joints of this Skeleton follow.
    """
    own, legal = joint_tokens(character), legal_skeleton(skeleton)
    if len(skeleton) == len(own) or legal.joints == skeleton.joints:
        return
    renamed = dict(zip(skeleton.joints, legal.joints, strict=True))
    kind = Sdf.ValueTypeNames.TokenArray
    spec = Sdf.CreatePrimInLayer(layer, character.skeleton.GetPath())
    _set(spec, "joints", kind, Vt.TokenArray(list(legal.joints)))
    for name, kept in ((ORIGINALS, legal.originals), (ALIASES, legal.aliases)):
        if kept:
            _set(spec, name, kind, Vt.TokenArray(list(kept)), custom=True)
    moved = layer.GetPrimAtPath(animation).attributes["joints"]
    moved.default = Vt.TokenArray([renamed[str(joint)] for joint in moved.default])
    for prim in character.stage.Traverse():
        binding = UsdSkel.BindingAPI(prim)
        listed = [str(joint) for joint in binding.GetJointsAttr().Get() or ()]
        if listed and binding.GetInheritedSkeleton().GetPrim() == character.skeleton:
            names = Vt.TokenArray([renamed.get(joint, joint) for joint in listed])
            _set(Sdf.CreatePrimInLayer(layer, prim.GetPath()), "skel:joints", kind, names)


def _set(
    prim: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: Any, custom: bool = False
) -> None:
    attribute = prim.attributes.get(name) or Sdf.AttributeSpec(
        prim, name, kind, Sdf.VariabilityUniform, custom
    )
    attribute.default = value


def _matrices(values: Vt.Matrix4dArray) -> Array:
    """(n, 4, 4) for column vectors."""
    return np.swapaxes(np.array(values, dtype=np.float64), 1, 2)


def _in_units(matrices: Array, unit: float) -> Array:
    result = matrices.copy()
    result[:, :3, 3] /= unit
    return result


def _below(matrices: Array, world: World) -> Array:
    """World matrices (n, 4, 4) in the space of the skeleton, in the file's units."""
    return _in_units(np.linalg.inv(world.first) @ matrices, world.scale)
