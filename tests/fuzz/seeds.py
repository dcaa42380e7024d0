"""Small sound files of every kind that is read; what fuzzing damages.

usage: python seeds.py FOLDER
"""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from builders.every_format import fbx_of
from builders.in_memory import arrays_of, reordered

import usdhand
from usdhand.motion import Clip
from usdhand.motion.editing import trim
from usdhand.requests.fill import FillRequest
from usdhand.requests.library import LibraryBuildRequest
from usdhand.requests.reduce import ReduceRequest
from usdhand.requests.splice import SpliceRequest
from usdhand.verbs.run import run

REPOSITORY = Path(__file__).resolve().parents[2]
SAMPLES = REPOSITORY / "samples"
MAP = """\
[house]
about = "our rigs"
side = ["Left", "Right"]
digit = ["Index", "Middle", "Ring", "Pinky"]
prefix = ["a:"]
wrist = "{side}Hand"
elbow = "{side}ForeArm"
thumb = ["{side}HandThumb1", "{side}HandThumb2", "{side}HandThumb3"]
finger = ["{side}Hand{digit}1", "{side}Hand{digit}2", "{side}Hand{digit}3"]
tip = ["{side}Hand{digit}4", "{side}Hand{digit}3_End"]
hips = "Hips"

[right]
wrist = "RightHand"
IndexMCP = "RightHandIndex1"
IndexPIP = "RightHandIndex2"
MiddleMCP = "RightHandMiddle1"
MiddlePIP = "RightHandMiddle2"

[body]
hips = "Hips"
"""


def part(name: str, seconds: float, start: float = 0.5) -> Clip:
    """A few frames of a sample, which is no longer tied to its file."""
    clip = usdhand.read_clip(SAMPLES / f"{name}.usdc")
    first = clip.time_code(round(start * clip.fps))
    last = clip.time_code(round((start + seconds) * clip.fps))
    return replace(trim(clip, first, last), source=None, name="s")


EDITS = {
    "schema": "usdhand.edits/1",
    "splice": {
        "pins": [
            {"body": 20, "hand": 21.5, "tolerance": 1, "side": "left"},
            {"body": 40, "hand": 40},
        ]
    },
}
# Joints that show every kind of hand: small files are damaged where it matters, and read fast.
FEW = re.compile("Hips(/Spine.?)*|.*(Right.*|Left(Shoulder|Arm|ForeArm|Hand|Hand(Thumb|Index).))")
LEG = re.compile(".*(Leg|Foot|Toe)")


def few_joints(clip: Clip) -> Clip:
    """Both arms, a whole hand, and two fingers of the other."""
    keep: list[int] = []
    for joint, path in enumerate(clip.skeleton.joints):
        whole = clip.skeleton.parents[joint] in (-1, *keep)
        if whole and FEW.fullmatch(path) and not LEG.fullmatch(path):
            keep.append(joint)
    return Clip.from_arrays(**reordered(arrays_of(clip), np.array(keep)))


def make(folder: Path) -> None:
    """Write all of them."""
    short = few_joints(part("gestures/ok_01", 0.1))
    for suffix in ("usda", "usdc", "usdz", "bvh", "glb", "gltf"):
        usdhand.write_new(short, folder / f"s.{suffix}")
    fbx_of(short, folder / "s.fbx", {})
    body = folder / "body.usdc"
    usdhand.write_new(part("gestures/ok_02", 1.0), body)
    clips = []
    for name in ("ok_01", "big_01"):
        clips.append(folder / f"{name}.usdc")
        usdhand.write_new(part(f"gestures/{name}", 1.0), clips[-1])
    run(ReduceRequest(clips=(str(folder / "s.usdc"),), output=folder / "rig.usda", flatten=True))
    run(ReduceRequest(clips=(str(folder / "s.usdc"),), output=folder / "rig.usdc", flatten=True))
    library = folder / "library.usdc"
    run(LibraryBuildRequest(clips=tuple(map(str, clips)), output=library))
    out = folder / "filled.usdc"
    report = folder / "fill.json"
    run(FillRequest(body=body, library=library, output=out, report=report, replace=True))
    report, out = folder / "splice.json", folder / "spliced.usdc"
    run(SpliceRequest(body=body, hands=clips[0], output=out, report=report))
    (folder / "map.toml").write_text(MAP)
    (folder / "edits.json").write_text(json.dumps(EDITS, indent=1))


if __name__ == "__main__":
    make(Path(sys.argv[1]))
