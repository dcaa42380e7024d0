"""The motion of an ascii layer in a crate beside it, ``NAME.motion.usdc``.

What a person reads stays in ``NAME.usda``. Attributes with many time samples, or long arrays, go to
the crate, which is its strongest sublayer: they compose as before.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf

from usdhand.formats.hashing import file_hash
from usdhand.formats.paths import MOTION_SUFFIX, motion_crate
from usdhand.formats.usd.damage import usd_diagnostics

# What other validators take to be too much for a text file.
MANY_SAMPLES = 4
LONG_ARRAY = 64

# What a layer says of itself under ``usdhand`` in its customLayerData.
MOTION_OF = "motionOf"  # of a crate: the name of its layer
MOTION = "motionSha256"  # of a layer: the content of its crate
TIMES = ("timeCodesPerSecond", "framesPerSecond", "startTimeCode", "endTimeCode")
DESCRIBING = (*TIMES, "upAxis", "metersPerUnit", "kilogramsPerUnit", "defaultPrim")


def taken_out(layer: Sdf.Layer, output: Path) -> Sdf.Layer | None:
    """Take what belongs into a crate out of a layer; None if there is nothing of it.

    Parameters
    ----------
    output : the file that the layer will be
    """
    heavy = _heavy(layer)
    if not heavy:
        return None
    crate = Sdf.Layer.CreateAnonymous(".usdc")
    for field in DESCRIBING:
        if layer.pseudoRoot.HasInfo(field):
            crate.pseudoRoot.SetInfo(field, layer.pseudoRoot.GetInfo(field))
    _say(crate, {MOTION_OF: output.name})
    with Sdf.ChangeBlock():
        for path in dict.fromkeys(path.GetParentPath() for path in heavy):
            _prims_above(layer, crate, path)
        for path in heavy:
            Sdf.CopySpec(layer, path, crate, path)
            prim = layer.GetPrimAtPath(path.GetParentPath())  # also of a variant
            prim.RemoveProperty(layer.GetAttributeAtPath(path))
    return crate


def refer_to(layer: Sdf.Layer, crate: Path, name: str) -> None:
    """Let a layer have a crate, which will be beside it as ``name``, as its strongest sublayer."""
    layer.subLayerPaths.insert(0, f"./{name}")
    _say(layer, {MOTION: file_hash(crate)})


def described(layer: Sdf.Layer) -> dict[str, Any]:
    """The custom data of a layer that hold for layers over it: not what it says of its crate."""
    data = dict(layer.customLayerData)
    own = {k: v for k, v in dict(data.pop("usdhand", {})).items() if k not in (MOTION, MOTION_OF)}
    return data | ({"usdhand": own} if own else {})


def own_crate(output: Path) -> Path | None:
    """The crate beside a file that holds its motion, be it there or to be there no longer."""
    crate = motion_crate(output)
    return crate if motion_of(crate) == output.name else None


def motion_of(path: Path) -> str | None:
    """Name of the layer whose motion a crate holds, None for other files."""
    if not path.name.endswith(MOTION_SUFFIX) or not path.is_file():
        return None
    with usd_diagnostics():
        try:
            layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
        except (Tf.ErrorException, UnicodeError):
            return None
    name = _said(layer).get(MOTION_OF) if layer else None
    return name if isinstance(name, str) else None


def other_motion(layer: Sdf.Layer) -> str | None:
    """Name of the crate beside a layer if its content is not what was written with the layer."""
    digest = _said(layer).get(MOTION)
    if not digest or not layer.realPath:
        return None
    for asset in layer.subLayerPaths:
        path = Path(layer.realPath).parent / asset
        if path.name.endswith(MOTION_SUFFIX):
            return None if file_hash(path) == digest else path.name
    return None


def _heavy(layer: Sdf.Layer) -> list[Sdf.Path]:
    """Attributes for the crate. Value clips of the layer would win over them there."""
    found: list[Sdf.Path] = []
    clipped: list[Sdf.Path] = []

    def look(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips"):
            clipped.append(path)
        if isinstance(spec, Sdf.AttributeSpec) and _is_heavy(layer, spec):
            found.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, look)
    return sorted(p for p in found if not any(p.HasPrefix(above) for above in clipped))


def _is_heavy(layer: Sdf.Layer, spec: Sdf.AttributeSpec) -> bool:
    times = layer.ListTimeSamplesForPath(spec.path)
    if len(times) > MANY_SAMPLES:
        return True
    if not spec.typeName.isArray:
        return False
    values = [spec.default, *(layer.QueryTimeSample(spec.path, time) for time in times)]
    return any(hasattr(value, "__len__") and len(value) > LONG_ARRAY for value in values)


def _prims_above(layer: Sdf.Layer, crate: Sdf.Layer, path: Sdf.Path) -> None:
    """Make a prim and all above it, each among its siblings, whose order is composed as well."""
    for own in path.GetPrefixes():
        if crate.GetPrimAtPath(own):
            continue
        if own.IsPrimVariantSelectionPath():
            Sdf.CreatePrimInLayer(crate, own)
            continue
        above = own.GetParentPath()
        root = above == Sdf.Path.absoluteRootPath
        for prim in (layer.pseudoRoot if root else layer.GetPrimAtPath(above)).nameChildren:
            Sdf.CreatePrimInLayer(crate, prim.path)


def _said(layer: Sdf.Layer) -> Mapping[str, Any]:
    own = layer.customLayerData.get("usdhand")
    return own if isinstance(own, Mapping) else {}


def _say(layer: Sdf.Layer, values: Mapping[str, Any]) -> None:
    data = dict(layer.customLayerData)
    data["usdhand"] = {**_said(layer), **values}
    layer.customLayerData = data
