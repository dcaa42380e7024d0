"""One clip as a file of every format that is read, and of FBX with every kind of axes."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from builders.fbx_files import Keys, Node, write_fbx
from builders.gltf_files import glb
from conftest import REPOSITORY
from scipy.spatial.transform import Rotation

from usdhand import find_hands, read_clip, write_new
from usdhand.motion import Clip
from usdhand.motion import rotations as rot
from usdhand.motion.editing import trim

TALK = REPOSITORY / "samples" / "conversations" / "talk_01_full.usdc"
FRAMES = 90
MIRROR = np.diag([-1.0, 1.0, 1.0])

# What FBX files call right, up and front; their signs decide the handedness.
FBX_AXES: dict[str, dict[str, float]] = {
    "y_up": {},
    "z_up": {"UpAxis": 2, "FrontAxis": 1, "FrontAxisSign": -1},
    "x_up": {"UpAxis": 0, "FrontAxis": 2, "CoordAxis": 1, "CoordAxisSign": -1},
    "to_the_back": {"FrontAxisSign": -1, "CoordAxisSign": -1},
    "z_down": {"UpAxis": 2, "UpAxisSign": -1, "FrontAxis": 1},
    "left_handed": {"CoordAxisSign": -1},
    "z_up_left_handed": {"UpAxis": 2, "FrontAxis": 1},
}
FBX = tuple(f"{name}.fbx" for name in FBX_AXES)
USD = ("take.usda", "take.usdc", "take.usdz")
OTHERS = ("take.bvh", "two_roots.bvh", "take.glb", "take.gltf", "take.vrm", *FBX)
SECOND_ROOT = """ROOT Prop
{
  OFFSET 50 20 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Lid
  {
    OFFSET 0 9 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 4 0
    }
  }
}
"""


@cache
def talk() -> Clip:
    """Two hands that talk, for three seconds."""
    clip = read_clip(TALK)
    return trim(clip, 100, 100 + FRAMES - 1)


def written(clip: Clip, folder: Path, name: str) -> Path:
    """The clip as the file of this name, one of `USD` and `OTHERS`."""
    path = folder / name
    if path.suffix == ".fbx":
        return fbx_of(clip, path, FBX_AXES[path.stem])
    if path.suffix == ".vrm":
        write_new(clip, folder / "vrm.glb")
        return _vrm(clip, folder / "vrm.glb", path)
    write_new(clip, path)
    return _with_second_root(path) if name == "two_roots.bvh" else path


def root_of(name: str, clip: Clip) -> str | None:
    """What `skel` must say so that the clip is read again from the file of this name."""
    return clip.skeleton.joints[0] if name == "two_roots.bvh" else None


def reader(folder: Path) -> Callable[[str], Clip]:
    """Clips of the files of these names, each written and read once; FBX skips without ufbx."""

    @cache
    def clip(name: str) -> Clip:
        if name.endswith(".fbx"):
            pytest.importorskip("ufbx", reason="FBX needs the extra 'convert'")
        return read_clip(written(talk(), folder, name), root_of(name, talk()))

    return clip


def fbx_of(clip: Clip, path: Path, axes: Mapping[str, float]) -> Path:
    """The clip as an FBX file with a bind pose, in these axes."""
    turn = _axes(axes)
    mirrored = np.linalg.det(turn) < 0
    proper = (turn @ MIRROR if mirrored else turn).T
    skeleton, roots = clip.skeleton, clip.skeleton.parents < 0

    def local(q: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, t = q.copy(), t.copy()
        q[:, roots] = rot.multiply(rot.from_matrix(proper), q[:, roots])
        t[:, roots] = t[:, roots] @ proper.T
        if mirrored:
            q, t = q * [1.0, -1.0, -1.0, 1.0], t * [-1.0, 1.0, 1.0]
        euler = Rotation.from_quat(q.reshape(-1, 4)).as_euler("xyz", degrees=True)
        return np.unwrap(euler.reshape(*q.shape[:2], 3), axis=0, period=360.0), t

    turned, moved = local(clip.rotations, clip.translations)
    rest = skeleton.rest[None]
    rest_turned, rest_moved = local(rot.from_matrix(rest[..., :3, :3]), rest[..., :3, 3])
    nodes = [
        Node(
            name,
            int(skeleton.parents[j]),
            vectors={
                "Lcl Rotation": tuple(rest_turned[0, j]),
                "Lcl Translation": tuple(rest_moved[0, j]),
            },
            keys=_keys("Lcl Rotation", turned[:, j], clip)
            | _keys("Lcl Translation", moved[:, j], clip),
        )
        for j, name in enumerate(skeleton.names)
    ]
    wide, flip = np.eye(4), np.diag([-1.0, 1.0, 1.0, 1.0]) if mirrored else np.eye(4)
    wide[:3, :3] = proper
    bind = {j: flip @ wide @ skeleton.bind[j] @ flip for j in range(len(skeleton))}
    end = (len(clip) - 1) / clip.fps
    return write_fbx(path, nodes, takes={"Take": (0.0, end)}, settings=axes, bind=bind)


def _keys(name: str, values: np.ndarray, clip: Clip) -> dict[tuple[str, str], Keys]:
    times = np.arange(len(clip)) / clip.fps
    return {
        (name, axis): list(zip(times.tolist(), column.tolist(), strict=True))
        for axis, column in zip("XYZ", values.T, strict=True)
    }


def _axes(settings: Mapping[str, float]) -> np.ndarray:
    """(3, 3) that turns the file's axes to X right, Y up, Z to the front."""
    usual = {"CoordAxis": 0, "UpAxis": 1, "FrontAxis": 2}
    turn = np.zeros((3, 3))
    for row, (axis, own) in enumerate(usual.items()):
        turn[row, int(settings.get(axis, own))] = settings.get(f"{axis}Sign", 1)
    return turn


def _with_second_root(path: Path) -> Path:
    hierarchy, motion = path.read_text().split("MOTION\n")
    frames, time, *rows = motion.strip().split("\n")
    more = [f"{row.rstrip()} 50 20 {i} 0 {i} 0 {i} 0 0" for i, row in enumerate(rows)]
    path.write_text(hierarchy + SECOND_ROOT + "MOTION\n" + "\n".join([frames, time, *more]) + "\n")
    return path


def _vrm(clip: Clip, source: Path, path: Path) -> Path:
    """A glTF file as a VRM avatar that names its wrists and hips."""
    data = source.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + size])
    nodes = {node.get("name"): i for i, node in enumerate(document["nodes"])}
    hands = find_hands(clip).character
    bones = {f"{side}Hand": hand.wrist for side, hand in hands.hands.items()}
    bones |= {"hips": hands.hips}
    named = {bone: {"node": nodes[clip.skeleton.names[j]]} for bone, j in bones.items()}
    document["extensions"] = {"VRMC_vrm": {"specVersion": "1.0", "humanoid": {"humanBones": named}}}
    document["extensionsUsed"] = [*document.get("extensionsUsed", []), "VRMC_vrm"]
    path.write_bytes(glb(json.dumps(document).encode(), data[20 + size + 8 :]))
    return path
