"""Characters of all kinds, and what it takes to write them with another hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from builders import stages
from pxr import Gf, Sdf, UsdUtils

from usdhand.formats.usd.read import clip_from_character, read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import Clip
from usdhand.motion import rotations as rot

COUNT = len(stages.JOINTS)
HAND = tuple(range(5, COUNT))
BODY = tuple(range(5))


def turned(clip: Clip, joints: tuple[int, ...] = HAND) -> Clip:
    """The clip with some joints turned."""
    rotations = clip.rotations.copy()
    by = stages.turned(np.array([0.3, 0.2, -0.4])).astype(float)
    rotations[:, joints] = rot.multiply(rotations[:, joints], by)
    return clip.with_rotations(rotations)


def rewrite(path: Path, output: Path, **options: object) -> tuple[Clip, Clip]:
    """Write a file's character with its hand turned; returns what was meant and what is read."""
    character = find_character(path)
    meant = turned(clip_from_character(character))
    write_motion(character, meant, HAND, output, **options)
    return meant, read_clip(output)


def raw(path: Path, name: str, times: tuple[float, ...] = stages.TIMES) -> np.ndarray:
    """Values of the bound animation's attribute as USD composes them."""
    character = find_character(path)
    attribute = character.animation.GetAttribute(name)
    return np.array([np.array(attribute.Get(t)) for t in times])


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to the bit."""
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


def plain(folder: Path) -> Path:
    return stages.character(folder / "in.usdc")


def wobbling(folder: Path) -> Path:
    """Everything moves, under transforms, with signs flipped and tiny numbers."""
    wobble = 1.0 + 0.1 * np.sin(np.arange(12.0))[:, None, None]
    signs = np.where(np.arange(12) % 3, 1, -1)[:, None, None]
    rotations = stages.waves(stages.TIMES, COUNT) * signs
    rotations[:, 0, 0] = 1e-12
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    path = stages.character(
        folder / "in.usda",
        rotations=rotations,
        translations=stages.offsets(COUNT) * wobble,
        scales=np.ones((COUNT, 3)) * wobble,
        up="Z",
        meters=1.0,
    )
    stage = stages.edited(path)
    xform = stages.place(stage, rotate=(-90, 10, 5), scale=(0.01, 0.01, 0.01))
    move = xform.AddTranslateOp()
    for time in stages.TIMES:
        move.Set(Gf.Vec3d(time, 2 * time, 0), time)
    stage.Save()
    return path


def sublayered(folder: Path) -> Path:
    asset = stages.character(folder / "asset.usda", rate=48.0)
    offset = Sdf.LayerOffset(3.0)
    return stages.sublayering(folder / "in.usda", asset, offset=offset, rate=24.0)


def referenced(folder: Path) -> Path:
    (folder / "sub").mkdir()
    asset = stages.character(folder / "sub" / "asset.usda")
    return stages.referencing(folder / "in.usda", asset, offset=Sdf.LayerOffset(2.0))


def payload(folder: Path) -> Path:
    return stages.referencing(folder / "in.usda", plain_asset(folder), how="payload")


def instance(folder: Path) -> Path:
    return stages.referencing(folder / "in.usda", plain_asset(folder), instanceable=True)


def plain_asset(folder: Path) -> Path:
    return stages.character(folder / "asset.usda")


def reordered(folder: Path) -> Path:
    return stages.character(folder / "in.usda", animated=stages.JOINTS[:1:-1])


def bound_on_root(folder: Path) -> Path:
    path = stages.character(folder / "in.usda", without=["binding"])
    stage = stages.edited(path)
    stages.bind(stage.GetPrimAtPath(stages.ROOT), stages.ANIMATION)
    stage.Save()
    return path


def sparse(folder: Path) -> Path:
    return stages.character(folder / "in.usda", times=[1.0, 4.0, 12.0])


def package(folder: Path) -> Path:
    path = stages.character(folder / "in.usdc")
    assert UsdUtils.CreateNewUsdzPackage(str(path), str(folder / "in.usdz"))
    return folder / "in.usdz"


def bare(folder: Path) -> Path:
    return stages.character(folder / "in.usda", without=["translations", "scales"])


def fewer(folder: Path) -> Path:
    return stages.character(folder / "in.usda", animated=["Tail", *stages.JOINTS[3:8]])


INPUTS: list[Callable[[Path], Path]] = [
    plain, wobbling, sublayered, referenced, payload, instance, reordered, bound_on_root, sparse,
    package, bare, fewer,
]  # fmt: skip
