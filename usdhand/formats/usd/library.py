"""A motion library as a USD stage that a person can open and edit.

A prim a clip under ``/Library/Clips``: a payload to the clip's file (relative, so that the folder
can move), what is said of it, and packed arrays of what search and assembly need.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from pxr import Sdf, Tf, Usd, Vt

from usdhand.anatomy import SIDES, Side
from usdhand.errors import InputError, UsdHandError
from usdhand.fill.library import (
    ARM_FPS,
    ARM_WIDTH,
    Left,
    LibraryClip,
    LibraryHand,
    MotionLibrary,
    pack_arm,
    unpack_arm,
)
from usdhand.fill.segment import Segmentation
from usdhand.formats.output import check_output
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.stage import open_stage
from usdhand.formats.usd.write import save_layer

VERSION = 1
ROOT = "/Library"
CLIPS = f"{ROOT}/Clips"
LEFT_OUT = f"{ROOT}/LeftOut"
_TYPES = Sdf.ValueTypeNames


def write_library(library: MotionLibrary, output: Path, *, force: bool = False) -> None:
    """Write a library; clip paths must be relative to the output's folder, or absolute.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written.
    """
    check_output(output, (), force, [s for s in USD_SUFFIXES if s != ".usdz"])
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        root = _prim(layer, ROOT, "Scope")
        layer.defaultPrim = root.name
        layer.pseudoRoot.SetInfo("upAxis", "Y")
        layer.pseudoRoot.SetInfo("metersPerUnit", 0.01)
        _set_time(layer, library)
        segmentation = library.segmentation
        _set_all(
            root,
            {
                "libraryVersion": (_TYPES.Int, VERSION),
                "armFps": (_TYPES.Double, ARM_FPS),
                "segmentation:speed": (_TYPES.Double, segmentation.speed),
                "segmentation:shortest": (_TYPES.Double, segmentation.shortest),
                "segmentation:longest": (_TYPES.Double, segmentation.longest),
                "segmentation:smoothing": (_TYPES.Double, segmentation.smoothing),
            },
        )
        _prim(layer, CLIPS, "Scope")
        for clip, prim_name in zip(library.clips, _prim_names(library), strict=True):
            _write_clip(layer, clip, prim_name)
        if library.left_out:
            _prim(layer, LEFT_OUT, "Scope")
        for number, left in enumerate(library.left_out):
            prim = _prim(layer, f"{LEFT_OUT}/Clip{number}", "Scope")
            values = {"path": (_TYPES.String, left.path), "reason": (_TYPES.String, left.reason)}
            _set_all(prim, values)
    save_layer(layer, output, flatten=False)


def is_library(path: Path) -> bool:
    """Whether a file is a motion library, of any version."""
    try:
        open_stage(path)
    except UsdHandError:
        return False
    stage = Usd.Stage.Open(str(path), Usd.Stage.LoadNone)
    root = stage.GetPrimAtPath(ROOT)
    return bool(root) and root.GetAttribute("usdhand:libraryVersion").HasValue()


def read_library(path: str | Path) -> MotionLibrary:
    """Read a library, clips in order of their names.

    Raises
    ------
    InputError
        if the file is no library, of another version, or a clip in it is damaged.
    """
    path = Path(path)
    open_stage(path)  # says what is wrong with a file that is no USD
    stage = Usd.Stage.Open(str(path), Usd.Stage.LoadNone)
    root = stage.GetPrimAtPath(ROOT)
    version = root.GetAttribute("usdhand:libraryVersion").Get() if root else None
    if version != VERSION:
        found = "no motion library" if version is None else f"a library of version {version}"
        raise InputError(
            f"{path} is {found}; 'usdhand library build CLIP... -o LIBRARY' makes one."
        )

    def setting(name: str, default: float) -> float:
        value = root.GetAttribute(f"usdhand:segmentation:{name}").Get()
        return default if value is None else float(value)

    usual = Segmentation()
    segmentation = Segmentation(
        setting("speed", usual.speed),
        setting("shortest", usual.shortest),
        setting("longest", usual.longest),
        setting("smoothing", usual.smoothing),
    )
    clips = stage.GetPrimAtPath(CLIPS)
    found_clips = [_read_clip(prim, path) for prim in clips.GetChildren()] if clips else []
    left = stage.GetPrimAtPath(LEFT_OUT)
    left_out = [
        Left(str(_get(p, "path", "")), str(_get(p, "reason", "")))
        for p in (left.GetChildren() if left else ())
    ]
    ordered = tuple(sorted(found_clips, key=lambda c: c.name))
    return MotionLibrary(ordered, segmentation, tuple(left_out))


def relative_path(path: Path, library: Path) -> str:
    """How a library in ``library``'s folder refers to a clip."""
    try:
        return Path(os.path.relpath(path, library.absolute().parent)).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()


def _set_time(layer: Sdf.Layer, library: MotionLibrary) -> None:
    """Time codes as most clips count them, so that few are rescaled when they are looked at."""
    rates = [clip.fps for clip in library.clips]
    rate = max(sorted(set(rates)), key=rates.count)
    layer.timeCodesPerSecond = layer.framesPerSecond = rate
    layer.startTimeCode = 0.0
    layer.endTimeCode = float(np.ceil(rate * max(clip.duration for clip in library.clips)))


def _write_clip(layer: Sdf.Layer, clip: LibraryClip, name: str) -> None:
    prim = _prim(layer, f"{CLIPS}/{name}", "Scope")
    _set_all(
        prim,
        {
            "name": (_TYPES.String, clip.name),
            "skeleton": (_TYPES.String, clip.skel),
            "label": (_TYPES.String, clip.label),
            "actor": (_TYPES.String, clip.actor),
            "height": (_TYPES.Double, clip.height),
            "fps": (_TYPES.Double, clip.fps),
            "duration": (_TYPES.Double, clip.duration),
            "contentHash": (_TYPES.String, clip.content_hash),
            "file": (_TYPES.Asset, Sdf.AssetPath(clip.path)),
        },
    )
    motion = _prim(layer, f"{prim.path}/Motion", "")
    first = Sdf.Path(clip.skel).GetPrefixes()[0] if clip.skel else Sdf.Path.emptyPath
    motion.payloadList.prependedItems = [Sdf.Payload(clip.path, first)]
    for side, hand in clip.hands.items():
        segments = np.array(hand.segments, dtype=np.int32).reshape(-1, 2)
        _set_all(
            prim,
            {
                f"{side}:joints": (_TYPES.TokenArray, Vt.TokenArray(list(hand.joints))),
                f"{side}:segments": (_TYPES.Int2Array, Vt.Vec2iArray.FromNumpy(segments)),
                f"{side}:arm": (_TYPES.FloatArray, _floats(pack_arm(hand.arm))),
                f"{side}:fingers": (_TYPES.FloatArray, _floats(hand.fingers)),
            },
        )


def _read_clip(prim: Usd.Prim, path: Path) -> LibraryClip:
    where = f"{path}: {prim.GetPath()}"

    def need(name: str) -> Any:
        value = _get(prim, name)
        if value is None:
            raise InputError(f"{where} has no usdhand:{name}; build the library again.")
        return value

    hands: dict[Side, LibraryHand] = {}
    for side in SIDES:
        joints = _get(prim, f"{side}:joints")
        if joints is None:
            continue
        arm = np.array(need(f"{side}:arm"), dtype=np.float64)
        fingers = np.array(need(f"{side}:fingers"), dtype=np.float64)
        segments = np.array(need(f"{side}:segments")).reshape(-1, 2)
        if arm.size % ARM_WIDTH or not len(joints) or fingers.size % (3 * len(joints)):
            raise InputError(f"{where}: the {side} arrays do not fit; build the library again.")
        arm = arm.reshape(-1, ARM_WIDTH)
        if len(segments) and (segments.min() < 0 or segments.max() >= len(arm)):
            raise InputError(f"{where}: the {side} segments do not fit; build the library again.")
        hands[side] = LibraryHand(
            unpack_arm(arm),
            tuple(str(j) for j in joints),
            fingers.reshape(-1, 3 * len(joints)),
            tuple((int(a), int(b)) for a, b in segments),
        )
    return LibraryClip(
        str(need("name")),
        str(need("file").path),
        str(_get(prim, "skeleton", "")),
        str(_get(prim, "label", "")),
        str(_get(prim, "actor", "")),
        float(need("height")),
        float(need("fps")),
        float(need("duration")),
        str(need("contentHash")),
        cast(Mapping[Side, LibraryHand], hands),
    )


def _get(prim: Usd.Prim, name: str, default: Any = None) -> Any:
    value = prim.GetAttribute(f"usdhand:{name}").Get()
    return default if value is None else value


def _prim(layer: Sdf.Layer, path: str, type_name: str) -> Sdf.PrimSpec:
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    if type_name:
        prim.typeName = type_name
    return prim


def _set_all(prim: Sdf.PrimSpec, values: Mapping[str, tuple[Sdf.ValueTypeName, Any]]) -> None:
    for name, (type_name, value) in values.items():
        attribute = Sdf.AttributeSpec(
            prim, f"usdhand:{name}", type_name, Sdf.VariabilityVarying, True
        )
        attribute.default = value


def _floats(values: Any) -> Vt.FloatArray:
    return Vt.FloatArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32).ravel())


def _prim_names(library: MotionLibrary) -> list[str]:
    """A legal name a clip; different ones for names that differ only in what is not legal."""
    names: dict[str, None] = {}
    for clip in library.clips:
        legal = name = str(Tf.MakeValidIdentifier(clip.name))
        number = 1
        while name in names:
            number += 1
            name = f"{legal}_{number}"
        names[name] = None
    return list(names)
