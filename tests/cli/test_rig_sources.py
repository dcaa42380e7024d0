"""Rigs whose clip has changed since, and files with rigs of several characters."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from conftest import REPOSITORY
from oracles.usdskel import joint_worlds
from pxr import Usd, UsdSkel, Vt

from usdhand import UsageError, expand, expand_onto, read_clip

OK = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"
BEN = REPOSITORY / "samples" / "characters" / "ben.usdc"


def lifted(path: Path, by: float = 10.0) -> None:
    """Move the root joint of a clip."""
    stage = Usd.Stage.Open(str(path))
    clip = read_clip(path)
    animation = UsdSkel.Animation(stage.GetPrimAtPath(clip.origin.animation_path))
    attribute = animation.GetTranslationsAttr()
    for time in attribute.GetTimeSamples() or [Usd.TimeCode.Default()]:
        values = np.array(attribute.Get(time))
        values[0, 1] += by
        attribute.Set(Vt.Vec3fArray.FromNumpy(values), time)
    stage.Save()


def copied(path: Path) -> None:
    """A clip in one file."""
    Usd.Stage.Open(str(OK)).Flatten().Export(str(path))


@pytest.fixture
def layered(tmp_path: Path) -> tuple[Path, Path]:
    """A clip, and a rig over it."""
    clip, rig = tmp_path / "clip.usdc", tmp_path / "rig.usda"
    copied(clip)
    run("reduce", clip, "-o", rig, "-q")
    return clip, rig


def hips(path: Path) -> float:
    return float(read_clip(path).translations[0, 0, 1])


def test_nothing_is_said_while_nothing_changes(layered: tuple[Path, Path], tmp_path: Path) -> None:
    said = run("expand", layered[1], "-o", tmp_path / "out.usda").output
    assert "changed" not in said
    assert not [p for p in expand(layered[1]).problems if p.code == "changed-source"]


def test_takes_without_poses_are_compared_too(tmp_path: Path) -> None:
    """UsdSkel shows no motion without bind and rest pose."""
    clip, rig = tmp_path / "clip.usdc", tmp_path / "rig.usda"
    copied(clip)
    stage = Usd.Stage.Open(str(clip))
    for name in ("bindTransforms", "restTransforms"):
        stage.GetPrimAtPath("/Ada/Skeleton").RemoveProperty(name)
    stage.Save()
    run("reduce", clip, "-o", rig, "-q")
    assert "changed" not in run("expand", rig, "-o", tmp_path / "out.usda").output
    lifted(clip)
    said = run("expand", rig, "-o", tmp_path / "old.usda").output
    assert re.search(r"'Hips' moves\s+differently", said)


def test_a_body_that_moved_is_told_and_refreshed(
    layered: tuple[Path, Path], tmp_path: Path
) -> None:
    clip, rig = layered
    before = hips(clip)
    lifted(clip)
    said = run("expand", rig, "-o", tmp_path / "old.usda").output
    assert "has changed" in said
    assert "--refresh" in said
    assert hips(tmp_path / "old.usda") == pytest.approx(before, abs=1e-3)
    said = run("expand", rig, "-o", tmp_path / "new.usda", "--refresh").output
    assert "changed" not in said
    old, new = read_clip(tmp_path / "old.usda"), read_clip(tmp_path / "new.usda")
    assert hips(tmp_path / "new.usda") == pytest.approx(before + 10.0, abs=1e-3)
    assert np.abs(old.rotations - new.rotations).max() < 1e-4
    assert np.allclose(
        joint_worlds(clip, skeleton_of(clip), new.time_codes)[:, 0],
        joint_worlds(tmp_path / "new.usda", skeleton_of(clip), new.time_codes)[:, 0],
    )
    assert expand(rig, refresh=True).translations[0, 0, 1] == pytest.approx(before + 10.0, abs=1e-3)


def skeleton_of(clip: Path) -> str:
    return read_clip(clip).origin.skeleton_path


def test_a_change_below_the_clip_is_seen(tmp_path: Path) -> None:
    """The clip itself is the same file; what it refers to has moved."""
    asset, clip, rig = tmp_path / "asset.usdc", tmp_path / "clip.usda", tmp_path / "rig.usda"
    copied(asset)
    stages.sublayering(clip, asset, rate=30.0, start=None, end=None)
    run("reduce", clip, "-o", rig, "-q")
    assert "changed" not in run("expand", rig, "-o", tmp_path / "a.usda").output
    lifted(asset)
    said = run("expand", rig, "-o", tmp_path / "b.usda").output
    assert "moves differently" in " ".join(said.split())


def test_a_change_that_is_no_motion(layered: tuple[Path, Path], tmp_path: Path) -> None:
    clip, rig = layered
    stage = Usd.Stage.Open(str(clip))
    stage.DefinePrim("/Lamp", "SphereLight")
    stage.Save()
    said = " ".join(run("expand", rig, "-o", tmp_path / "a.usda").output.split())
    assert "has changed; the motion of the body is the same" in said


def test_edited_rigs_and_shots_find_the_clip(layered: tuple[Path, Path], tmp_path: Path) -> None:
    clip, rig = layered
    stages.sublayering(tmp_path / "edit.usda", rig, rate=30.0, start=None, end=None)
    assert "changed" not in run("expand", tmp_path / "edit.usda", "-o", tmp_path / "a.usda").output
    lifted(clip)
    assert "has changed" in run("expand", tmp_path / "edit.usda", "-o", tmp_path / "b.usda").output


def test_a_flattened_rig_has_nothing_to_refresh_from(tmp_path: Path) -> None:
    run("reduce", OK, "-o", tmp_path / "rig.usdc", "--flatten", "-q")
    assert "changed" not in run("expand", tmp_path / "rig.usdc", "-o", tmp_path / "a.usda").output
    with pytest.raises(UsageError, match="--onto"):
        expand(tmp_path / "rig.usdc", refresh=True)
    run("expand", tmp_path / "rig.usdc", "-o", tmp_path / "b.usda", "--onto", OK, "-q")
    run(
        "expand",
        tmp_path / "rig.usdc",
        "-o",
        tmp_path / "c.usda",
        "--onto",
        OK,
        "--refresh",
        code=2,
    )


# --- several rigs --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One file with rigs of /Ada and /Ada2, of which the second has fewer free channels."""
    folder = tmp_path_factory.mktemp("two")
    stage = Usd.Stage.CreateNew(str(folder / "two.usda"))
    stage.SetTimeCodesPerSecond(30.0)
    for name in ("Ada", "Ada2"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(OK))
    stage.Save()
    run("reduce", folder / "two.usda", "--skel", "/Ada", "-o", folder / "one.usda", "-q")
    run("reduce", folder / "one.usda", "--skel", "/Ada2", "-o", folder / "both.usda", "-q",
        "--target-dofs", 4)  # fmt: skip
    return folder / "both.usda"


def free(two: Path, *arguments: object) -> int:
    output = run("expand", two, "-o", two.parent / "x.usda", "-n", "--json", *arguments).stdout
    return int(re.search(r'"free_channels": (\d+)', output)[1])


def test_a_path_does_not_match_a_longer_name(two: Path) -> None:
    assert free(two, "--skel", "/Ada") > 4
    assert free(two, "--skel", "/Ada2") == 4


def test_the_rig_is_chosen_apart_from_the_target(two: Path) -> None:
    said = run("expand", two, "--onto", BEN, "-o", two.parent / "y.usda", code=3).output
    assert "--rig-skel" in said
    skeletons = re.findall(r"\(of\s+(\S+)\)", said)
    assert len(skeletons) == 2
    counts = [free(two, "--onto", BEN, "--rig-skel", skeleton) for skeleton in skeletons]
    assert sorted(counts)[0] == 4
    assert sorted(counts)[1] > 4
    assert free(two, "--onto", BEN, "--skel", "/Ada2") == 4
    assert free(two, "--onto", two, "--rig-skel", "/Ada2", "--skel", "/Ada") == 4
    clip = expand_onto(two, two, "/Ada", rig_skel="/Ada2")
    assert clip.origin.skeleton_path.startswith("/Ada/")
    run("expand", two, "--rig-skel", "/Ada", "-o", two.parent / "z.usda", code=2)
