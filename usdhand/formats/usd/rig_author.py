"""A reduced rig authored as custom attributes of a Scope."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pxr import Sdf, Vt

from usdhand.formats.hashing import file_hash
from usdhand.formats.usd.rig_version import VERSION
from usdhand.motion.rotations import Array
from usdhand.reduce.method import Reduction
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.variation import EDGES_HZ, Residuals

CHANNEL_PREFIX = "usdhand:channel"
HELD = "held"
# Attribute of a channel -> that end of its range.
LIMITS = {"min": "low", "softMin": "soft_low", "softMax": "soft_high", "max": "high"}
_TYPES = Sdf.ValueTypeNames


def author_rig(
    layer: Sdf.Layer, path: Sdf.Path, reduction: Reduction, skeleton_path: Sdf.Path
) -> None:
    """Write a rig as a Scope at ``path``: explicit custom attributes, typed by the schema."""
    rig, clip = reduction.rig, reduction.clip
    times = [float(t) for t in clip.time_codes]
    curves = dict(zip(reduction.free.names, reduction.free.values.T, strict=True))
    prim = author_relations(layer, path, rig, times, curves)
    skeleton = Sdf.RelationshipSpec(prim, "usdhand:skeleton", custom=True)
    skeleton.targetPathList.explicitItems = [skeleton_path]
    if clip.origin.path is not None:
        _set(prim, "usdhand:sourceHash", _TYPES.String, file_hash(clip.origin.path))
    for side, frames in reduction.hands.frames.items():
        # The joints' own names too, so that other programs can turn them without finding the hand.
        for name, joints in (
            ("joints", frames.names),
            ("skeletonJoints", [clip.skeleton.joints[j] for j in frames.joints]),
            ("referenceJoints", [clip.skeleton.joints[j] for j in frames.references]),
        ):
            tokens = Vt.TokenArray(list(joints))
            _set(prim, f"usdhand:{side}:{name}", _TYPES.TokenArray, tokens)
        for name, values in (
            ("referenceFrames", frames.reference_frames),
            ("jointFrames", frames.joint_frames),
        ):
            quaternions = Vt.QuatdArray.FromNumpy(np.ascontiguousarray(values))
            _set(prim, f"usdhand:{side}:{name}", _TYPES.QuatdArray, quaternions)


def author_relations(
    layer: Sdf.Layer,
    path: Sdf.Path,
    rig: ReducedRig,
    times: Sequence[float] = (),
    curves: Mapping[str, Array] | None = None,
) -> Sdf.PrimSpec:
    """Write what a rig is, whatever character it is for.

    Free channels without a curve are at the middle of their limits.
    """
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "Scope"
    schemas = Sdf.TokenListOp()
    instances = [f"HandChannelAPI:{name}" for name in (*rig.names, *rig.held)]
    schemas.prependedItems = ["HandRigAPI", *instances]
    prim.SetInfo("apiSchemas", schemas)

    _set(prim, "usdhand:version", _TYPES.Int, VERSION)
    _set(prim, "usdhand:fit", _TYPES.Token, rig.fit)
    _set(prim, "usdhand:rangeThreshold", _TYPES.Double, rig.range_threshold)
    _set(prim, "usdhand:rmsdThreshold", _TYPES.Double, rig.rmsd_threshold)
    if rig.measure:
        _set(prim, "usdhand:measure", _TYPES.Token, rig.measure)
    if rig.residuals is not None:
        _author_residuals(prim, rig.residuals)
    _set(prim, "usdhand:sources", _TYPES.StringArray, Vt.StringArray(list(rig.sources)))
    for relation in rig.relations:
        _author_channel(layer, prim, relation, times, (curves or {}).get(relation.name))
    for name, value in rig.held.items():
        _set_channel(prim, name, "kind", _TYPES.Token, HELD)
        _set_channel(prim, name, "value", _TYPES.Double, value)
    return prim


def _author_channel(
    layer: Sdf.Layer,
    prim: Sdf.PrimSpec,
    relation: Relation,
    times: Sequence[float],
    curve: Array | None,
) -> None:
    name = relation.name
    _set_channel(prim, name, "kind", _TYPES.Token, relation.kind)
    if relation.std is not None:
        _set_channel(prim, name, "std", _TYPES.Double, relation.std)
    if relation.limits is not None:
        for end in LIMITS:
            value = getattr(relation.limits, LIMITS[end])
            _set_channel(prim, name, end, _TYPES.Double, value)
    if relation.left_out_error is not None and relation.kind != "free":
        _set_channel(prim, name, "leftOutError", _TYPES.Double, relation.left_out_error)
    if relation.kind == "free" and curve is not None:
        attribute = _set_channel(prim, name, "value", _TYPES.Double, None)
        for time, value in zip(times, curve.tolist(), strict=True):
            layer.SetTimeSample(attribute.path, time, value)
        return
    if relation.kind == "free":
        value = relation.limits.middle if relation.limits else 0.0
        _set_channel(prim, name, "value", _TYPES.Double, value)
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


def _author_residuals(prim: Sdf.PrimSpec, residuals: Residuals) -> None:
    """Mixtures as one array: bands x noises x channels."""
    names = Vt.TokenArray(list(residuals.names))
    _set(prim, "usdhand:residual:channels", _TYPES.TokenArray, names)
    _set(prim, "usdhand:residual:bands", _TYPES.DoubleArray, Vt.DoubleArray(list(EDGES_HZ)))
    flat = Vt.FloatArray.FromNumpy(residuals.array.astype(np.float32).ravel())
    _set(prim, "usdhand:residual:mixtures", _TYPES.FloatArray, flat)


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
