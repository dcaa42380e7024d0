"""The reduced rig on a stage: custom attributes of a Scope, readable without any schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
from pxr import Sdf, Usd, UsdSkel, Vt

from usdhand.anatomy.channels import Channels, Hands
from usdhand.anatomy.frames import HandFrames
from usdhand.anatomy.hand import SIDES, Side
from usdhand.errors import InputError
from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.findings import Finding
from usdhand.formats.usd.read import clip_from_character
from usdhand.formats.usd.stage import Character, find_character, open_stage
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.reduce import ReducedRig, Reduction, Relation
from usdhand.reduce.rig import Kind, evaluation_order

RIG_NAME = "HandRig"
VERSION = 1
CHANNEL_PREFIX = "usdhand:channel"
HELD = "held"
_TYPES = Sdf.ValueTypeNames


@dataclass(frozen=True, eq=False)
class StoredRig:
    """A rig as it was read, with the motion that it was written with.

    Attributes
    ----------
    free : curves of the free channels at the clip's frames, edits by others included
    clip : the rig file's own character and its (baked) motion
    frames : the anatomical frames of the skeleton it was fitted on
    """

    rig: ReducedRig
    free: Channels
    character: Character
    clip: Clip
    frames: Mapping[Side, StoredFrames]


@dataclass(frozen=True, eq=False)
class StoredFrames:
    """Anatomical frames as the rig has them: hand joints and quaternions (n, 4)."""

    names: tuple[str, ...]
    reference_frames: Array
    joint_frames: Array

    def on(self, frames: HandFrames) -> HandFrames:
        """Return these frames on a hand with the same joints, else the hand's own."""
        if self.names != frames.names:
            return frames
        return replace(
            frames, reference_frames=self.reference_frames, joint_frames=self.joint_frames
        )


def write_rig(
    reduction: Reduction,
    character: Character,
    output: Path,
    *,
    flatten: bool = False,
    force: bool = False,
) -> None:
    """Write a rig over its clip, with the reduced motion baked beside it.

    Raises the errors of `write_motion`.
    """
    frames = reduction.hands.frames.values()
    write_motion(
        character,
        reduction.motion,
        [int(j) for f in frames for j in f.joints],
        output,
        flatten=flatten,
        force=force,
        author=lambda layer, root: _author_rig(layer, root.AppendChild(RIG_NAME), reduction),
    )


def read_rig(path: str | Path) -> ReducedRig:
    """Read the relations of a rig file, without its motion.

    Raises
    ------
    InputError
        if the file holds no rig, or one that contradicts itself.
    """
    stage, _ = open_stage(Path(path))
    return _relations(find_rig(stage, Path(path)), Path(path))


def read_stored_rig(path: str | Path, skel: str | None = None) -> StoredRig:
    """Read a rig file with the curves of its free channels and its character."""
    path = Path(path)
    stage, _ = open_stage(path)
    prim = find_rig(stage, path)
    rig = _relations(prim, path)
    character = find_character(path, skel or _skeleton_path(prim))
    clip = clip_from_character(character)
    curves = [_curve(prim, name, clip.time_codes, path) for name in rig.free]
    values = np.stack(curves, axis=1) if curves else np.empty((len(clip), 0))
    return StoredRig(rig, Channels(rig.free, values), character, clip, _stored_frames(prim))


def find_rig(stage: Usd.Stage, path: Path) -> Usd.Prim:
    """The rig prim of a stage.

    Raises
    ------
    InputError
        if there is none, or more than one.
    """
    rigs = list(rig_prims(stage))
    if len(rigs) == 1:
        return rigs[0]
    if not rigs:
        raise InputError(f"{path}: no hand rig on this stage; 'usdhand reduce' writes one.")
    names = ", ".join(str(r.GetPath()) for r in rigs)
    raise InputError(f"{path}: more than one hand rig on this stage: {names}.")


def rig_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """All rigs on a stage, told by their version attribute: works without the schema."""
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return (prim for prim in everything if prim.GetAttribute("usdhand:version").HasAuthoredValue())


def rig_findings(stage: Usd.Stage, path: Path) -> Iterator[Finding]:
    """What is wrong with the rigs of a stage; see `usdhand.formats.usd.check.check_file`."""
    for prim in rig_prims(stage):
        where = str(prim.GetPath())
        try:
            rig = _relations(prim, path)
        except InputError as error:
            yield Finding("error", "broken-rig", str(error), where)
            continue
        if _skeleton_path(prim) is None:
            yield Finding("error", "rig-skeleton", "the rig's skeleton is not on the stage", where)
        for name in rig.free:
            attribute = prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:value")
            if not attribute.HasAuthoredValue():
                message = f"the free channel '{name}' has no value"
                yield Finding("error", "rig-no-value", message, where)


# -- writing ------------------------------------------------------------------------------------


def _author_rig(layer: Sdf.Layer, path: Sdf.Path, reduction: Reduction) -> None:
    rig, clip = reduction.rig, reduction.clip
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "Scope"
    schemas = Sdf.TokenListOp()
    instances = [f"HandChannelAPI:{name}" for name in (*rig.names, *rig.held)]
    schemas.prependedItems = ["HandRigAPI", *instances]
    prim.SetInfo("apiSchemas", schemas)

    skeleton = Sdf.RelationshipSpec(prim, "usdhand:skeleton", custom=True)
    skeleton.targetPathList.explicitItems = [Sdf.Path(clip.origin.skeleton_path)]
    _set(prim, "usdhand:version", _TYPES.Int, VERSION)
    _set(prim, "usdhand:fit", _TYPES.Token, rig.fit)
    _set(prim, "usdhand:rangeThreshold", _TYPES.Double, rig.range_threshold)
    _set(prim, "usdhand:rmsdThreshold", _TYPES.Double, rig.rmsd_threshold)
    _set(prim, "usdhand:sources", _TYPES.StringArray, Vt.StringArray(list(rig.sources)))
    if clip.origin.path is not None:
        _set(prim, "usdhand:sourceHash", _TYPES.String, file_hash(clip.origin.path))
    for side, frames in reduction.hands.frames.items():
        _set(prim, f"usdhand:{side}:joints", _TYPES.TokenArray, Vt.TokenArray(list(frames.names)))
        for name, values in (
            ("referenceFrames", frames.reference_frames),
            ("jointFrames", frames.joint_frames),
        ):
            quaternions = Vt.QuatdArray.FromNumpy(np.ascontiguousarray(values))
            _set(prim, f"usdhand:{side}:{name}", _TYPES.QuatdArray, quaternions)
    times = [float(t) for t in clip.time_codes]
    curves = dict(zip(reduction.free.names, reduction.free.values.T, strict=True))
    for relation in rig.relations:
        _author_channel(layer, prim, relation, times, curves.get(relation.name))
    for name, value in rig.held.items():
        _set_channel(prim, name, "kind", _TYPES.Token, HELD)
        _set_channel(prim, name, "value", _TYPES.Double, value)


def _author_channel(
    layer: Sdf.Layer,
    prim: Sdf.PrimSpec,
    relation: Relation,
    times: list[float],
    curve: Array | None,
) -> None:
    name = relation.name
    _set_channel(prim, name, "kind", _TYPES.Token, relation.kind)
    if relation.kind == "free" and curve is not None:
        attribute = _set_channel(prim, name, "value", _TYPES.Double, None)
        for time, value in zip(times, curve.tolist(), strict=True):
            layer.SetTimeSample(attribute.path, time, value)
        return
    _set_channel(prim, name, "rmsError", _TYPES.Double, relation.rms_error)
    if relation.kind == "constant":
        _set_channel(prim, name, "value", _TYPES.Double, relation.offset)
        return
    _set_channel(prim, name, "offset", _TYPES.Double, relation.offset)
    if relation.rmsd is not None:
        _set_channel(prim, name, "rmsd", _TYPES.Double, relation.rmsd)
    if len(relation.controllers) == 1:
        _set_channel(prim, name, "controller", _TYPES.Token, relation.controllers[0])
        _set_channel(prim, name, "slope", _TYPES.Double, relation.slopes[0])
    else:
        names = Vt.TokenArray(list(relation.controllers))
        _set_channel(prim, name, "controllers", _TYPES.TokenArray, names)
        slopes = Vt.DoubleArray(list(relation.slopes))
        _set_channel(prim, name, "slopes", _TYPES.DoubleArray, slopes)


def _set_channel(
    prim: Sdf.PrimSpec, channel: str, name: str, type_name: Sdf.ValueTypeName, value: Any
) -> Sdf.AttributeSpec:
    return _set(prim, f"{CHANNEL_PREFIX}:{channel}:{name}", type_name, value)


def _set(
    prim: Sdf.PrimSpec, name: str, type_name: Sdf.ValueTypeName, value: Any
) -> Sdf.AttributeSpec:
    attribute = Sdf.AttributeSpec(prim, name, type_name, Sdf.VariabilityVarying, True)
    if value is not None:
        attribute.default = value
    return attribute


# -- reading ------------------------------------------------------------------------------------


def _relations(prim: Usd.Prim, path: Path) -> ReducedRig:
    version = prim.GetAttribute("usdhand:version").Get()
    if version != VERSION:
        raise InputError(
            f"{path}: the rig has version {version}, this usdhand reads version {VERSION}."
        )
    relations, held = [], {}
    for name in _channel_names(prim):
        kind = _value(prim, name, "kind", path)
        if kind == HELD:
            held[name] = float(_value(prim, name, "value", path))
        elif kind in get_args(Kind):
            relations.append(_relation(prim, name, cast(Kind, kind), path))
        else:
            raise InputError(f"{path}: channel '{name}' has the unknown kind '{kind}'.")
    if not relations:
        raise InputError(f"{path}: the rig {prim.GetPath()} has no channels.")
    try:
        evaluation_order(relations)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error

    def get(name: str, default: Any) -> Any:
        value = prim.GetAttribute(f"usdhand:{name}").Get()
        return default if value is None else value

    return ReducedRig(
        tuple(relations),
        held,
        float(get("rangeThreshold", 0.0)),
        float(get("rmsdThreshold", 0.0)),
        str(get("fit", "paper")),
        tuple(str(s) for s in get("sources", ())),
    )


def _channel_names(prim: Usd.Prim) -> list[str]:
    """Channels in the order they were written: namesakes of the applied API instances, else all."""
    found = {a.GetName().split(":")[2] for a in prim.GetAttributes() if _is_channel(a)}
    listed = prim.GetMetadata("apiSchemas")
    order = [str(s).partition(":")[2] for s in listed.GetAddedOrExplicitItems()] if listed else []
    known = [name for name in order if name in found]
    return known + sorted(found - set(known))


def _is_channel(attribute: Usd.Attribute) -> bool:
    name: str = attribute.GetName()
    return name.startswith(f"{CHANNEL_PREFIX}:") and name.endswith(":kind") and name.count(":") == 3


def _relation(prim: Usd.Prim, name: str, kind: Kind, path: Path) -> Relation:
    def get(attribute: str) -> Any:
        return prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:{attribute}").Get()

    error = float(get("rmsError") or 0.0)
    if kind == "free":
        return Relation(name, kind)
    if kind == "constant":
        return Relation(name, kind, float(_value(prim, name, "value", path)), rms_error=error)
    several = get("controllers")
    controllers = tuple(several) if several else (_value(prim, name, "controller", path),)
    slopes = tuple(get("slopes") or ()) if several else (_value(prim, name, "slope", path),)
    if len(slopes) != len(controllers):
        raise InputError(
            f"{path}: channel '{name}' has {len(controllers)} controllers and {len(slopes)} slopes."
        )
    rmsd = get("rmsd")
    return Relation(
        name,
        kind,
        float(_value(prim, name, "offset", path)),
        tuple(str(c) for c in controllers),
        tuple(float(s) for s in slopes),
        None if rmsd is None else float(rmsd),
        error,
    )


def _value(prim: Usd.Prim, channel: str, name: str, path: Path) -> Any:
    value = prim.GetAttribute(f"{CHANNEL_PREFIX}:{channel}:{name}").Get()
    if value is None:
        raise InputError(f"{path}: channel '{channel}' of the rig has no '{name}'.")
    if isinstance(value, float) and not np.isfinite(value):
        raise InputError(f"{path}: '{name}' of channel '{channel}' is not a number.")
    return value


def _curve(prim: Usd.Prim, name: str, times: Array, path: Path) -> Array:
    """Degrees at the clip's frames; keys that someone thinned out are interpolated."""
    attribute = prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:value")
    query = Usd.AttributeQuery(attribute)
    sampled = query.GetTimeSamples()
    if not sampled:
        return np.full(len(times), float(_value(prim, name, "value", path)))
    values = np.array([query.Get(t) for t in sampled], dtype=np.float64)
    if not np.isfinite(values).all():
        raise InputError(f"{path}: the curve of channel '{name}' has values that are no numbers.")
    return np.interp(times, sampled, values)


def _skeleton_path(prim: Usd.Prim) -> str | None:
    targets = prim.GetRelationship("usdhand:skeleton").GetTargets()
    found = [t for t in targets if prim.GetStage().GetPrimAtPath(t).IsA(UsdSkel.Skeleton)]
    return str(found[0]) if found else None


def _stored_frames(prim: Usd.Prim) -> dict[Side, StoredFrames]:
    found: dict[Side, StoredFrames] = {}
    for side in SIDES:
        joints, reference, own = (
            prim.GetAttribute(f"usdhand:{side}:{name}").Get()
            for name in ("joints", "referenceFrames", "jointFrames")
        )
        if joints and reference and own and len(joints) == len(reference) == len(own):
            found[side] = StoredFrames(
                tuple(str(j) for j in joints), np.array(reference), np.array(own)
            )
    return found


def with_stored_frames(hands: Hands, stored: Mapping[Side, StoredFrames]) -> Hands:
    """Return hands with the frames that a rig was fitted with."""
    return replace(
        hands, frames={s: stored[s].on(f) if s in stored else f for s, f in hands.frames.items()}
    )
