"""Flat hands, whose joints are side by side: the same angles and motion as of a hand's bones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import run
from builders.moving_hands import at_bind, gesture, hand_map, moved, random_turns, skeleton
from conftest import REPOSITORY, shared_data
from numpy.testing import assert_allclose

from usdhand import find_hands, read_clip
from usdhand.anatomy.channels import Channels, Hands, carry_followers
from usdhand.anatomy.frames import hand_frames
from usdhand.anatomy.hand import DIGITS, SIDES, CharacterMap, HandMap
from usdhand.errors import HandNotFoundError, UsageError
from usdhand.formats.files import read_any
from usdhand.motion import Clip, Skeleton, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.rotations import Array
from usdhand.splice.merge import with_wrist, wrist_along
from usdhand.verbs.convert import retarget_hands, write_new

SAMPLES = REPOSITORY / "samples"
TALK = SAMPLES / "conversations" / "talk_02_full.usdc"
RIG, INDEX = skeleton(axes=4)
MAPS = {side: hand_map(INDEX, side) for side in SIDES}
FRAMES = 30
Reparent = Callable[[Skeleton, HandMap], dict[int, int]]


def line(hand: HandMap, digit: str) -> list[int]:
    """A digit's joints from the metacarpal to the tip."""
    inner = [hand.metacarpals[digit]] if digit in hand.metacarpals else []
    tip = [hand.tips[digit]] if digit in hand.tips else []
    return [*inner, *(j for n, j in hand.joints.items() if n.startswith(digit)), *tip]


def all_on(role: str | None) -> Reparent:
    """All joints of a hand side by side: below a joint of the arm, or roots."""

    def change(rig: Skeleton, hand: HandMap) -> dict[int, int]:
        above = {None: -1, "wrist": hand.wrist, "elbow": int(rig.parents[hand.wrist])}[role]
        return dict.fromkeys((j for d in DIGITS for j in line(hand, d)), above)

    return change


def last_ones_on_the_wrist(_: Skeleton, hand: HandMap) -> dict[int, int]:
    """Only the last joints of the fingers, with their tips below them, and one tip alone."""
    moving = [hand.joints[d + "DIP"] for d in ("Index", "Ring")] + [hand.tips["Middle"]]
    return dict.fromkeys(moving, hand.wrist)


def one_finger_on_the_elbow(rig: Skeleton, hand: HandMap) -> dict[int, int]:
    return dict.fromkeys(line(hand, "Middle"), int(rig.parents[hand.wrist]))


SHAPES = {
    "on the wrist": all_on("wrist"),
    "on the elbow": all_on("elbow"),
    "roots": all_on(None),
    "last ones": last_ones_on_the_wrist,
    "one finger": one_finger_on_the_elbow,
}
shapes = pytest.mark.parametrize("shape", SHAPES.values(), ids=list(SHAPES))
scaled_shapes = pytest.mark.parametrize(
    ("shape", "scale"),  # roots are not scaled with an arm
    [(shape, scale) for n, shape in SHAPES.items() for scale in (1.0, 2.0)[: 1 + (n != "roots")]],
)


def reparented(clip: Clip, above: Mapping[int, int]) -> Clip:
    """The same motion of all joints in the world, some of them with other parents."""
    rig, pose = clip.skeleton, forward_kinematics(clip)
    parents, paths = rig.parents.copy(), list(rig.joints)
    rest, rotations, translations = rig.rest.copy(), clip.rotations.copy(), clip.translations.copy()
    for j, p in above.items():
        parents[j] = p
        paths[j] = (f"{rig.joints[p]}/" if p >= 0 else "") + rig.names[j]
        if p < 0:
            rest[j] = rig.bind[j]
            rotations[:, j], translations[:, j] = pose.rotations[:, j], pose.positions[:, j]
            continue
        rest[j] = np.linalg.inv(rig.bind[p]) @ rig.bind[j]
        back = rot.conjugate(pose.rotations[:, p])
        size = np.prod(clip.scales[0, [p, *rig.ancestors(p)], 0])
        rotations[:, j] = rot.multiply(back, pose.rotations[:, j])
        translations[:, j] = rot.rotate(back, pose.positions[:, j] - pose.positions[:, p]) / size
    return replace(
        clip,
        skeleton=Skeleton(tuple(paths), parents, rig.bind, rest),
        rotations=rot.make_continuous(rotations),
        translations=translations,
    )


def hands_of(clip: Clip) -> Hands:
    return Hands.of(clip, CharacterMap(MAPS, "test"))


def pair(shape: Reparent, scale: float = 1.0) -> tuple[Clip, Clip]:
    """One motion of arms and hands on a rig of bones and on a flat one."""
    clip = moved(RIG, INDEX, random_turns(FRAMES, 5))
    scales = clip.scales.copy()
    scales[:, INDEX["left", "elbow"]] = scale
    clip = replace(clip, scales=scales)
    above = {j: p for hand in MAPS.values() for j, p in shape(RIG, hand).items()}
    return clip, reparented(clip, above)


def assert_same_world(a: Clip, b: Clip, cm: float = 1e-9) -> None:
    one, other = forward_kinematics(a), forward_kinematics(b)
    assert_allclose(other.positions, one.positions, atol=cm)
    assert rot.angle_between(one.rotations, other.rotations).max() < 1e-4


def another(names: tuple[str, ...]) -> Channels:
    return Channels(names, gesture(FRAMES, len(names) // 3, 8))


@scaled_shapes
def test_angles_and_fingertips_are_those_of_the_bones(shape: Reparent, scale: float) -> None:
    bones, flat = pair(shape, scale)
    assert all(f.links.followers for f in hands_of(flat).frames.values())
    assert_allclose(
        hands_of(flat).encode(flat).values, hands_of(bones).encode(bones).values, atol=1e-6
    )
    ours, theirs = hands_of(flat).fingertips(flat), hands_of(bones).fingertips(bones)
    assert_allclose(ours, theirs, atol=1e-9)


@scaled_shapes
def test_new_angles_move_all_joints_as_they_move_bones(shape: Reparent, scale: float) -> None:
    bones, flat = pair(shape, scale)
    hands = hands_of(flat)
    channels = another(hands.all_names)
    made = hands.decode(channels, flat)
    assert_same_world(hands_of(bones).decode(channels, bones), made)
    assert_allclose(hands.encode(made).values, channels.values, atol=1e-6)
    assert_allclose(hands.fingertips(flat, channels), hands.fingertips(made), atol=1e-9)
    moving = {j for f in hands.frames.values() for j in f.links.moving}
    still = [j for j in range(len(RIG)) if j not in moving]
    for before, after in (
        (flat.rotations, made.rotations),
        (flat.translations, made.translations),
    ):
        assert np.array_equal(before[:, still], after[:, still])


@shapes
def test_own_angles_change_nothing(shape: Reparent) -> None:
    _, flat = pair(shape)
    hands = hands_of(flat)
    again = hands.decode(hands.encode(flat), flat)
    assert rot.angle_between(again.rotations, flat.rotations).max() < 1e-4
    assert_allclose(again.translations, flat.translations, atol=1e-9)


@pytest.mark.parametrize("role", [None, "elbow", "wrist"])
def test_a_turned_wrist_takes_a_flat_hand_along(role: str | None) -> None:
    bones, flat = pair(all_on(role))
    turn = rot.from_axis_angle(np.array([0.0, 0.6, 0.8]), np.linspace(0, 1, FRAMES))

    def turned(clip: Clip) -> Clip:
        q = clip.rotations.copy()
        wrist = INDEX["left", "wrist"]
        q[:, wrist] = rot.multiply(q[:, wrist], turn)
        return carry_followers(clip, clip.with_rotations(q), hands_of(clip).frames["left"])

    assert_same_world(turned(bones), turned(flat))


def test_a_thumb_that_hangs_off_the_arm_as_a_whole_stays_there() -> None:
    clip = moved(RIG, INDEX, random_turns(FRAMES, 5))
    above = {h.joints["ThumbCMC"]: int(RIG.parents[h.wrist]) for h in MAPS.values()}
    hands = hands_of(reparented(clip, above))
    assert not any(f.links.followers for f in hands.frames.values())
    assert hands.decode(another(hands.all_names), clip).translations is clip.translations


def test_a_tip_that_carries_the_hand_stays() -> None:
    hand = MAPS["left"]
    above = {hand.tips["Pinky"]: int(RIG.parents[hand.wrist]), hand.wrist: hand.tips["Pinky"]}
    frames = hand_frames(reparented(at_bind(RIG), above).skeleton, hand)
    assert not frames.links.followers


def test_joints_in_another_order_than_a_hands_are_refused() -> None:
    hand = MAPS["left"]
    inner, outer = hand.joints["IndexPIP"], hand.joints["IndexDIP"]
    rig = reparented(at_bind(RIG), {outer: hand.wrist, inner: outer}).skeleton
    with pytest.raises(HandNotFoundError, match=r"IndexPIP.*moves with.*IndexDIP"):
        hand_frames(rig, hand)


# --- characters and files ------------------------------------------------------------------------


def flat_sample(path: Path, folder: Path, role: str | None = None) -> Path:
    """A flat copy of a sample's hands."""
    clip, animated = read_any(path)
    maps = find_hands(clip).character.hands
    above = {j: p for h in maps.values() for j, p in all_on(role)(clip.skeleton, h).items()}
    output = folder / f"flat_{path.stem}.usdc"
    write_new(reparented(clip, above), output, animated=animated)
    return output


def assert_same_files(flat: Path, bones: Path) -> None:
    """Joints of the same names are at the same places."""
    a, b = read_clip(flat), read_clip(bones)
    order = [a.skeleton.names.index(name) for name in b.skeleton.names]
    ours, theirs = forward_kinematics(a, order), forward_kinematics(b)
    assert_allclose(ours.positions, theirs.positions, atol=1e-3)
    assert_allclose(find_hands(a).encode(a).values, find_hands(b).encode(b).values, atol=0.05)


ADA = SAMPLES / "characters" / "ada.usdc"
BODY = SAMPLES / "conversations" / "talk_02_body.usdc"


@pytest.mark.parametrize(
    ("character", "before", "after"),
    [
        (ADA, ("convert", TALK, "--onto"), ()),
        (TALK, ("reduce",), ()),
        (ADA, ("expand", "rig.usdc", "--onto"), ()),
        (BODY, ("splice",), (TALK, "--wrist", "hands")),
    ],
    ids=["convert", "reduce", "expand", "splice"],
)
def test_a_flat_copy_gets_the_motion_that_its_original_gets(
    character: Path,
    before: tuple[object, ...],
    after: tuple[object, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    if before[0] == "expand":
        run("reduce", TALK, "-o", "rig.usdc")
    run(*before, flat_sample(character, tmp_path), *after, "-o", "of_flat.usdc")
    run(*before, character, *after, "-o", "of_bones.usdc")
    assert_same_files(tmp_path / "of_flat.usdc", tmp_path / "of_bones.usdc")


@pytest.mark.parametrize("role", [None, "wrist"])
def test_fill(tmp_path: Path, role: str | None) -> None:
    library = tmp_path / "library.usdc"
    gestures = [SAMPLES / "gestures" / f"{n}.usdc" for n in ("ok_01", "wipe_01", "turn_01")]
    run("library", "build", *gestures, "-o", library, "-q")
    for path, name in ((flat_sample(BODY, tmp_path, role), "flat"), (BODY, "bones")):
        run("fill", path, "--library", library, "-o", tmp_path / f"{name}.usdc", "-q")
    assert_same_files(tmp_path / "flat.usdc", tmp_path / "bones.usdc")


def test_a_flat_take_gives_its_motion_to_others(tmp_path: Path) -> None:
    flat = read_clip(flat_sample(TALK, tmp_path))
    ben, _ = read_any(SAMPLES / "characters" / "ben.usdc")
    ours, theirs = retarget_hands(flat, ben), retarget_hands(read_clip(TALK), ben)
    assert rot.angle_between(ours.rotations, theirs.rotations).max() < 0.05


def test_a_wrist_without_a_forearm_is_not_spliced() -> None:
    clip = moved(RIG, INDEX, random_turns(FRAMES, 5))
    hand = MAPS["left"]
    roots = reparented(clip, {hand.wrist: -1} | all_on(None)(RIG, hand))
    warp = np.arange(FRAMES) / clip.fps
    for body, other in ((roots, clip), (clip, roots)):
        with pytest.raises(UsageError, match=r"left wrist.*no forearm"):
            spliced_wrist(body, other, warp)


def spliced_wrist(body: Clip, other: Clip, warp: Array) -> Clip:
    return with_wrist(
        body, hands_of(body), "left", wrist_along(other, hands_of(other), "left", warp)
    )


def turned_since_the_start(clip: Clip, hand: HandMap) -> dict[str, Array]:
    """Degrees (frames,) that each joint has turned against the one before it: no frames needed."""
    pose, found = forward_kinematics(clip), {}
    for digit in hand.digits:
        names = [n for n in hand.joints if n.startswith(digit)]
        above = [hand.wrist, *(hand.joints[n] for n in names[:-1])]
        for name, a in zip(names, above, strict=True):
            q = rot.multiply(rot.conjugate(pose.rotation(a)), pose.rotation(hand.joints[name]))
            found[name] = rot.angle_between(q, q[:1])
    return found


def from_the_one_before(clip: Clip, joint: int, above: int) -> Array:
    """(frames, 3) where a joint is in the axes of another one, cm."""
    pose = forward_kinematics(clip, [joint, above])
    away = pose.position(joint) - pose.position(above)
    return rot.rotate(rot.conjugate(pose.rotation(above)), away)


@pytest.mark.real_data
@pytest.mark.parametrize("side", SIDES)
def test_a_talk_on_a_tracked_hand(side: str) -> None:
    """A WebXR hand of 25 joints under one node: its bones stay whole and turn as the talk's do."""
    target, _ = read_any(shared_data("gltf", "webxr-generic-hand", f"{side}.glb"))
    talk = read_clip(TALK)
    made = retarget_hands(talk, target)
    [hand] = find_hands(made).character.hands.values()
    theirs = turned_since_the_start(talk, find_hands(talk).character.hands[hand.side])
    ours = turned_since_the_start(made, hand)
    assert set(ours) == set(hand.joints)
    for name, angles in ours.items():
        assert_allclose(angles, theirs[name], atol=0.05)
    for digit in DIGITS:
        for above, joint in pairwise([hand.wrist, *line(hand, digit)]):
            ours = from_the_one_before(made, joint, above)
            assert_allclose(ours - from_the_one_before(target, joint, above), 0.0, atol=1e-6)
        tip = from_the_one_before(made, hand.tips[digit], hand.wrist)
        assert np.linalg.norm(np.ptp(tip, axis=0)) > 2.0
