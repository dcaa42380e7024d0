"""Rig files: what ``usdhand reduce`` wrote, and layers of edited channels over it.

Read through the USD that Blender brings, since its importer passes on no arrays and no time samples
of custom attributes.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdSkel

VERSION = 2
PREFIX = "usdhand:channel"
LIMITS = ("min", "softMin", "softMax", "max")
SUFFIXES = (".usda", ".usdc", ".usd")
# Keys of Blender are single precision.
SAME_DEG = 1e-3


class RigError(Exception):
    """What is wrong with a rig or a file, for people."""


@dataclass(frozen=True)
class Channel:
    """One rotation angle of one joint, degrees.

    ``times`` (time codes) and ``values`` are the curve of a free channel, or one value at no time;
    a linear one is ``offset + sum(slopes * controllers)``, which bends off beyond the inner two of
    its ``limits`` (min, softMin, softMax, max) and never passes the outer two.
    """

    name: str
    kind: str
    times: tuple[float, ...] = ()
    values: tuple[float, ...] = (0.0,)
    controllers: tuple[str, ...] = ()
    slopes: tuple[float, ...] = ()
    offset: float = 0.0
    limits: tuple[float, float, float, float] | None = None

    def at(self, times: np.ndarray) -> np.ndarray:
        """Values of a curve as ``usdhand expand`` reads it: straight between the samples."""
        if not self.times:
            return np.full(len(times), self.values[0])
        return np.interp(times, self.times, self.values)


@dataclass(frozen=True)
class Joint:
    """A joint of a hand: names of bones, and frames as quaternions (x, y, z, w)."""

    side: str
    name: str  # "IndexPIP"
    bone: str
    reference: str
    reference_frame: np.ndarray
    joint_frame: np.ndarray

    @property
    def is_ball(self) -> bool:
        """Whether its angles are swing and twist."""
        return self.name == "ThumbCMC"

    @property
    def channels(self) -> tuple[str, str, str]:
        """Its abduction, flexion and rotation about the bone."""
        letters = "xzy" if self.name.startswith("Thumb") else "xyz"
        a, f, t = (f"{self.side[:2]}{self.name}{letter}" for letter in letters)
        return a, f, t


@dataclass(frozen=True)
class HandRig:
    """A rig prim of a file, with what it says about time."""

    path: str  # of the prim
    skeleton: str
    channels: Mapping[str, Channel]
    joints: tuple[Joint, ...]
    times: np.ndarray  # time codes of the motion
    codes_per_second: float
    start: float
    end: float

    @property
    def free(self) -> tuple[Channel, ...]:
        """Channels that an animator moves."""
        return tuple(c for c in self.channels.values() if c.kind == "free")


def read_rigs(path: str) -> list[HandRig]:
    """Read all rigs of a file; raises RigError if there is none, or one cannot be used."""
    stage = open_stage(path)
    found = [
        _rig(prim)
        for prim in stage.Traverse(Usd.TraverseInstanceProxies())
        if prim.GetAttribute("usdhand:version").HasAuthoredValue()
    ]
    if not found:
        raise RigError(f"{path} holds no hand rig; 'usdhand reduce' writes one.")
    return found


def open_stage(path: str) -> Usd.Stage:
    """Open a stage; raises RigError if that fails."""
    if not Path(path).is_file():
        raise RigError(f"{path}: no such file.")
    try:
        return Usd.Stage.Open(path)
    except Tf.ErrorException as error:
        raise RigError(f"{path} cannot be read as USD.") from error


def write_edits(path: str, rig_path: str, output: str, edited: Mapping[str, Channel]) -> None:
    """Write a layer over a rig file that says anew what the edited channels do.

    Raises RigError if the output is one of the files that the rig is made of, or cannot be
    written; nothing is left behind then.
    """
    stage, target = open_stage(path), Path(output).resolve()
    if target.suffix.lower() not in SUFFIXES:
        raise RigError(f"{target.name}: the name must end in {', '.join(SUFFIXES)}.")
    if target in [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]:
        raise RigError(f"{target} is a part of the rig and stays as it is: choose another name.")
    if not target.parent.is_dir():
        raise RigError(f"{target.parent}: no such folder to write {target.name} to.")
    layer = _layer_over(stage, target)
    prim = Sdf.CreatePrimInLayer(layer, rig_path)
    for channel in edited.values():
        name = f"{PREFIX}:{channel.name}:value"
        attribute = Sdf.AttributeSpec(
            prim, name, Sdf.ValueTypeNames.Double, Sdf.VariabilityVarying, True
        )
        for time, value in zip(channel.times, channel.values, strict=True):
            layer.SetTimeSample(attribute.path, time, value)
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        if not layer.Export(str(temporary)):
            raise RigError(f"USD cannot write to {target.parent}.")
        temporary.replace(target)
    except (Tf.ErrorException, OSError) as error:
        raise RigError(f"USD cannot write to {target.parent}.") from error
    finally:
        temporary.unlink(missing_ok=True)
    known = Sdf.Layer.Find(str(target))
    if known:
        known.Reload(force=True)


def _layer_over(stage: Usd.Stage, target: Path) -> Sdf.Layer:
    """Layer that says the same of units, axes and time as the stage it is over."""
    source, layer = stage.GetRootLayer(), Sdf.Layer.CreateAnonymous(".usdc")
    for field in ("upAxis", "metersPerUnit", "startTimeCode", "endTimeCode", "defaultPrim"):
        if stage.HasAuthoredMetadata(field):
            layer.pseudoRoot.SetInfo(field, stage.GetMetadata(field))
    layer.timeCodesPerSecond = stage.GetTimeCodesPerSecond()
    layer.framesPerSecond = stage.GetFramesPerSecond()
    below = Path(source.realPath)
    try:
        relative = Path(os.path.relpath(below, target.parent)).as_posix()
    except ValueError:  # another drive
        relative = below.as_posix()
    layer.subLayerPaths.append(relative if relative.startswith((".", "/")) else f"./{relative}")
    return layer


def _rig(prim: Usd.Prim) -> HandRig:
    version = prim.GetAttribute("usdhand:version").Get()
    if version != VERSION:
        raise RigError(f"The rig has version {version}; this add-on reads version {VERSION}.")
    stage = prim.GetStage()
    targets = prim.GetRelationship("usdhand:skeleton").GetTargets()
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(targets[0])) if targets else None
    if not skeleton:
        raise RigError(f"The skeleton of the rig {prim.GetPath()} is not there.")
    leaves = [str(j).rsplit("/", 1)[-1] for j in skeleton.GetJointsAttr().Get() or ()]
    names = sorted(
        a.GetName().split(":")[2]
        for a in prim.GetAttributes()
        if a.GetName().startswith(f"{PREFIX}:") and a.GetName().endswith(":kind")
    )
    channels = {name: _channel(prim, name) for name in names}
    for channel in channels.values():
        if not set(channel.controllers) <= set(channels):
            raise RigError(f"Channel '{channel.name}' follows one that the rig does not have.")
    joints = [j for side in ("left", "right") for j in _joints(prim, side)]
    # A joint that the rig says nothing of keeps its motion.
    joints = [j for j in joints if not channels.keys().isdisjoint(j.channels)]
    turning = {name for joint in joints for name in joint.channels}
    if turning != set(channels):
        odd = sorted(turning ^ set(channels))
        raise RigError(f"Channels and joints of the rig do not fit: '{odd[0]}'.")
    for joint in joints:
        if leaves.count(joint.bone) != 1:
            raise RigError(f"{leaves.count(joint.bone)} joints are named '{joint.bone}'.")
    times = _times(skeleton, channels)
    return HandRig(
        str(prim.GetPath()),
        str(targets[0]),
        channels,
        tuple(joints),
        times,
        stage.GetTimeCodesPerSecond(),
        stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else times[0],
        stage.GetEndTimeCode() if stage.HasAuthoredTimeCodeRange() else times[-1],
    )


def _channel(prim: Usd.Prim, name: str) -> Channel:
    def get(attribute: str) -> object:
        value = prim.GetAttribute(f"{PREFIX}:{name}:{attribute}").Get()
        if value is None:
            raise RigError(f"Channel '{name}' of the rig has no '{attribute}'.")
        return value

    kind = str(get("kind"))
    if kind == "linear":
        several = prim.GetAttribute(f"{PREFIX}:{name}:controllers").Get()
        controllers = [str(c) for c in several] if several else [str(get("controller"))]
        slopes = [float(s) for s in get("slopes")] if several else [float(get("slope"))]
        if len(slopes) != len(controllers):
            raise RigError(f"Slopes and controllers of channel '{name}' do not fit.")
        return Channel(
            name,
            kind,
            controllers=tuple(controllers),
            slopes=tuple(slopes),
            offset=float(get("offset")),
            limits=_limits(prim, name),
        )
    if kind not in ("free", "constant", "held"):
        raise RigError(f"Channel '{name}' has the unknown kind '{kind}'.")
    query = Usd.AttributeQuery(prim.GetAttribute(f"{PREFIX}:{name}:value"))
    times = query.GetTimeSamples() if kind == "free" else []
    values = [query.Get(t) for t in times] or [get("value")]
    if not all(isinstance(v, (int, float)) and np.isfinite(v) for v in values):
        raise RigError(f"The curve of channel '{name}' has values that are no angles.")
    return Channel(name, kind, tuple(times), tuple(map(float, values)), limits=_limits(prim, name))


def _limits(prim: Usd.Prim, name: str) -> tuple[float, float, float, float] | None:
    """Limits of a channel; None for rigs that say nothing of them."""
    ends = [prim.GetAttribute(f"{PREFIX}:{name}:{end}").Get() for end in LIMITS]
    if not any(isinstance(end, float) for end in ends):
        return None
    if not all(isinstance(end, float) for end in ends) or sorted(ends) != ends:
        raise RigError(f"The limits of channel '{name}' are damaged.")
    return tuple(ends)


def _joints(prim: Usd.Prim, side: str) -> list[Joint]:
    def get(name: str) -> object:
        return prim.GetAttribute(f"usdhand:{side}:{name}").Get()

    names = get("joints")
    if names is None:
        return []
    bones, references = get("skeletonJoints"), get("referenceJoints")
    frames = [
        np.array([(*q.GetImaginary(), q.GetReal()) for q in get(name) or ()])
        for name in ("referenceFrames", "jointFrames")
    ]
    if bones is None or references is None:
        raise RigError("The rig does not name its joints: reduce again with a newer usdhand.")
    if {len(bones), len(references), *map(len, frames)} != {len(names)}:
        raise RigError(f"The frames of the {side} hand of the rig are damaged.")
    return [
        Joint(side, str(name), bone.rsplit("/", 1)[-1], reference.rsplit("/", 1)[-1], before, own)
        for name, bone, reference, before, own in zip(
            names, bones, references, *frames, strict=True
        )
    ]


def _times(skeleton: UsdSkel.Skeleton, channels: Mapping[str, Channel]) -> np.ndarray:
    """Time codes of the character's motion and of the channels."""
    found = {t for c in channels.values() for t in c.times}
    source = UsdSkel.BindingAPI(skeleton).GetInheritedAnimationSource()
    if source:
        found.update(UsdSkel.Animation(source).GetRotationsAttr().GetTimeSamples())
    return np.array(sorted(found) or [0.0])
