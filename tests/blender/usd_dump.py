"""Runs inside Blender's Python: import a USD file, write what Blender made of it to an .npz.

usage: python usd_dump.py FILE.usd OUT.npz FRAME...

Blender brings a USD of its own, so this never shares a process with usd-core.
"""

import json
import sys

import bpy
import numpy as np


def main(source: str, target: str, frames: list[float]) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=source)
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    bones = armature.data.bones
    rest = [np.array(armature.matrix_world @ b.matrix_local) for b in bones]
    posed = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
        world = armature.matrix_world
        posed.append([np.array(world @ armature.pose.bones[b.name].matrix) for b in bones])
    properties = {
        f"{owner.name}/{key}": _plain(owner[key])
        for owner in bpy.data.objects
        for key in owner.keys()  # noqa: SIM118  (an ID block is no dict)
    }
    np.savez(
        target,
        names=np.array([b.name for b in bones]),
        rest=np.array(rest),
        posed=np.array(posed),
        properties=json.dumps(properties),
    )


def _plain(value: object) -> object:
    return value if isinstance(value, (bool, int, float, str)) else str(value)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], [float(f) for f in sys.argv[3:]])
