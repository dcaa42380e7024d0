"""Clips keep what they were read from: edited, copied, pickled, or made in memory."""

from __future__ import annotations

import copy
import gc
import importlib.util
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.every_format import reader, talk, written
from builders.written_over import (
    NEAR_CM,
    assert_shows,
    channels_scaled,
    in_memory,
    result_of,
    small_library,
)
from numpy.testing import assert_allclose
from pxr import Sdf, Usd, UsdSkel

import usdhand as api
from usdhand.errors import InputError
from usdhand.fill.library import MotionLibrary
from usdhand.formats.sources import character_under
from usdhand.formats.usd.check import check_file
from usdhand.formats.usd.convert import StageEdit, placed
from usdhand.formats.usd.shown import read_shown
from usdhand.formats.usd.stage import ClosedCharacter
from usdhand.motion import Clip, Origin, forward_kinematics
from usdhand.motion.editing import counted_in_frames, scaled, starting_at, trim
from usdhand.motion.resample import resample
from usdhand.rigs.graft import add_finger_joints

FBX_IS_READ = importlib.util.find_spec("ufbx") is not None


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    return small_library(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Clip]:
    return reader(tmp_path_factory.mktemp("inputs"))


@pytest.mark.parametrize("name", ["take.bvh", "take.glb", "left_handed.fbx"])
def test_a_file_that_is_not_usd_is_read_once(name: str, tmp_path: Path) -> None:
    if name.endswith(".fbx"):
        pytest.importorskip("ufbx", reason="FBX needs the extra 'convert'")
    path = written(talk(), tmp_path, name)
    made = channels_scaled(api.read_clip(path), 0.5)
    path.unlink()
    api.write_clip(made, tmp_path / "out.usdc")
    assert_shows(tmp_path / "out.usdc", made)
    stage = Usd.Stage.Open(str(tmp_path / "out.usdc"))
    animations = [p.GetName() for p in stage.Traverse() if p.IsA(UsdSkel.Animation)]
    assert animations == ["Motion", "HandMotion"]  # the original motion is kept beside


def test_clips_that_were_edited_are_written_over_what_they_were_read_from(
    read: Callable[[str], Clip], tmp_path: Path
) -> None:
    for name in ("take.usdc", "take.bvh", "z_up.fbx" if FBX_IS_READ else "take.glb"):
        clip = read(name)
        start = clip.origin.first_time_code
        for i, edited in enumerate((
            trim(clip, start + 10, start + 40), resample(clip, 24.0), starting_at(clip, 7.0),
            clip.with_rotations(clip.rotations),
        )):  # fmt: skip
            assert edited.source is clip.source
            made, output = channels_scaled(edited, 0.5), tmp_path / f"{i}_{name}.usda"
            api.write_clip(made, output)
            assert_shows(output, made)
            if name == "take.usdc":
                assert Sdf.Layer.FindOrOpen(str(output)).subLayerPaths


def test_another_size_is_another_character(read: Callable[[str], Clip], tmp_path: Path) -> None:
    for name in ("take.usdc", "take.bvh"):
        small = scaled(read(name), 0.5)
        assert small.source is None
        api.write_clip(small, tmp_path / f"{name}.usda")
        assert_shows(tmp_path / f"{name}.usda", small)


def test_time_codes_count_as_on_the_stage(read: Callable[[str], Clip], tmp_path: Path) -> None:
    made = channels_scaled(read("take.usdc"), 0.5)
    origin = replace(
        made.origin, time_codes_per_second=60.0, first_time_code=200.0, time_codes_per_frame=2.0
    )
    for i, clip in enumerate((made, replace(made, origin=origin))):
        assert clip.times == pytest.approx(made.times)
        api.write_clip(clip, tmp_path / f"{i}.usdc")
        assert_shows(tmp_path / f"{i}.usdc", made)


def test_clips_with_other_joints_are_refused(read: Callable[[str], Clip], tmp_path: Path) -> None:
    for name in ("take.usdc", "take.glb"):
        clip = read(name)
        other = replace(clip.skeleton, joints=("Root", *clip.skeleton.joints[1:]))
        with pytest.raises(InputError, match=r"does not have the joints of .*Skeleton"):
            api.write_clip(replace(clip, skeleton=other), tmp_path / "out.usdc")
        assert not (tmp_path / "out.usdc").exists()


def test_joints_that_were_added_are_written_by_every_verb(
    library: MotionLibrary, tmp_path: Path
) -> None:
    """Finger joints are put on bodies of which some were read from a file that has none."""
    donor = talk()
    below = {
        j for j, name in enumerate(donor.skeleton.names)
        if any(d in name for d in ("Thumb", "Index", "Middle", "Ring", "Pinky"))
    }  # fmt: skip
    keep = [j for j in range(len(donor.skeleton)) if j not in below]
    parents = np.array([keep.index(p) if p >= 0 else -1 for p in donor.skeleton.parents[keep]])
    skeleton = replace(
        donor.skeleton,
        joints=tuple(donor.skeleton.joints[j] for j in keep),
        parents=parents,
        bind=donor.skeleton.bind[keep],
        rest=donor.skeleton.rest[keep],
    )
    bare = replace(
        in_memory(donor),
        skeleton=skeleton,
        rotations=donor.rotations[:, keep],
        translations=donor.translations[:, keep],
        scales=donor.scales[:, keep],
    )
    for name in ("bare.usdc", "bare.glb"):
        path = written(counted_in_frames(replace(bare, origin=Origin())), tmp_path, name)
        body = api.read_clip(path)
        assert len(body.skeleton) == len(keep)
        clip = add_finger_joints(body, donor.skeleton, api.find_hands(donor)).clip
        assert clip.source is body.source
        for verb in ("write_clip", "reduce", "splice", "fill"):
            result = result_of(verb, clip, library, tmp_path)
            result.write(tmp_path / "out.usdc", force=True)
            found = assert_shows(tmp_path / "out.usdc", result.clip)
            assert found.skeleton.joints == clip.skeleton.joints
            assert_allclose(found.skeleton.bind, clip.skeleton.bind, atol=1e-4)


def test_joint_names_that_usd_does_not_take(library: MotionLibrary, tmp_path: Path) -> None:
    clip = in_memory(talk())
    names = tuple(j.replace("Hand", "-Hand") for j in clip.skeleton.joints)
    odd = replace(clip, skeleton=replace(clip.skeleton, joints=names))
    for verb in ("write_clip", "reduce", "splice", "fill"):
        result, output = result_of(verb, odd, library, tmp_path), tmp_path / f"{verb}.usdc"
        result.write(output)
        meant = replace(result.clip, origin=replace(Origin(), time_codes_per_second=30.0))
        found = assert_shows(output, meant)
        assert found.skeleton.originals == odd.skeleton.names
        assert not [f for f in check_file(output) if f.severity == "error"]


def test_joints_before_their_parents(tmp_path: Path) -> None:
    clip = in_memory(talk())
    back = list(range(len(clip.skeleton)))[::-1]
    skeleton = clip.skeleton
    turned = replace(
        clip,
        skeleton=replace(
            skeleton,
            joints=tuple(skeleton.joints[j] for j in back),
            parents=np.array([back.index(p) if p >= 0 else -1 for p in skeleton.parents[back]]),
            bind=skeleton.bind[back],
            rest=skeleton.rest[back],
        ),
        rotations=clip.rotations[:, back],
        translations=clip.translations[:, back],
        scales=clip.scales[:, back],
    )
    api.write_clip(turned, tmp_path / "out.usdc")  # puts them in order
    found = api.read_clip(tmp_path / "out.usdc")
    index = [found.skeleton.joints.index(joint) for joint in turned.skeleton.joints]
    ours, theirs = (forward_kinematics(c).positions for c in (turned, found))
    assert np.abs(ours - theirs[:, index]).max() < NEAR_CM
    [reduction] = api.reduce_hands([turned])
    with pytest.raises(InputError, match=r"the joint .* stands before its parent"):
        api.write_rig(reduction, tmp_path / "rig.usdc")


@pytest.mark.parametrize("name", ["take.usdc", "take.bvh"])
def test_clips_go_to_other_processes(
    name: str, read: Callable[[str], Clip], tmp_path: Path
) -> None:
    clip = read(name)
    far = pickle.loads(pickle.dumps(channels_scaled(clip, 0.5)))
    assert isinstance(far.source, ClosedCharacter) == (name == "take.usdc")
    again = pickle.loads(pickle.dumps(far))
    for i, each in enumerate((far, again)):
        api.write_clip(each, tmp_path / f"{i}.usdc")
        assert_shows(tmp_path / f"{i}.usdc", channels_scaled(clip, 0.5))


def test_copies_share_the_stage(read: Callable[[str], Clip], tmp_path: Path) -> None:
    clip = read("take.usdc")
    deep = copy.deepcopy(clip)
    assert deep.source is clip.source
    assert deep.rotations is not clip.rotations
    api.write_clip(channels_scaled(deep, 0.5), tmp_path / "out.usdc")


def test_a_stage_in_memory_is_not_pickled(read: Callable[[str], Clip]) -> None:
    with pytest.raises(pickle.PicklingError, match="in memory"):
        pickle.dumps(placed(character_under(read("take.usdc")), StageEdit()))


def test_a_file_that_was_replaced_is_told(tmp_path: Path) -> None:
    path = tmp_path / "take.usdc"
    api.write_clip(in_memory(talk()), path)
    clip = api.read_clip(path)
    api.write_clip(replace(in_memory(talk()), name="Other"), path, force=True)
    with pytest.raises(InputError, match=r"take\.usdc: the file was written anew.*Read it again"):
        api.write_clip(clip, tmp_path / "out.usdc")


def test_libraries_hold_no_stage(tmp_path: Path) -> None:
    paths = []
    for i in range(3):
        paths.append(tmp_path / f"{i}.usda")
        api.write_clip(in_memory(talk()), paths[-1])
    gc.collect()
    assert not any(Sdf.Layer.Find(str(path)) for path in paths)
    library = api.build_library(paths, tmp_path / "library.usdc").library
    gc.collect()
    assert len(library.clips) == 3
    assert not any(Sdf.Layer.Find(str(path)) for path in paths)
    assert len(pickle.loads(pickle.dumps(library)).clips) == 3


def test_a_clip_that_is_only_looked_at_lets_go_of_its_stage(tmp_path: Path) -> None:
    path = tmp_path / "take.usda"
    api.write_clip(in_memory(talk()), path)
    clip = api.read_clip(path)
    assert Sdf.Layer.Find(str(path))
    clip = replace(clip, source=None)
    gc.collect()
    assert not Sdf.Layer.Find(str(path))
    [shown] = read_shown(path)
    gc.collect()
    assert shown.clip.source is None
    assert not Sdf.Layer.Find(str(path))
    assert "source=" not in repr(clip)
