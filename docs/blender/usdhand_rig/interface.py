"""Operators, menu entries and the panel in the sidebar."""

import os

import bpy
from bpy.props import BoolProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .build import MOTIONS, RECORD, digit_of, import_rig, sampled
from .rig_file import RigError, read_rigs, write_edits

DIGITS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
JOINTS = ("CMC", "MCP", "PIP", "DIP", "IP")
USD_FILES = "*.usd;*.usda;*.usdc"


class USDHAND_OT_import_rig(bpy.types.Operator, ImportHelper):  # noqa: N801 (Blender's convention)
    """Import a hand rig of usdhand with sliders for its free channels."""

    bl_idname = "usdhand.import_rig"
    bl_label = "Import Hand Rig"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)

    filter_glob: StringProperty(default=USD_FILES + ";*.usdz", options={"HIDDEN"})
    thin: FloatProperty(
        name="Thin Keys (degrees)",
        description="Leave out keys where the curve stays this close. 0 keeps all",
        default=0.0,
        min=0.0,
        soft_max=5.0,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether objects can be added now."""
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Import."""
        try:
            armatures = import_rig(context, absolute(self.filepath), self.thin)
        except RigError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        free = sum(len(channels(a, "free")) for a in armatures)
        self.report({"INFO"}, f"{free} free channels: see the usdhand tab of the sidebar")
        context.view_layer.objects.active = armatures[0]
        return {"FINISHED"}


class USDHAND_OT_export_edits(bpy.types.Operator, ExportHelper):  # noqa: N801
    """Write the edited channels as a layer over the rig file, for 'usdhand expand'."""

    bl_idname = "usdhand.export_edits"
    bl_label = "Export Edited Channels"

    filename_ext = ".usda"
    check_extension = None  # .usdc and .usd are as good
    filter_glob: StringProperty(default=USD_FILES, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Whether the active object is a hand rig."""
        return has_rig(context.object)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file, beside the rig's by default."""
        stem, _ = os.path.splitext(context.object[RECORD]["file"])  # noqa: PTH122
        self.filepath = f"{stem}_edited.usda"
        return super().invoke(context, event)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write what differs from the rig file."""
        record = context.object[RECORD]
        try:
            rigs = [r for r in read_rigs(record["file"]) if r.path == record["rig"]]
            if not rigs:
                raise RigError(f"{record['file']} has no rig {record['rig']} any more.")
            edited = sampled(context, context.object, rigs[0])
            write_edits(record["file"], record["rig"], absolute(self.filepath), edited)
        except RigError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        names = ", ".join(edited) or "none"
        total = len(rigs[0].free)
        self.report({"INFO"}, f"{len(edited)} of {total} free channels were edited: {names}")
        return {"FINISHED"}


class USDHAND_PT_channels(bpy.types.Panel):  # noqa: N801
    """Channels of the active rig, by hand and digit."""

    bl_label = "Hand Channels"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "usdhand"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw sliders."""
        layout = self.layout
        layout.operator(USDHAND_OT_import_rig.bl_idname, icon="IMPORT")
        if not has_rig(context.object):
            layout.label(text="Select the armature of a hand rig.")
            return
        layout.operator(USDHAND_OT_export_edits.bl_idname, icon="EXPORT")
        layout.prop(context.window_manager, "usdhand_show_dependents")
        kinds = ("free", "linear") if context.window_manager.usdhand_show_dependents else ("free",)
        shown = channels(context.object, *kinds)
        for side in ("Right", "Left"):
            for digit in DIGITS:
                prefix = side[:2].lower() + digit
                of_digit = [c for c in shown if c.startswith(prefix)]
                if of_digit:
                    header, body = layout.panel(f"usdhand_{prefix}")
                    header.label(text=f"{side} {digit}")
                    draw_channels(body, context.object, of_digit)


def draw_channels(
    layout: bpy.types.UILayout | None, armature: bpy.types.Object, names: list[str]
) -> None:
    """Draw one slider a channel, dependents greyed; nothing where the panel is closed."""
    if layout is None:
        return
    column = layout.column(align=True)
    for name in names:
        row = column.row()
        row.enabled = armature[RECORD]["kinds"][name] == "free"
        row.prop(armature, f'["{name}"]', text=label(name), slider=True)


def channels(armature: bpy.types.Object, *kinds: str) -> list[str]:
    """Channels of these kinds, from the palm outwards."""
    found = [n for n, kind in armature[RECORD]["kinds"].items() if kind in kinds and n in armature]
    return sorted(found, key=lambda n: (JOINTS.index(n[2 + len(digit_of(n[2:-1])) : -1]), n[-1]))


def label(channel: str) -> str:
    """``riRingDIPy`` -> ``DIP flexion``."""
    joint = channel[2:-1]
    letters = "xzy" if joint.startswith("Thumb") else "xyz"
    motion = "aft"[letters.index(channel[-1])]
    return f"{joint.removeprefix(digit_of(joint))} {MOTIONS[motion]}"


def absolute(path: str) -> str:
    """A path that means the same wherever the .blend file goes."""
    return os.path.realpath(bpy.path.abspath(path))


def has_rig(item: bpy.types.Object | None) -> bool:
    """Whether an object is an armature with channels."""
    return item is not None and item.type == "ARMATURE" and RECORD in item


def _import_entry(self: bpy.types.Menu, _: bpy.types.Context) -> None:
    self.layout.operator(USDHAND_OT_import_rig.bl_idname, text="Hand Rig (.usda/.usdc)")


def _export_entry(self: bpy.types.Menu, _: bpy.types.Context) -> None:
    self.layout.operator(USDHAND_OT_export_edits.bl_idname, text="Edited Hand Channels (.usda)")


CLASSES = (USDHAND_OT_import_rig, USDHAND_OT_export_edits, USDHAND_PT_channels)


def register() -> None:
    """Add everything to Blender."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.WindowManager.usdhand_show_dependents = BoolProperty(
        name="Show Dependents",
        description="Also list the channels that follow others",
        default=False,
    )
    bpy.types.TOPBAR_MT_file_import.append(_import_entry)
    bpy.types.TOPBAR_MT_file_export.append(_export_entry)


def unregister() -> None:
    """Take everything out of Blender."""
    bpy.types.TOPBAR_MT_file_import.remove(_import_entry)
    bpy.types.TOPBAR_MT_file_export.remove(_export_entry)
    del bpy.types.WindowManager.usdhand_show_dependents
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
