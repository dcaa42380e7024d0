"""Runs inside Blender's Python: import a BVH file, write what Blender made of it to an .npz.

usage: python bvh_dump.py FILE.bvh OUT.npz FRAME...
"""

import sys

import bpy
import numpy as np


def main(source: str, target: str, frames: list[int]) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="io_anim_bvh")
    bpy.ops.import_anim.bvh(filepath=source)
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    bones = armature.data.bones
    rest = [np.array(armature.matrix_world @ b.matrix_local) for b in bones]
    posed = []
    for frame in frames:
        bpy.context.scene.frame_set(frame + 1)  # its first frame is 1
        world = armature.matrix_world
        posed.append([np.array(world @ armature.pose.bones[b.name].matrix) for b in bones])
    np.savez(
        target, names=np.array([b.name for b in bones]), rest=np.array(rest), posed=np.array(posed)
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], [int(f) for f in sys.argv[3:]])
