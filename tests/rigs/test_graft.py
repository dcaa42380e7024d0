"""Finger joints added to bodies that have none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import joints_of
from builders.mirroring import mirror_below
from builders.rigs import build, known_rigs
from conftest import REPOSITORY, shared_data
from numpy.testing import assert_allclose
from oracles.usdskel import joint_worlds
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

import usdhand
from usdhand.anatomy import SIDES, Hands, Side
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton, forward_kinematics, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.rigs import map_character
from usdhand.rigs.fingerless import fingerless_arms
from usdhand.rigs.graft import Grafted, add_finger_joints, hand_shape

SAMPLES = REPOSITORY / "samples"
ADA, BEN = SAMPLES / "gestures" / "ok_01.usdc", SAMPLES / "gestures_ben" / "ok_01.usdc"
BODY = SAMPLES / "conversations" / "talk_03_body.usdc"
# Hands alone are nothing without fingers.
WITH_ARMS = {
    name: rig for name, rig in known_rigs().items() if {(s, "elbow") for s in SIDES} <= set(rig)
}


@pytest.fixture(scope="module")
def ada() -> Clip:
    return usdhand.read_clip(ADA)


@pytest.fixture(scope="module")
def ben() -> Clip:
    return usdhand.read_clip(BEN)


def below_wrists(clip: Clip) -> set[int]:
    wrists = {h.wrist for h in usdhand.find_hands(clip).character.hands.values()}
    return {j for j in range(len(clip.skeleton)) if wrists & set(clip.skeleton.ancestors(j))}


def without(clip: Clip, joints: set[int]) -> Clip:
    keep = [j for j in range(len(clip.skeleton)) if j not in joints]
    s = clip.skeleton
    names = tuple(s.joints[j] for j in keep)
    rig = Skeleton(names, parents_from_paths(names), s.bind[keep], s.rest[keep])
    return joints_of(clip, keep, rig)


def bare(clip: Clip) -> Clip:
    return without(clip, below_wrists(clip))


def still(skeleton: Skeleton) -> Clip:
    """Two frames at the rest pose."""
    q = rot.from_matrix(skeleton.rest[:, :3, :3])
    t = skeleton.rest[:, :3, 3]
    count = len(skeleton)
    return Clip(skeleton, np.stack([q, q]), np.stack([t, t]), np.ones((2, count, 3)), 30.0)


def grafted(body: Clip, donor: Clip) -> Grafted:
    return add_finger_joints(body, donor.skeleton, usdhand.find_hands(donor))


def palm(skeleton: Skeleton, hands: Hands, side: Side) -> np.ndarray:
    wrist = hands.character.hands[side].wrist
    return skeleton.bind_rotations[wrist] @ rot.to_matrix(hands.frames[side].palm)


def degrees_apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip((np.trace(a.T @ b) - 1) / 2, -1, 1))))


@pytest.mark.parametrize(("of", "onto"), [("ada", "ben"), ("ben", "ada"), ("ada", "ada")])
def test_a_hand_comes_back_where_it_was(of: str, onto: str, request: pytest.FixtureRequest) -> None:
    """Palms within ten degrees of the true ones, sizes by the forearms, and all else as it was."""
    donor, whole = request.getfixturevalue(of), request.getfixturevalue(onto)
    body = bare(whole)
    made = grafted(body, donor).clip
    true, found = usdhand.find_hands(whole), usdhand.find_hands(made)
    count = len(body.skeleton)
    assert made.skeleton.joints[:count] == body.skeleton.joints
    assert np.array_equal(made.rotations[:, :count], body.rotations)
    for side in SIDES:
        assert len(found.frames[side].names) == 15
        assert (
            degrees_apart(palm(whole.skeleton, true, side), palm(made.skeleton, found, side)) < 10
        )
        own, theirs = (
            c.skeleton.bind_positions[[h.character.hands[side].wrist for h in [hands]]
                                      + [hands.character.hands[side].joints["MiddleMCP"]]
                                      + [hands.character.hands[side].elbow]]
            for c, hands in ((made, found), (donor, usdhand.find_hands(donor)))
        )  # fmt: skip
        ratios = [np.linalg.norm(p[1] - p[0]) / np.linalg.norm(p[2] - p[0]) for p in (own, theirs)]
        assert ratios[0] == pytest.approx(ratios[1])


@pytest.mark.parametrize("pose", ["T", "A"])
@pytest.mark.parametrize("name", sorted(WITH_ARMS))
def test_every_naming(name: str, pose: str, ada: Clip) -> None:
    """Added joints are found again by every rig's own names, or by another convention's."""
    whole, index = build(WITH_ARMS[name], pose=pose)
    hands = map_character(whole)
    fingers = {j for (side, role), j in index.items() if side and role[:5] in _DIGITS}
    body = without(still(whole), fingers)
    assert fingerless_arms(body.skeleton) is not None
    made = grafted(body, ada)
    found = usdhand.find_hands(made.clip)
    for side in SIDES:
        frames, hand = found.frames[side], found.character.hands[side]
        assert len(frames.names) == 15
        assert made.clip.skeleton.joints[hand.wrist] == whole.joints[hands.hands[side].wrist]
        own = Hands(hands, {}).character.hands[side]
        true = Hands.of(still(whole), hands).frames[side]
        turned = whole.bind_rotations[own.wrist] @ rot.to_matrix(true.palm)
        assert degrees_apart(turned, palm(made.clip.skeleton, found, side)) < 12


_DIGITS = {"Thumb", "Index", "Middl", "Ring", "RingM", "RingP", "RingD", "RingT", "Pinky"}


def test_hands_are_mirror_images(ada: Clip) -> None:
    """A donor's one hand serves both sides, and both come out mirrored at the bind pose."""
    hands = usdhand.find_hands(ada)
    one = replace(hands, frames={"right": hands.frames["right"]})
    made = add_finger_joints(bare(ada), ada.skeleton, one)
    assert {side: len(paths) for side, paths in made.added.items()} == {"left": 20, "right": 20}
    points = made.clip.skeleton.bind_positions
    found = usdhand.find_hands(made.clip).character.hands
    for role in found["left"].joints:
        left, right = (points[found[side].joints[role]] for side in SIDES)
        assert_allclose(left, right * [-1, 1, 1], atol=0.3)
    shapes = [hand_shape(ada.skeleton, one, side) for side in SIDES]
    assert_allclose(np.linalg.det(shapes[0].rotations), 1.0)
    channels = usdhand.find_hands(made.clip).encode(made.clip)
    left, right = (
        channels.values[0, [n.startswith(p) for n in channels.names]] for p in ("le", "ri")
    )
    assert_allclose(left, right, atol=1e-6)


def test_names_that_are_taken_are_not_used_again(ada: Clip) -> None:
    """A thumb of one joint, as some body-only motion has it, stays what it is."""
    joints = below_wrists(ada)
    thumbs = {j for j in joints if ada.skeleton.names[j].endswith("HandThumb1")}
    body = without(ada, joints - thumbs)
    made = grafted(body, usdhand.read_clip(BEN))
    assert len(set(made.clip.skeleton.joints)) == len(made.clip.skeleton)
    found = usdhand.find_hands(made.clip)
    assert [len(f.names) for f in found.frames.values()] == [15, 15]
    added = {path for paths in made.added.values() for path in paths}
    for hand in found.character.hands.values():
        assert {made.clip.skeleton.joints[j] for j in hand.joints.values()} <= added


def test_a_hand_joint_gives_the_direction(ada: Clip) -> None:
    joints = below_wrists(ada)
    ends = {j for j in joints if ada.skeleton.names[j].endswith("HandMiddle1")}
    body = without(ada, joints - ends)
    names = [j.replace("HandMiddle1", "HandEnd") for j in body.skeleton.joints]
    body = replace(body, skeleton=replace(body.skeleton, joints=tuple(names)))
    made = grafted(body, ada)
    true = usdhand.find_hands(ada)
    found = usdhand.find_hands(made.clip)
    for side in SIDES:
        ours, theirs = palm(made.clip.skeleton, found, side), palm(ada.skeleton, true, side)
        assert ours[:, 2] @ theirs[:, 2] == pytest.approx(1.0, abs=1e-6)


def test_arms_that_hang_have_their_thumbs_in_front(ada: Clip) -> None:
    """As motion from a zero pose has it."""
    s = bare(ada).skeleton
    arms = fingerless_arms(s)
    assert arms is not None
    bind = s.bind.copy()
    for side, sign in (("left", -1.0), ("right", 1.0)):
        hand = arms.character.hands[side]
        assert hand.shoulder is not None
        top = s.bind_positions[hand.shoulder]
        turn = np.eye(4)
        turn[:3, :3] = rot.to_matrix(rot.from_axis_angle(np.array([0, 0, 1.0]), sign * np.pi / 2))
        turn[:3, 3] = top - turn[:3, :3] @ top
        for j in range(len(s)):
            if j == hand.shoulder or hand.shoulder in s.ancestors(j):
                bind[j] = turn @ bind[j]
    made = grafted(still(replace(s, bind=bind)), ada)
    found = usdhand.find_hands(made.clip)
    for side, inward in (("left", -1.0), ("right", 1.0)):
        normal, flexion, forward = palm(made.clip.skeleton, found, side).T
        assert forward[1] < -0.95
        assert normal[0] * inward > 0.9
        assert flexion[2] * inward > 0.9


def test_scaled_bodies(ada: Clip) -> None:
    """A root joint with a scale, as some exporters write it, must not blow up the hands."""
    body = bare(ada)
    s = body.skeleton
    shrunk = np.diag([100.0, 100.0, 100.0, 1.0])
    bind, rest = s.bind @ shrunk, s.rest.copy()
    rest[:, :3, 3] /= np.where(s.parents >= 0, 100.0, 1.0)[:, None]
    scales = np.ones_like(body.scales)
    scales[:, s.parents < 0] = 100.0
    translations = body.translations / np.where(s.parents >= 0, 100.0, 1.0)[:, None]
    scaled = replace(
        body, skeleton=replace(s, bind=bind, rest=rest), scales=scales, translations=translations
    )
    ours, plain = grafted(scaled, ada).clip, grafted(body, ada).clip
    assert_allclose(ours.skeleton.bind_positions, plain.skeleton.bind_positions, atol=1e-6)
    assert_allclose(
        forward_kinematics(ours).positions, forward_kinematics(plain).positions, atol=1e-4
    )


def test_bodies_without_wrists_or_with_fingers_are_refused(ada: Clip) -> None:
    unnamed = bare(ada)
    joints = tuple(f"b{i}" for i in range(len(unnamed.skeleton)))
    nameless = replace(unnamed, skeleton=replace(unnamed.skeleton, joints=joints))
    for clip in (nameless, ada):
        with pytest.raises(HandNotFoundError, match="no wrist without fingers"):
            grafted(clip, ada)


def test_wrists_named_in_a_map_file(tmp_path: Path, ada: Clip) -> None:
    body = bare(ada)
    paths = {p: f"b{i}" for i, p in enumerate(body.skeleton.joints)}
    joints = tuple("/".join(_numbered(paths, p)) for p in body.skeleton.joints)
    nameless = replace(body, skeleton=replace(body.skeleton, joints=joints))
    wrists = {s: h.wrist for s, h in usdhand.find_hands(ada).character.hands.items()}
    table = tmp_path / "map.toml"
    kept = [j for j in range(len(ada.skeleton)) if j not in below_wrists(ada)]
    table.write_text(
        "".join(f'[{s}]\nwrist = "{joints[kept.index(w)]}"\n' for s, w in wrists.items())
    )
    conventions = usdhand.load_conventions(table)
    made = add_finger_joints(nameless, ada.skeleton, usdhand.find_hands(ada), conventions)
    assert [len(f.names) for f in usdhand.find_hands(made.clip, conventions).frames.values()] == [
        15,
        15,
    ]


def _numbered(names: dict[str, str], path: str) -> list[str]:
    parts = path.split("/")
    return [names["/".join(parts[: i + 1])] for i in range(len(parts))]


# --- files ----------------------------------------------------------------------------------------


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


OPEN: list[Usd.Stage] = []  # prims live as long as their stage


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
    assert "--fingers-from" in run(*arguments, "--add-fingers", code=3).output
    run(*arguments, "--fingers-from", BEN)


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
        assert "stays as it is beside the added thumb" in text
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
