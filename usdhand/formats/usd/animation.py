"""A clip's motion authored as a SkelAnimation, in its file's own units and axes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, UsdSkel, Vt

from usdhand.errors import InputError
from usdhand.formats.usd.add_joints import joint_tokens
from usdhand.formats.usd.curves import Tracks, frame_timing, joint_targets
from usdhand.formats.usd.poses import authored_poses
from usdhand.formats.usd.samples import EVERY, Places, Track, blocks, steady
from usdhand.formats.usd.stage import Character
from usdhand.formats.usd.world import world_above
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.kinematics import scaled_joints
from usdhand.motion.resample import at_frames
from usdhand.motion.rotations import Array
from usdhand.motion.timing import time_codes
from usdhand.motion.transforms import ROUNDED, compose_trs, rigid
from usdhand.problems import Problem, counted

VARIANT_SET = "fingers"
AT_REST = 1e-6  # of the largest number in a rest transform: below, a joint has not left it


@dataclass(frozen=True, eq=False)
class Kept:
    """Motion of the input at the frames of a clip.

    Attributes
    ----------
    times : time codes of the frames, and those of the input's samples between them
    frames : what each of ``times`` is in frames of the clip, None where they are its frames
    elements, places : which of the input's elements belong to which joints
    changed : joints that come from the clip all the same, or that the input does not have
    """

    times: Array
    tracks: Tracks
    elements: Places
    places: Places
    changed: NDArray[np.intp]
    frames: Array | None = None


@dataclass(frozen=True, eq=False)
class FileCurve:
    """A motion attribute on its way to a file.

    Attributes
    ----------
    values : (frames, joints, n) of the clip
    roots, root_values : joints that stand somewhere else without what is above the skeleton
    unit : what all of these are divided by
    own : joints that come from them; the others are ``kept``, from ``track``
    """

    values: Array
    roots: NDArray[np.intp]
    root_values: Array
    unit: float
    own: NDArray[np.intp]
    kept: Kept | None = None
    track: Track | None = None

    @property
    def still(self) -> bool:
        """Whether one value is enough for all frames."""
        moves = self.track is not None and not self.track.still
        return not moves and steady(self.values, self.own) and steady(self.root_values)

    def joint(self, joint: int) -> Array:
        """(frames, n) of one joint of the clip, not yet divided by ``unit``."""
        if joint in self.roots:
            return self.root_values[:, list(self.roots).index(joint)]
        return self.values[:, joint]

    def rows(self, dtype: Any) -> Iterator[NDArray[Any]]:
        """Values frame by frame; made block by block, in the processor's cache."""
        among_own = np.searchsorted(self.own, self.roots)
        for block in blocks(len(self.values)):
            values = self.values[block]
            rows = np.empty(values.shape, dtype)
            if self.track is not None and self.kept is not None:
                self.track.fill(rows, block.start, self.kept.elements, self.kept.places)
            values = np.take(values, self.own, axis=1)  # five times faster than an index
            values[:, among_own] = self.root_values[block]
            rows[:, self.own] = values if self.unit == 1.0 else values / self.unit
            yield from rows


def author_animation(
    layer: Sdf.Layer, path: Sdf.Path, character: Character, clip: Clip, changed: Sequence[int]
) -> Array:
    """Define a SkelAnimation with the joints of a clip, and return its time codes.

    Joints other than ``changed`` keep the input's values to the bit where it has these frames.
    Joints that stay at a rest transform with a scale or shear are left to it: a SkelAnimation has
    no shear, and rounds scales to half precision.
    """
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SkelAnimation"
    joints = Sdf.AttributeSpec(
        prim, "joints", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
    )
    kept = _kept(character, clip, changed)
    times = clip.time_codes if kept is None else kept.times
    if kept is not None and kept.frames is not None:
        clip = at_frames(clip, kept.frames)
    curves = rotations, translations, scales = _file_curves(character, clip, times, kept)
    resting = _resting(character, clip, curves)
    listed = EVERY if not resting else np.setdiff1d(np.arange(len(clip.skeleton)), resting)
    joints.default = Vt.TokenArray(np.array(clip.skeleton.joints)[listed].tolist())
    types = Sdf.ValueTypeNames
    for name, value_type, curve, dtype, convert in (
        ("rotations", types.QuatfArray, rotations, np.float32, Vt.QuatfArray.FromNumpy),
        ("translations", types.Float3Array, translations, np.float32, Vt.Vec3fArray.FromNumpy),
        ("scales", types.Half3Array, scales, np.float16, Vt.Vec3hArray.FromNumpy),
    ):
        attribute = Sdf.AttributeSpec(prim, name, value_type)
        rows = (np.ascontiguousarray(row[listed]) for row in curve.rows(dtype))
        still = name != "rotations" and curve.still  # Blender wants samples of rotations
        spec = attribute.path
        for time, row in zip(times.tolist(), rows, strict=True):
            if not np.isfinite(row).all():
                raise InputError(
                    f"{character.path}: {name} at time code {time:g} are too large for USD."
                )
            if still:
                attribute.default = convert(row)
                break
            layer.SetTimeSample(spec, time, convert(row))
    return times


def animation_losses(layer: Sdf.Layer, path: Sdf.Path, clip: Clip) -> Iterator[Problem]:
    """What a SkelAnimation, authored at ``path`` for a clip, has not of its rest transforms."""
    listed = set(layer.GetAttributeAtPath(path.AppendProperty("joints")).default)
    joints = clip.skeleton.joints
    sheared = [j for j in sorted(clip.shears) if joints[j] in listed]
    if sheared:
        message = (
            f"a SkelAnimation has no shear: that of {counted(len(sheared), 'moving joint')} is lost"
        )
        yield Problem("sheared", message, joints[sheared[0]])
    rounded = [
        j
        for j in sorted(scaled_joints(clip))
        if joints[j] in listed
        and steady(clip.scales[:, j, None])
        and np.abs(_half(clip.scales[0, j]) / clip.scales[0, j] - 1.0).max() > ROUNDED
    ]
    if rounded:
        message = (
            "a SkelAnimation has scales in half precision: that of "
            f"{counted(len(rounded), 'joint')} is rounded, and what is below them moves"
        )
        yield Problem("rounded-scale", message, joints[rounded[0]])


def _half(values: Array) -> Array:
    return values.astype(np.float16).astype(np.float64)


def author_variants(
    layer: Sdf.Layer,
    path: Sdf.Path,
    character: Character,
    clips: Mapping[str, Clip],
    changed: Sequence[int],
) -> Array:
    """Define a SkelAnimation with a motion a variant, and return the time codes.

    All values are inside the variants, since a local opinion would win over them.
    """
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierDef
    prim.typeName = "SkelAnimation"
    prim.variantSetNameList.prependedItems = [VARIANT_SET]
    variants = Sdf.VariantSetSpec(prim, VARIANT_SET)
    for name, clip in clips.items():
        inside = Sdf.VariantSpec(variants, name).primSpec.path
        times = author_animation(layer, inside, character, clip, changed)
    prim.variantSelections[VARIANT_SET] = next(iter(clips))
    return times


def _kept(character: Character, clip: Clip, changed: Sequence[int]) -> Kept | None:
    """Return the input's motion, None if the clip has other frames."""
    if character.animation is None:
        return None
    animation = UsdSkel.Animation(character.animation)
    targets = joint_targets(animation, clip.skeleton.joints)
    tracks = Tracks.of(animation, len(targets))
    timing = frame_timing(character.stage, tracks.times)[0]
    codes = time_codes(np.arange(timing.count, dtype=np.float64), timing.start, timing.step)
    if len(codes) != len(clip) or not np.allclose(codes, clip.time_codes, rtol=1e-12, atol=1e-6):
        return None
    times = timing.all_times  # what does not change must miss no sample
    frames = (times - timing.start) / timing.step if len(times) > len(clip) else None
    every = np.arange(len(clip.skeleton))
    whole = np.array_equal(targets, every)
    elements = EVERY if whole else np.flatnonzero(targets >= 0)
    own = np.flatnonzero(np.isin(every, changed) | ~np.isin(every, targets))
    return Kept(times, tracks.at(times), elements, targets[elements], own, frames)


def _resting(
    character: Character, clip: Clip, curves: tuple[FileCurve, FileCurve, FileCurve]
) -> list[int]:
    """Joints that stay at a rest transform which is no rotation and translation alone."""
    unit = curves[1].unit
    rest = authored_poses(character, len(joint_tokens(character)), unit)[0].rest
    if rest is None:
        return []
    uneven = np.abs(rest - rigid(rest))[:, :3, :3].max(axis=(1, 2)) > ROUNDED
    return [
        j
        for j in np.flatnonzero(uneven & np.isin(np.arange(len(rest)), curves[0].own)).tolist()
        if _stays(j, rest[j], clip.shears.get(j), curves)
    ]


def _stays(
    joint: int,
    rest: Array,
    shear: Array | None,
    curves: tuple[FileCurve, FileCurve, FileCurve],
) -> bool:
    rotations, translations, scales = (curve.joint(joint) for curve in curves)
    local = compose_trs(translations, rotations, scales)
    if shear is not None:
        local[..., :3, :3] = local[..., :3, :3] @ shear
    return bool((np.abs(local - rest) <= AT_REST * np.abs(rest).max()).all())


def _file_curves(
    character: Character, clip: Clip, times: Array, kept: Kept | None
) -> tuple[FileCurve, FileCurve, FileCurve]:
    """The clip's curves without what stands above the skeleton in its file."""
    world = world_above(character.skeleton, times)
    roots = np.flatnonzero(clip.skeleton.parents < 0)
    above = rot.conjugate(rot.from_matrix(world.rotation))[:, None]
    turned = rot.multiply(above, clip.rotations[:, roots])
    moved = rot.rotate(above, clip.translations[:, roots] - world.translation[:, None])

    def curve(values: Array, root_values: Array, track: Track | None, unit: float) -> FileCurve:
        if kept is None or track is None:
            every = np.arange(len(clip.skeleton))
            return FileCurve(values, roots, root_values, unit, every)
        own = np.isin(roots, kept.changed)
        return FileCurve(values, roots[own], root_values[:, own], unit, kept.changed, kept, track)

    tracks = Tracks(None, None, None) if kept is None else kept.tracks
    return (
        curve(clip.rotations, turned, tracks.rotations, 1.0),
        curve(clip.translations, moved, tracks.translations, world.scale),
        curve(clip.scales, clip.scales[:, roots], tracks.scales, 1.0),
    )
