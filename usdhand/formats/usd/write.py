"""Results written as small layers over their input, or flattened into one file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdSkel, UsdUtils

from usdhand.errors import InputError, OutputError, UsdHandError
from usdhand.formats.output import check_output, written_beside
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.animation import author_animation, author_variants
from usdhand.formats.usd.flatten import flat_layer
from usdhand.formats.usd.stage import (
    Character,
    binding_prim,
    find_skeletons,
    is_text,
    open_stage,
    readable,
    usd_diagnostics,
)
from usdhand.formats.usd.textures import (
    copies_of,
    copy_files,
    is_packed,
    is_udim,
    missing_files,
    modify_paths,
    unpacked_beside,
)
from usdhand.motion import Clip, Problem

ANIMATION_NAME = "HandMotion"
# Fields of a root layer that are about the layer itself; all others describe the stage.
LAYER_FIELDS = {
    "comment",
    "documentation",
    "hasOwnedSubLayers",
    "layerRelocates",
    "owner",
    "primChildren",
    "subLayerOffsets",
    "subLayers",
}


def write_motion(
    character: Character,
    clip: Clip,
    changed: Sequence[int],
    output: Path,
    *,
    flatten: bool = False,
    force: bool = False,
    inputs: Sequence[Path] = (),
    variants: Mapping[str, Clip] | None = None,
    author: Callable[[Sdf.Layer, Sdf.Path], None] | None = None,
) -> tuple[Problem, ...]:
    """Write a character with new motion as a layer over its input.

    Parameters
    ----------
    changed : joints whose motion differs from the input's; all others are kept to the bit
    flatten : write one file that needs no other (always done for .usdz)
    inputs : further files that the output must not replace
    variants : name -> motion of the same frames: a variant set of the new animation, the first one
        selected, instead of ``clip`` alone
    author : adds opinions to the new layer; gets it and the path of the character's root prim

    Returns
    -------
    tuple of Problem
        what flattening could not keep, and where files are that were inside packages.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    check_name(output)
    check_output(output, [*stage_files(character.stage), *inputs], force, USD_SUFFIXES)
    for motion in (clip, *(variants or {}).values()):
        if not np.isfinite(motion.rotations).all():
            raise InputError(f"{character.path}: the result has rotations that are no numbers.")
    layer = layer_over(character.stage, output)
    with Sdf.ChangeBlock():
        for path in instances_above(character):
            Sdf.CreatePrimInLayer(layer, path).SetInfo("instanceable", False)
        root = character.root.GetPath()
        animation = free_child(character.stage, root, ANIMATION_NAME)
        if variants:
            times = author_variants(layer, animation, character, variants, changed)
        else:
            times = author_animation(layer, animation, character, clip, changed)
        if character.animation is not None:
            copy_blend_shapes(layer, animation, UsdSkel.Animation(character.animation))
        bind_animation(layer, character, animation)
        extend_time(layer, times)
        if author is not None:
            author(layer, root)
    return save_layer(layer, output, flatten=flatten)


def save_layer(layer: Sdf.Layer, output: Path, *, flatten: bool) -> tuple[Problem, ...]:
    """Save a layer to ``output``: written beside, opened once to see that it holds, then moved.

    Returns what flattening could not keep, and where files are that were inside packages.
    """
    check_name(output)
    problems: tuple[Problem, ...] = ()
    with ExitStack() as undone, written_beside(output) as temporary:
        if output.suffix.lower() == ".usdz":
            problems = _package(layer, temporary, output)
        elif flatten:
            flat, problems = _flattened(layer, output)
            problems += undone.enter_context(unpacked_beside(flat, output))
            _make_relative(flat, output)
            _export(flat, temporary)
        else:
            _export(layer, temporary)
        _verify(temporary)
    loaded = Sdf.Layer.Find(str(output.absolute()))
    if loaded:
        loaded.Reload(force=True)
    return problems


def check_name(output: Path) -> None:
    """Refuse a path that is no text, which USD cannot write.

    Raises
    ------
    OutputError
        if its bytes are no UTF-8.
    """
    if not is_text(output):
        raise OutputError(f"{readable(output)}: this name is no valid text (UTF-8); USD needs one.")


def _flattened(layer: Sdf.Layer, output: Path) -> tuple[Sdf.Layer, tuple[Problem, ...]]:
    """Return one layer for all that ``layer`` is over, and what it cannot keep."""
    beside = output.with_name(f".{output.stem}.{os.getpid()}.layer.usdc")
    try:
        _export(layer, beside)
        return flat_layer(Usd.Stage.Open(str(beside)))
    finally:
        beside.unlink(missing_ok=True)


def _make_relative(flat: Sdf.Layer, output: Path) -> None:
    """Give a layer paths as seen from ``output``.

    Flattening makes all paths absolute, and files that move together would lose each other.
    """
    modify_paths(
        flat, lambda asset: _relative(Path(asset), output) if Path(asset).is_absolute() else asset
    )


def _package(layer: Sdf.Layer, temporary: Path, output: Path) -> tuple[Problem, ...]:
    flat, problems = _flattened(layer, output)
    with TemporaryDirectory(prefix=f".{output.stem}.", dir=output.absolute().parent) as folder:
        # USD packs UDIM tiles only where they are below the layer, and packages as a whole.
        copies = copies_of(flat, lambda asset: is_udim(asset) or is_packed(asset))
        copy_files(flat, copies, Path(folder, "textures"))
        path = Path(folder, "flat.usdc")
        missing = missing_files(flat)
        _make_relative(flat, path)
        _export(flat, path)
        name = f"{output.stem}.usdc"
        with usd_diagnostics() as messages:
            done = UsdUtils.CreateNewUsdzPackage(str(path), str(temporary), name)
        if not done:
            reason = f"; not found: {', '.join(missing)}" if missing else ""
            raise OutputError(f"{output}: USD could not make the .usdz package{reason}.")
    return (*problems, *(Problem("usd", message) for message in messages))


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
    """Open what was written. What the input lacks is the input's, but it must be found."""
    try:
        stage, _ = open_stage(path)
    except UsdHandError as error:
        raise OutputError(f"What was written cannot be read back: {error}") from error
    layer = stage.GetRootLayer()
    for asset in layer.subLayerPaths:
        if not Sdf.Layer.FindOrOpenRelativeToLayer(layer, asset):
            raise OutputError(f"{asset} cannot be found from {path.parent}.")


def layer_over(stage: Usd.Stage, output: Path) -> Sdf.Layer:
    """Return a layer over a stage that says the same about units, axes and time.

    A root layer without ``timeCodesPerSecond`` would silently rescale time to 24. What is on a
    stage in memory is copied, since there is no file to be over.
    """
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    source = stage.GetRootLayer()
    if source.anonymous:
        layer.TransferContent(source)
        return layer
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


def instances_above(character: Character) -> list[Sdf.Path]:
    """Instances that must be opened up, since nothing can be authored inside them."""
    paths = character.skeleton.GetPath().GetPrefixes()
    return [p for p in paths if character.stage.GetPrimAtPath(p).IsInstance()]


def free_child(stage: Usd.Stage, parent: Sdf.Path, name: str) -> Sdf.Path:
    """Return a path below ``parent`` that no prim of the stage has yet."""
    path, number = parent.AppendChild(name), 1
    while stage.GetPrimAtPath(path):
        number += 1
        path = parent.AppendChild(f"{name}{number}")
    return path


def copy_blend_shapes(layer: Sdf.Layer, path: Sdf.Path, source: UsdSkel.Animation) -> None:
    """Give the animation at ``path`` the blend shapes of another one."""
    prim = layer.GetPrimAtPath(path)
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


def bind_animation(layer: Sdf.Layer, character: Character, animation: Sdf.Path) -> None:
    """Make a character play an animation: override the binding that is in force."""
    owner = binding_prim(character.skeleton)
    sharing = [s for s in find_skeletons(character.stage) if binding_prim(s) == owner]
    if len(sharing) > 1:  # a binding that other skeletons inherit stays theirs
        owner = character.skeleton
    prim = Sdf.CreatePrimInLayer(layer, owner.GetPath())
    if not owner.HasAPI(UsdSkel.BindingAPI):
        schemas = Sdf.TokenListOp()
        schemas.prependedItems = ["SkelBindingAPI"]
        prim.SetInfo("apiSchemas", schemas)
    # A layer that is a copy of a stage in memory has one.
    relationship = prim.relationships.get("skel:animationSource") or Sdf.RelationshipSpec(
        prim, "skel:animationSource", custom=False
    )
    relationship.targetPathList.explicitItems = [animation]


def extend_time(layer: Sdf.Layer, times: NDArray[np.float64]) -> None:
    """Let a layer's time range hold these time codes."""
    if not layer.HasStartTimeCode() or layer.startTimeCode > times[0]:
        layer.startTimeCode = float(times[0])
    if not layer.HasEndTimeCode() or layer.endTimeCode < times[-1]:
        layer.endTimeCode = float(times[-1])
