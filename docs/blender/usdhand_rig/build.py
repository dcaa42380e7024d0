"""A character in Blender whose fingers follow channels: properties, keys and drivers."""

import math
from collections.abc import Iterable

import bpy
import numpy as np

from . import followers, rotations
from .keys import thinned
from .rig_file import SAME_DEG, Channel, HandRig, Joint, RigError, read_rigs

RECORD = "usdhand"  # the armature's property that remembers where its rig is
LINEAR = 1  # of the interpolations of keys
HELPER = "usdhand_{}"
# Soft limits in degrees of flexion, abduction, rotation about the bone.
LIMITS = {
    "MCP": ((-30, 100), (-30, 30), (-30, 30)),
    "PIP": ((-10, 120), (-15, 15), (-15, 15)),
    "DIP": ((-15, 90), (-15, 15), (-15, 15)),
    "ThumbCMC": ((-50, 60), (-50, 50), (-60, 60)),
    "ThumbMCP": ((-30, 80), (-30, 30), (-30, 30)),
    "ThumbIP": ((-40, 90), (-15, 15), (-15, 15)),
}
MOTIONS = {"f": "flexion", "a": "abduction", "t": "rotation"}


def import_rig(context: bpy.types.Context, path: str, thin: float = 0.0) -> list[bpy.types.Object]:
    """Import a rig file and make its armatures follow its channels.

    Parameters
    ----------
    thin : keys are left out where the curve stays within this many degrees

    Returns
    -------
    The armatures. Raises RigError if the file holds no rig that can be used.
    """
    rigs = read_rigs(path)
    before = set(bpy.data.objects)
    bpy.ops.wm.usd_import(filepath=path)
    new = [o for o in bpy.data.objects if o not in before]
    try:
        armatures = [_armature(rig, new) for rig in rigs]
    except RigError:
        bpy.data.batch_remove(new)
        raise
    # One value a channel arrives as well, of no use beside the channels themselves.
    bpy.data.batch_remove([o for o in new if o.type == "EMPTY" and "usdhand:version" in o])
    _set_time(context.scene, rigs)
    for armature, rig in zip(armatures, rigs, strict=True):
        build(context, armature, rig, thin)
        kinds = {c.name: c.kind for c in rig.channels.values()}
        armature[RECORD] = {"file": path, "rig": rig.path, "kinds": kinds}
    return armatures


def build(
    context: bpy.types.Context, armature: bpy.types.Object, rig: HandRig, thin: float
) -> None:
    """Put a rig's channels on an armature: properties, keys of the free ones, drivers."""
    by_name = {
        name: (joint, motion)
        for joint in rig.joints
        for name, motion in zip(joint.channels, "aft", strict=True)
    }
    for name, (joint, motion) in by_name.items():
        _add_property(armature, rig.channels[name], joint, motion)
    for channel in rig.channels.values():
        if channel.kind == "linear":
            _drive_channel(armature, channel)
        elif channel.times:
            joint, _ = by_name[channel.name]
            _add_keys(armature, channel, f"{joint.side.title()} {digit_of(joint.name)}", thin)
    helpers = _add_helpers(context, armature, rig.joints)
    _drop_rotation_curves(armature, {j.bone for j in rig.joints})
    for joint in rig.joints:
        _drive_bone(armature, joint, helpers.get(joint.name + joint.side))
    armature.update_tag()
    context.view_layer.update()


def digit_of(joint: str) -> str:
    """``IndexPIP`` -> ``Index``."""
    return joint.rstrip("CDIMP")


def sampled(
    context: bpy.types.Context, armature: bpy.types.Object, rig: HandRig
) -> dict[str, Channel]:
    """Free channels as they play in Blender, at every frame of the rig: those that were edited."""
    missing = [c.name for c in rig.free if c.name not in armature]
    if missing:
        raise RigError(f"The armature has lost its channel '{missing[0]}'.")
    scene, frame = context.scene, context.scene.frame_current_final
    values = []
    for time in rig.times:
        scene.frame_set(math.floor(time), subframe=time % 1.0)
        evaluated = armature.evaluated_get(context.evaluated_depsgraph_get())
        values.append([evaluated[c.name] for c in rig.free])
    scene.frame_set(math.floor(frame), subframe=frame % 1.0)
    curves = np.array(values, dtype=float).reshape(len(rig.times), -1).T
    return {
        channel.name: Channel(channel.name, "free", tuple(rig.times.tolist()), tuple(curve))
        for channel, curve in zip(rig.free, curves.tolist(), strict=True)
        if np.abs(np.array(curve) - channel.at(rig.times)).max() > SAME_DEG
    }


def _set_time(scene: bpy.types.Scene, rigs: list[HandRig]) -> None:
    """One frame a time code, which is how Blender imports keys, at the file's speed."""
    rate = rigs[0].codes_per_second
    scene.render.fps = max(1, round(rate))
    scene.render.fps_base = scene.render.fps / rate
    scene.frame_start = math.floor(min(rig.start for rig in rigs))
    scene.frame_end = math.ceil(max(rig.end for rig in rigs))


def _armature(rig: HandRig, new: list[bpy.types.Object]) -> bpy.types.Object:
    """The armature that Blender made of the rig's skeleton."""
    needed = {name for joint in rig.joints for name in (joint.bone, joint.reference)}
    candidates = [o for o in new if o.type == "ARMATURE"]
    fitting = [o for o in candidates if needed <= set(o.data.bones.keys())]
    if not fitting:
        bones = {name for o in candidates for name in set(o.data.bones.keys())}
        raise RigError(
            f"Blender made no bone of the joint '{min(needed - bones, default='')}' of "
            f"{rig.skeleton}: names with a space or a colon are none that USD takes."
        )
    name = rig.skeleton.rsplit("/", 1)[-1]
    named = [o for o in fitting if o.name.partition(".")[0] == name]
    if len(named or fitting) > 1:
        raise RigError(f"Blender made {len(fitting)} armatures that may be {rig.skeleton}.")
    return (named or fitting)[0]


def _add_property(armature: bpy.types.Object, channel: Channel, joint: Joint, motion: str) -> None:
    limits = LIMITS.get(joint.name, LIMITS.get(joint.name[-3:], ((-90, 90),) * 3))
    low, high = limits["fat".index(motion)]
    if channel.limits:
        low, _, _, high = channel.limits
    armature[channel.name] = channel.values[0]
    armature.id_properties_ui(channel.name).update(
        description=f"{joint.side.title()} {joint.name}: {MOTIONS[motion]} in degrees "
        f"({channel.kind})",
        soft_min=min(low, *channel.values),
        soft_max=max(high, *channel.values),
        precision=2,
        step=10,
    )
    armature.property_overridable_library_set(f'["{channel.name}"]', True)


def _add_keys(armature: bpy.types.Object, channel: Channel, group: str, thin: float) -> None:
    data = armature.animation_data_create()
    if data.action is None:
        data.action = bpy.data.actions.new(f"{armature.name} hands")
    curve = data.action.fcurve_ensure_for_datablock(armature, f'["{channel.name}"]')
    groups = _curves_of(armature).groups
    curve.group = groups.get(group) or groups.new(group)
    keys = thinned(np.array([channel.times, channel.values]).T, thin)
    points = curve.keyframe_points
    points.add(len(keys))
    points.foreach_set("co", keys.ravel())
    # Straight between keys, as usdhand reads them.
    points.foreach_set("interpolation", [LINEAR] * len(keys))
    curve.update()


def _drive_channel(armature: bpy.types.Object, channel: Channel) -> None:
    """One driver, or several where an expression would be longer than Blender keeps one."""
    for name, expression, variables in followers.drivers(channel):
        if name != channel.name:
            armature[name] = 0.0
        curve = armature.driver_add(f'["{name}"]')
        _set_driver(curve, armature, expression, variables)


def _drive_bone(armature: bpy.types.Object, joint: Joint, helper: str | None) -> None:
    bone = armature.pose.bones[helper or joint.bone]
    rest = bone.bone.matrix_local.to_quaternion()
    if bone.parent:
        rest = bone.parent.bone.matrix_local.to_quaternion().inverted() @ rest
    at_rest = np.array([rest.x, rest.y, rest.z, rest.w])
    before = rotations.left_product(rotations.conjugate(at_rest)) @ joint.reference_frame
    after = rotations.conjugate(joint.joint_frame)
    bone.rotation_mode = "QUATERNION"
    components = rotations.expressions(before, after, joint.side, joint.is_ball)
    for i, expression in enumerate(components):
        curve = bone.driver_add("rotation_quaternion", i)
        _set_driver(curve, armature, expression, zip("aft", joint.channels, strict=True))


def _set_driver(
    curve: bpy.types.FCurve,
    armature: bpy.types.Object,
    expression: str,
    variables: Iterable[tuple[str, str]],
) -> None:
    # Blender starts a driver with keys at 0 and 1, and snaps values to keys that are near.
    curve.keyframe_points.clear()
    driver = curve.driver
    for letter, channel in variables:
        variable = driver.variables.new()
        variable.name = letter
        variable.targets[0].id = armature
        variable.targets[0].data_path = f'["{channel}"]'
    driver.type = "SCRIPTED"
    driver.expression = expression
    if len(expression) > rotations.LONGEST or not driver.is_simple_expression:
        raise RigError(f"Blender does not take the expression {expression} without Python.")


def _add_helpers(
    context: bpy.types.Context, armature: bpy.types.Object, joints: Iterable[Joint]
) -> dict[str, str]:
    """Bones below the wrist for digits that are measured from it but do not hang off it.

    The digit's first bone stays where it is, and turns as its helper does.
    """
    bones = armature.data.bones
    apart = [j for j in joints if getattr(bones[j.bone].parent, "name", None) != j.reference]
    if not apart:
        return {}
    context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for joint in apart:
        source = armature.data.edit_bones[joint.bone]
        helper = armature.data.edit_bones.new(HELPER.format(joint.bone))
        helper.length = source.length
        helper.matrix = source.matrix
        helper.parent = armature.data.edit_bones[joint.reference]
        helper.use_deform = False
    bpy.ops.object.mode_set(mode="OBJECT")
    for joint in apart:
        name = HELPER.format(joint.bone)
        armature.data.bones[name].hide = True
        follow = armature.pose.bones[joint.bone].constraints.new("COPY_ROTATION")
        follow.name = "usdhand"
        follow.target, follow.subtarget = armature, name
        follow.owner_space = follow.target_space = "POSE"
    return {j.name + j.side: HELPER.format(j.bone) for j in apart}


def _drop_rotation_curves(armature: bpy.types.Object, bones: set[str]) -> None:
    """Remove the imported keys that would fight the drivers."""
    if armature.animation_data is None or armature.animation_data.action is None:
        return
    paths = {f'pose.bones["{bone}"].rotation_quaternion' for bone in bones}
    curves = _curves_of(armature).fcurves
    for curve in [c for c in curves if c.data_path in paths]:
        curves.remove(curve)


def _curves_of(armature: bpy.types.Object) -> bpy.types.ActionChannelbag:
    """The part of an armature's action that is about the armature."""
    data = armature.animation_data
    return data.action.layers[0].strips[0].channelbag(data.action_slot)
