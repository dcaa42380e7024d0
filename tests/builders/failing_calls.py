"""Calls of public functions that fail, with the error and the words of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from builders.in_memory import SAMPLES, first_frame, sample, still, with_hand, without_fingers

import usdhand
from usdhand.anatomy.channels import Channels

OK = SAMPLES / "gestures" / "ok_01.usdc"
GESTURES = sorted((SAMPLES / "gestures").glob("ok_*.usdc"))[:4]
BODY = "conversations/talk_01_body"
FINGERS = "hands/talk_01_hands_a"
BEN = SAMPLES / "characters" / "ben.usdc"


@dataclass(frozen=True)
class Case:
    """A call that fails."""

    function: str
    error: type[usdhand.UsdHandError]
    words: str
    call: Callable[[], object]


def file_without_hands(folder: Path) -> Path:
    usdhand.write_new(without_fingers(sample("gestures/ok_01")), folder / "bare.usda", force=True)
    return folder / "bare.usda"


def two_characters(folder: Path) -> Path:
    """A stage with two characters, and no motion chosen."""
    from pxr import Usd

    path = folder / "two.usda"
    stage = Usd.Stage.CreateNew(str(path)) if not path.exists() else Usd.Stage.Open(str(path))
    for name in ("A", "B"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(OK), "/Ada")
    stage.Save()
    return path


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def cases(folder: Path) -> Iterator[Case]:
    """At least one for each error that a docstring names."""
    usage, no_input = usdhand.UsageError, usdhand.InputError
    no_output, no_hand = usdhand.OutputError, usdhand.HandNotFoundError
    stopped = usdhand.CancelledError
    clip, body, fingers = sample("gestures/ok_01"), sample(BODY), sample(FINGERS)
    built = usdhand.build_library(GESTURES, folder / "library.usdc")
    library = built.library
    hands = usdhand.find_hands(clip)
    [reduction] = usdhand.reduce_hands([clip])
    rig, whole = folder / "rig.usda", folder / "whole_rig.usda"
    usdhand.write_rig(reduction, rig, force=True)
    usdhand.write_rig(reduction, whole, flatten=True, force=True)
    bare, nothing = without_fingers(body), folder / "nothing.usdc"
    text = written(folder, "text.usda", "nothing")
    no_folder = folder / "nowhere" / "out.usda"

    yield Case(
        "add_finger_joints",
        no_hand,
        "no wrist without fingers",
        lambda: usdhand.add_finger_joints(clip, clip.skeleton, hands),
    )
    yield Case(
        "animation_names",
        no_input,
        "no such file",
        lambda: usdhand.animation_names(folder / "nothing.bvh"),
    )
    yield Case(
        "animation_names",
        no_input,
        "'.mov' files are not read",
        lambda: usdhand.animation_names(written(folder, "clip.mov", "")),
    )
    left = with_hand(clip, "Left")
    yield Case(
        "apply_rig",
        usage,
        "The rig has the channel",
        lambda: usdhand.apply_rig(reduction.rig, left, usdhand.find_hands(left)),
    )
    yield Case(
        "build_library",
        usage,
        "given twice",
        lambda: usdhand.build_library([OK, OK], folder / "a.usdc"),
    )
    yield Case(
        "build_library",
        no_input,
        "No clip can be used",
        lambda: usdhand.build_library([nothing], folder / "a.usdc"),
    )
    yield Case(
        "build_library",
        stopped,
        "Stopped",
        lambda: usdhand.build_library([OK], folder / "a.usdc", progress=lambda *_: False),
    )
    yield Case("check_file", no_input, "cannot read this file", lambda: usdhand.check_file(text))
    yield Case("check_file", usage, "skeleton", lambda: usdhand.check_file(OK, "Nobody"))
    yield Case("compare", no_input, "no such file", lambda: usdhand.compare(clip, nothing))
    yield Case("compare", no_hand, "no hand found", lambda: usdhand.compare(clip, bare))
    yield Case(
        "compare",
        usage,
        "have no hand joint in common",
        lambda: usdhand.compare(left, with_hand(clip, "Right")),
    )
    yield Case(
        "convert", no_input, "no such file", lambda: usdhand.convert(nothing, folder / "a.bvh")
    )
    yield Case(
        "convert",
        usage,
        "several|more than one|--skel",
        lambda: usdhand.convert(two_characters(folder), folder / "a.bvh"),
    )
    yield Case(
        "convert",
        usage,
        "no frame from 900 to",
        lambda: usdhand.convert(OK, folder / "a.bvh", usdhand.Edits(trim=(900.0, None))),
    )
    yield Case(
        "convert",
        no_hand,
        "no hand found",
        lambda: usdhand.convert(OK, folder / "a.bvh", onto=file_without_hands(folder)),
    )
    yield Case(
        "convert",
        no_output,
        "an input of this command",
        lambda: usdhand.convert(OK, OK, force=True),
    )
    yield Case("expand", no_input, "no hand rig", lambda: usdhand.expand(OK))
    yield Case(
        "expand", usage, "does not refer to the clip", lambda: usdhand.expand(whole, refresh=True)
    )
    named = usdhand.load_conventions({"left": {"wrist": "Nobody"}})
    yield Case(
        "expand", no_hand, "'Nobody' is not in the skeleton", lambda: usdhand.expand(rig, named)
    )
    yield Case(
        "expand_motion",
        usage,
        "lack the channel",
        lambda: usdhand.expand_motion(reduction.rig, left),
    )
    yield Case(
        "expand_motion",
        no_hand,
        "no hand found",
        lambda: usdhand.expand_motion(reduction.rig, bare),
    )
    yield Case("fit_rig", no_input, "", lambda: usdhand.fit_rig([]))
    yield Case("fit_rig", no_hand, "no hand found", lambda: usdhand.fit_rig([bare]))
    yield Case(
        "fit_rig",
        usage,
        "",
        lambda: usdhand.fit_rig([clip], usdhand.ReduceSettings(preset=4, max_error=1.0)),
    )
    yield Case("expand_onto", no_input, "no such file", lambda: usdhand.expand_onto(rig, nothing))
    yield Case(
        "expand_onto",
        usage,
        "several|more than one|--skel",
        lambda: usdhand.expand_onto(rig, two_characters(folder)),
    )
    yield Case("expand_onto", no_hand, "no hand found", lambda: usdhand.expand_onto(rig, bare))
    yield Case("fill_fingers", usage, "already move", lambda: usdhand.fill_fingers(clip, library))
    yield Case(
        "fill_fingers",
        no_hand,
        "no finger joints below its left and right wrist",
        lambda: usdhand.fill_fingers(bare, library),
    )
    yield Case(
        "fill_fingers",
        no_input,
        "a single frame",
        lambda: usdhand.fill_fingers(first_frame(body), library),
    )
    yield Case(
        "fill_fingers",
        no_input,
        "The library is empty",
        lambda: usdhand.fill_fingers(body, usdhand.MotionLibrary(())),
    )
    yield Case(
        "fill_fingers",
        stopped,
        "Stopped after 0 of",
        lambda: usdhand.fill_fingers(body, library, progress=lambda *_: False),
    )
    yield Case(
        "find_hands",
        usage,
        "There is no side 'Left'",
        lambda: usdhand.find_hands(clip, sides=("Left",)),
    )  # type: ignore[arg-type]
    yield Case(
        "find_hands",
        no_hand,
        "no left hand, only the right one",
        lambda: usdhand.find_hands(with_hand(clip, "Right"), sides=("left",)),
    )
    yield Case(
        "label_agreement",
        no_input,
        "at least two are needed",
        lambda: usdhand.label_agreement(library),
    )
    yield Case(
        "load_conventions", usage, "cannot be read", lambda: usdhand.load_conventions(nothing)
    )
    yield Case("make_request", usage, "no verb", lambda: usdhand.make_request({"verb": "dance"}))
    yield Case(
        "load_conventions",
        usage,
        r"\[left\] wirst: unknown joint",
        lambda: usdhand.load_conventions({"left": {"wirst": "x"}}),
    )
    yield Case(
        "measure_library",
        stopped,
        "Stopped after 0 of",
        lambda: usdhand.measure_library(library, folder, progress=lambda *_: False),
    )
    yield Case("parse_pin", usage, "is not a pin", lambda: usdhand.parse_pin("1", body, fingers))
    yield Case(
        "parse_pin",
        usage,
        "outside the hand clip",
        lambda: usdhand.parse_pin("1:99999", body, fingers),
    )
    yield Case("preview_clips", no_input, "no such file", lambda: usdhand.preview_clips([nothing]))
    yield Case("preview_clips", usage, "nothing to show", lambda: usdhand.preview_clips([]))
    for read in (usdhand.read_clip, usdhand.read_character):
        yield Case(read.__name__, no_input, "no such file", lambda read=read: read(nothing))
        yield Case(read.__name__, usage, "skeleton", lambda read=read: read(two_characters(folder)))
    yield Case(
        "read_library", no_input, "no motion library|is no", lambda: usdhand.read_library(OK)
    )
    yield Case("read_rig", no_input, "no hand rig", lambda: usdhand.read_rig(OK))
    yield Case("reduce_hands", usage, "There is no clip", lambda: usdhand.reduce_hands([]))
    yield Case(
        "reduce_hands",
        usage,
        "either thresholds, a number of channels, or",
        lambda: usdhand.reduce_hands([clip], usdhand.ReduceSettings(preset=4, max_error=1.0)),
    )
    yield Case("reduce_hands", no_hand, "no hand found", lambda: usdhand.reduce_hands([bare]))
    yield Case(
        "reduce_hands",
        no_input,
        "has only one frame",
        lambda: usdhand.reduce_hands([first_frame(clip)]),
    )
    yield Case(
        "reduce_hands",
        no_input,
        "has other hand joints",
        lambda: usdhand.reduce_hands([clip, left]),
    )
    some, others = (with_hand(clip, "Left", d) for d in ("Index|Middle", "Ring|Pinky"))
    apart = {"no hand in common": (left, with_hand(clip, "Right"))}
    apart["no finger joint in common"] = (some, others)
    for name, function in (
        ("retarget_hands", usdhand.retarget_hands),
        ("splice_hands", usdhand.splice_hands),
    ):
        for words, pair in apart.items():
            yield Case(name, no_hand, words, partial(function, *pair))
    yield Case(
        "run",
        usdhand.UsdHandError,
        "no such file",
        lambda: usdhand.run(usdhand.CompareRequest(a=OK, b=nothing)),
    )
    yield Case(
        "splice_hands",
        no_input,
        "No hand moves in the hand clip",
        lambda: usdhand.splice_hands(clip, still(clip)),
    )
    yield Case(
        "splice_hands",
        usage,
        "Pin",
        lambda: usdhand.splice_hands(
            body, fingers, pins=[usdhand.Pin(1.0, 2.0), usdhand.Pin(2.0, 1.0)]
        ),
    )
    yield Case(
        "splice_hands",
        stopped,
        "Stopped after 0 of",
        lambda: usdhand.splice_hands(
            body, fingers, pins=["1:1", "181:403"], progress=lambda *_: False
        ),
    )
    yield Case(
        "write_clip", no_output, "no such folder", lambda: usdhand.write_clip(clip, no_folder)
    )
    yield Case(
        "write_clip",
        no_input,
        "joints",
        lambda: usdhand.write_clip(
            replace(
                clip,
                skeleton=left.skeleton,
                rotations=left.rotations,
                translations=left.translations,
                scales=left.scales,
            ),
            folder / "a.usda",
        ),
    )
    yield Case(
        "write_library",
        no_output,
        "cannot write '.bvh' files",
        lambda: usdhand.write_library(library, folder / "a.bvh"),
    )
    yield Case(
        "write_new",
        no_output,
        "cannot write '.fbx' files",
        lambda: usdhand.write_new(clip, folder / "a.fbx"),
    )
    yield Case(
        "write_new",
        usage,
        "glTF is always Y up",
        lambda: usdhand.write_new(clip, folder / "a.glb", up="Z"),
    )
    page = usdhand.preview_clips([clip])
    yield Case(
        "write_preview",
        no_output,
        "no such folder",
        lambda: usdhand.write_preview(page, folder / "nowhere" / "a.html"),
    )
    yield from writers(folder, reduction, library)


def writers(
    folder: Path, reduction: usdhand.Reduction, library: usdhand.MotionLibrary
) -> Iterator[Case]:
    """Results that are no numbers, and outputs that cannot be."""
    body, fingers = sample(BODY), sample(FINGERS)
    filled = usdhand.fill_fingers(body, library)
    spliced = usdhand.splice_hands(body, fingers, pins=["1:1", "181:403"])
    no_folder, output = folder / "nowhere" / "out.usda", folder / "nan.usda"

    def broken(clip: usdhand.Clip) -> usdhand.Clip:
        return clip.with_rotations(np.full_like(clip.rotations, np.nan))

    no_numbers = Channels(reduction.free.names, np.full_like(reduction.free.values, np.nan))
    reduced = Channels(reduction.reduced.names, np.full_like(reduction.reduced.values, np.nan))
    nan = {
        "write_filled": lambda: usdhand.write_filled(
            replace(filled, clips=(broken(filled.clips[0]),)), output
        ),
        "write_spliced": lambda: usdhand.write_spliced(
            replace(spliced, clip=broken(spliced.clip)), output
        ),
        "write_rig": lambda: usdhand.write_rig(
            replace(reduction, free=no_numbers, reduced=reduced), output
        ),
    }
    for name, call in nan.items():
        yield Case(name, usdhand.InputError, "not numbers", call)
    lost = {
        "write_filled": lambda: usdhand.write_filled(filled, no_folder),
        "write_spliced": lambda: usdhand.write_spliced(spliced, no_folder),
        "write_rig": lambda: usdhand.write_rig(reduction, no_folder),
    }
    for name, call in lost.items():
        yield Case(name, usdhand.OutputError, "no such folder", call)
