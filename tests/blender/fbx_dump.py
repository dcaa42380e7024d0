"""Runs inside Blender's Python: import an FBX file, write where its bones are to an .npz.

usage: python fbx_dump.py FILE.fbx OUT.npz TAKE FRAME...

The importer is Blender's own one in Python, which shares no code with the library that we read
with. Frames are of the file, from 0.
"""

import sys

import bpy  # first: it brings addon_utils
import numpy as np


def main(source: str, target: str, take: str, frames: list[int]) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import addon_utils

    addon_utils.enable("io_scene_fbx", default_set=True)
    bpy.ops.import_scene.fbx(filepath=source, anim_offset=0.0)
    scene = bpy.context.scene
    armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    for armature in armatures if take else ():
        # Blender calls an action "ARMATURE|TAKE|LAYER", without a layer that has the take's name.
        name = f"{armature.name}|{take}"
        [action] = [a for a in bpy.data.actions if f"{a.name}|".startswith(f"{name}|")]
        armature.animation_data.action = action
    names, positions = [], []
    for frame in frames:
        scene.frame_set(frame)
        here = []
        for armature in armatures:
            here += [armature.matrix_world @ bone.head for bone in armature.pose.bones]
            if armature.name not in armature.pose.bones:  # a root bone that became the armature
                here.append(armature.matrix_world.translation)
        positions.append(np.array(here) * 100.0 * scene.unit_settings.scale_length)
    for armature in armatures:
        names += [bone.name for bone in armature.pose.bones]
        if armature.name not in armature.pose.bones:
            names.append(armature.name)
    np.savez(target, names=np.array(names), positions=np.array(positions))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], [int(f) for f in sys.argv[4:]])
