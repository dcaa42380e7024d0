"""Real rigs whose names are hidden, moved, posed and cut up: the map is right or refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from builders.misleading import MISLEADING, renamed
from builders.rigs import HAND, Joint, found_joints, from_points, known_rigs
from conftest import REPOSITORY, shared_data
from hypothesis import given
from hypothesis import strategies as st

from usdhand.anatomy.hand import DIGITS, FINGERS, SIDES, Side, digit_joints
from usdhand.errors import HandNotFoundError
from usdhand.formats.files import read_character, read_clip
from usdhand.motion import forward_kinematics
from usdhand.motion.rotations import Array
from usdhand.motion.skeleton import Skeleton
from usdhand.motion.transforms import unit
from usdhand.rigs.body import joint_points
from usdhand.rigs.mapping import map_character

pytestmark = pytest.mark.real_data

SAMPLES = REPOSITORY / "samples" / "characters"
FILES = {
    "full": "studiogalt/full/SG_ASL_ABC_2023_2_3.usdc",
    "mini": "studiogalt/mini/SG_ASL_ABC_2023_2_3.usdc",
    "full fbx": "studiogalt/fbx/SG_ASL_5_2023-1-29_No_Mesh_Full.fbx",
    "maya": "maya/HIK_Export.usda",
    "rokoko": "bvh/animated-drawings/jesse_dance.bvh",
    "mixamo": "bvh/performs/Idle.bvh",
    "ozz": "fbx/ozz/walk.fbx",
    "ada": "ada.usdc",
    "ada's hands": "ada_hands.usdc",
    "ben": "ben.usdc",
}
# A skeleton and which joints of it are which, by their names.
Known = tuple[Skeleton, dict[Joint, int]]
Change = Callable[[Skeleton, dict[Joint, int]], Known]


@cache
def known(rig: str) -> Known:
    """A real rig as joints at places, misplaced ones put back, and what its names say."""
    path = Path(FILES[rig])
    file = shared_data(*path.parts) if len(path.parts) > 1 else SAMPLES / path
    skeleton = read_character(file).skeleton
    truth = found_joints(map_character(skeleton))
    return from_points(list(skeleton.joints), joint_points(skeleton)), truth


WORDS = ("index", "thumb", "middle", "hand", "finger", "end", "arm", "tip", "Spine", "leaf", "ball")
SIDE_WORDS = (*WORDS, "left", "l", "R")


def hidden(skeleton: Skeleton, seed: int = 0, words: Iterable[str] = ("joint",)) -> Skeleton:
    """The skeleton with names that say nothing, in another order of numbers."""
    random = np.random.default_rng(seed)
    numbers, words = random.permutation(len(skeleton)), tuple(words)
    paths: dict[int, str] = {}
    for j in skeleton.order:
        above = f"{paths[p]}/" if (p := int(skeleton.parents[j])) >= 0 else ""
        paths[j] = f"{above}{words[random.integers(len(words))]}_{numbers[j]}"
    return from_points([paths[j] for j in range(len(skeleton))], skeleton.bind_positions)


def verdict(skeleton: Skeleton, truth: dict[Joint, int]) -> str:
    """ "right", "less" (a hand is missing) or "refused"; the test fails where a map is wrong."""
    try:
        found = found_joints(map_character(skeleton))
    except HandNotFoundError as error:
        if "--map FILE" not in str(error):
            raise
        return "refused"
    points = skeleton.bind_positions
    wrong = {joint: i for joint, i in found.items() if truth.get(joint) != i}
    for joint in [j for j in wrong if j[0] is None and j in truth]:
        # Of two joints in one place (Hips, Pelvis) each is as good.
        if np.allclose(points[wrong[joint]], points[truth[joint]], atol=0.01 * np.ptp(points)):
            del wrong[joint]
    assert not wrong, {joint: skeleton.joints[i] for joint, i in wrong.items()}
    wanted = {j for j in truth if j[1] in (*HAND, "wrist")}
    return "right" if wanted <= set(found) else "less"


# --- changes ------------------------------------------------------------------------------------


def moved(matrix: Array) -> Change:
    """Places multiplied by a matrix (3, 3); a reflection swaps left and right."""

    def change(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
        if np.linalg.det(matrix) < 0:
            other: dict[Side | None, Side | None] = {"left": "right", "right": "left", None: None}
            truth = {(other[side], role): joint for (side, role), joint in truth.items()}
        return from_points(list(skeleton.joints), skeleton.bind_positions @ matrix.T), truth

    return change


def turned(axis: Iterable[float], degrees: float) -> Array:
    """Rotation (3, 3) about an axis."""
    x, y, z = unit(np.array(list(axis), dtype=float))
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.radians(degrees)
    return np.asarray(np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k)


def below(skeleton: Skeleton, *joints: int) -> set[int]:
    """The joints and all below them."""
    return {i for i in range(len(skeleton)) if {i, *skeleton.ancestors(i)} & set(joints)}


def part(skeleton: Skeleton, truth: dict[Joint, int], kept: Iterable[int]) -> Known:
    """Only some joints; what hangs below one that is gone moves up."""
    kept = sorted(kept)
    new = {old: i for i, old in enumerate(kept)}
    paths: dict[int, str] = {}
    for j in skeleton.order:
        if j in new:
            above = next((paths[a] + "/" for a in skeleton.ancestors(j) if a in new), "")
            paths[j] = above + skeleton.names[j]
    cut = from_points([paths[j] for j in kept], skeleton.bind_positions[kept])
    return cut, {joint: new[i] for joint, i in truth.items() if i in new}


def curled(degrees: dict[str, float]) -> Change:
    """Fingers bent at all their joints by so much, digit by digit."""

    def change(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
        points = skeleton.bind_positions.copy()
        for side in SIDES:
            if (side, "IndexMCP") not in truth:
                continue
            first, last = (points[truth[side, f + "MCP"]] for f in ("Index", "Pinky"))
            axis = (last - first) if side == "left" else (first - last)
            for digit, angle in degrees.items():
                for joint in digit_joints(digit)[digit == "Thumb" :]:
                    root = truth[side, digit + joint]
                    inside = list(below(skeleton, root))
                    points[inside] = points[root] + (points[inside] - points[root]) @ (
                        turned(axis, angle).T
                    )
        return from_points(list(skeleton.joints), points), truth

    return change


def fist(degrees: float) -> Change:
    """All fingers bent by one angle, the thumb by a third of it."""
    return curled(dict.fromkeys(FINGERS, degrees) | {"Thumb": degrees / 3})


def without(*roles: str) -> Change:
    """Joints of these roles gone, and with a digit's first joint the whole digit."""

    def change(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
        gone: set[int] = set()
        for (side, role), joint in truth.items():
            if side and role in roles:
                digit = next((d for d in DIGITS if role == d + digit_joints(d)[0]), None)
                inner = truth.get((side, f"{digit}Metacarpal"), joint)
                gone |= below(skeleton, inner) if digit else {joint}
        return part(skeleton, truth, set(range(len(skeleton))) - gone)

    return change


def only(role: str, *sides: Side) -> Change:
    """What hangs below the joints of one role, such as arms or hands without a body."""

    def change(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
        roots = [truth[side, role] for side in sides if (side, role) in truth]
        return part(skeleton, truth, below(skeleton, *roots)) if roots else (skeleton, truth)

    return change


def legless(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
    """The spine and all above, nothing else."""
    if (None, "chest") not in truth:
        return skeleton, truth
    chest = truth[None, "chest"]
    kept = below(skeleton, chest) | set(skeleton.ancestors(chest))
    return part(skeleton, truth, kept)


def helped(seed: int) -> Change:
    """Leaf joints (twists, sockets) beside a third of all bones."""

    def change(skeleton: Skeleton, truth: dict[Joint, int]) -> Known:
        random, points = np.random.default_rng(seed), skeleton.bind_positions
        joints, places = list(skeleton.joints), list(points)
        for i, children in enumerate(skeleton.children):
            if children and random.random() < 0.35:
                bone = points[children[0]] - points[i]
                off = random.normal(0, 0.05 * np.linalg.norm(bone), 3)
                joints.append(f"{skeleton.joints[i]}/helper{i}")
                places.append(points[i] + random.uniform(0, 0.6) * bone + off)
        return from_points(joints, np.array(places)), truth

    return change


# Where everything is there, the map must be right; where something is not, it may be refused.
COMPLETE: dict[str, Change] = {
    "as it is": moved(np.eye(3)),
    "mirrored": moved(np.diag([-1.0, 1, 1])),
    "in metres": moved(np.eye(3) / 100),
    "in millimetres": moved(np.eye(3) * 10),
    "from behind": moved(turned([0, 1, 0], 180)),
    "from the side": moved(turned([0, 1, 0], 77)),
    "curled a little": fist(15),
    "curled": fist(35),
    "a fist": fist(70),
    "pointing": curled({"Middle": 80, "Ring": 80, "Pinky": 80, "Thumb": 30}),
    "without tips": without(*(d + "Tip" for d in DIGITS)),
    "without metacarpals": without(*(d + "Metacarpal" for d in DIGITS)),
    "helpers 1": helped(1),
    "helpers 2": helped(2),
}
INCOMPLETE: dict[str, Change] = {
    "Z up": moved(turned([1, 0, 0], 90)),
    "lying": moved(turned([1, 0, 0], -90)),
    "tilted": moved(turned([1, 2, 3], 77)),
    "bent backward": fist(-12),
    "a tight fist": fist(85),
    "no legs": legless,
    "hands": only("wrist", *SIDES),
    "left hand": only("wrist", "left"),
    "forearms": only("elbow", *SIDES),
    "right forearm": only("elbow", "right"),
    "arms": only("clavicle", *SIDES),
    "left arm": only("clavicle", "left"),
    **{f"no {d}": without(d + digit_joints(d)[0]) for d in DIGITS},
    "no Ring, no Pinky": without("RingMCP", "PinkyMCP"),
}


@pytest.mark.parametrize("words", [("joint",), SIDE_WORDS], ids=["joint_17", "words"])
@pytest.mark.parametrize("change", COMPLETE)
@pytest.mark.parametrize("rig", FILES)
def test_complete_rigs_are_right(rig: str, change: str, words: tuple[str, ...]) -> None:
    skeleton, truth = COMPLETE[change](*known(rig))
    assert verdict(hidden(skeleton, len(change), words), truth) == "right"


@pytest.mark.parametrize("change", INCOMPLETE)
@pytest.mark.parametrize("rig", FILES)
def test_incomplete_rigs_are_right_or_refused(rig: str, change: str) -> None:
    skeleton, truth = INCOMPLETE[change](*known(rig))
    verdict(hidden(skeleton, len(change)), truth)


@given(st.sampled_from(sorted(FILES)), st.integers(0, 10_000))
def test_hands_of_all_poses_places_and_sizes(rig: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    skeleton, truth = curled({d: random.uniform(-10, 85) for d in FINGERS})(*known(rig))
    bones = skeleton.bind_positions - skeleton.bind_positions[skeleton.parents]
    sizes = np.linalg.norm(bones, axis=1, keepdims=True).clip(0, 10)
    noise = random.uniform(-0.04, 0.04, bones.shape) * sizes
    skeleton = from_points(list(skeleton.joints), skeleton.bind_positions + noise)
    matrix = turned([0, 1, 0], random.uniform(0, 360)) * random.uniform(0.01, 10)
    skeleton, truth = moved(matrix @ np.diag([random.choice([-1, 1]), 1, 1]))(skeleton, truth)
    verdict(hidden(skeleton, seed, WORDS), truth)


# --- real poses ---------------------------------------------------------------------------------


def verdicts(folder: str, takes: slice, step: int) -> Counter[str]:
    """Every so many frames of takes of sign language as if they were the bind pose."""
    found: Counter[str] = Counter()
    changes = (moved(np.eye(3)), only("elbow", *SIDES), only("elbow", "left"))
    for path in sorted(shared_data("studiogalt", folder).glob("*.usdc"))[takes]:
        clip = read_clip(path)
        skeleton = clip.skeleton
        truth = found_joints(map_character(skeleton))
        places = forward_kinematics(clip, range(len(skeleton))).positions
        for points in places[::step]:
            posed = from_points(list(skeleton.joints), points)
            for change in changes:
                cut, there = change(posed, truth)
                found[verdict(hidden(cut), there)] += 1
    return found


@pytest.mark.parametrize("folder", ["full", "mini"])
def test_bound_in_signing_poses(folder: str) -> None:
    found = verdicts(folder, slice(None, None, 6), 60)
    assert found["right"] > 0.95 * found.total()


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["full", "mini"])
def test_bound_in_all_signing_poses(folder: str) -> None:
    found = verdicts(folder, slice(None), 30)
    assert found["right"] > 0.95 * found.total()


# --- other hierarchies --------------------------------------------------------------------------


@pytest.mark.parametrize("side", SIDES)
def test_flat_webxr_hands_are_refused(side: Side) -> None:
    # All joints beside each other: without names there are no chains.
    skeleton = read_character(shared_data("gltf", "webxr-generic-hand", f"{side}.glb")).skeleton
    truth = found_joints(map_character(skeleton))
    assert (
        verdict(hidden(from_points(list(skeleton.joints), joint_points(skeleton))), truth)
        == "refused"
    )


@pytest.mark.parametrize("side", SIDES)
def test_webxr_hands_with_a_hierarchy(side: Side) -> None:
    skeleton = read_character(shared_data("gltf", "webxr-generic-hand", f"{side}.glb")).skeleton
    points, truth = joint_points(skeleton), found_joints(map_character(skeleton))
    wrist = truth[side, "wrist"]
    paths = {wrist: "wrist"}
    for digit in DIGITS:
        line = [wrist]
        for role in ("Metacarpal", *digit_joints(digit), "Tip"):
            if (side, digit + role) in truth:
                line.append(truth[side, digit + role])
                paths[line[-1]] = f"{paths[line[-2]]}/{digit}{role}"
    kept = sorted(paths)
    chained = from_points([paths[j] for j in kept], points[kept])
    there = {joint: kept.index(i) for joint, i in truth.items()}
    assert verdict(hidden(chained), there) == "right"


@pytest.mark.parametrize("name", ["jumping_jacks", "wave_hello"])
def test_bodies_without_fingers_are_refused(name: str) -> None:
    skeleton = read_character(shared_data("bvh", "animated-drawings", f"{name}.bvh")).skeleton
    assert verdict(hidden(skeleton), {}) == "refused"


# --- names that mislead -------------------------------------------------------------------------

CONVENTIONS = {name: rig for name, rig in known_rigs().items() if ("right", "IndexMCP") in rig}
POSES = {"as it is": moved(np.eye(3)), "curled": fist(35), "in metres": moved(np.eye(3) / 100)}


@pytest.mark.parametrize("change", MISLEADING)
@pytest.mark.parametrize("rig", FILES)
def test_names_in_the_wrong_places_do_not_mislead(rig: str, change: str) -> None:
    """Every rig with the names of every third convention, permuted, shifted and exchanged."""
    for name in sorted(CONVENTIONS)[len(rig + change) % 3 :: 3]:
        skeleton, truth = known(rig)
        named = renamed(skeleton, truth, CONVENTIONS[name], MISLEADING[change])
        assert verdict(named, truth) == "right", name


@given(
    rig=st.sampled_from(sorted(FILES)),
    convention=st.sampled_from(sorted(CONVENTIONS)),
    change=st.sampled_from(sorted(MISLEADING)),
    pose=st.sampled_from(sorted(POSES)),
    mirrored=st.booleans(),
    prefix=st.sampled_from(["", "Hero:", "rig_"]),
)
def test_misleading_names_on_bodies_of_all_kinds(
    rig: str, convention: str, change: str, pose: str, mirrored: bool, prefix: str
) -> None:
    skeleton, truth = POSES[pose](*known(rig))
    named = renamed(skeleton, truth, CONVENTIONS[convention], MISLEADING[change], prefix)
    if mirrored:
        named, truth = moved(np.diag([-1.0, 1, 1]))(named, truth)
    assert verdict(named, truth) == "right"
