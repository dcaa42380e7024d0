"""Runs inside Blender's Python: import a glTF file, write what Blender made of it.

To an .npz, and with Blender's own exporter to a .glb beside it.

usage: python gltf_dump.py FILE.glb OUT.npz FPS FRAME...
"""

import sys

import bpy
import numpy as np


def main(source: str, target: str, fps: int, frames: list[float]) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = fps  # key times are seconds
    bpy.ops.import_scene.gltf(filepath=source)
    [armature] = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    bones = armature.data.bones
    posed = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
        world = armature.matrix_world
        posed.append([np.array(world @ armature.pose.bones[b.name].matrix) for b in bones])
    np.savez(
        target,
        names=np.array([b.name for b in bones]),
        parents=np.array([b.parent.name if b.parent else "" for b in bones]),
        rest=np.array([np.array(armature.matrix_world @ b.matrix_local) for b in bones]),
        posed=np.array(posed),
        empties=np.array([o.name for o in bpy.data.objects if o.type == "EMPTY"]),
    )
    bpy.ops.export_scene.gltf(filepath=target.replace(".npz", ".glb"))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), [float(f) for f in sys.argv[4:]])
