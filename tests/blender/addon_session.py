"""Runs inside Blender's Python: one session of the hand rig add-on, told by a JSON file.

usage: python addon_session.py SESSION.json, with

    {"open": BLEND without the add-on, or "import": RIG, "thin": DEGREES,
     "edits": [["offset", CHANNEL, DEGREES], ["key", CHANNEL, FRAME, DEGREES],
               ["still", CHANNEL, DEGREES]],
     "frames": [...], "poses": OUT.npz, "export": OUT.usda, "save": OUT.blend}

Prints a JSON line of what happened last. Blender brings a USD of its own, so this never shares a
process with usd-core.
"""

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

ADD_ON = Path(__file__).resolve().parent.parent.parent / "docs" / "blender"
# Blender's own packages, which the bpy module does not put on the path.
BUNDLED = Path(bpy.utils.resource_path("LOCAL")) / "python" / "lib"


def main(session: dict) -> dict:
    said = {}
    if "open" in session:
        bpy.ops.wm.open_mainfile(filepath=session["open"], use_scripts=False)
    else:
        start()
        try:
            bpy.ops.usdhand.import_rig(filepath=session["import"], thin=session.get("thin", 0.0))
        except RuntimeError as error:
            return {"refused": str(error), "objects": len(bpy.data.objects)}
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    for edit in session.get("edits", ()):
        change(armature, *edit)
    if "poses" in session:
        dump(armature, session["frames"], session["poses"])
    said |= facts(armature)
    if "import" in session:
        said["panel"] = drawn(armature)
    if "export" in session:
        try:
            bpy.ops.usdhand.export_edits(filepath=session["export"])
        except RuntimeError as error:
            said["refused"] = str(error)
    if "save" in session:
        bpy.ops.wm.save_as_mainfile(filepath=session["save"])
    return said


def start() -> None:
    sys.path[:0] = [str(ADD_ON)]
    sys.path += map(str, BUNDLED.glob("python*/site-packages"))
    import usdhand_rig

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.filepaths.use_scripts_auto_execute = False
    usdhand_rig.register()


def change(armature: bpy.types.Object, what: str, channel: str, *numbers: float) -> None:
    path = f'["{channel}"]'
    if what == "still":
        [armature[channel]] = numbers
        armature.update_tag()
    elif what == "key":
        frame, value = numbers
        armature[channel] = value
        armature.keyframe_insert(path, frame=frame)
    else:
        curve = next(c for c in curves(armature) if c.data_path == path)
        for key in curve.keyframe_points:
            key.co.y += numbers[0]
        curve.update()


def curves(armature: bpy.types.Object) -> list[bpy.types.FCurve]:
    action = armature.animation_data.action
    bags = [b for la in action.layers for s in la.strips for b in s.channelbags]
    return [c for b in bags for c in b.fcurves]


def dump(armature: bpy.types.Object, frames: list[float], target: str) -> None:
    """Write the pose at some frames."""
    scene, bones = bpy.context.scene, armature.data.bones
    posed = []
    for frame in frames:
        scene.frame_set(int(frame), subframe=frame % 1)
        world = armature.matrix_world
        posed.append([np.array(world @ armature.pose.bones[b.name].matrix) for b in bones])
    rest = [np.array(armature.matrix_world @ b.matrix_local) for b in bones]
    np.savez(target, names=[b.name for b in bones], rest=rest, posed=posed)


def facts(armature: bpy.types.Object) -> dict:
    scene, drivers = bpy.context.scene, armature.animation_data.drivers
    driven = {d.data_path for d in drivers}
    keyed = curves(armature)
    return {
        "fps": scene.render.fps / scene.render.fps_base,
        "range": [scene.frame_start, scene.frame_end],
        "drivers": len(drivers),
        "simple": all(d.driver.is_simple_expression for d in drivers),
        "valid": all(d.driver.is_valid for d in drivers),
        "fought_over": sorted(driven & {c.data_path for c in keyed}),
        "keys": {
            c.data_path[2:-2]: len(c.keyframe_points) for c in keyed if c.data_path[:2] == '["'
        },
        "objects": sorted(o.name for o in bpy.data.objects),
    }


def drawn(armature: bpy.types.Object) -> list[list]:
    """Sliders of the panel: channel, label, whether it can be moved."""
    from usdhand_rig.interface import USDHAND_PT_channels

    sliders = []

    class Layout:
        enabled = True

        def prop(self, owner: object, path: str, text: str = "", **_: object) -> None:
            if owner == armature:
                sliders.append([path[2:-2], text, self.enabled])

        def row(self, **_: object) -> "Layout":
            return Layout()

        column = row

        def panel(self, _: str) -> "tuple[Layout, Layout]":
            return self, self

        def label(self, **_: object) -> None:
            pass

        def operator(self, *_: object, **__: object) -> None:
            pass

    bpy.context.view_layer.objects.active = armature
    bpy.context.window_manager.usdhand_show_dependents = True
    USDHAND_PT_channels.draw(SimpleNamespace(layout=Layout()), bpy.context)
    return sliders


if __name__ == "__main__":
    print(json.dumps(main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))), flush=True)
    os._exit(0)  # the bpy module 4.5 hangs at its end once its USD was loaded
