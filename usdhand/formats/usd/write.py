"""Results written as small layers over their input, or flattened into one file."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdSkel, UsdUtils, Vt

from usdhand.errors import InputError, OutputError, UsdHandError
from usdhand.formats.output import check_output, written_beside
from usdhand.formats.usd.read import read_file_motion
from usdhand.formats.usd.stage import (
    USD_SUFFIXES,
    Character,
    binding_prim,
    bound_animation,
    open_stage,
)
from usdhand.formats.usd.world import world_above
from usdhand.motion import Clip
from usdhand.motion import rotations as rot

ANIMATION_NAME = "HandMotion"
# Fields of a root layer that are about the layer itself; all others describe the stage.
LAYER_FIELDS = {"subLayers", "subLayerOffsets", "primChildren", "comment", "documentation", "owner"}


@dataclass(frozen=True, eq=False)
class AnimationArrays:
    """Values of a SkelAnimation in the file's own units: a row a frame, or one row for all."""

    joints: tuple[str, ...]
    times: NDArray[np.float64]
    rotations: NDArray[np.float32]
    translations: NDArray[np.float32]
    scales: NDArray[np.float16]


def animation_arrays(character: Character, clip: Clip, changed: Sequence[int]) -> AnimationArrays:
    """Arrays of a clip's motion in the file's units.

    Joints other than ``changed`` keep the file's values to the bit where it has these frames.
    """
    skeleton = clip.skeleton
    roots = np.flatnonzero(skeleton.parents < 0)
    world = world_above(character, clip.time_codes)
    above = rot.conjugate(rot.from_matrix(world.rotation))[:, None]
    rotations = clip.rotations.astype(np.float32)
    translations = (clip.translations / world.scale).astype(np.float32)
    rotations[:, roots] = rot.multiply(above, clip.rotations[:, roots])
    placed = clip.translations[:, roots] - world.translation[:, None]
    translations[:, roots] = rot.rotate(above, placed) / world.scale
    scales = clip.scales.astype(np.float16)
    if character.animation is not None:
        motion = read_file_motion(character)
        if np.array_equal(motion.times, clip.time_codes):
            kept = np.setdiff1d(np.arange(len(skeleton)), changed)
            rotations[:, kept] = motion.rotations[:, kept]
            translations[:] = motion.translations
            scales[:] = motion.scales
    return AnimationArrays(
        skeleton.joints, clip.time_codes, rotations, _collapsed(translations), _collapsed(scales)
    )


def write_motion(
    character: Character,
    clip: Clip,
    changed: Sequence[int],
    output: Path,
    *,
    flatten: bool = False,
    force: bool = False,
    inputs: Sequence[Path] = (),
    author: Callable[[Sdf.Layer, Sdf.Path], None] | None = None,
) -> None:
    """Write a character with new motion as a layer over its input.

    Parameters
    ----------
    changed : joints whose motion differs from the input's; all others are kept to the bit
    flatten : write one file that needs no other (always done for .usdz)
    inputs : further files that the output must not replace
    author : adds opinions to the new layer; gets it and the path of the character's root prim

    Raises
    ------
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    check_output(output, [*stage_files(character.stage), *inputs], force, USD_SUFFIXES)
    layer = _layer_over(character.stage, output)
    with Sdf.ChangeBlock():
        for path in _instances_above(character):
            Sdf.CreatePrimInLayer(layer, path).SetInfo("instanceable", False)
        root = character.root.GetPath()
        animation = _free_child(character.stage, root, ANIMATION_NAME)
        arrays = animation_arrays(character, clip, changed)
        _author_animation(layer, animation, arrays, character.animation)
        _bind(layer, character, animation)
        _extend_time(layer, arrays.times)
        if author is not None:
            author(layer, root)
    save_layer(layer, output, flatten=flatten)


def save_layer(layer: Sdf.Layer, output: Path, *, flatten: bool) -> None:
    """Save a layer to ``output``: written beside, opened once to see that it holds, then moved."""
    suffix = output.suffix.lower()
    with written_beside(output) as temporary:
        if not flatten and suffix != ".usdz":
            _export(layer, temporary)
            _verify(temporary)
        else:
            beside = temporary.with_name(f"{temporary.stem}.layer.usdc")
            flat = temporary.with_name(f"{output.stem}.{os.getpid()}.flat.usdc")
            try:
                _export(layer, beside)
                stage = Usd.Stage.Open(str(beside))
                _export(stage.Flatten(), flat if suffix == ".usdz" else temporary)
                del stage
                packed = suffix == ".usdz"
                if packed and not UsdUtils.CreateNewUsdzPackage(str(flat), str(temporary)):
                    raise OutputError(f"{output}: USD could not make the .usdz package.")
                _verify(temporary)
            finally:
                beside.unlink(missing_ok=True)
                flat.unlink(missing_ok=True)
    loaded = Sdf.Layer.Find(str(output.absolute()))
    if loaded:
        loaded.Reload(force=True)


def stage_files(stage: Usd.Stage) -> list[Path]:
    """All files that a stage is made of."""
    return [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]


def _export(layer: Sdf.Layer, path: Path) -> None:
    try:
        done = layer.Export(str(path))
    except Tf.ErrorException as error:
        raise OutputError(f"{path.parent}: USD cannot write there ({error.args[0]}).") from error
    if not done:
        raise OutputError(f"{path.parent}: USD cannot write there.")


def _verify(path: Path) -> None:
    try:
        stage, problems = open_stage(path)
    except UsdHandError as error:
        raise OutputError(f"What was written cannot be read back: {error}") from error
    if problems:
        raise OutputError(f"What was written does not hold together: {problems[0]}.")
    del stage


def _layer_over(stage: Usd.Stage, output: Path) -> Sdf.Layer:
    """Return a layer over a stage that says the same about units, axes and time.

    A root layer without ``timeCodesPerSecond`` would silently rescale time to 24.
    """
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    source = stage.GetRootLayer()
    for field in source.pseudoRoot.ListInfoKeys():
        if field not in LAYER_FIELDS:
            layer.pseudoRoot.SetInfo(field, source.pseudoRoot.GetInfo(field))
    layer.timeCodesPerSecond = stage.GetTimeCodesPerSecond()
    layer.framesPerSecond = stage.GetFramesPerSecond()
    for field in ("upAxis", "metersPerUnit", "kilogramsPerUnit"):
        if stage.HasAuthoredMetadata(field):
            layer.pseudoRoot.SetInfo(field, stage.GetMetadata(field))
    if stage.GetDefaultPrim():
        layer.defaultPrim = stage.GetDefaultPrim().GetName()
    layer.subLayerPaths.append(_relative(Path(source.realPath), output))
    return layer


def _relative(path: Path, output: Path) -> str:
    try:
        relative = Path(os.path.relpath(path, output.absolute().parent)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()
    return relative if relative.startswith("..") else f"./{relative}"


def _instances_above(character: Character) -> list[Sdf.Path]:
    """Instances that must be opened up, since nothing can be authored inside them."""
    paths = character.skeleton.GetPath().GetPrefixes()
    return [p for p in paths if character.stage.GetPrimAtPath(p).IsInstance()]


def _free_child(stage: Usd.Stage, parent: Sdf.Path, name: str) -> Sdf.Path:
    path, number = parent.AppendChild(name), 1
    while stage.GetPrimAtPath(path):
        number += 1
        path = parent.AppendChild(f"{name}{number}")
    return path


def _author_animation(
    layer: Sdf.Layer, path: Sdf.Path, arrays: AnimationArrays, source: Usd.Prim | None
) -> None:
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SkelAnimation"
    joints = Sdf.AttributeSpec(
        prim, "joints", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
    )
    joints.default = Vt.TokenArray(list(arrays.joints))
    for name, type_name, values, convert in (
        ("rotations", Sdf.ValueTypeNames.QuatfArray, arrays.rotations, Vt.QuatfArray.FromNumpy),
        (
            "translations",
            Sdf.ValueTypeNames.Float3Array,
            arrays.translations,
            Vt.Vec3fArray.FromNumpy,
        ),
        ("scales", Sdf.ValueTypeNames.Half3Array, arrays.scales, Vt.Vec3hArray.FromNumpy),
    ):
        attribute = Sdf.AttributeSpec(prim, name, type_name)
        if len(values) == 1 and name != "rotations":  # Blender wants samples of rotations
            attribute.default = convert(np.ascontiguousarray(values[0]))
            continue
        for time, row in zip(arrays.times, values, strict=True):
            layer.SetTimeSample(attribute.path, float(time), convert(np.ascontiguousarray(row)))
    if source is not None:
        _copy_blend_shapes(layer, prim, UsdSkel.Animation(source))


def _copy_blend_shapes(layer: Sdf.Layer, prim: Sdf.PrimSpec, source: UsdSkel.Animation) -> None:
    for attribute, variability in (
        (source.GetBlendShapesAttr(), Sdf.VariabilityUniform),
        (source.GetBlendShapeWeightsAttr(), Sdf.VariabilityVarying),
    ):
        if not attribute or not attribute.HasAuthoredValue():
            continue
        spec = Sdf.AttributeSpec(prim, attribute.GetName(), attribute.GetTypeName(), variability)
        times = attribute.GetTimeSamples()
        for time in times:
            layer.SetTimeSample(spec.path, time, attribute.Get(time))
        if not times:
            spec.default = attribute.Get()


def _bind(layer: Sdf.Layer, character: Character, animation: Sdf.Path) -> None:
    owner = binding_prim(character.skeleton)
    prim = Sdf.CreatePrimInLayer(layer, owner.GetPath())
    if not owner.HasAPI(UsdSkel.BindingAPI):
        schemas = Sdf.TokenListOp()
        schemas.prependedItems = ["SkelBindingAPI"]
        prim.SetInfo("apiSchemas", schemas)
    relationship = Sdf.RelationshipSpec(prim, "skel:animationSource", custom=False)
    relationship.targetPathList.explicitItems = [animation]


def _extend_time(layer: Sdf.Layer, times: NDArray[np.float64]) -> None:
    if not layer.HasStartTimeCode() or layer.startTimeCode > times[0]:
        layer.startTimeCode = float(times[0])
    if not layer.HasEndTimeCode() or layer.endTimeCode < times[-1]:
        layer.endTimeCode = float(times[-1])


def _collapsed(values: NDArray[Any]) -> NDArray[Any]:
    """One row where all rows are the same."""
    return values[:1] if (values == values[:1]).all() else values


__all__ = [
    "ANIMATION_NAME",
    "AnimationArrays",
    "animation_arrays",
    "bound_animation",
    "save_layer",
    "stage_files",
    "write_motion",
]
