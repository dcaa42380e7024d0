"""Finger joints added to bodies that have none, whatever their names and poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.bare_bodies import bare, below_wrists, degrees_apart, grafted, palm, without
from builders.rigs import build, known_rigs
from conftest import REPOSITORY
from numpy.testing import assert_allclose

import usdhand
from usdhand.anatomy import SIDES, Hands
from usdhand.errors import HandNotFoundError
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.rigs import map_character
from usdhand.rigs.fingerless import fingerless_arms
from usdhand.rigs.graft import add_finger_joints, hand_shape

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


def still(skeleton: Skeleton) -> Clip:
    """Two frames at the rest pose."""
    q = rot.from_matrix(skeleton.rest[:, :3, :3])
    t = skeleton.rest[:, :3, 3]
    count = len(skeleton)
    return Clip(skeleton, np.stack([q, q]), np.stack([t, t]), np.ones((2, count, 3)), 30.0)


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
