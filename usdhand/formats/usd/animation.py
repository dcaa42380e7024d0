"""A clip's motion authored as a SkelAnimation, in its file's own units and axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdSkel, Vt

from usdhand.formats.usd.curves import Tracks, frame_times, joint_targets
from usdhand.formats.usd.samples import Track, blocks, steady
from usdhand.formats.usd.stage import Character
from usdhand.formats.usd.world import world_above
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class Kept:
    """Motion of the input that stays to the bit: some joints at all frames.

    ``elements`` of the input's arrays belong to the joints ``places``.
    """

    times: Array
    tracks: Tracks
    elements: NDArray[np.intp]
    places: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FileCurve:
    """Values (frames, joints, n) of a motion attribute, on their way to a file.

    They are divided by ``unit``; at ``roots`` there are ``root_values`` instead, and what is kept
    of the input comes from ``track``.
    """

    values: Array
    roots: NDArray[np.intp]
    root_values: Array
    unit: float
    track: Track | None
    kept: Kept | None

    @property
    def still(self) -> bool:
        """Whether one value is enough for all frames."""
        moves = self.track is not None and not self.track.still
        return not moves and steady(self.values) and steady(self.root_values)

    def rows(self, dtype: Any) -> Iterator[NDArray[Any]]:
        """Values frame by frame; made block by block, in the processor's cache."""
        for block in blocks(len(self.values)):
            values = self.values[block].copy()
            values[:, self.roots] = self.root_values[block]
            if self.unit != 1.0:
                values /= self.unit
            rows = values.astype(dtype)
            if self.track is not None and self.kept is not None:
                self.track.fill(rows, block.start, self.kept.elements, self.kept.places)
            yield from rows


def author_animation(
    layer: Sdf.Layer, path: Sdf.Path, character: Character, clip: Clip, changed: Sequence[int]
) -> Array:
    """Define a SkelAnimation with all joints of a clip, and return its time codes.

    Joints other than ``changed`` keep the input's values to the bit where it has these frames.
    """
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SkelAnimation"
    joints = Sdf.AttributeSpec(
        prim, "joints", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
    )
    joints.default = Vt.TokenArray(list(clip.skeleton.joints))
    kept = _kept(character, clip, changed)
    times = clip.time_codes if kept is None else kept.times
    rotations, translations, scales = _file_curves(character, clip, times, kept)
    types = Sdf.ValueTypeNames
    for name, value_type, curve, dtype, convert in (
        ("rotations", types.QuatfArray, rotations, np.float32, Vt.QuatfArray.FromNumpy),
        ("translations", types.Float3Array, translations, np.float32, Vt.Vec3fArray.FromNumpy),
        ("scales", types.Half3Array, scales, np.float16, Vt.Vec3hArray.FromNumpy),
    ):
        attribute = Sdf.AttributeSpec(prim, name, value_type)
        rows = curve.rows(dtype)
        if name != "rotations" and curve.still:  # Blender wants samples of rotations
            attribute.default = convert(next(rows))
            continue
        spec = attribute.path
        for time, row in zip(times.tolist(), rows, strict=True):
            layer.SetTimeSample(spec, time, convert(row))
    return times


def _kept(character: Character, clip: Clip, changed: Sequence[int]) -> Kept | None:
    """Return what stays of the input, None if the clip has other frames."""
    if character.animation is None:
        return None
    animation = UsdSkel.Animation(character.animation)
    targets = joint_targets(animation, clip.skeleton.joints)
    tracks = Tracks.of(animation, len(targets))
    times, _ = frame_times(character.stage, tracks.times)
    if len(times) != len(clip) or not np.allclose(times, clip.time_codes, rtol=1e-12, atol=1e-6):
        return None
    elements = np.flatnonzero((targets >= 0) & ~np.isin(targets, changed))
    return Kept(times, tracks.at(times), elements, targets[elements])


def _file_curves(
    character: Character, clip: Clip, times: Array, kept: Kept | None
) -> tuple[FileCurve, FileCurve, FileCurve]:
    """The clip's curves without what stands above the skeleton in its file."""
    world = world_above(character.skeleton, times)
    roots = np.flatnonzero(clip.skeleton.parents < 0)
    above = rot.conjugate(rot.from_matrix(world.rotation))[:, None]
    turned = rot.multiply(above, clip.rotations[:, roots])
    moved = rot.rotate(above, clip.translations[:, roots] - world.translation[:, None])
    tracks = Tracks(None, None, None) if kept is None else kept.tracks
    return (
        FileCurve(clip.rotations, roots, turned, 1.0, tracks.rotations, kept),
        FileCurve(clip.translations, roots, moved, world.scale, tracks.translations, kept),
        FileCurve(clip.scales, roots, clip.scales[:, roots], 1.0, tracks.scales, kept),
    )
