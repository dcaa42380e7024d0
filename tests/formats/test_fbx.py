"""FBX files made for the purpose: transforms, units, axes, times, takes, skeletons, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.fbx_files import (
    COMPONENTWISE,
    NO_PARENT_SCALE,
    NORMAL,
    Keys,
    Node,
    positions,
    write_fbx,
)

from usdhand.errors import InputError, UsageError
from usdhand.formats.fbx import read, scene
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot

pytest.importorskip("ufbx", reason="no ufbx: pip install 'usdhand[convert]'")
VECTORS = ("Lcl Translation", "Lcl Rotation", "PreRotation", "PostRotation")
PIVOTS = ("RotationPivot", "RotationOffset", "ScalingPivot", "ScalingOffset")
SWING: dict[tuple[str, str], Keys] = {("Lcl Rotation", "Z"): [(0.0, 0.0), (1.0, 90.0)]}
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # of Z-up vectors


def chain(names: str = "Hips Spine Head", kind: str = "LimbNode", start: int = -1) -> list[Node]:
    """A chain that swings, each joint 10 above the other; ``start`` is what it hangs on."""
    nodes = []
    for i, name in enumerate(names.split()):
        parent = start if i == 0 else start + i
        place = {"Lcl Translation": (0.0, 10.0, 0.0)}
        nodes.append(Node(name, parent, kind, place, keys=SWING))
    return nodes


def world(clip: Clip) -> np.ndarray:
    return forward_kinematics(clip).positions


def random_chain(seed: int, *, pivots: bool, scales: float, inherit: bool) -> list[Node]:
    rng = np.random.default_rng(seed)

    def vector(size: float) -> tuple[float, float, float]:
        x, y, z = rng.normal(scale=size, size=3)
        return float(x), float(y), float(z)

    nodes = []
    for i in range(6):
        vectors = {name: vector(60.0) for name in VECTORS}
        vectors |= {name: vector(5.0) for name in PIVOTS if pivots}
        if scales:
            even = float(rng.uniform(0.5, 2.0))
            uneven = rng.uniform(0.5, 2.0, 3)
            x, y, z = uneven if scales > 1 else (even, even, even)
            vectors["Lcl Scaling"] = float(x), float(y), float(z)
        keys = {
            (name, axis): [(t, float(rng.normal(scale=40.0))) for t in (0.0, 0.4, 1.0)]
            for name in VECTORS[:2]
            for axis in "XYZ"
        }
        mode = int(rng.integers(3)) if inherit else NORMAL
        nodes.append(Node(f"J{i}", i - 1, "LimbNode", vectors, int(rng.integers(6)), mode, keys))
    return nodes


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("pivots", "scales", "inherit"),
    [(False, 0, False), (True, 0, False), (True, 1, False), (True, 2, False), (False, 1, True)],
    ids=["orders", "pivots", "even scales", "uneven scales", "inherit types"],
)
def test_transforms(tmp_path: Path, seed: int, pivots: bool, scales: float, inherit: bool) -> None:
    nodes = random_chain(seed, pivots=pivots, scales=scales, inherit=inherit)
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert np.abs(world(clip) - positions(nodes, clip.times)).max() < 1e-9
    assert np.allclose(np.linalg.norm(clip.rotations, axis=-1), 1.0)
    assert (np.einsum("tji,tji->tj", clip.rotations[1:], clip.rotations[:-1]) > 0).all()
    assert not [p for p in clip.problems if p.severity == "warning"]


def test_smooth_keys(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    nodes = [
        replace(node, keys={("Lcl Rotation", axis): _smooth(rng) for axis in "XYZ"})
        for node in chain()
    ]
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    # slopes are of single precision in the file
    assert np.abs(world(clip) - positions(nodes, clip.times)).max() < 1e-5


def _smooth(rng: np.random.Generator) -> Keys:
    return [(t, float(rng.normal(scale=40)), float(rng.normal(scale=90))) for t in (0, 0.3, 1)]


@pytest.mark.parametrize("inherit", [COMPONENTWISE, NORMAL, NO_PARENT_SCALE])
def test_a_scaled_parent(tmp_path: Path, inherit: int) -> None:
    nodes = chain("Hips Spine Head Top")
    wide = {**nodes[1].vectors, "Lcl Scaling": (2.0, 2.0, 2.0)}
    nodes[1] = replace(nodes[1], vectors=wide)
    nodes[2] = replace(nodes[2], inherit=inherit)
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    length = np.linalg.norm(np.diff(world(clip), axis=1), axis=-1)
    last = 10.0 if inherit == NO_PARENT_SCALE else 20.0
    assert np.allclose(length, [10.0, 20.0, last])
    assert np.allclose(clip.scales[:, 1], 2.0)
    assert np.allclose(clip.scales[:, 2], 0.5 if inherit == NO_PARENT_SCALE else 1.0)


def test_animated_and_zero_scale(tmp_path: Path) -> None:
    nodes = chain()
    keys = {("Lcl Scaling", axis): [(0.0, 0.0), (1.0, 3.0)] for axis in "XYZ"}
    nodes[1] = replace(nodes[1], keys={**SWING, **keys})
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert np.allclose(clip.scales[:, 1], np.linspace(0, 3, 31)[:, None])
    assert np.allclose(world(clip), positions(nodes, clip.times))


@pytest.mark.parametrize(
    ("unit", "given", "cm"),
    [(1.0, None, 1.0), (2.54, None, 2.54), (100.0, None, 100.0), (1.0, 10.0, 10.0)],
)
def test_units(tmp_path: Path, unit: float, given: float | None, cm: float) -> None:
    path = write_fbx(tmp_path / "a.fbx", chain(), settings={"UnitScaleFactor": unit})
    clip = read.read_clip(path, Reading(cm_per_unit=given))
    assert np.allclose(world(clip)[0, :, 1], [10 * cm, 20 * cm, 30 * cm])
    assert np.allclose(clip.skeleton.bind_positions, world(clip)[0])
    assert clip.origin.cm_per_unit == pytest.approx(cm)


def test_up_axis(tmp_path: Path) -> None:
    z_up = {"UpAxis": 2, "FrontAxis": 1, "FrontAxisSign": -1}
    nodes = random_chain(1, pivots=False, scales=0, inherit=False)
    said = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes, settings=z_up))
    assert said.origin.up_axis == "Z"
    expected = positions(nodes, said.times) @ Y_UP.T
    assert np.allclose(world(said), expected)
    unsaid = write_fbx(tmp_path / "b.fbx", nodes)
    assert read.read_clip(unsaid).origin.up_axis == "Y"
    assert np.allclose(world(read.read_clip(unsaid, Reading(up="Z"))), expected)
    assert np.allclose(
        world(read.read_clip(tmp_path / "a.fbx", Reading(up="Y"))) @ Y_UP.T, expected
    )


def test_left_handed_axes(tmp_path: Path) -> None:
    nodes = random_chain(2, pivots=True, scales=1, inherit=False)
    path = write_fbx(tmp_path / "a.fbx", nodes, settings={"CoordAxisSign": -1})
    clip = read.read_clip(path)
    assert np.allclose(world(clip), positions(nodes, clip.times) * [-1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("mode", "custom", "fps"), [(3, -1.0, 60.0), (11, -1.0, 24.0), (14, 12.5, 12.5)]
)
def test_frame_rate(tmp_path: Path, mode: int, custom: float, fps: float) -> None:
    settings = {"TimeMode": mode, "CustomFrameRate": custom}
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", chain(), settings=settings))
    assert clip.fps == clip.origin.time_codes_per_second == pytest.approx(fps)
    assert len(clip) == int(fps) + 1


@pytest.mark.parametrize(("mode", "custom"), [(0, -1.0), (14, 0.0), (14, -1.0)])
def test_an_unsaid_frame_rate_is_that_of_the_keys(tmp_path: Path, mode: int, custom: float) -> None:
    keys = {("Lcl Rotation", "X"): [(i / 50, float(i)) for i in range(51)]}
    nodes = [replace(node, keys=keys) for node in chain()]
    settings = {"TimeMode": mode, "CustomFrameRate": custom}
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes, settings=settings))
    assert clip.fps == pytest.approx(50.0)
    assert "guessed-fps" in [p.code for p in clip.problems]


def test_keys_between_frames_are_told_of(tmp_path: Path) -> None:
    keys = {("Lcl Rotation", "X"): [(i / 120, float(i)) for i in range(121)]}
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", [replace(n, keys=keys) for n in chain()]))
    assert len(clip) == 31
    assert [p.code for p in clip.problems if p.severity == "warning"] == ["dense-keys"]


@pytest.mark.parametrize(
    ("span", "first", "frames", "told"),
    [
        ((0.5, 0.9), 15.0, 13, False),
        ((0.0, 2.0), 0.0, 61, False),  # holds still at the end
        ((0.0, 0.0), 0.0, 31, True),
        ((5.0, 9.0), 0.0, 31, True),
        ((0.0, 1e6), 0.0, 31, True),
        ((0.51, 0.99), 15.3, 15, False),  # off the frames
    ],
)
def test_spans(
    tmp_path: Path, span: tuple[float, float], first: float, frames: int, told: bool
) -> None:
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", chain(), takes={"Take": span}))
    assert clip.origin.first_time_code == pytest.approx(first)
    assert len(clip) == frames
    assert clip.start == pytest.approx(first / 30)
    assert np.allclose(world(clip), positions(chain(), clip.times))
    assert ("take-span" in [p.code for p in clip.problems]) == told


def test_too_many_frames(tmp_path: Path) -> None:
    nodes = [replace(n, keys={("Lcl Rotation", "X"): [(0.0, 0.0), (1e6, 1.0)]}) for n in chain()]
    path = write_fbx(tmp_path / "a.fbx", nodes, takes={"Take": (0.0, 0.0)})
    with pytest.raises(InputError, match=r"a\.fbx.*30000001 frames"):
        read.read_clip(path)


def test_takes(tmp_path: Path) -> None:
    more = {"Wave": {("Lcl Rotation", "X"): [(1.0, 0.0), (2.0, 45.0)]}}
    nodes = [replace(node, more_keys=more) for node in chain()]
    takes = {"Walk": (0.0, 1.0), "Wave": (1.0, 2.0), "Empty": (0.0, 1.0)}
    path = write_fbx(tmp_path / "a.fbx", nodes, takes=takes)
    assert read.animation_names(path) == ("Walk", "Wave")
    with pytest.raises(UsageError, match=r"'Walk', 'Wave'.*--animation"):
        read.read_clip(path)
    with pytest.raises(UsageError, match="no animation 'Empty'"):
        read.read_clip(path, Reading(animation="Empty"))
    wave = read.read_clip(path, Reading(animation="Wave"))
    assert wave.origin.animation_path == "Wave"
    assert wave.origin.first_time_code == 30.0
    assert np.allclose(rot.angle_between(wave.rotations[0], wave.rotations[-1]), 45.0)
    assert len(read.read_character(path)) == 1


def test_no_motion(tmp_path: Path) -> None:
    nodes = [replace(node, keys={}) for node in chain()]
    path = write_fbx(tmp_path / "a.fbx", nodes, takes={"Empty": (0.0, 1.0)})
    assert read.animation_names(path) == ()
    with pytest.raises(InputError, match="nothing is animated"):
        read.read_clip(path)
    character = read.read_character(path)
    assert np.allclose(world(character)[0, :, 1], [10.0, 20.0, 30.0])


def test_what_stands_above_becomes_part_of_the_roots(tmp_path: Path) -> None:
    above = Node(
        "Armature",
        kind="Null",
        vectors={"Lcl Rotation": (-90.0, 0.0, 0.0), "Lcl Scaling": (100.0, 100.0, 100.0)},
        keys={("Lcl Translation", "X"): [(0.0, 0.0), (1.0, 50.0)]},
    )
    nodes = [above, *chain(start=0)]
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert clip.skeleton.joints == ("Hips", "Hips/Spine", "Hips/Spine/Head")
    assert np.allclose(world(clip), positions(nodes, clip.times)[:, 1:])
    assert np.allclose(clip.scales, 1.0)
    assert np.allclose(clip.translations[:, 1:], [0.0, 1000.0, 0.0])
    assert clip.origin.skeleton_path == ""


def test_only_what_stands_above_moves(tmp_path: Path) -> None:
    above = Node("Cart", kind="Null", keys={("Lcl Translation", "X"): [(0.0, 0.0), (1.0, 50.0)]})
    nodes = [above, *(replace(node, keys={}) for node in chain(start=0))]
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert np.allclose(np.ptp(world(clip), axis=0), [50.0, 0.0, 0.0])


def test_nulls_between_joints_are_joints(tmp_path: Path) -> None:
    nodes = [*chain("Hips Group Head"), Node("Prop", 2, "Null"), Node("Mesh", -1, "Mesh")]
    nodes[1] = replace(nodes[1], kind="Null")
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert clip.skeleton.joints == ("Hips", "Hips/Group", "Hips/Group/Head")


def test_a_skeleton_of_nulls(tmp_path: Path) -> None:
    nodes = [*chain(kind="Null"), Node("End", 2, "Null"), Node("Lamp target", -1, "Null")]
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    assert clip.skeleton.joints == ("Hips", "Hips/Spine", "Hips/Spine/Head", "Hips/Spine/Head/End")
    assert [p.severity for p in clip.problems if p.code == "no-limbs"] == ["note"]


def test_names(tmp_path: Path) -> None:
    nodes = [*chain("Character1:Hips a/b Jörg"), Node("a/b", 0), Node("", 0), Node("a/b", 0)]
    clip = read.read_clip(write_fbx(tmp_path / "a.fbx", nodes))
    hips = "Character1:Hips"
    names = ("", "/a_b", "/a_b/Jörg", "/a_b_1", "/unnamed", "/a_b_2")
    assert clip.skeleton.joints == tuple(hips + name for name in names)


def test_several_skeletons(tmp_path: Path) -> None:
    still = [replace(node, keys={}) for node in chain("Hips1 Spine Head", start=4)]
    one = [Node("A", kind="Null"), *chain(start=0)]
    both = [*one, Node("B", kind="Null"), *chain("Hips1 Spine Head", start=4)]
    path = write_fbx(tmp_path / "a.fbx", both)
    with pytest.raises(UsageError, match=r"'A', 'B'.*--skel"):
        read.read_clip(path)
    with pytest.raises(UsageError, match="no skeleton 'C'"):
        read.read_clip(path, Reading(skel="C"))
    for name in ("B", "Hips1"):
        clip = read.read_clip(path, Reading(skel=name))
        assert clip.skeleton.joints[0] == "Hips1"
        assert clip.origin.skeleton_path == "B"
    moving = write_fbx(tmp_path / "b.fbx", [*one, both[4], *still])
    assert read.read_clip(moving).origin.skeleton_path == "A"
    with pytest.raises(InputError, match="does not move 'B'"):
        read.read_clip(moving, Reading(skel="B"))
    prop = [*chain(), Node("Sword", keys=SWING)]
    assert read.read_clip(write_fbx(tmp_path / "c.fbx", prop)).origin.skeleton_path == "Hips"


def test_bind_pose(tmp_path: Path) -> None:
    nodes = chain()
    apart = {i: np.eye(4) for i in (0, 1)}
    apart[0][:3, 3], apart[1][:3, 3] = (1, 2, 3), (4, 5, 6)
    turn = rot.to_matrix(rot.from_axis_angle(np.array([1.0, 0, 0]), np.pi / 2))
    apart[1][:3, :3] = 3.0 * turn
    path = write_fbx(tmp_path / "a.fbx", nodes, bind=apart, settings={"UnitScaleFactor": 100.0})
    skeleton = read.read_clip(path).skeleton
    assert np.allclose(skeleton.bind_positions[:2], [[100, 200, 300], [400, 500, 600]])
    assert np.allclose(skeleton.bind_positions[2], [400, 500, 1600])  # hangs on its parent
    assert np.allclose(skeleton.bind[1, :3, :3], turn)
    assert np.allclose(skeleton.rest[:, :3, 3], [0.0, 1000.0, 0.0])
    character = read.read_character(path)
    assert np.allclose(world(character)[0], skeleton.bind_positions)
    assert np.allclose(character.skeleton.bind, skeleton.bind)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"These are just words.\n" * 50, "cannot be read as FBX"),
        (bytes(range(256)) * 20, "cannot be read as FBX"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "cannot be read as FBX"),
        (b"Kaydara FBX Binary  \x00\x1a\x00", "cannot be read as FBX"),
        (b"Kaydara FBX Binary  \x00\x1a\x00\xd0\x07\0\0" + bytes(100), "FBX version 2"),
        (b"; FBX 5.0.0 project file\nFBXHeaderExtension: {\n FBXVersion: 5000\n}\n", "version 5"),
    ],
    ids=["empty", "text", "bytes", "obj", "cut", "too old", "old and empty"],
)
def test_refusals(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "a.fbx"
    path.write_bytes(content)
    for reader in (read.read_clip, read.read_character):
        with pytest.raises(InputError, match=message) as caught:
            reader(path)
        assert str(path) in str(caught.value)


def test_missing_files_and_skeletons(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read.read_clip(tmp_path / "a.fbx")
    with pytest.raises(InputError, match="no such file"):
        read.read_clip(tmp_path)
    light = Node("Lamp", kind="Light", keys=SWING)
    with pytest.raises(InputError, match="there is no skeleton"):
        read.read_clip(write_fbx(tmp_path / "b.fbx", [light]))
    with pytest.raises(InputError, match="one unit is 0 cm"):
        read.read_clip(write_fbx(tmp_path / "c.fbx", chain()), Reading(cm_per_unit=0.0))


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_fbx(tmp_path / "a.fbx", chain())
    monkeypatch.setattr(scene.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install 'usdhand\[convert\]'"):
        read.read_clip(path)


def test_a_library_that_crashes_is_survived(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_fbx(tmp_path / "a.fbx", chain())
    worker = tmp_path / "worker.py"
    monkeypatch.setattr(scene, "WORKER", worker)
    worker.write_text("import os; os.abort()")
    with pytest.raises(InputError, match=r"a\.fbx.*signal 6"):
        read.read_clip(path)
    worker.write_text("raise MemoryError")
    with pytest.raises(InputError, match=r"a\.fbx.*MemoryError"):
        read.read_clip(path)
    worker.write_text("while True: pass")
    monkeypatch.setattr(scene, "TIME_LIMIT", 0.3)
    with pytest.raises(InputError, match=r"a\.fbx.*more than 0\.3 s"):
        read.read_clip(path)
