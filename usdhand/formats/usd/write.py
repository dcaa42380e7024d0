"""Results written as small layers over their input, or flattened into one file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdSkel, UsdUtils

from usdhand.errors import OutputError, UsageError
from usdhand.formats.atomic import ended_by_exception, written_beside
from usdhand.formats.output import check_outputs
from usdhand.formats.paths import relative_path, written_files
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.add_joints import author_joints, author_legal_names, joint_tokens
from usdhand.formats.usd.animation import animation_losses, author_animation, author_variants
from usdhand.formats.usd.bindings import bind_animation
from usdhand.formats.usd.character import as_on_stage
from usdhand.formats.usd.curves import Tracks
from usdhand.formats.usd.damage import refuses_damage, usd_diagnostics
from usdhand.formats.usd.extents import author_extents, withhold_extents
from usdhand.formats.usd.flatten import flat_layer
from usdhand.formats.usd.motion_crate import described
from usdhand.formats.usd.saving import export, reload, save, verify
from usdhand.formats.usd.stage import (
    Character,
    compose,
    readable,
)
from usdhand.formats.usd.textures import (
    copies_of,
    copy_files,
    is_packed,
    is_udim,
    missing_files,
    modify_paths,
    outside_files,
    unpacked_beside,
    without_times,
)
from usdhand.inputs import is_text
from usdhand.motion import Clip
from usdhand.motion.plausible import check_clip
from usdhand.motion.timing import SAME_CODE
from usdhand.problems import Problem, listed

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


@refuses_damage
def write_motion(
    character: Character,
    clip: Clip,
    changed: Sequence[int],
    output: Path,
    *,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
    inputs: Sequence[str | Path] = (),
    variants: Mapping[str, Clip] | None = None,
    author: Callable[[Sdf.Layer, Sdf.Path], None] | None = None,
) -> tuple[Problem, ...]:
    """Write a character with new motion as a layer over its input.

    Joints that the clip has beyond the character's are added to its Skeleton.

    Parameters
    ----------
    changed : joints whose motion differs from the input's; all others are kept to the bit
    flatten : write one file that needs no other (always done for .usdz)
    allow_outside : pack files from outside the input's folder, too
    inputs : further files that the output must not replace
    variants : name -> motion of the same frames: a variant set of the new animation, the first one
        selected, instead of ``clip`` alone
    author : adds opinions to the new layer; gets it and the path of the character's root prim

    Returns
    -------
    tuple of Problem
        what flattening could not keep, where files are that were inside packages, and whether the
        layer refers to its input by an absolute path.

    Raises
    ------
    InputError
        if the clip is of another skeleton, or has values that are not plausible.
    OutputError
        if the output is refused or cannot be written; nothing is left behind then.
    """
    check_name(output)
    check_outputs(
        written_files(output, flatten=flatten),
        [*stage_files(character.stage), *inputs],
        force,
        USD_SUFFIXES,
    )
    clips = {
        name: as_on_stage(motion, character) for name, motion in (variants or {"": clip}).items()
    }
    for motion in clips.values():
        check_clip(motion, character.path, "the result")
    skeleton = next(iter(clips.values())).skeleton
    changed = sorted({*changed, *range(len(joint_tokens(character)), len(skeleton))})
    layer = layer_over(character.stage)
    with Sdf.ChangeBlock():
        for path in instances_above(character):
            Sdf.CreatePrimInLayer(layer, path).SetInfo("instanceable", False)
        author_joints(layer, character, skeleton)
        root = character.root.GetPath()
        animation = free_child(character.stage, root, ANIMATION_NAME)
        if variants:
            times = author_variants(layer, animation, character, clips, changed)
        else:
            times = author_animation(layer, animation, character, clips[""], changed)
        if character.animation is not None:
            copy_blend_shapes(layer, animation, UsdSkel.Animation(character.animation))
        shared = bind_animation(layer, character, animation)
        author_legal_names(layer, character, skeleton, animation)
        if not within_samples(character, times):  # else the input says what of them is shown
            extend_time(layer, times)
        if author is not None:
            author(layer, root)
    (withhold_extents if variants else author_extents)(layer, root)
    lost = () if variants else tuple(animation_losses(layer, animation, clips[""]))
    saved = save_layer(layer, output, flatten=flatten, allow_outside=allow_outside)
    return (*shared, *lost, *saved)


def save_layer(
    layer: Sdf.Layer, output: Path, *, flatten: bool, allow_outside: bool = False
) -> tuple[Problem, ...]:
    """Save a layer to ``output``: written beside, opened once to see that it holds, then moved.

    Its sublayers are given as absolute paths; what is not flattened gets relative ones.

    Returns what flattening could not keep, where files are that were inside packages, and which
    absolute paths had to stay.
    """
    if flatten or output.suffix.lower() == ".usdz":
        with usd_diagnostics():
            stage = compose(layer)
        return save_flat(stage, output, allow_outside=allow_outside)
    check_name(output)
    problems = _make_relative(layer, output)
    save(layer, output, split=True)
    return problems


def save_flat(
    stage: Usd.Stage, output: Path, *, allow_outside: bool = False, split: bool = False
) -> tuple[Problem, ...]:
    """Save all of a stage as one file, or package; see `save_layer`.

    With ``split``, the motion of an ascii file is in a crate beside it; see `motion_crate`.

    Raises
    ------
    UsageError
        if files from outside the input's folder would be taken in and that is not allowed.
    """
    check_name(output)
    flat, problems = flat_layer(stage)
    packed = output.suffix.lower() == ".usdz"
    if not allow_outside and (found := outside_files(stage, flat, packages_only=not packed)):
        raise UsageError(
            f"{output}: {listed(found)} would be packed, from outside the input's folder. Give "
            "--allow-outside if that is meant."
        )
    if packed:
        with written_beside(output) as temporary:
            problems += _package(flat, temporary, output)
            verify(temporary)
        reload(output)
        return problems
    with ended_by_exception(), unpacked_beside(flat, output) as told:
        problems += told + _make_all_relative(flat, output)
        save(flat, output, split=split)
    return problems


def check_name(output: Path) -> None:
    """Refuse a path that is no text, which USD cannot write.

    Raises
    ------
    OutputError
        if its bytes are no UTF-8.
    """
    if not is_text(str(output.absolute())):
        raise OutputError(f"{readable(output)}: this name is not valid UTF-8, which USD needs.")


def _make_relative(layer: Sdf.Layer, output: Path) -> tuple[Problem, ...]:
    """Give the sublayers of a layer paths as seen from ``output``; say which stay absolute.

    Files that move together would lose each other by absolute paths.
    """
    paths = {path: _relative(Path(path), output) for path in layer.subLayerPaths}
    layer.subLayerPaths[:] = list(paths.values())
    return _absolute(paths.values(), output)


def _make_all_relative(flat: Sdf.Layer, output: Path) -> tuple[Problem, ...]:
    """Do so with all paths of a layer, which flattening makes absolute."""
    paths: dict[str, str] = {}

    def relative(asset: str) -> str:
        if not Path(asset).is_absolute():
            return asset
        return paths.setdefault(asset, _relative(Path(asset), output))

    modify_paths(flat, relative)
    return _absolute(paths.values(), output)


def _absolute(paths: Iterable[str], output: Path) -> tuple[Problem, ...]:
    why = (
        "is referred to by its absolute path, since no relative one leads to it from both "
        f"{output.absolute().parent} and {output.parent.resolve()}"
    )
    return tuple(
        Problem("absolute-path", f"{path} {why}") for path in paths if Path(path).is_absolute()
    )


def _package(flat: Sdf.Layer, temporary: Path, output: Path) -> tuple[Problem, ...]:
    with TemporaryDirectory(prefix=f"{temporary.stem}.", dir=temporary.parent) as folder:
        # USD packs UDIM tiles only where they are below the layer, and packages as a whole.
        copies = copies_of(flat, lambda asset: is_udim(asset) or is_packed(asset))
        copy_files(flat, copies, Path(folder, "textures"))
        path = Path(folder, "flat.usdc")
        missing = missing_files(flat)
        _make_all_relative(flat, path)
        export(flat, path)
        name = f"{output.stem}.usdc"
        with usd_diagnostics() as messages:
            done = UsdUtils.CreateNewUsdzPackage(str(path), str(temporary), name)
        if not done:
            reason = f"; not found: {', '.join(missing)}" if missing else ""
            raise OutputError(f"{output}: USD could not make the .usdz package{reason}.")
        without_times(temporary)
    return tuple(Problem("usd", message) for message in messages)


def stage_files(stage: Usd.Stage) -> list[Path]:
    """All files that a stage is made of."""
    return [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]


def layer_over(stage: Usd.Stage) -> Sdf.Layer:
    """Return a layer over a stage that says the same about units, axes and time.

    It refers to the stage's file by an absolute path until it is saved. A root layer without
    ``timeCodesPerSecond`` would silently rescale time to 24. What is on a stage in memory is
    copied, since there is no file to be over.
    """
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    source = stage.GetRootLayer()
    if source.anonymous:
        layer.TransferContent(source)
        return layer
    for field in sorted(source.pseudoRoot.ListInfoKeys()):  # listed by memory address
        if field not in LAYER_FIELDS:
            layer.pseudoRoot.SetInfo(field, source.pseudoRoot.GetInfo(field))
    if layer.customLayerData:
        layer.customLayerData = described(source)
    layer.timeCodesPerSecond = stage.GetTimeCodesPerSecond()
    layer.framesPerSecond = stage.GetFramesPerSecond()
    for field in ("upAxis", "metersPerUnit", "kilogramsPerUnit"):
        if stage.HasAuthoredMetadata(field):
            layer.pseudoRoot.SetInfo(field, stage.GetMetadata(field))
    layer.subLayerPaths.append(source.realPath)
    return layer


def _relative(path: Path, output: Path) -> str:
    relative = relative_path(path, output.absolute().parent)
    if relative is None:
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


def within_samples(character: Character, times: NDArray[np.float64]) -> bool:
    """Whether a stage with a time range has its motion sampled over all of these time codes."""
    if character.animation is None or not character.stage.HasAuthoredTimeCodeRange():
        return False
    found = Tracks.of(UsdSkel.Animation(character.animation), 0).times
    if not found:
        return False
    first, last = min(t[0] for t in found), max(t[-1] for t in found)
    return bool(first - SAME_CODE <= times[0] and times[-1] <= last + SAME_CODE)


def describe_layer(layer: Sdf.Layer, default_prim: str) -> None:
    """Say of a layer that is over no other one: its default prim, centimetres, Y up."""
    layer.defaultPrim = default_prim
    layer.pseudoRoot.SetInfo("upAxis", "Y")
    layer.pseudoRoot.SetInfo("metersPerUnit", 0.01)


def extend_time(layer: Sdf.Layer, times: NDArray[np.float64]) -> None:
    """Let a layer's time range hold these time codes."""
    if not layer.HasStartTimeCode() or layer.startTimeCode > times[0]:
        layer.startTimeCode = float(times[0])
    if not layer.HasEndTimeCode() or layer.endTimeCode < times[-1]:
        layer.endTimeCode = float(times[-1])
