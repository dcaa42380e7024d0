"""The picture of fill on the whole character: the same moment before and after, with close-ups.

usage: USDHAND_BLENDER_PYTHON=PYTHON_WITH_BPY python docs/pictures/make_render.py (and matplotlib)

Blender renders it with Cycles on the CPU: this file runs itself again there.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BODY = ROOT / "samples" / "conversations" / "talk_01_body.usdc"
FRAME = 338
SIZE = {"body": (600, 400), "hand": (298, 270)}
SAMPLES = 32


def main() -> None:
    """Fill, render, compose."""
    import usdhand

    folder = Path(tempfile.mkdtemp())
    clips = sorted((ROOT / "samples" / "gestures").glob("*.usdc"))
    library = usdhand.build_library(clips, folder / "library.usdc").library
    filled = usdhand.fill_fingers(usdhand.read_clip(BODY), library)
    usdhand.write_filled(filled, folder / "after.usdc")
    shots = [
        [str(BODY), str(folder / "before")],
        [str(folder / "after.usdc"), str(folder / "after")],
    ]
    (folder / "shots.json").write_text(json.dumps(shots), encoding="utf-8")
    python = os.environ["USDHAND_BLENDER_PYTHON"]
    subprocess.run([python, __file__, str(folder / "shots.json")], check=True)
    compose(folder, ROOT / "docs" / "pictures" / "render.png")


def compose(folder: Path, target: Path) -> None:
    """Two panels side by side: the body, its hands below, a title over each."""
    from matplotlib import font_manager
    from PIL import Image, ImageDraw, ImageFont

    gap, title = 4, 34
    (width, height), (wide, low) = SIZE["body"], SIZE["hand"]
    sheet = Image.new("RGB", (2 * width + 2 * gap, title + height + gap + low), "white")
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 19)
    draw = ImageDraw.Draw(sheet)
    names = {"before": "body clip: fingers still", "after": "after usdhand fill"}
    for panel, (name, text) in enumerate(names.items()):
        left = panel * (width + 2 * gap)
        draw.text((left + width / 2, title / 2), text, "#222222", font, anchor="mm")
        sheet.paste(Image.open(folder / f"{name}_body.png"), (left, title))
        for side, x in (("Right", 0), ("Left", width - wide)):
            image = Image.open(folder / f"{name}_{side}.png")
            sheet.paste(image, (left + x, title + height + gap))
    sheet.quantize(256, method=Image.Quantize.MEDIANCUT).save(target, optimize=True)


def render(source: str, stem: str) -> None:
    """Runs in Blender: the character and its hands at one frame."""
    import bpy
    from mathutils import Vector

    studio()
    bpy.ops.wm.usd_import(filepath=source, import_lights=False)
    scene = bpy.context.scene
    scene.frame_set(FRAME)
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")

    def joint(name: str) -> Vector:
        return (armature.matrix_world @ armature.pose.bones[name].matrix).translation

    middle = (joint("LeftHand") + joint("RightHand")) / 2
    shoot(middle + Vector((-0.3, -1.35, 0.3)), middle + Vector((0, 0, 0.1)), "body", stem)
    for side, turn in (("Right", 1.0), ("Left", -1.0)):
        wrist, index, middle, little = (
            joint(f"{side}Hand{name}") for name in ("", "Index1", "Middle1", "Pinky1")
        )
        forward, radial = (middle - wrist).normalized(), (index - little).normalized()
        palm = turn * radial.cross(forward)
        toward = (palm + 0.6 * forward + 0.3 * radial).normalized()
        shoot(middle + 0.32 * toward, middle + 0.015 * forward, "hand", f"{stem}_{side}")


def studio() -> None:
    """A soft grey room with a window to the left."""
    import bpy
    from mathutils import Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = True
    scene.cycles.max_bounces = 3
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background[0].default_value = (0.80, 0.83, 0.87, 1)
    background[1].default_value = 0.65
    for name, place, size, watts in (
        ("window", (-1.4, -2.2, 2.2), 1.0, 70),
        ("rim", (1.6, 1.2, 2.2), 0.6, 40),
    ):
        lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "AREA"))
        lamp.data.size, lamp.data.energy = size, watts
        lamp.location = place
        lamp.rotation_euler = (
            (Vector((0, 0, 1.2)) - lamp.location).to_track_quat("-Z", "Y").to_euler()
        )
        scene.collection.objects.link(lamp)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 50
    camera.data.clip_start = 0.01
    scene.collection.objects.link(camera)
    scene.camera = camera


def shoot(eye: object, target: object, kind: str, stem: str) -> None:
    """Write one image of the scene."""
    import bpy

    scene = bpy.context.scene
    scene.camera.location = eye
    scene.camera.rotation_euler = (target - eye).to_track_quat("-Z", "Y").to_euler()
    scene.render.resolution_x, scene.render.resolution_y = SIZE[kind]
    scene.render.filepath = f"{stem}_body.png" if kind == "body" else f"{stem}.png"
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        for each in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")):
            render(*each)
    else:
        main()
