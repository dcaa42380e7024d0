"""Writing motion: the input stays, the body stays to the bit, and what was written is read back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.rewriting import (
    BODY,
    COUNT,
    HAND,
    INPUTS,
    bound_on_root,
    instance,
    package,
    plain,
    raw,
    reordered,
    rewrite,
    same,
    sparse,
    turned,
    wobbling,
)
from conftest import REPOSITORY, shared_data
from oracles.usdskel import assert_same_world
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from usdhand.errors import OutputError
from usdhand.formats.usd.check import check_file
from usdhand.formats.usd.read import clip_from_character, read_character, read_clip
from usdhand.formats.usd.stage import bound_animation, find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import rotations as rot


@pytest.mark.parametrize("flatten", [False, True])
@pytest.mark.parametrize("make", INPUTS)
def test_what_is_written_is_read_back(
    make: Callable[[Path], Path], flatten: bool, tmp_path: Path
) -> None:
    path = make(tmp_path)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    output = tmp_path / "out.usdc"
    meant, found = rewrite(path, output, flatten=flatten)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file() and p != output} == before
    assert np.allclose(found.time_codes, meant.time_codes)
    assert rot.angle_between(found.rotations, meant.rotations).max() < 1e-4
    assert np.abs(found.translations - meant.translations).max() < 1e-4
    assert np.abs(found.scales - meant.scales).max() < 1e-3
    assert_same_world(found)  # USD shows the new motion there
    assert not {f.code for f in check_file(output)} - {f.code for f in check_file(path)}
    if flatten:
        assert not Sdf.Layer.FindOrOpen(str(output)).GetExternalReferences()


@pytest.mark.parametrize("make", [plain, wobbling, instance, bound_on_root, package])
def test_the_body_stays_to_the_bit(make: Callable[[Path], Path], tmp_path: Path) -> None:
    path = make(tmp_path)
    rewrite(path, tmp_path / "out.usdc")
    for name in ("rotations", "translations", "scales"):
        old, new = raw(path, name), raw(tmp_path / "out.usdc", name)
        assert same(old[:, BODY], new[:, BODY]), name
    assert not same(
        raw(path, "rotations")[:, HAND], raw(tmp_path / "out.usdc", "rotations")[:, HAND]
    )


def test_a_reordered_body_stays_to_the_bit(tmp_path: Path) -> None:
    path = reordered(tmp_path)
    rewrite(path, tmp_path / "out.usdc")
    old, new = raw(path, "rotations"), raw(tmp_path / "out.usdc", "rotations")
    assert same(old[:, ::-1][:, :3], new[:, 2:5])


def test_sparse_keys_become_dense_as_usd_interpolates(tmp_path: Path) -> None:
    path = sparse(tmp_path)
    rewrite(path, tmp_path / "out.usdc")
    character = find_character(tmp_path / "out.usdc")
    assert character.animation.GetAttribute("rotations").GetTimeSamples() == list(stages.TIMES)
    new = raw(tmp_path / "out.usdc", "rotations")
    assert same(raw(path, "rotations")[:, BODY], new[:, BODY])


def test_a_long_take(tmp_path: Path) -> None:
    # More frames than are worked on at a time; signs flip anywhere.
    times = tuple(range(1, 301))
    signs = np.random.default_rng(8).choice([-1, 1], (len(times), COUNT, 1))
    rotations = stages.waves(times, COUNT) * signs
    path = stages.character(tmp_path / "in.usdc", times=times, rotations=rotations)
    clip = read_clip(path)
    assert (np.sum(clip.rotations[1:] * clip.rotations[:-1], axis=-1) > 0).all()
    assert rot.angle_between(clip.rotations, rotations.astype(float)).max() < 1e-4
    meant, found = rewrite(path, tmp_path / "out.usdc")
    assert rot.angle_between(found.rotations, meant.rotations).max() < 1e-4
    old, new = (raw(p, "rotations", times) for p in (path, tmp_path / "out.usdc"))
    assert same(old[:, BODY], new[:, BODY])


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd", ".usdz"])
def test_all_suffixes(suffix: str, tmp_path: Path) -> None:
    meant, found = rewrite(plain(tmp_path), tmp_path / f"out{suffix}")
    assert np.abs(found.rotations - meant.rotations).max() < 1e-6
    assert check_file(tmp_path / f"out{suffix}") == ()
    motion = ["out.motion.usdc"] if suffix == ".usda" else []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.usdc", *motion, f"out{suffix}"]


def test_into_another_folder_that_moves_along(tmp_path: Path) -> None:
    (tmp_path / "a" / "deep").mkdir(parents=True)
    rewrite(plain(tmp_path / "a"), tmp_path / "a" / "deep" / "out.usda")
    (tmp_path / "a").rename(tmp_path / "b")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "b" / "deep" / "out.usda"))
    assert list(layer.subLayerPaths) == ["./out.motion.usdc", "../in.usdc"]
    assert len(read_clip(tmp_path / "b" / "deep" / "out.usda")) == len(stages.TIMES)


def test_the_stage_says_the_same_about_itself(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "in.usda", rate=50.0, up="Z", meters=0.0254, start=-5.0)
    stage = stages.edited(path)
    stage.SetMetadata("customLayerData", {"shot": "a12"})
    stage.Save()
    rewrite(path, tmp_path / "out.usdc")
    old, new = (Sdf.Layer.FindOrOpen(str(p)) for p in (path, tmp_path / "out.usdc"))
    fields = old.pseudoRoot.ListInfoKeys()
    assert {"customLayerData", "timeCodesPerSecond", "upAxis", "metersPerUnit"} <= set(fields)
    for field in fields:
        assert new.pseudoRoot.GetInfo(field) == old.pseudoRoot.GetInfo(field), field


def test_a_rate_in_frames_only_is_not_rescaled(tmp_path: Path) -> None:
    path = plain(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    layer.ClearTimeCodesPerSecond()
    layer.framesPerSecond = 60.0
    layer.Save()
    _, found = rewrite(path, tmp_path / "out.usda")
    assert found.fps == read_clip(path).fps == 60.0
    assert np.array_equal(found.time_codes, stages.TIMES)


def test_no_rate_is_said_aloud(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "in.usda", rate=None)
    rewrite(path, tmp_path / "out.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "out.usda"))
    assert layer.HasTimeCodesPerSecond()
    assert layer.timeCodesPerSecond == 24.0


def test_everything_else_stays(tmp_path: Path) -> None:
    path = plain(tmp_path)
    stage = stages.edited(path)
    stages.add_character(stage, "/Other")
    cube = UsdGeom.Cube.Define(stage, "/Hero/Box")
    variants = cube.GetPrim().GetVariantSets().AddVariantSet("look")
    for name in ("red", "blue"):
        variants.AddVariant(name)
    variants.SetVariantSelection("blue")
    animation = UsdSkel.Animation.Get(stage, stages.ANIMATION)
    animation.CreateBlendShapesAttr(["smile", "blink"])
    weights = animation.CreateBlendShapeWeightsAttr()
    for time in (1.0, 6.5):
        weights.Set(Vt.FloatArray([0.1 * time, 0.5]), time)
    stage.Save()

    character = find_character(path, "Hero")
    clip = clip_from_character(character)
    write_motion(character, turned(clip), HAND, tmp_path / "out.usda")
    result = Usd.Stage.Open(str(tmp_path / "out.usda"))
    sets = result.GetPrimAtPath("/Hero/Box").GetVariantSets()
    assert sets.GetVariantSet("look").GetVariantNames() == ["blue", "red"]
    assert sets.GetVariantSelection("look") == "blue"
    bound = UsdSkel.Animation(bound_animation(result.GetPrimAtPath(stages.SKELETON)))
    assert list(bound.GetBlendShapesAttr().Get()) == ["smile", "blink"]
    assert bound.GetBlendShapeWeightsAttr().GetTimeSamples() == [1.0, 6.5]
    assert bound.GetBlendShapeWeightsAttr().Get(6.5)[0] == pytest.approx(0.65)
    assert bound_animation(result.GetPrimAtPath("/Other/Skel")).GetPath() == "/Other/Anim"


def test_two_skeletons_under_one_binding_are_told_apart(tmp_path: Path) -> None:
    path = bound_on_root(tmp_path)
    stage = stages.edited(path)
    twin = UsdSkel.Skeleton.Define(stage, "/Hero/Twin")
    for name in ("joints", "bindTransforms", "restTransforms"):
        value = stage.GetPrimAtPath(stages.SKELETON).GetAttribute(name).Get()
        twin.GetPrim().GetAttribute(name).Set(value)
    twin.GetJointsAttr().Set(["Elsewhere", *stages.JOINTS[1:]])
    stage.Save()
    character = find_character(path, "/Hero/Skel")
    write_motion(character, turned(clip_from_character(character)), HAND, tmp_path / "out.usda")
    result = Usd.Stage.Open(str(tmp_path / "out.usda"))
    assert bound_animation(result.GetPrimAtPath("/Hero/Twin")).GetPath() == stages.ANIMATION
    assert bound_animation(result.GetPrimAtPath(stages.SKELETON)).GetPath() != stages.ANIMATION


def test_a_result_is_an_input_again(tmp_path: Path) -> None:
    first, _ = rewrite(plain(tmp_path), tmp_path / "first.usdc")
    meant, found = rewrite(tmp_path / "first.usdc", tmp_path / "second.usdc")
    assert np.abs(meant.rotations - turned(first).rotations).max() < 1e-6
    assert np.abs(found.rotations - meant.rotations).max() < 1e-6
    assert check_file(tmp_path / "second.usdc") == ()
    with pytest.raises(OutputError, match="is an input"):
        rewrite(tmp_path / "second.usdc", tmp_path / "in.usdc", force=True)


def test_motion_for_a_character_that_has_none(tmp_path: Path) -> None:
    path = stages.character(tmp_path / "in.usda", without=["binding", "api"], up="Z", meters=1.0)
    still = read_character(path)
    frames = 5
    clip = replace(
        still,
        rotations=np.repeat(still.rotations, frames, axis=0),
        translations=np.repeat(still.translations, frames, axis=0),
        scales=np.repeat(still.scales, frames, axis=0),
    )
    write_motion(find_character(path), clip, range(COUNT), tmp_path / "out.usda")
    found = read_clip(tmp_path / "out.usda")
    assert len(found) == frames
    assert rot.angle_between(found.rotations, clip.rotations).max() < 1e-4
    assert check_file(tmp_path / "out.usda") == ()


def test_frames_that_the_input_does_not_have(tmp_path: Path) -> None:
    character = find_character(wobbling(tmp_path))
    clip = clip_from_character(character)
    late = replace(clip, origin=replace(clip.origin, first_time_code=101.0))
    write_motion(character, late, HAND, tmp_path / "out.usdc")
    found = read_clip(tmp_path / "out.usdc")
    assert np.array_equal(found.time_codes, late.time_codes)
    assert rot.angle_between(found.rotations, late.rotations).max() < 1e-4
    assert np.abs(found.translations - late.translations).max() < 1e-4
    stage = Usd.Stage.Open(str(tmp_path / "out.usdc"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1.0, 112.0)


def test_an_author_adds_to_the_layer(tmp_path: Path) -> None:
    def author(layer: Sdf.Layer, root: Sdf.Path) -> None:
        Sdf.CreatePrimInLayer(layer, root.AppendChild("Note")).typeName = "Scope"

    rewrite(plain(tmp_path), tmp_path / "out.usda", author=author)
    assert Usd.Stage.Open(str(tmp_path / "out.usda")).GetPrimAtPath("/Hero/Note")


def test_an_input_that_lacks_a_prop_can_be_written(tmp_path: Path) -> None:
    path = plain(tmp_path)
    stage = stages.edited(path)
    stage.DefinePrim("/Prop").GetReferences().AddReference("./lost.usda")
    stage.Save()
    meant, found = rewrite(path, tmp_path / "out.usda")
    assert np.abs(found.rotations - meant.rotations).max() < 1e-6


# -- real files ---------------------------------------------------------------------------------


def hands_rewritten(path: Path, output: Path, codes: set[str]) -> None:
    character = find_character(path)
    clip = clip_from_character(character)
    hands = [j for j, name in enumerate(clip.skeleton.names) if "Index" in name or "Thumb" in name]
    assert hands
    write_motion(character, turned(clip, tuple(hands)), hands, output)
    assert {f.code for f in check_file(output)} == codes
    times = tuple(clip.time_codes)
    old_joints = list(UsdSkel.Animation(character.animation).GetJointsAttr().Get())
    kept = [j for j in range(len(clip.skeleton)) if j not in hands]
    kept = [j for j in kept if clip.skeleton.joints[j] in old_joints]
    before = [old_joints.index(clip.skeleton.joints[j]) for j in kept]
    for name in ("rotations", "translations", "scales"):
        assert same(raw(path, name, times)[:, before], raw(output, name, times)[:, kept]), name
    assert_same_world(read_clip(output))


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("take", "codes"),
    [
        ("maya/HIK_Export.usda", {"sign-flip", "identity-bind"}),
        ("studiogalt/full/SG_ASL_Abnormal_2_2023_2_6.usdc", {"sign-flip"}),
    ],
)
def test_real_takes(take: str, codes: set[str], tmp_path: Path) -> None:
    hands_rewritten(shared_data(*take.split("/")), tmp_path / "out.usdc", codes)


def test_samples(tmp_path: Path) -> None:
    take = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
    hands_rewritten(take, tmp_path / "out.usdc", set())


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_a_flattened_file_still_finds_its_textures(suffix: str, tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "tex" / "skin.png").write_bytes(b"a picture")
    path = plain(tmp_path)
    stage = stages.edited(path)
    prim = stage.DefinePrim("/Hero/Skin", "Shader")
    prim.CreateAttribute("inputs:file", Sdf.ValueTypeNames.Asset).Set("./tex/skin.png")
    stage.Save()
    output = tmp_path / "out" / f"out{suffix}"
    rewrite(path, output, flatten=True)
    result = Usd.Stage.Open(str(output))
    found = result.GetPrimAtPath("/Hero/Skin").GetAttribute("inputs:file").Get()
    assert found.resolvedPath
    if suffix == ".usda":
        assert found.path == "../tex/skin.png"  # files that move together stay together
