"""Reading motion: a clip's joints are where UsdSkel puts them, however the stage is made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from conftest import shared_data
from oracles.usdskel import assert_same_world
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from usdhand.errors import UsageError
from usdhand.formats.usd.read import read_character, read_clip
from usdhand.motion import Clip
from usdhand.motion import rotations as rot

COUNT, FRAMES = len(stages.JOINTS), len(stages.TIMES)
HUNDREDS = stages.offsets(COUNT)[None] / 100.0


def moving(values: np.ndarray, amount: float = 0.1) -> np.ndarray:
    """Values over time, a little different in each frame."""
    shift = 1.0 + amount * np.sin(np.arange(FRAMES))
    return values * shift[:, None, None].astype(np.float32)


def codes(clip: Clip) -> set[str]:
    return {problem.code for problem in clip.problems}


CHARACTERS: dict[str, dict[str, object]] = {
    "plain": {},
    "translations over time": {"translations": moving(stages.offsets(COUNT)[None])},
    "scales": {"scales": moving(np.ones((1, COUNT, 3)), 0.3)},
    "scale of one joint": {
        "scales": np.where(np.arange(COUNT)[:, None] == 3, 1.5, [1.0, 1.0, 1.0])[None]
    },
    "non-uniform scales": {
        "scales": np.random.default_rng(5).uniform(0.7, 1.3, (1, COUNT, 3)),
    },
    "mirroring joints": {
        "scales": np.random.default_rng(6).choice([-1.0, 1.0], (1, COUNT, 3)),
    },
    "metres": {"meters": 1.0, "translations": HUNDREDS},
    "inches": {"meters": 0.0254},
    "Z up": {"up": "Z"},
    "no unit, no axis": {"meters": None, "up": None},
    "no rate": {"rate": None},
    "60 a second": {"rate": 60.0},
    "ticks": {
        "rate": 46186158000.0,
        "times": [t * 46186158000.0 / 30.0 for t in range(FRAMES)],
    },
    "sub-frames": {"times": [1.0 + i * 0.4 for i in range(FRAMES)]},
    "every other": {"times": [1.0 + i * 0.5 for i in range(FRAMES)], "rate": 30.0},
    "one frame": {"times": [7.0], "rotations": stages.waves([7.0], COUNT)},
    "no time samples": {"rotations": stages.waves([7.0], COUNT)},
    "several roots": {"joints": ["Hips", "Hips/Arm", "Prop", "Prop/Tip", "World"]},
    "joints out of order": {"joints": stages.JOINTS, "animated": stages.JOINTS[::-1]},
    "fewer joints": {"animated": stages.JOINTS[4:]},
    "unknown joints": {"animated": ["Tail", *stages.JOINTS, "Hips/Ear"]},
    "skipped ancestor": {"joints": ["Hips", "Hips/A/B", "Hips/A/B/C/D"]},
    "no bind": {"without": ["bind"]},
    "flipped signs": {
        "rotations": stages.waves(stages.TIMES, COUNT)
        * np.where(np.arange(FRAMES) % 3, 1, -1)[:, None, None]
    },
}


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
@pytest.mark.parametrize("name", CHARACTERS)
def test_characters(name: str, suffix: str, tmp_path: Path) -> None:
    clip = read_clip(stages.character(tmp_path / f"made{suffix}", **CHARACTERS[name]))
    # A non-uniform scale shears turned children: no rotation says that.
    assert_same_world(clip, turned=name != "non-uniform scales")
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0, atol=1e-6)
    assert (np.sum(clip.rotations[1:] * clip.rotations[:-1], axis=-1) >= 0).all()


def above(**placement: object) -> Callable[[Usd.Stage], None]:
    return lambda stage: stages.place(stage, **placement) and None


def animated_xform(stage: Usd.Stage) -> None:
    xform = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT))
    move, turn = xform.AddTranslateOp(), xform.AddRotateXYZOp()
    for time in stages.TIMES:
        move.Set(Gf.Vec3d(time * 3.0, 1.0, -time), time)
        turn.Set(Gf.Vec3f(10.0 * time, 40.0 * time, 5.0), time)


def sparse_xform(stage: Usd.Stage) -> None:
    turn = UsdGeom.Xformable(stage.GetPrimAtPath(stages.SKELETON)).AddRotateYOp()
    turn.Set(0.0, 1.0)
    turn.Set(90.0, 12.0)


def reset_stack(stage: Usd.Stage) -> None:
    stages.place(stage, translate=(50, 0, 0), rotate=(0, 45, 0))
    skeleton = stages.place(stage, stages.SKELETON, translate=(1, 2, 3), rotate=(10, 20, 30))
    skeleton.SetResetXformStack(True)


PLACEMENTS: dict[str, tuple[Callable[[Usd.Stage], None], dict[str, object]]] = {
    "translated": (above(translate=(10, 20, 30)), {}),
    "turned": (above(translate=(1, 2, 3), rotate=(-90, 30, 10)), {}),
    "scaled": (above(scale=(0.01, 0.01, 0.01), rotate=(-90, 0, 0)), {"meters": 1.0}),
    "on the skeleton": (lambda s: stages.place(s, stages.SKELETON, rotate=(0, 90, 0)) and None, {}),
    "animated": (animated_xform, {}),
    "animated, Z up, metres": (animated_xform, {"up": "Z", "meters": 1.0}),
    "animated by two keys": (sparse_xform, {}),
    "animated over one pose": (animated_xform, {"animated": stages.JOINTS[:1]}),
    "reset stack": (reset_stack, {}),
}


@pytest.mark.parametrize("name", PLACEMENTS)
def test_what_stands_above(name: str, tmp_path: Path) -> None:
    place, options = PLACEMENTS[name]
    path = stages.character(tmp_path / "made.usda", **options)
    stage = stages.edited(path)
    place(stage)
    stage.Save()
    assert_same_world(read_clip(path))


def test_what_a_clip_cannot_say_is_a_problem(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda")
    stage = stages.edited(path)
    scale = UsdGeom.Xformable(stage.GetPrimAtPath(stages.ROOT)).AddScaleOp()
    scale.Set(Gf.Vec3f(-1, 1, 2))
    stage.Save()
    assert codes(read_clip(path)) == {"mirrored", "non-uniform-scale"}
    scale.Set(Gf.Vec3f(1, 1, 1), 1.0)
    scale.Set(Gf.Vec3f(2, 2, 2), 9.0)
    stage.Save()
    assert codes(read_clip(path)) == {"animated-scale"}


ARCS = ["reference", "payload", "sublayer"]
OFFSETS = [Sdf.LayerOffset(), Sdf.LayerOffset(10.0), Sdf.LayerOffset(-3.0, 2.0)]


@pytest.mark.parametrize("rates", [(24.0, 24.0), (60.0, 24.0), (24.0, 30.0)])
@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("arc", ARCS)
def test_arcs_move_and_scale_time(
    arc: str, offset: Sdf.LayerOffset, rates: tuple[float, float], tmp_path: Path
) -> None:
    own, rate = rates
    asset = stages.character(tmp_path / "asset.usdc", rate=own)
    if arc == "sublayer":
        path = stages.sublayering(tmp_path / "shot.usda", asset, offset=offset, rate=rate)
    else:
        path = stages.referencing(tmp_path / "shot.usda", asset, how=arc, offset=offset, rate=rate)
    clip = read_clip(path)
    factor = offset.scale * rate / own
    assert clip.time_codes[0] == pytest.approx(offset.offset + stages.TIMES[0] * factor)
    assert clip.time_codes[-1] == pytest.approx(offset.offset + stages.TIMES[-1] * factor)
    assert clip.duration == pytest.approx((FRAMES - 1) / own * offset.scale)
    assert_same_world(clip)


def test_nested_arcs(tmp_path: Path) -> None:
    asset = stages.character(tmp_path / "asset.usda", rate=30.0)
    inner = stages.sublayering(
        tmp_path / "inner.usda", asset, offset=Sdf.LayerOffset(5.0), rate=30.0
    )
    path = stages.referencing(
        tmp_path / "shot.usda", inner, offset=Sdf.LayerOffset(2.0, 0.5), rate=60.0
    )
    clip = read_clip(path)
    assert clip.time_codes[0] == pytest.approx(2.0 + 0.5 * (1.0 + 5.0) * 2.0)
    assert_same_world(clip)


def test_an_override_of_rotations_in_a_stronger_layer(tmp_path: Path) -> None:
    asset = stages.character(tmp_path / "asset.usda")
    path = stages.sublayering(tmp_path / "shot.usda", asset)
    stage = stages.edited(path)
    turned = stages.waves(stages.TIMES, COUNT, seed=9)
    stages.set_values(stage.GetPrimAtPath(stages.ANIMATION), "rotations", stages.TIMES, turned)
    stage.Save()
    clip = read_clip(path)
    assert rot.angle_between(clip.rotations, turned.astype(float)).max() < 1e-4
    assert_same_world(clip)


@pytest.mark.parametrize("moved", [False, True])
def test_instances(moved: bool, tmp_path: Path) -> None:
    asset = stages.character(tmp_path / "asset.usda")
    path = stages.referencing(tmp_path / "shot.usda", asset, instanceable=True)
    if moved:
        stage = stages.edited(path)
        stages.place(stage, translate=(5, 6, 7), rotate=(0, 80, 0))
        stage.Save()
    clip = read_clip(path)
    assert clip.origin.skeleton_path == stages.SKELETON
    assert_same_world(clip)


@pytest.fixture
def crowd(tmp_path: Path) -> Path:
    path = stages.character(tmp_path / "crowd.usda")
    stage = stages.edited(path)
    stages.add_character(stage, "/Extra", rotations=stages.waves(stages.TIMES, COUNT, seed=7))
    stage.Save()
    return path


def test_several_skeletons(crowd: Path) -> None:
    for chosen in ("/Extra/Skel", "/Extra", "Extra"):
        clip = read_clip(crowd, chosen)
        assert clip.origin.skeleton_path == "/Extra/Skel"
        assert_same_world(clip)


@pytest.mark.parametrize("chosen", [None, "Nobody", "Skel", "/Her", "/Hero/Anim", "a b", "/a b"])
def test_the_error_lists_the_skeletons(crowd: Path, chosen: str | None) -> None:
    with pytest.raises(UsageError, match=r"--skel.*/Hero/Skel, /Extra/Skel"):
        read_clip(crowd, chosen)


def test_the_only_animated_skeleton_needs_no_choice(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda")
    stage = stages.edited(path)
    stages.add_character(stage, "/Statue", without=["binding"])
    stage.Save()
    assert read_clip(path).origin.skeleton_path == stages.SKELETON


def test_animation_bound_on_the_root(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda", without=["binding"])
    stage = stages.edited(path)
    stages.bind(stage.GetPrimAtPath(stages.ROOT), stages.ANIMATION)
    stage.Save()
    assert_same_world(read_clip(path))


def test_missing_translations_and_scales_do_not_lose_the_rotations(tmp_path: Path) -> None:
    # UsdSkel shows the rest pose then; what was meant is the rotations over rest translations.
    path = stages.character(tmp_path / "made.usda", without=["translations", "scales"])
    clip = read_clip(path)
    assert codes(clip) == {"missing-translations", "missing-scales"}
    whole = stages.character(
        tmp_path / "whole.usda", translations=stages.rest_matrices(stages.JOINTS)[None, :, 3, :3]
    )
    assert_same_world(clip, whole)


@pytest.mark.parametrize(
    "without", [["rest"], ["rest", "bind"], ["rest", "scales"], ["rest", "bind", "translations"]]
)
def test_missing_poses(without: list[str], tmp_path: Path) -> None:
    clip = read_clip(stages.character(tmp_path / "made.usda", without=without))
    assert codes(clip) == {f"missing-{name}" for name in without}
    whole = read_clip(stages.character(tmp_path / "whole.usda"))
    assert np.abs(clip.rotations - whole.rotations).max() < 1e-9
    if "translations" not in without:
        assert np.abs(clip.translations - whole.translations).max() < 1e-6


def test_sparse_keys_become_frames(tmp_path: Path) -> None:
    times = [1.0, 10.0, 33.0]
    path = stages.character(tmp_path / "made.usda", times=times, end=33.0)
    clip = read_clip(path)
    assert codes(clip) == {"resampled"}
    assert np.array_equal(clip.time_codes, np.arange(1.0, 34.0))
    assert_same_world(clip)


def test_attributes_with_samples_of_their_own(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda")
    stage = stages.edited(path)
    some = stages.TIMES[::3]
    values = stages.offsets(COUNT)[None] * np.linspace(1.0, 1.3, len(some))[:, None, None]
    stages.set_values(stage.GetPrimAtPath(stages.ANIMATION), "translations", some, values)
    stage.Save()
    clip = read_clip(path)
    assert np.array_equal(clip.time_codes, stages.TIMES)
    assert_same_world(clip)


def test_joint_names_that_are_no_paths(tmp_path: Path) -> None:
    joints = ["rig:Hips", "rig:Hips/left arm", "rig:Hips/left arm/hand-L", "rig:Hips/1.toe"]
    path = stages.character(tmp_path / "made.usda", joints=joints)
    clip = read_clip(path)
    assert clip.skeleton.parents.tolist() == [-1, 0, 1, 0]
    legal = ["Hips", "Hips/left_arm", "Hips/left_arm/hand_L", "Hips/_1_toe"]
    assert_same_world(clip, stages.character(tmp_path / "legal.usda", joints=legal))


def test_bind_pose_of_a_character_without_motion(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "made.usda", without=["binding"], meters=1.0)
    clip = read_character(path)
    assert len(clip) == 1
    binds = stages.bind_matrices(stages.JOINTS)[:, 3, :3] * 100.0
    assert np.abs(clip.skeleton.bind_positions - binds).max() < 1e-4


def test_a_bind_pose_in_skeleton_or_world_space(tmp_path: Path) -> None:
    def placed(name: str, matrix: Gf.Matrix4d) -> Clip:
        rest = stages.waves([0.0], COUNT, seed=3)
        path = stages.character(tmp_path / name, times=[1.0], rotations=rest)
        stage = stages.edited(path)
        stages.place(stage, rotate=(-90, 0, 0))
        attribute = UsdSkel.Skeleton.Get(stage, stages.SKELETON).GetBindTransformsAttr()
        attribute.Set([m * matrix for m in attribute.Get()])
        stage.Save()
        return read_clip(path)

    up = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d.XAxis(), -90))
    in_skeleton, in_world = placed("blender.usda", Gf.Matrix4d(1)), placed("maya.usda", up)
    assert np.abs(in_skeleton.skeleton.bind - in_world.skeleton.bind).max() < 1e-4


@pytest.mark.real_data
@pytest.mark.parametrize(
    "take",
    [
        "maya/HIK_Export.usda",
        "studiogalt/full/SG_ASL_2_2023_1_28.usdc",
        "studiogalt/full/SG_ASL_Abnormal_2_2023_2_6.usdc",
        "studiogalt/mini/SG_ASL_ABC_2023_2_3.usdc",
    ],
)
def test_real_takes(take: str) -> None:
    assert_same_world(read_clip(shared_data(*take.split("/"))))
