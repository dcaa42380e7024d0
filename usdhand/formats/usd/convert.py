"""A USD character written anew as a file of its own, with all else that its stage holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdSkel, Vt

from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.animation import animation_losses, author_animation
from usdhand.formats.usd.bindings import apply_api, bind_animation
from usdhand.formats.usd.character import character_of, gf_matrices, legal_clip
from usdhand.formats.usd.damage import refuses_damage
from usdhand.formats.usd.extents import author_extents
from usdhand.formats.usd.names import ALIASES, ORIGINALS, author_names, legal_skeleton
from usdhand.formats.usd.placement import turn_and_scale
from usdhand.formats.usd.poses import AuthoredPoses, authored_poses
from usdhand.formats.usd.stage import Character, bound_animation, compose, find_skeletons
from usdhand.formats.usd.world import world_above
from usdhand.formats.usd.write import (
    check_name,
    copy_blend_shapes,
    free_child,
    instances_above,
    layer_over,
    save_flat,
    save_layer,
    stage_files,
    within_samples,
)
from usdhand.motion import Clip, Skeleton
from usdhand.motion.plausible import check_clip
from usdhand.motion.rotations import Array
from usdhand.motion.timing import recounted_code
from usdhand.motion.transforms import local_matrices
from usdhand.problems import Problem

# Problems of a clip whose animation is written again to mend them.
MENDED = {"missing-translations", "missing-scales", "wrong-type"}


@dataclass(frozen=True)
class StageEdit:
    """How a whole stage is measured, placed and timed anew.

    Attributes
    ----------
    per_second : time codes a second; None to leave them
    offset : added to all time codes, after they count to the new rate
    scale : factor on everything's size
    up : "Y" or "Z"; None to leave it
    """

    per_second: float | None = None
    offset: float = 0.0
    scale: float = 1.0
    up: str | None = None


@refuses_damage
def placed(character: Character, placement: StageEdit) -> Character:
    """Return a character on a stage in memory that shows its own stage with another placement.

    Scale and up axis are transforms of all that is on the stage; see `turn_and_scale`.
    """
    source = character.stage
    layer = layer_over(source)
    layer.subLayerOffsets[0] = Sdf.LayerOffset(placement.offset)
    old, new = source.GetTimeCodesPerSecond(), placement.per_second
    if new is not None:
        layer.timeCodesPerSecond = layer.framesPerSecond = new
    for field in ("startTimeCode", "endTimeCode"):
        if source.HasAuthoredMetadata(field):
            moved = recounted_code(source.GetMetadata(field), old, new or old) + placement.offset
            layer.pseudoRoot.SetInfo(field, moved)
    stage = compose(layer)
    turn_and_scale(stage, placement.up, placement.scale, character.path)
    skeleton = stage.GetPrimAtPath(character.skeleton.GetPath())
    return replace(character, stage=stage, skeleton=skeleton, animation=bound_animation(skeleton))


@refuses_damage
def write_placed(
    character: Character,
    clip: Clip,
    output: Path,
    *,
    edited: bool,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
    inputs: Sequence[Path] = (),
) -> tuple[Problem, ...]:
    """Write one file with all of a `placed` character's stage, the motion ``clip`` if ``edited``.

    The stage, which is in memory, shows the result afterwards. Joint names become legal and poses
    that are missing are written. The stage's own motion is kept as it is where it is whole, with
    all of its variants.

    Returns
    -------
    tuple of Problem
        what one file could not keep, and where files are that were inside packages.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    check_name(output)
    check_clip(clip, character.path, "the result")
    check_outputs(
        written_files(output, flatten=flatten),
        [character.path, *stage_files(character.stage), *inputs],
        force,
        USD_SUFFIXES,
    )
    stage = character.stage
    if not stage.GetRootLayer().anonymous:
        raise AssertionError("the stage of a file is not written to")
    layer = layer_over(stage)
    with Sdf.ChangeBlock():
        for path in instances_above(character):
            Sdf.CreatePrimInLayer(layer, path).SetInfo("instanceable", False)
    lost: tuple[Problem, ...] = ()
    if edited or any(problem.code in MENDED for problem in clip.problems):
        changed = range(len(clip.skeleton)) if edited else ()
        variants = motion_variants(character)
        with Sdf.ChangeBlock():
            path, shared = _author_motion(layer, character, clip, changed, variants)
        author_extents(layer, character.root.GetPath())
        lost = (
            *shared,
            *(_one_motion(*place) for place in variants),
            *animation_losses(layer, path, clip),
        )
    poses, _ = authored_poses(character, len(clip.skeleton), 1.0)
    local = _local_in_file(character, clip)
    stage.GetRootLayer().TransferContent(layer)
    _mend_skeleton(stage.GetPrimAtPath(character.skeleton.GetPath()), clip.skeleton, poses, local)
    saved = save_flat(stage, output, allow_outside=allow_outside, split=not flatten)
    return (*lost, *saved)


def write_made(
    clip: Clip, output: Path, *, up: str = "Y", animated: bool = True, flatten: bool = False
) -> tuple[Problem, ...]:
    """Write a clip as a file with a complete character and nothing else; see `character_of`.

    Returns what USD said of the package, if it is one. Raises OutputError if it cannot be written.
    """
    check_clip(clip, clip.origin.path or clip.name, "the result")
    stage = character_of(legal_clip(clip), up=up, animated=animated).stage
    if output.suffix.lower() == ".usdz":
        return save_flat(stage, output)
    return save_layer(stage.GetRootLayer(), output, flatten=flatten)


def motion_variants(character: Character) -> list[tuple[Sdf.Path, str, str]]:
    """Prims, variant sets and selections on which a character's motion depends."""
    own = character.skeleton.GetPath()
    paths = set(own.GetPrefixes())
    if character.animation is not None:
        paths |= set(character.animation.GetPath().GetPrefixes())
    places = [
        (path, name)
        for path in sorted(paths)
        for name in character.stage.GetPrimAtPath(path).GetVariantSets().GetNames()
    ]
    if not places:
        return []
    stage = compose(character.stage.GetRootLayer())  # with a session layer of its own
    stage.SetEditTarget(stage.GetSessionLayer())
    found = []
    for path, name in places:
        sets = stage.GetPrimAtPath(path).GetVariantSets()
        selected, selection = _opinions(stage, own), sets.GetVariantSelection(name)
        for other in sets.GetVariantSet(name).GetVariantNames():
            sets.SetSelection(name, other)
            if _opinions(stage, own) != selected:
                found.append((path, name, selection))
                break
        stage.GetSessionLayer().Clear()
    return found


def _opinions(stage: Usd.Stage, skeleton: Sdf.Path) -> list[tuple[str, str]]:
    """Where the motion of a skeleton is authored: layers and paths in them."""
    prim = stage.GetPrimAtPath(skeleton)
    animation = bound_animation(prim) if prim else None
    if animation is None:
        return []
    return [
        (spec.layer.identifier, str(spec.path))
        for attribute in animation.GetAttributes()
        for spec in attribute.GetPropertyStack()
    ]


def _one_motion(path: Sdf.Path, name: str, selection: str) -> Problem:
    message = (
        f"only the motion of variant '{selection}' of '{name}' is kept, since the motion is "
        "rewritten"
    )
    return Problem("variants", message, str(path))


def _author_motion(
    layer: Sdf.Layer,
    character: Character,
    clip: Clip,
    changed: Sequence[int],
    variants: Sequence[tuple[Sdf.Path, str, str]],
) -> tuple[Sdf.Path, tuple[Problem, ...]]:
    source = character.animation
    shared = [s for s in find_skeletons(character.stage) if bound_animation(s) == source]
    if source is not None and len(shared) == 1 and not source.IsInstanceProxy():
        path = source.GetPath()  # stronger samples replace the weaker ones as a whole
    else:
        path = free_child(character.stage, character.root.GetPath(), "Motion")
    told: tuple[Problem, ...] = ()
    times = author_animation(layer, path, character, clip, changed)
    # What is authored here wins over variants: those of an animation would be without effect.
    own = [name for place, name, _ in variants if place == path]
    if own:
        layer.GetPrimAtPath(path).variantSetNameList.deletedItems = own
    if source is None or path != source.GetPath() or variants:
        if source is not None:
            copy_blend_shapes(layer, path, UsdSkel.Animation(source))
        told = bind_animation(layer, character, path)
    if changed or not within_samples(character, times):
        layer.startTimeCode, layer.endTimeCode = float(times[0]), float(times[-1])
    return path, told


def _mend_skeleton(prim: Usd.Prim, own: Skeleton, poses: AuthoredPoses, local: Array) -> None:
    """Write what a skeleton lacks: legal names, bind and rest pose, the binding schema.

    ``local`` (joints, 4, 4) are the joint-to-parent matrices that stand in for poses.
    """
    skeleton, legal = UsdSkel.Skeleton(prim), legal_skeleton(own)
    pairs = zip(own.joints, legal.joints, strict=True)
    if renamed := {a: b for a, b in pairs if a != b}:
        skeleton.GetJointsAttr().Set(Vt.TokenArray(list(legal.joints)))
        author_names(prim, legal)
        _rename(prim.GetStage(), renamed)
    if poses.rest is None:
        skeleton.CreateRestTransformsAttr(gf_matrices(local))
    if poses.bind is None:
        skeleton.CreateBindTransformsAttr(gf_matrices(own.accumulated(local)))
    apply_api(prim)
    if (own.parents > np.arange(len(own))).any():
        _put_in_order(prim, legal.joints, _parents_first(own))


def _parents_first(skeleton: Skeleton) -> list[int]:
    """Joints in their order, but for parents that come later: these go before their children."""
    order: dict[int, None] = {}
    for joint in range(len(skeleton)):
        for above in reversed((joint, *skeleton.ancestors(joint))):
            order.setdefault(above)
    return list(order)


def _put_in_order(prim: Usd.Prim, joints: Sequence[str], order: Sequence[int]) -> None:
    """List the joints of a skeleton in another order, in which parents come first."""
    for name in ("joints", "bindTransforms", "restTransforms", "jointNames", ORIGINALS, ALIASES):
        attribute = prim.GetAttribute(name)
        values = attribute.Get() if attribute else None
        if values is not None and len(values) == len(order):
            attribute.Set(type(values)([values[j] for j in order]))
    for mesh in prim.GetStage().Traverse():  # whose indices count the joints in their old order
        binding = UsdSkel.BindingAPI(mesh)
        indices, own = binding.GetJointIndicesAttr(), binding.GetJointsAttr()
        if not (indices and indices.HasAuthoredValue()) or (own and own.HasAuthoredValue()):
            continue
        if binding.GetInheritedSkeleton().GetPrim() == prim:
            binding.CreateJointsAttr(Vt.TokenArray(list(joints)))


def _rename(stage: Usd.Stage, renamed: dict[str, str]) -> None:
    """Rename joints wherever meshes and animations list them."""
    for prim in stage.Traverse():
        for name in ("skel:joints", "joints"):
            attribute = prim.GetAttribute(name)
            if not attribute or prim.IsA(UsdSkel.Skeleton):
                continue
            listed = [str(token) for token in attribute.Get() or ()]
            if any(joint in renamed for joint in listed):
                attribute.Set(Vt.TokenArray([renamed.get(joint, joint) for joint in listed]))


def _local_in_file(character: Character, clip: Clip) -> Array:
    """Joint-to-parent matrices (n, 4, 4) of the clip's bind pose in the file's units and axes."""
    world = world_above(character.skeleton)
    skeleton = clip.skeleton
    local = local_matrices(skeleton.bind, skeleton.parents, world.first)
    local[:, :3, 3] /= world.scale
    return local
