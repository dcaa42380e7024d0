"""Runs inside Blender's Python: render shots of USD characters.

usage: python render.py SHOTS.json, a list of {file, frame, hand, scale, out}; "hand" names the
bones of the wrist, middle, index and little finger, so that every hand is seen from its palm.
"""

import json
import math
import sys

import bpy
from mathutils import Matrix

SIZE = 420


def scene() -> None:
    """Daylight, a plain background and an orthographic camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    current = bpy.context.scene
    current.render.engine = "CYCLES"
    current.cycles.samples = 32
    current.cycles.max_bounces = 3
    current.view_settings.view_transform = "Standard"
    current.render.resolution_x = current.render.resolution_y = SIZE
    current.world = bpy.data.worlds.new("world")
    current.world.use_nodes = True
    background = current.world.node_tree.nodes["Background"].inputs
    background[0].default_value = (0.80, 0.83, 0.87, 1)
    background[1].default_value = 0.6
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle = 3.0, 0.1
    sun.rotation_euler = (math.radians(50), 0, math.radians(30))
    current.collection.objects.link(sun)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    current.collection.objects.link(camera)
    current.camera = camera


def render(shot: dict) -> None:
    """Look at the right hand from its palm, at a frame."""
    scene()
    bpy.ops.wm.usd_import(filepath=shot["file"], import_lights=False)
    current = bpy.context.scene
    current.frame_set(shot["frame"])
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    wrist, middle, index, little = (
        (armature.matrix_world @ armature.pose.bones[name].matrix).translation
        for name in shot["hand"]
    )
    forward, radial = (middle - wrist).normalized(), (index - little).normalized()
    palm = radial.cross(forward).normalized()
    direction = (palm + 0.9 * radial).normalized()
    current.camera.location = middle + direction * 5
    # The fingers point up in the picture.
    right = forward.cross(direction).normalized()
    axes = (right, direction.cross(right), direction)
    current.camera.rotation_euler = Matrix(axes).transposed().to_euler()
    current.camera.data.ortho_scale = shot["scale"]
    current.render.filepath = shot["out"]
    bpy.ops.render.render(write_still=True)


for each in json.load(open(sys.argv[1], encoding="utf-8")):  # noqa: PTH123, SIM115
    render(each)
