"""The reduced rig on a stage: custom attributes of a Scope, readable without any schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
from pxr import Sdf, Usd, UsdSkel, Vt

from usdhand.anatomy.channels import Channels
from usdhand.anatomy.hand import HAND_JOINTS, SIDES, Side
from usdhand.errors import InputError
from usdhand.formats.usd.character import as_on_stage
from usdhand.formats.usd.damage import damage_refused, refuses_damage
from usdhand.formats.usd.read import clip_from_character
from usdhand.formats.usd.rig_author import CHANNEL_PREFIX, HELD, LIMITS, author_rig
from usdhand.formats.usd.rig_frames import StoredFrames
from usdhand.formats.usd.rig_residuals import read_residuals
from usdhand.formats.usd.rig_source import RigSource, rig_source
from usdhand.formats.usd.rig_version import check_version, rig_version
from usdhand.formats.usd.stage import (
    Character,
    bound_animation,
    is_meant,
    open_stage,
)
from usdhand.formats.usd.write import free_child, write_motion
from usdhand.motion import Clip
from usdhand.motion.rotations import UNIT_TOLERANCE, Array
from usdhand.problems import Problem
from usdhand.reduce.limits import Limits
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import Kind, ReducedRig, Relation, evaluation_order

RIG_NAME = "HandRig"
LARGEST = 1e6  # degrees, or anything else a rig counts: more cannot be meant


@dataclass(frozen=True, eq=False)
class StoredRig:
    """A rig as it was read, with the motion that it was written with.

    Attributes
    ----------
    free : curves of the free channels at the clip's frames, edits by others included
    clip : the rig file's own character and its (baked) motion
    frames : the anatomical frames of the skeleton it was fitted on
    version : of its encoding
    source : the file that it was made from, where it is known
    """

    rig: ReducedRig
    free: Channels
    character: Character
    clip: Clip
    frames: Mapping[Side, StoredFrames]
    version: int
    source: RigSource | None = None


def write_rig(
    reduction: Reduction,
    character: Character,
    output: Path,
    *,
    flatten: bool = False,
    allow_outside: bool = False,
    force: bool = False,
) -> tuple[Problem, ...]:
    """Write a rig over its clip, with the reduced motion baked beside it.

    Returns what flattening could not keep, and other problems of the file. Raises the errors of
    `write_motion`.
    """
    frames = reduction.hands.frames.values()
    reduction = replace(reduction, clip=as_on_stage(reduction.clip, character))
    stage, skeleton = character.stage, character.skeleton.GetPath()
    old = [p.GetPath() for p in rig_prims(stage) if _skeleton_path(p) in (str(skeleton), None)]

    def author(layer: Sdf.Layer, root: Sdf.Path) -> None:
        # A rig that the input has would shine through the new one: it is put aside.
        for path in old:
            Sdf.CreatePrimInLayer(layer, path).SetInfo("active", False)
        author_rig(layer, free_child(stage, root, RIG_NAME), reduction, skeleton)

    return write_motion(
        character,
        reduction.motion,
        [j for f in frames for j in f.links.moving],
        output,
        flatten=flatten,
        allow_outside=allow_outside,
        force=force,
        author=author,
    )


@refuses_damage
def read_rig(path: str | Path, skel: str | None = None) -> ReducedRig:
    """Read the relations of a rig file, without its motion.

    ``skel`` chooses by the skeleton where a stage has rigs of several characters.

    Raises
    ------
    InputError
        if the file holds no rig, or one that contradicts itself.
    """
    path = Path(path)
    stage, _ = open_stage(path)
    return read_rig_on(stage, path, skel)


def read_rig_on(stage: Usd.Stage, path: Path, skel: str | None = None) -> ReducedRig:
    """Read the relations of a rig on a stage that was opened from ``path``; see `read_rig`."""
    with damage_refused(path):
        return read_rig_at(find_rig(stage, path, skel), path)


@refuses_damage
def read_stored_rig(path: str | Path, skel: str | None = None, option: str = "--skel") -> StoredRig:
    """Read a rig file with the curves of its free channels and its character.

    Parameters and errors are those of `read_rig` and `find_rig`.
    """
    path = Path(path)
    stage, problems = open_stage(path)
    prim = find_rig(stage, path, skel, option)
    rig = read_rig_at(prim, path, with_frames=True)
    found = _skeleton_path(prim)
    if found is None and not prim.GetRelationship("usdhand:skeleton"):
        raise InputError(
            f"{path}: the rig {prim.GetPath()} was fitted without a character and has no "
            "motion of its own; 'usdhand expand --motion' takes the free channels from a clip."
        )
    if found is None:
        raise InputError(f"{path}: the skeleton of the rig {prim.GetPath()} does not exist.")
    skeleton = stage.GetPrimAtPath(found)
    character = Character(stage, path, skeleton, bound_animation(skeleton), problems)
    clip = clip_from_character(character)
    curves = [_curve(prim, name, clip.time_codes, path) for name in rig.free]
    values = np.stack(curves, axis=1) if curves else np.empty((len(clip), 0))
    frames = _stored_frames(prim, path)
    source = rig_source(prim)
    free, version = Channels(rig.free, values), rig_version(prim)
    return StoredRig(rig, free, character, clip, frames, version, source)


def find_rig(
    stage: Usd.Stage, path: Path, skel: str | None = None, option: str = "--skel"
) -> Usd.Prim:
    """The rig prim of a stage; see `read_rig`.

    ``option`` chooses one on the command line, for messages.

    Raises
    ------
    InputError
        if there is none, or more than one to choose from.
    """
    rigs = list(rig_prims(stage))
    if skel is not None:
        rigs = [r for r in rigs if is_meant(Sdf.Path(_skeleton_path(r) or "/"), skel)]
    if len(rigs) == 1:
        return rigs[0]
    if not rigs:
        of = f" for the skeleton '{skel}'" if skel else ""
        raise InputError(f"{path}: no hand rig{of} on this stage; 'usdhand reduce' writes one.")
    names = ", ".join(f"{r.GetPath()} (of {_skeleton_path(r)})" for r in rigs)
    raise InputError(
        f"{path}: there are several hand rigs; choose one by its skeleton with {option}: {names}."
    )


def names_a_rig(path: str | Path, skel: str) -> bool:
    """Whether a file has several rigs, and ``skel`` chooses one of them by its skeleton."""
    stage, _ = open_stage(Path(path))
    skeletons = [_skeleton_path(prim) for prim in rig_prims(stage)]
    meant = [s for s in skeletons if s and is_meant(Sdf.Path(s), skel)]
    return len(skeletons) > 1 and len(meant) == 1


def rig_prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """All rigs on a stage, told by their version attribute: works without the schema."""
    everything = stage.Traverse(Usd.TraverseInstanceProxies())
    return (prim for prim in everything if prim.GetAttribute("usdhand:version").HasAuthoredValue())


def rig_findings(stage: Usd.Stage, path: Path) -> Iterator[Problem]:
    """What is wrong with the rigs of a stage; see `usdhand.formats.usd.check.check_file`."""
    seen: dict[str | None, str] = {}
    for prim in rig_prims(stage):
        where, skeleton = str(prim.GetPath()), _skeleton_path(prim)
        if not prim.GetRelationship("usdhand:skeleton"):
            skeleton = f"none, {where}"  # fitted without a character
        if skeleton is None:
            yield Problem("rig-skeleton", "the rig's skeleton is not on the stage", where, "error")
        elif skeleton in seen:
            message = f"{seen[skeleton]} is a rig of the same skeleton; deactivate one of them"
            yield Problem("second-rig", message, where, "error")
        seen[skeleton] = where
        try:
            rig = read_rig_at(prim, path, with_frames=True)
            _stored_frames(prim, path)
            for name in rig.free:
                _curve(prim, name, np.zeros(1), path)
        except InputError as error:
            yield Problem("broken-rig", str(error), where, "error")


def read_rig_at(prim: Usd.Prim, path: Path, *, with_frames: bool = False) -> ReducedRig:
    """Read the relations of the rig at a prim; see `read_rig`.

    ``with_frames``: they are used with the frames that are stored beside them.
    """
    check_version(rig_version(prim), path, with_frames=with_frames)
    relations, held = [], {}
    for name in _channel_names(prim):
        kind = _value(prim, name, "kind", path)
        if kind == HELD:
            held[name] = _number(prim, name, "value", path)
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

    def get(name: str, kind: type, default: Any) -> Any:
        value = prim.GetAttribute(f"usdhand:{name}").Get()
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{path}: usdhand:{name} of the rig has the wrong type.")
        return default if value is None else value

    return ReducedRig(
        tuple(relations),
        held,
        float(get("rangeThreshold", float, 0.0)),
        float(get("rmsdThreshold", float, 0.0)),
        str(get("fit", str, "paper")),
        tuple(str(s) for s in get("sources", Vt.StringArray, ())),
        str(get("measure", str, "")),
        read_residuals(prim, path),
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
    def number(attribute: str) -> float | None:
        there = prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:{attribute}").HasAuthoredValue()
        return _number(prim, name, attribute, path) if there else None

    found = Relation(
        name,
        kind,
        rms_error=number("rmsError") or 0.0,
        left_out_error=number("leftOutError"),
        std=number("std"),
        limits=_limits(name, {end: number(end) for end in LIMITS}, path),
    )
    if kind == "free":
        return found
    if kind == "constant":
        return replace(found, offset=_number(prim, name, "value", path))
    controllers, slopes = _controllers(prim, name, path)
    offset = _number(prim, name, "offset", path)
    return replace(
        found, offset=offset, controllers=controllers, slopes=slopes, rmsd=number("rmsd")
    )


def _limits(name: str, ends: Mapping[str, float | None], path: Path) -> Limits | None:
    """Limits of a channel; None for rigs that say nothing of them."""
    there = [value for value in ends.values() if value is not None]
    if not there:
        return None
    if len(there) < len(LIMITS) or sorted(there) != there:
        raise InputError(
            f"{path}: the limits of channel '{name}' must be {', '.join(LIMITS)}, in rising order."
        )
    return Limits(*there)


def _controllers(
    prim: Usd.Prim, name: str, path: Path
) -> tuple[tuple[str, ...], tuple[float, ...]]:
    several = prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:controllers").Get()
    if not several:
        controller = str(_value(prim, name, "controller", path))
        return (controller,), (_number(prim, name, "slope", path),)
    slopes = _value(prim, name, "slopes", path)
    if not isinstance(slopes, Vt.DoubleArray) or not isinstance(several, Vt.TokenArray):
        raise InputError(f"{path}: controllers or slopes of channel '{name}' have the wrong type.")
    if len(slopes) != len(several) or not np.isfinite(np.array(slopes)).all():
        raise InputError(
            f"{path}: the {len(slopes)} slopes of channel '{name}' do not fit its {len(several)} "
            "controllers."
        )
    return tuple(str(c) for c in several), tuple(float(s) for s in slopes)


def _value(prim: Usd.Prim, channel: str, name: str, path: Path) -> Any:
    attribute = prim.GetAttribute(f"{CHANNEL_PREFIX}:{channel}:{name}")
    if _is_animated(attribute):
        raise InputError(
            f"{path}: '{name}' of channel '{channel}' is animated, which only the 'value' of a "
            "free channel may be. Remove its time samples or spline"
            + (f", or set usdhand:channel:{channel}:kind to 'free'." if name == "value" else ".")
        )
    value = attribute.Get()
    if value is None:
        raise InputError(f"{path}: channel '{channel}' of the rig has no '{name}'.")
    return value


def _is_animated(attribute: Usd.Attribute) -> bool:
    """Whether values come from time samples, a value clip or a spline."""
    return bool(
        attribute and (attribute.GetNumTimeSamples() or attribute.ValueMightBeTimeVarying())
    )


def _number(prim: Usd.Prim, channel: str, name: str, path: Path) -> float:
    value = _value(prim, channel, name, path)
    if not isinstance(value, (int, float)) or not abs(value) <= LARGEST:
        raise InputError(
            f"{path}: '{name}' of channel '{channel}' is {value!r}, which is not plausible."
        )
    return float(value)


def _curve(prim: Usd.Prim, name: str, times: Array, path: Path) -> Array:
    """Degrees at the clip's frames, as USD interpolates samples or evaluates a spline."""
    attribute = prim.GetAttribute(f"{CHANNEL_PREFIX}:{name}:value")
    if not _is_animated(attribute):
        return np.full(len(times), _number(prim, name, "value", path))
    query = Usd.AttributeQuery(attribute)
    values = [query.Get(t) for t in times.tolist()]
    if not all(isinstance(v, (int, float)) and abs(v) <= LARGEST for v in values):
        raise InputError(f"{path}: the curve of channel '{name}' has values that are not angles.")
    return np.array(values, dtype=np.float64)


def _skeleton_path(prim: Usd.Prim) -> str | None:
    stage = prim.GetStage()
    for target in prim.GetRelationship("usdhand:skeleton").GetTargets():
        found = stage.GetPrimAtPath(target)
        if found and found.IsA(UsdSkel.Skeleton):
            return str(target)
    return None


def _stored_frames(prim: Usd.Prim, path: Path) -> dict[Side, StoredFrames]:
    found: dict[Side, StoredFrames] = {}
    for side in SIDES:
        joints = prim.GetAttribute(f"usdhand:{side}:joints").Get()
        if joints is None:
            continue
        names = tuple(str(j) for j in joints)
        frames = [
            np.array(prim.GetAttribute(f"usdhand:{side}:{name}").Get(), dtype=np.float64)
            for name in ("referenceFrames", "jointFrames")
        ]
        for values in frames:
            fits = values.shape == (len(names), 4) and np.isfinite(values).all()
            if not fits or np.abs(np.linalg.norm(values, axis=1) - 1.0).max() > UNIT_TOLERANCE:
                raise InputError(f"{path}: the frames of the {side} hand of the rig are damaged.")
        if not set(names) <= set(HAND_JOINTS):
            raise InputError(f"{path}: the rig has {side} hand joints that do not exist.")
        found[side] = StoredFrames(names, frames[0], frames[1])
    return found
