"""A motion library as a USD stage that a person can open and edit.

A prim a clip under ``/Library/Clips``: a payload to the clip's file (relative, so that the folder
can move), what is said of it, and packed arrays of what search and assembly need.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import numpy as np
from pxr import Gf, Kind, Sdf, Tf, Usd, Vt

from usdhand.anatomy import HAND_JOINTS, SIDES, Side
from usdhand.errors import InputError, UsageError, UsdHandError
from usdhand.fill.library import (
    ARM_FPS,
    ARM_WIDTH,
    LibraryClip,
    LibraryHand,
    MotionLibrary,
    damage,
    pack_arm,
    unpack_arm,
)
from usdhand.fill.settings import Segmentation
from usdhand.formats import paths
from usdhand.formats.output import check_outputs
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.damage import damage_refused, refuses_damage, usd_diagnostics
from usdhand.formats.usd.hand_shapes import read_shapes, shape_values
from usdhand.formats.usd.stage import Character, compose, open_stage
from usdhand.formats.usd.write import describe_layer, save_layer
from usdhand.motion import Clip
from usdhand.problems import Problem, counted

# 2: the thumb's channels are about the axes of a pronated thumb.
VERSION = 2
OLD_VERSIONS = (1,)
ROOT = "/Library"
CLIPS = f"{ROOT}/Clips"
LEFT_OUT = f"{ROOT}/LeftOut"
_TYPES = Sdf.ValueTypeNames


def write_library(library: MotionLibrary, output: str | Path, *, force: bool = False) -> None:
    """Write a library; clip paths must be relative to the output's folder, or absolute.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written.
    """
    output = Path(output)
    check_outputs(paths.written_files(output), (), force, [s for s in USD_SUFFIXES if s != ".usdz"])
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        root = _prim(layer, ROOT, "Scope")
        describe_layer(layer, root.name)
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
        clips = _prim(layer, CLIPS, "Scope")
        for group in (root, clips):  # a character is a component: all above it are groups
            group.kind = Kind.Tokens.group
        for clip, prim_name in zip(library.clips, _prim_names(library), strict=True):
            _write_clip(layer, clip, prim_name)
        if library.left_out:
            _prim(layer, LEFT_OUT, "Scope")
        for number, left in enumerate(library.left_out):
            prim = _prim(layer, f"{LEFT_OUT}/Clip{number}", "Scope")
            values = {"path": (_TYPES.String, left.file), "reason": (_TYPES.String, left.message)}
            _set_all(prim, values)
    save_layer(layer, output, flatten=False)


def is_library(file: Path | Clip) -> bool:
    """Whether a file, or the one that a clip was read from, is a motion library of any version."""
    if isinstance(file, Clip):
        return isinstance(file.source, Character) and _holds_library(file.source.stage)
    try:
        with damage_refused(file):
            return _holds_library(_open(file))
    except UsdHandError:
        return False


def _holds_library(stage: Usd.Stage) -> bool:
    root = stage.GetPrimAtPath(ROOT)
    return bool(root) and root.GetAttribute("usdhand:libraryVersion").HasValue()


@refuses_damage
def read_library(path: str | Path, *, old: bool = False) -> MotionLibrary:
    """Read a library, clips in order of their names.

    With ``old``, one of an older version too: its labels and actors are still right, its motion is
    not.

    What is under ``/Library/Clips`` and cannot be used, since someone edited or damaged it, is
    left out and listed in ``damaged``.

    Raises
    ------
    InputError
        if the file is not a library, is of another version, or nothing in it can be used.
    """
    path = Path(path)
    stage = _open(path)
    root = stage.GetPrimAtPath(ROOT)
    version = root.GetAttribute("usdhand:libraryVersion").Get() if root else None
    if version != VERSION and not (old and version in OLD_VERSIONS):
        if version is None:
            raise InputError(
                f"{path} is not a motion library; "
                "'usdhand library build CLIP... -o LIBRARY' makes one."
            )
        raise InputError(
            f"{path} is a library of version {version}, but version {VERSION} is needed; "
            f"'usdhand library build CLIP... -o {path} --rebuild' builds it again."
        )
    clips: list[LibraryClip] = []
    damaged: list[Problem] = []
    parent = stage.GetPrimAtPath(CLIPS)
    for prim in parent.GetChildren() if parent else ():
        try:
            with damage_refused(path):
                clips.append(_read_clip(prim))
        except (_DamagedError, InputError) as error:
            damaged.append(Problem("damaged", str(error), file=str(prim.GetPath())))
    if damaged and not clips:
        raise InputError(
            f"{path}: none of its {counted(len(damaged), 'clip')} can be used ({damaged[0].file}: "
            f"{damaged[0].message}); "
            f"'usdhand library build CLIP... -o {path} --rebuild' builds it again."
        )
    left = stage.GetPrimAtPath(LEFT_OUT)
    left_out = [
        Problem("left-out", str(_get(p, "reason", "")), file=str(_get(p, "path", "")))
        for p in (left.GetChildren() if left else ())
    ]
    ordered = tuple(sorted(clips, key=lambda c: c.name))
    return MotionLibrary(ordered, _segmentation(root, path), tuple(left_out), tuple(damaged))


class _DamagedError(Exception):
    """What is wrong with the prim of a clip."""


def _open(path: Path) -> Usd.Stage:
    """A library's stage without its clips' files, which may be many or gone."""
    stage = None
    if path.is_file() and path.suffix.lower() in USD_SUFFIXES:
        with usd_diagnostics():
            try:
                stage = compose(str(path), Usd.Stage.LoadNone)
            except Tf.ErrorException:
                stage = None
    if stage is None:
        open_stage(path)  # says what is wrong
        raise InputError(f"{path}: USD cannot read this file.")
    return stage


def _segmentation(root: Usd.Prim, path: Path) -> Segmentation:
    names = [f.name for f in fields(Segmentation)]
    values = {name: _get(root, f"segmentation:{name}") for name in names}
    try:
        return Segmentation(**{n: float(v) for n, v in values.items() if v is not None})
    except (UsageError, TypeError, ValueError) as error:
        raise InputError(f"{path}: usdhand:segmentation is damaged ({error}).") from error


def relative_path(path: Path, library: Path) -> str:
    """How a library in ``library``'s folder refers to a clip."""
    return paths.relative_path(path, library.absolute().parent) or path.absolute().as_posix()


def _set_time(layer: Sdf.Layer, library: MotionLibrary) -> None:
    """Time codes as most clips count them, so that few are rescaled when they are looked at."""
    rates = Counter(clip.fps for clip in library.clips)
    rate = max(sorted(rates), key=lambda fps: rates[fps])
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
    if Path(clip.path).suffix.lower() in USD_SUFFIXES:
        prim.kind = Kind.Tokens.group
        motion = _prim(layer, f"{prim.path}/Motion", "")
        first = Sdf.Path(clip.skel).GetPrefixes()[0] if clip.skel else Sdf.Path.emptyPath
        motion.payloadList.prependedItems = [Sdf.Payload(clip.path, first)]
    for side, shape in clip.shapes.items():
        _set_all(prim, {f"{side}:{name}": value for name, value in shape_values(shape).items()})
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
        if hand.used is not None:
            _set_all(prim, {f"{side}:used": (_TYPES.Int2, Gf.Vec2i(*hand.used))})
    if clip.doubt:
        _set_all(prim, {"doubt": (_TYPES.String, clip.doubt)})


def _read_clip(prim: Usd.Prim) -> LibraryClip:
    """Read what a prim says of a clip.

    Raises
    ------
    _DamagedError
        if it is no clip, or does not fit together.
    """

    def need(name: str) -> Any:
        value = _get(prim, name)
        if value is None:
            raise _DamagedError(f"it has no usdhand:{name}")
        return value

    def positive(name: str) -> float:
        value = need(name)
        if not isinstance(value, (int, float)) or not 0.0 < value < np.inf:
            raise _DamagedError(f"its usdhand:{name} is {value}")
        return float(value)

    name, content, file = str(need("name")), str(need("contentHash")), need("file")
    try:
        hands = {
            side: _read_hand(side, need, _get(prim, f"{side}:used"))
            for side in SIDES
            if _get(prim, f"{side}:joints") is not None
        }
        height = positive("height")
        shapes = read_shapes(prim, height)
    except (TypeError, ValueError) as error:
        raise _DamagedError(f"its arrays have the wrong type ({error})") from error
    if not hands:
        raise _DamagedError("it has no hand")
    return LibraryClip(
        name,
        str(file.path) if isinstance(file, Sdf.AssetPath) else str(file),
        str(_get(prim, "skeleton", "")),
        str(_get(prim, "label", "")),
        str(_get(prim, "actor", "")),
        height,
        positive("fps"),
        positive("duration"),
        content,
        cast(Mapping[Side, LibraryHand], hands),
        shapes,
        str(_get(prim, "doubt", "")),
    )


def _read_hand(side: Side, need: Callable[[str], Any], used: Any) -> LibraryHand:
    joints = tuple(str(j) for j in need(f"{side}:joints"))
    arm = np.array(need(f"{side}:arm"), dtype=np.float64)
    fingers = np.array(need(f"{side}:fingers"), dtype=np.float64)
    segments = np.array(need(f"{side}:segments"), dtype=np.intp).reshape(-1, 2)
    known = joints and set(joints) <= set(HAND_JOINTS) and len(set(joints)) == len(joints)
    if not known or not arm.size or arm.size % ARM_WIDTH:
        raise _DamagedError(f"its {side} arrays have the wrong length")
    arm, width = arm.reshape(-1, ARM_WIDTH), 3 * len(joints)
    if not fingers.size or fingers.size % width:
        raise _DamagedError(f"its {side} arrays have the wrong length")
    if not (np.isfinite(arm).all() and np.isfinite(fingers).all()):
        raise _DamagedError(f"its {side} arrays have values that are not numbers")
    if reason := damage(arm, fingers):
        raise _DamagedError(f"{side} hand: {reason}")
    inside = (segments >= 0) & (segments < len(arm))
    if not inside.all() or (segments[:, 0] >= segments[:, 1]).any():
        raise _DamagedError(f"its {side} segments are outside the motion")
    if used is not None:
        used = int(used[0]), int(used[1])
        if not 0 <= used[0] <= used[1] < len(arm):
            raise _DamagedError(f"its {side} frames of use are outside the motion")
    return LibraryHand(
        unpack_arm(arm),
        joints,
        fingers.reshape(-1, width),
        tuple((int(a), int(b)) for a, b in segments),
        used,
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
    numbers: Counter[str] = Counter()
    for clip in library.clips:
        legal = name = str(Tf.MakeValidIdentifier(clip.name))
        while name in names:
            numbers[legal] += 1
            name = f"{legal}_{numbers[legal] + 1}"
        names[name] = None
    return list(names)
