"""Files of bodies that gain finger joints: all that they had stays, and hands come to it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from builders.bare_bodies import bare, below_wrists, degrees_apart, grafted, palm
from builders.cli_runner import run
from builders.mirroring import mirror_below
from conftest import REPOSITORY, shared_data
from numpy.testing import assert_allclose
from oracles.usdskel import joint_worlds
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

import usdhand
from usdhand.anatomy import SIDES
from usdhand.motion import forward_kinematics

SAMPLES = REPOSITORY / "samples"
BEN = SAMPLES / "gestures_ben" / "ok_01.usdc"
BODY = SAMPLES / "conversations" / "talk_03_body.usdc"
OPEN: list[Usd.Stage] = []  # prims live as long as their stage


def bare_file(source: Path, target: Path) -> Path:
    """A file without finger joints in skeleton and animation, with a mesh bound to its arms."""
    clip = usdhand.read_clip(source)
    layer = Usd.Stage.Open(str(source)).Flatten()
    stage = Usd.Stage.Open(layer)
    OPEN.append(stage)
    gone = below_wrists(clip)
    keep = [j for j in range(len(clip.skeleton)) if j not in gone]
    prim = stage.GetPrimAtPath(clip.origin.skeleton_path)
    for name in ("bindTransforms", "restTransforms"):
        values = prim.GetAttribute(name).Get()
        prim.GetAttribute(name).Set(Vt.Matrix4dArray([values[j] for j in keep]))
    names = [clip.skeleton.joints[j] for j in keep]
    prim.GetAttribute("joints").Set(Vt.TokenArray(names))
    for mesh in [p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]:
        stage.RemovePrim(mesh.GetPath())
    sleeve = UsdGeom.Mesh.Define(stage, prim.GetParent().GetPath().AppendChild("Sleeve"))
    arms = [i for i, n in enumerate(names) if "arm" in n.rsplit("/", 1)[-1].lower()]
    world = np.array(prim.GetAttribute("bindTransforms").Get())[arms, 3, :3]
    sleeve.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*map(float, p)) for p in world]))
    binding = UsdSkel.BindingAPI.Apply(sleeve.GetPrim())
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray(arms))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1.0] * len(arms)))
    binding.CreateSkeletonRel().SetTargets([prim.GetPath()])
    layer.Export(str(target))
    return target


def skinned(path: Path) -> np.ndarray:
    """Points of the sleeve as UsdSkel moves them."""
    stage = Usd.Stage.Open(Usd.Stage.Open(str(path)).Flatten())
    [root] = [p for p in stage.Traverse() if p.IsA(UsdSkel.Root)]
    UsdSkel.BakeSkinning(UsdSkel.Root(root), Gf.Interval(0, 60))
    points = UsdGeom.Mesh(root.GetChild("Sleeve")).GetPointsAttr()
    return np.array([np.array(points.Get(t)) for t in range(0, 60, 6)])


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("graft") / "l.usdc"
    clips = [SAMPLES / "gestures" / f"{name}_01.usdc" for name in ("ok", "wipe", "turn")]
    run("library", "build", *clips, BEN, "-o", path, "-q")
    return path


@pytest.mark.parametrize("flatten", [False, True])
def test_a_body_file_gains_fingers(library: Path, tmp_path: Path, flatten: bool) -> None:
    body, out = bare_file(BODY, tmp_path / "body.usdc"), tmp_path / "out.usdc"
    message = run("fill", body, "--library", library, "-o", out, code=4).output
    assert "no finger joints" in message
    assert "--add-fingers" in message
    more = ("--flatten",) if flatten else ()
    report = json.loads(
        run("fill", body, "--library", library, "-o", out, "--add-fingers", "--json", *more).stdout
    )
    assert report["fingers_from"].endswith("gestures_ben/ok_01.usdc")  # as tall as the body
    before, after = (Usd.Stage.Open(str(p)) for p in (body, out))
    skeletons = [UsdSkel.Skeleton(s.GetPrimAtPath("/Ben/Skeleton")) for s in (before, after)]
    old, new = ([str(j) for j in s.GetJointsAttr().Get()] for s in skeletons)
    added = [path for paths in report["added_joints"].values() for path in paths]
    assert new == old + added
    assert UsdSkel.Topology(new).Validate()[0]
    for name in ("bindTransforms", "restTransforms"):
        values = [s.GetPrim().GetAttribute(name).Get() for s in skeletons]
        assert list(values[1])[: len(old)] == list(values[0])
    bind, rest = (np.array(skeletons[1].GetPrim().GetAttribute(n).Get())
                  for n in ("bindTransforms", "restTransforms"))  # fmt: skip
    for j in range(len(old), len(new)):
        parent = new.index(new[j].rsplit("/", 1)[0])
        assert_allclose(rest[j] @ bind[parent], bind[j], atol=1e-9)
    animations = [
        UsdSkel.Animation(UsdSkel.BindingAPI(s.GetPrim()).GetInheritedAnimationSource())
        for s in skeletons
    ]
    listed = [str(j) for j in animations[0].GetJointsAttr().Get()]
    theirs = [str(j) for j in animations[1].GetJointsAttr().Get()]
    assert theirs == new
    for read in ("GetRotationsAttr", "GetTranslationsAttr"):
        one, other = (getattr(a, read)() for a in animations)
        for time in one.GetTimeSamples() or [Usd.TimeCode.Default()]:
            values = np.array(other.Get(time))
            for i, joint in enumerate(listed):
                if joint in old:
                    assert np.array_equal(np.array(one.Get(time))[i], values[theirs.index(joint)])
    assert_allclose(skinned(body), skinned(out), atol=1e-6)
    assert np.ptp(skinned(out), axis=0).max() > 0.01
    filled = usdhand.read_clip(out)
    for side, frames in usdhand.find_hands(filled).frames.items():
        assert len(frames.names) == 15
        assert np.ptp(filled.rotations[:, frames.joints], axis=0).max() > 0.04, side
    run("check", out)


def test_the_finger_joints_of_a_chosen_character(library: Path, tmp_path: Path) -> None:
    body, out = bare_file(BODY, tmp_path / "body.usdc"), tmp_path / "out.usda"
    other = SAMPLES / "characters" / "ada_hand_right.usdc"
    arguments = ("fill", body, "--library", library, "-o", out, "--json")
    report = json.loads(run(*arguments, "--fingers-from", other).stdout)
    assert report["fingers_from"] == str(other)
    assert {side: len(paths) for side, paths in report["added_joints"].items()} == {
        "left": 20, "right": 20
    }  # fmt: skip
    one = json.loads(run(*arguments, "--fingers-from", other, "--side", "left", "--force").stdout)
    assert list(one["added_joints"]) == list(one["hands"]) == ["left"]
    text = run("fill", out, "--library", library, "-o", tmp_path / "o.usda", "--side", "left",
               "--replace", "--add-fingers").output  # fmt: skip
    assert "none are added" in text
    text = run("fill", out, "--library", library, "-o", tmp_path / "p.usda", "--replace").output
    assert "right hand has no finger joints" in text


def test_a_library_whose_files_are_gone(tmp_path: Path) -> None:
    clips, library = tmp_path / "clips", tmp_path / "l.usdc"
    clips.mkdir()
    Usd.Stage.Open(str(BEN)).Flatten().Export(str(clips / "ok_01.usdc"))
    run("library", "build", clips, "-o", library, "-q")
    (clips / "ok_01.usdc").unlink()
    body, out = bare_file(BODY, tmp_path / "body.usdc"), tmp_path / "out.usda"
    arguments = ("fill", body, "--library", library, "-o", out)
    report = json.loads(run(*arguments, "--add-fingers", "--json").stdout)
    assert report["fingers_from"].endswith("clips/ok_01.usdc")
    other = tmp_path / "other.usda"
    run("fill", body, "--library", library, "-o", other, "--fingers-from", BEN)
    found, expected = usdhand.read_clip(out), usdhand.read_clip(other)
    assert found.skeleton.joints == expected.skeleton.joints
    assert_allclose(found.skeleton.bind, expected.skeleton.bind, atol=1e-9)
    # Someone removes the hands, or breaks them.
    stage = Usd.Stage.Open(str(library))
    [clip] = stage.GetPrimAtPath("/Library/Clips").GetChildren()
    clip.GetAttribute("usdhand:left:shape:parents").Set(Vt.TokenArray(["ThumbIP"] * 3))
    stage.GetRootLayer().Save()
    assert "wrong type" in run(*arguments, "--add-fingers", "--force", code=3).output
    for attribute in [a for a in clip.GetAttributes() if ":shape:" in a.GetName()]:
        clip.RemoveProperty(attribute.GetName())
    stage.GetRootLayer().Save()
    assert "--fingers-from" in run(*arguments, "--add-fingers", "--force", code=3).output
    run(*arguments, "--fingers-from", BEN, "--force")


def test_a_skeleton_without_poses(library: Path, tmp_path: Path) -> None:
    """What is missing is completed for all joints, so that the hand keeps its shape."""
    body, out = bare_file(BODY, tmp_path / "body.usda"), tmp_path / "out.usda"
    layer = Sdf.Layer.FindOrOpen(str(body))
    for name in ("bindTransforms", "restTransforms"):
        del layer.GetPrimAtPath("/Ben/Skeleton").properties[name]
    layer.Save()
    run("fill", body, "--library", library, "-o", out, "--add-fingers")
    clip = usdhand.read_clip(out)
    assert not {p.code for p in clip.problems} & {"missing-bind", "missing-rest"}
    assert len(usdhand.find_hands(clip).frames) == 2
    joints = list(usdhand.find_hands(clip).frames["left"].joints)
    pose = forward_kinematics(
        clip, [usdhand.find_hands(clip).character.hands["left"].wrist, *joints]
    )
    reach = np.linalg.norm(pose.positions[:, 1:] - pose.positions[:, :1], axis=-1)
    assert 1.0 < reach.min() < reach.max() < 25.0


@pytest.fixture(scope="module")
def filled(library: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A body without finger joints, and the same with filled fingers."""
    folder = tmp_path_factory.mktemp("filled")
    body, out = bare_file(BODY, folder / "body.usdc"), folder / "out.usdc"
    run("fill", body, "--library", library, "-o", out, "--add-fingers")
    return body, out


@pytest.mark.parametrize("top", ["clavicle_r", "hand_l"])
@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (-1, -1, -1), (1, 1, -1), (-1, -1, 1)])
def test_a_wrist_below_a_mirroring_joint(
    library: Path, filled: tuple[Path, Path], tmp_path: Path, top: str, signs: tuple[int, ...]
) -> None:
    """A body that moves the same gets the same fingers in the world, however its rig counts."""
    (body, plain), out = filled, tmp_path / "out.usdc"
    mirrored = mirror_below(body, tmp_path / "mirrored.usdc", top, signs)
    run("fill", mirrored, "--library", library, "-o", out, "--add-fingers")
    clip = usdhand.read_clip(out)
    times = clip.time_codes[::15]
    expected, found = (
        joint_worlds(path, clip.origin.skeleton_path, times)[..., :3, 3] for path in (plain, out)
    )
    before = len(usdhand.read_clip(body).skeleton)
    assert found.shape[1] > before + 30
    assert_allclose(found, expected, atol=1e-4)
    stage = Usd.Stage.Open(str(out))
    prim = stage.GetPrimAtPath(clip.origin.skeleton_path)
    rest = np.array(prim.GetAttribute("restTransforms").Get())[before:, :3, :3]
    assert_allclose(np.linalg.det(rest), 1.0)
    bind = np.array(prim.GetAttribute("bindTransforms").Get())[:, :3, :3]
    hand = usdhand.find_hands(clip).character.hands["left" if top == "hand_l" else "right"]
    assert_allclose(np.linalg.det(bind[list(hand.joints.values())]), np.prod(signs))


@pytest.mark.real_data
def test_real_body_motion(library: Path, tmp_path: Path) -> None:
    """Hands on a character from Maya, without its own, come where its own are."""
    source = shared_data("maya", "HIK_Export.usda")
    whole = usdhand.read_clip(source)
    made = grafted(bare(whole), usdhand.read_clip(BEN))
    true, found = usdhand.find_hands(whole), usdhand.find_hands(made.clip)
    for side in SIDES:
        away = degrees_apart(
            palm(whole.skeleton, true, side), palm(made.clip.skeleton, found, side)
        )
        assert away < 10
    body, out = bare_file(source, tmp_path / "maya.usdc"), tmp_path / "out.usdc"
    run("fill", body, "--library", library, "-o", out, "--add-fingers")
    run("check", out)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["jumping_jacks", "wave_hello"])
def test_body_only_bvh(library: Path, tmp_path: Path, name: str) -> None:
    """Motion without fingers of other formats: hands go on where the arms end, thumbs as theirs."""
    body = shared_data("bvh", "animated-drawings", f"{name}.bvh")
    out = tmp_path / "out.usda"
    text = run("fill", body, "--library", library, "-o", out, "--add-fingers").output
    clip = usdhand.read_clip(out)
    hands = usdhand.find_hands(clip)
    for side in SIDES:
        assert f"{side} hand: {'L' if side == 'left' else 'R'}" in text
        assert "stays beside the added thumb" in text
        frames, hand = hands.frames[side], hands.character.hands[side]
        assert len(frames.names) == 15
        assert hand.elbow is not None
        points = clip.skeleton.bind_positions
        forearm = points[hand.wrist] - points[hand.elbow]
        _, flexion, forward = palm(clip.skeleton, hands, side).T
        assert forward @ forearm > 0.9 * np.linalg.norm(forearm)
        [thumb] = [
            j
            for j, path in enumerate(clip.skeleton.joints)
            if path.endswith(("Thumb1", "LThumb", "RThumb"))
            and hand.wrist in clip.skeleton.ancestors(j)
            and j not in hand.joints.values()
        ]
        ends = [*clip.skeleton.children[thumb], thumb]
        stands = points[ends[0]] - points[hand.wrist]
        radial = flexion if side == "right" else -flexion
        assert radial @ stands >= 0
    run("check", out)
