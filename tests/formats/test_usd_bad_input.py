"""Input that cannot be used: one clear message, and never anything but a `UsdHandError`."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, UsdGeom, UsdSkel, Vt

from usdhand.errors import InputError, UsdHandError
from usdhand.formats.usd.check import check_file
from usdhand.formats.usd.read import read_character, read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion

COUNT = len(stages.JOINTS)
WHOLE = stages.character


def bad_rotation(value: float, frame: int = 3, joint: int = 2) -> np.ndarray:
    rotations = stages.waves(stages.TIMES, COUNT)
    rotations[frame, joint] = value
    return rotations


def text(path: Path) -> Path:
    path.write_text("a hand, a hand, my kingdom for a hand")
    return path


def empty(path: Path) -> Path:
    path.touch()
    return path


def truncated(path: Path) -> Path:
    stages.character(path)
    path.write_bytes(path.read_bytes()[:-400])
    return path


def without_joints(path: Path) -> Path:
    return changed(path, lambda s: UsdSkel.Skeleton.Get(s, stages.SKELETON).GetJointsAttr().Clear())


def changed(path: Path, change: Callable[[object], object], **options: object) -> Path:
    stages.character(path, **options)
    stage = stages.edited(path)
    change(stage)
    stage.Save()
    return path


def short_row(stage: object) -> None:
    row = Vt.QuatfArray.FromNumpy(stages.waves([1.0], 4)[0])
    UsdSkel.Animation.Get(stage, stages.ANIMATION).GetRotationsAttr().Set(row, 5.0)


def blocked(stage: object) -> None:
    UsdSkel.Animation.Get(stage, stages.ANIMATION).GetRotationsAttr().Set(Sdf.ValueBlock(), 4.0)


def zero_scale(stage: object) -> None:
    stages.place(stage, scale=(0, 0, 0))


def nan_xform(stage: object) -> None:
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))
    xform.AddTranslateOp().Set(Gf.Vec3d(float("nan"), 0, 0))


BAD: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "missing": ("no.usda", lambda p: p, "no such file"),
    "folder": ("folder.usd", lambda p: p.mkdir(), "is a folder"),
    "other suffix": ("take.fbx", text, "is not a USD file"),
    "text": ("take.usd", text, "USD cannot read this file"),
    "text as usdc": ("take.usdc", text, "USD cannot read this file"),
    "text as usdz": ("take.usdz", text, "USD cannot read this file"),
    "empty": ("take.usdc", empty, "USD cannot read this file"),
    "truncated": ("take.usdc", truncated, "USD cannot read this file"),
    "no skeleton": (
        "take.usda", lambda p: stages.layer(p).Save(), "there is no UsdSkel skeleton on this stage",
    ),
    "no joints": ("take.usda", without_joints, "lists no joints"),
    "twice": ("take.usda", lambda p: WHOLE(p, joints=["a", "a/b", "a/b"]), "'a/b' twice"),
    "no animation": ("take.usda", lambda p: WHOLE(p, without=["binding"]), "no animation is bound"),
    "no rotations": ("take.usda", lambda p: WHOLE(p, without=["rotations"]), "has no rotations"),
    "no joint": ("take.usda", lambda p: WHOLE(p, animated=["x"]), "animates none of the 11 joints"),
    "nan": (
        "take.usda",
        lambda p: WHOLE(p, rotations=bad_rotation(np.nan)),
        r"not-a-number in /Hero/Anim\.rotations, joint 'Hips/Spine/Head', at time code 4\.",
    ),
    "infinite": ("take.usda", lambda p: WHOLE(p, rotations=bad_rotation(np.inf)), "not-a-number"),
    "zero": (
        "take.usda",
        lambda p: WHOLE(p, rotations=bad_rotation(0.0)),
        r"zero-length quaternion in /Hero/Anim\.rotations, joint 'Hips/Spine/Head', at time code 4",
    ),
    "nan translation": (
        "take.usda",
        lambda p: WHOLE(p, translations=stages.offsets(COUNT)[None] * np.nan),
        r"not-a-number in /Hero/Anim\.translations, joint 'Hips', at the default value",
    ),
    "nan scale": (
        "take.usda",
        lambda p: WHOLE(p, scales=np.full((1, COUNT, 3), np.nan)),
        r"not-a-number in /Hero/Anim\.scales",
    ),
    "array length": (
        "take.usda", lambda p: changed(p, short_row), "4 elements at time code 5.*11 joints",
    ),
    "blocked": ("take.usda", lambda p: changed(p, blocked), "no value at time code 4"),
    "far apart": (
        "take.usda",
        lambda p: WHOLE(p, times=[0.0, 1e9], rotations=stages.waves([0.0, 1e9], COUNT)),
        "2 samples are spread over .* 1000000001 frames",
    ),
    "no unit": ("take.usda", lambda p: WHOLE(p, meters=0.0), "metersPerUnit is 0"),
    "no rate": ("take.usda", lambda p: WHOLE(p, rate=0.0), "USD cannot read .*framesPerSecond"),
    "zero scale": ("take.usda", lambda p: changed(p, zero_scale), "below a zero scale"),
    "nan above": ("take.usda", lambda p: changed(p, nan_xform), "not numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    filename, make, message = BAD[name]
    make(tmp_path / filename)
    capfd.readouterr()
    with pytest.raises(InputError, match=message) as caught:
        read_clip(tmp_path / filename)
    assert caught.value.exit_code == 3
    assert filename in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_a_late_fault_is_found_too(tmp_path: Path) -> None:
    times = np.arange(1.0, 301.0)
    rotations = stages.waves(times, COUNT)
    rotations[290, 1] = 0.0
    path = WHOLE(tmp_path / "take.usdc", times=times, rotations=rotations)
    with pytest.raises(InputError, match="joint 'Hips/Spine', at time code 291"):
        read_clip(path)


def test_no_samples_at_all(tmp_path: Path) -> None:
    path = WHOLE(tmp_path / "take.usda")
    stage = stages.edited(path)
    animation = UsdSkel.Animation.Get(stage, stages.ANIMATION)
    animation.GetRotationsAttr().Clear()
    stage.Save()
    source = path.read_text()
    path.write_text(source.replace("quatf[] rotations", "quatf[] rotations.timeSamples = {}"))
    with pytest.raises(InputError, match="rotations"):
        read_clip(path)


# -- anything at all ----------------------------------------------------------------------------

QUIET = settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
ANY_FLOAT = st.floats(width=32, allow_nan=True, allow_infinity=True)
NAMES = st.lists(st.text("aB1 :-./_é\t", min_size=0, max_size=6), max_size=5)


def survives(path: Path) -> None:
    """Reading, checking and writing work or are refused; nothing else."""
    for use in (read_clip, read_character, check_file, rewritten):
        with contextlib.suppress(UsdHandError):
            use(path)


def rewritten(path: Path) -> None:
    character = find_character(path)
    write_motion(character, read_clip(path), [0], path.with_name("out.usda"), force=True)


@QUIET
@given(joints=NAMES, animated=NAMES, poses=st.integers(0, 6))
def test_any_joint_names(
    joints: list[str], animated: list[str], poses: int, tmp_path: Path
) -> None:
    layer = stages.layer(tmp_path / "take.usda") if not (tmp_path / "take.usda").exists() else None
    layer = layer or Sdf.Layer.FindOrOpen(str(tmp_path / "take.usda"))
    layer.Clear()
    stage = stages.Usd.Stage.Open(layer)
    UsdSkel.Root.Define(stage, stages.ROOT)
    skeleton = UsdSkel.Skeleton.Define(stage, stages.SKELETON)
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateRestTransformsAttr(stages.matrices(np.tile(np.eye(4), (poses, 1, 1))))
    animation = UsdSkel.Animation.Define(stage, stages.ANIMATION)
    animation.CreateJointsAttr(animated)
    stages.set_values(
        animation.GetPrim(), "rotations", [1.0, 2.0], stages.waves([1, 2], len(animated))
    )
    stages.bind(skeleton.GetPrim(), stages.ANIMATION)
    layer.Save()
    survives(tmp_path / "take.usda")


@QUIET
@given(
    values=st.lists(ANY_FLOAT, min_size=8, max_size=8),
    times=st.lists(st.floats(-1e12, 1e12), min_size=2, max_size=2, unique=True),
    rate=st.sampled_from([-24.0, 1e-3, 24.0, 1e9, float("inf")]),
    meters=st.sampled_from([0.0, -1.0, 1e-30, 0.01, 1e30, float("nan")]),
)
def test_any_numbers(
    values: list[float], times: list[float], rate: float, meters: float, tmp_path: Path
) -> None:
    path = tmp_path / "take.usda"
    path.unlink(missing_ok=True)
    if found := Sdf.Layer.Find(str(path)):
        found.Reload(force=True)
    rotations = np.array(values, np.float32).reshape(2, 1, 4)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = stages.Usd.Stage.Open(layer)
    layer.timeCodesPerSecond = layer.framesPerSecond = rate
    layer.pseudoRoot.SetInfo("metersPerUnit", meters)
    stages.add_character(
        stage, stages.ROOT, joints=["Hips"], times=sorted(times), rotations=rotations
    )
    layer.Export(str(path))
    survives(path)


@QUIET
@given(data=st.data())
def test_any_damage(data: st.DataObject, tmp_path: Path) -> None:
    path = tmp_path / f"{data.draw(st.integers(0, 10**9))}.usda"
    source = (
        stages.character(tmp_path / "whole.usda")
        if not (tmp_path / "whole.usda").exists()
        else (tmp_path / "whole.usda")
    )
    whole = source.read_bytes()
    at = data.draw(st.integers(0, len(whole)))
    path.write_bytes(
        whole[:at] + data.draw(st.binary(max_size=4)) + whole[at + data.draw(st.integers(0, 50)) :]
    )
    survives(path)
    path.unlink()
