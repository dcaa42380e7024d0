"""Others that play a character's animation, and bindings that are not in force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from oracles.usdskel import joint_worlds
from pxr import Usd, UsdGeom, UsdSkel

from usdhand import read_clip
from usdhand.errors import InputError
from usdhand.formats.usd.read import clip_from_character
from usdhand.formats.usd.stage import bound_animation, find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import rotations as rot
from usdhand.problems import Problem

HAND = range(6, len(stages.JOINTS))
GLOVES = "/Hero/Gloves"
AT = np.array(stages.TIMES)
Change = Callable[[Usd.Stage], object]


def changed(tmp_path: Path, change: Change, without: Sequence[str] = ()) -> Path:
    path = stages.character(tmp_path / "in.usda", without=without)
    stage = stages.edited(path)
    change(stage)
    stage.Save()
    return path


def turned(path: Path, out: Path) -> dict[str, Problem]:
    """Turn all fingers; what is told, by its severity."""
    character = find_character(path, stages.SKELETON)
    clip = clip_from_character(character)
    rotations = clip.rotations.copy()
    rotations[:, HAND] = rot.multiply(rotations[:, HAND], np.array([0.0, 0.6, 0.0, 0.8]))
    told = write_motion(character, clip.with_rotations(rotations), list(HAND), out)
    return {p.severity: p for p in told if p.code == "shared-animation"}


def skeleton(
    stage: Usd.Stage, path: str, joints: Sequence[str] = stages.JOINTS, target: str | None = None
) -> Usd.Prim:
    """A second skeleton, as at `stages.SKELETON`."""
    places = [stages.JOINTS.index(j) if j in stages.JOINTS else 0 for j in joints]
    prim = UsdSkel.Skeleton.Define(stage, path)
    prim.CreateJointsAttr(list(joints))
    prim.CreateRestTransformsAttr(stages.matrices(stages.rest_matrices(stages.JOINTS)[places]))
    prim.CreateBindTransformsAttr(stages.matrices(stages.bind_matrices(stages.JOINTS)[places]))
    UsdSkel.BindingAPI.Apply(prim.GetPrim())
    if target:
        stages.bind(prim.GetPrim(), target)
    return prim.GetPrim()


def on_root(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(stages.SKELETON).RemoveProperty("skel:animationSource")
    stages.bind(stage.GetPrimAtPath(stages.ROOT), stages.ANIMATION)


def assert_together(out: Path, other: str = GLOVES) -> None:
    a, b = (joint_worlds(out, path, AT) for path in (stages.SKELETON, other))
    assert np.abs(a - b).max() < 1e-4


@pytest.mark.parametrize("inherited", [False, True])
@pytest.mark.parametrize("joints", [stages.JOINTS, stages.JOINTS[:9]])
def test_gloves_go_with_the_hand(tmp_path: Path, inherited: bool, joints: Sequence[str]) -> None:
    def change(stage: Usd.Stage) -> None:
        if inherited:
            on_root(stage)
        skeleton(stage, GLOVES, joints, None if inherited else stages.ANIMATION)

    path = changed(tmp_path, change)
    told = turned(path, tmp_path / "out.usda")
    assert GLOVES in told["note"].message
    assert "warning" not in told
    a, b = (joint_worlds(tmp_path / "out.usda", p, AT) for p in (stages.SKELETON, GLOVES))
    assert np.abs(a[:, : len(joints)] - b).max() < 1e-4
    before = joint_worlds(path, GLOVES, AT)
    assert np.abs(before - b).max() > 0.1


@pytest.mark.parametrize("inherited", [False, True])
def test_what_has_other_joints_is_named_and_stays(tmp_path: Path, inherited: bool) -> None:
    joints = (*stages.JOINTS, "Hips/Tail")

    def change(stage: Usd.Stage) -> None:
        if inherited:
            on_root(stage)
        target = None if inherited else stages.ANIMATION
        skeleton(stage, GLOVES, joints, target)
        skeleton(stage, "/Hero/Twin", target=target)

    path = changed(tmp_path, change)
    told = turned(path, tmp_path / "out.usda")
    assert GLOVES in told["warning"].message
    assert "/Hero/Twin" in told["note"].message
    before, after = (joint_worlds(p, GLOVES, AT) for p in (path, tmp_path / "out.usda"))
    assert np.array_equal(before, after)
    assert_together(tmp_path / "out.usda", "/Hero/Twin")


def test_a_skeleton_of_another_character_under_its_own_root(tmp_path: Path) -> None:
    def change(stage: Usd.Stage) -> None:
        UsdSkel.Root.Define(stage, "/Other")
        stages.bind(stage.GetPrimAtPath("/Other"), stages.ANIMATION)
        skeleton(stage, "/Other/Skel")
        skeleton(stage, "/Other/Tail", ("Hips", "Hips/Tail"))

    told = turned(changed(tmp_path, change), tmp_path / "out.usda")
    assert "/Other/Skel" in told["note"].message
    assert "/Other/Tail" in told["warning"].message
    assert_together(tmp_path / "out.usda", "/Other/Skel")
    stage = stages.edited(tmp_path / "out.usda")
    assert bound_animation(stage.GetPrimAtPath("/Other/Tail")).GetPath() == stages.ANIMATION


def test_meshes_with_bindings_of_their_own(tmp_path: Path) -> None:
    def change(stage: Usd.Stage) -> None:
        skeleton(stage, GLOVES, ("Hips", "Hips/Tail"), stages.ANIMATION)
        for name, target in (("Skin", stages.SKELETON), ("Nails", GLOVES), ("Hat", None)):
            mesh = UsdGeom.Mesh.Define(stage, f"/Hero/{name}").GetPrim()
            stages.bind(mesh, stages.ANIMATION)
            if target:
                UsdSkel.BindingAPI(mesh).CreateSkeletonRel().SetTargets([target])

    told = turned(changed(tmp_path, change), tmp_path / "out.usda")
    stage = stages.edited(tmp_path / "out.usda")
    for name, follows in (("Skin", True), ("Nails", False), ("Hat", True)):
        found = UsdSkel.BindingAPI(stage.GetPrimAtPath(f"/Hero/{name}")).GetAnimationSource()
        assert (found.GetPath() != stages.ANIMATION) == follows
        assert (f"/Hero/{name}" in told["note" if follows else "warning"].message) is True


# --- bindings that are not in force --------------------------------------------------------------


def stale(stage: Usd.Stage) -> None:
    """The root plays the motion; below it, another take is bound without the schema."""
    on_root(stage)
    other = UsdSkel.Animation.Define(stage, "/Hero/Stale")
    other.CreateJointsAttr(list(stages.JOINTS))
    values = {"rotations": stages.waves(stages.TIMES, len(stages.JOINTS), 9),
              "translations": stages.offsets(len(stages.JOINTS), 8)[None],
              "scales": np.ones((1, len(stages.JOINTS), 3))}  # fmt: skip
    for name, rows in values.items():
        stages.set_values(other.GetPrim(), name, stages.TIMES, rows)
    prim = stage.GetPrimAtPath(stages.SKELETON)
    prim.RemoveAPI(UsdSkel.BindingAPI)
    stages.bind(prim, "/Hero/Stale", api=False)


def test_a_stale_binding_does_not_wake(tmp_path: Path) -> None:
    path = changed(tmp_path, stale)
    codes = {p.code: p for p in read_clip(path).problems}
    assert "/Hero/Stale" in codes["unapplied-binding"].message
    before = joint_worlds(path, stages.SKELETON, AT)
    for arguments in ((), ("--start", 1), ("--trim", "1:12"), ("--fps", 24)):
        out = tmp_path / "out.usda"
        run("convert", path, "-o", out, "--force", *arguments)
        assert np.abs(joint_worlds(out, stages.SKELETON, AT) - before).max() < 1e-3
    turned(path, tmp_path / "b.usda")
    assert (
        np.abs(joint_worlds(tmp_path / "b.usda", stages.SKELETON, AT) - before)[:, :6].max() < 1e-3
    )


def test_a_stale_binding_without_any_other_does_not_wake(tmp_path: Path) -> None:
    def change(stage: Usd.Stage) -> None:
        stale(stage)
        stage.GetPrimAtPath(stages.ROOT).RemoveProperty("skel:animationSource")

    path = changed(tmp_path, change)
    run("convert", path, "-o", tmp_path / "out.usda")
    stage = stages.edited(tmp_path / "out.usda")
    assert bound_animation(stage.GetPrimAtPath(stages.SKELETON)) is None


@pytest.mark.parametrize("place", [stages.SKELETON, stages.ROOT])
def test_a_missing_schema_is_said(tmp_path: Path, place: str) -> None:
    def change(stage: Usd.Stage) -> None:
        stages.bind(stage.GetPrimAtPath(place), stages.ANIMATION, api=False)

    path = changed(tmp_path, change, without=("api", "binding"))
    with pytest.raises(InputError, match=f"Apply SkelBindingAPI to {place}"):
        read_clip(path)
    assert "SkelBindingAPI" in run("check", path, code=1).output

    # What the message says helps.
    stage = stages.edited(path)
    UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath(place))
    stage.Save()
    assert len(read_clip(path)) == 12


@pytest.mark.parametrize(
    ("target", "words"),
    [("/Hero/None", "names, does not exist"), ("/Hero", "names, is not a SkelAnimation")],
)
def test_a_binding_that_leads_nowhere_is_said(tmp_path: Path, target: str, words: str) -> None:
    path = changed(
        tmp_path, lambda stage: stages.bind(stage.GetPrimAtPath(stages.SKELETON), target)
    )
    with pytest.raises(InputError, match=words):
        read_clip(path)
