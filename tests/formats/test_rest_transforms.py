"""Joints that are not animated keep their whole rest transform: scale, mirror and shear."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from oracles.usdskel import assert_same_world, joint_worlds
from pxr import UsdSkel

from usdhand import read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion import forward_kinematics
from usdhand.motion.transforms import compose_trs, decompose

JOINTS = ("Armature", *(f"Armature/{joint}" for joint in stages.JOINTS))
FINGERS = list(range(7, len(JOINTS)))
AT = np.array(stages.TIMES)
KINDS = {
    "a hundredth": np.diag([0.01] * 3),
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
    "uneven": np.diag([1.5, 0.7, 1.1]),
    "sheared": np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.0], [0.2, 0.0, 1.0]]),
    "all of them": np.array([[-0.012, 0.002, 0.0], [0.0, 0.009, 0.001], [0.0, 0.0, 0.011]]),
}


def character(path: Path, still: dict[int, np.ndarray], **metadata: object) -> Path:
    """A character of which these joints are not animated, and have this linear part at rest."""
    animated = [joint for j, joint in enumerate(JOINTS) if j not in still]
    stages.character(path, joints=JOINTS, animated=animated, **metadata)
    stage = stages.edited(path)
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(stages.SKELETON))
    rest = stages.rest_matrices(JOINTS)
    for joint, linear in still.items():
        rest[joint, :3, :3] = linear.T @ rest[joint, :3, :3]
    skeleton.GetRestTransformsAttr().Set(stages.matrices(rest))
    worlds = stages.bind_matrices(JOINTS)
    parents = [JOINTS.index(j.rsplit("/", 1)[0]) if "/" in j else -1 for j in JOINTS]
    for joint, parent in enumerate(parents):
        worlds[joint] = rest[joint] if parent < 0 else rest[joint] @ worlds[parent]
    skeleton.GetBindTransformsAttr().Set(stages.matrices(worlds))
    stage.Save()
    return path


def assert_as_before(source: Path, out: Path, joints: list[int] | None = None) -> None:
    before, after = (joint_worlds(p, stages.SKELETON, AT) for p in (source, out))
    chosen = range(len(JOINTS)) if joints is None else joints
    error = np.abs(before - after)[:, chosen]
    assert error[..., :3, 3].max() < 1e-3  # 0.01 mm
    assert error[..., :3, :3].max() < 1e-3


@pytest.mark.parametrize("linear", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("joint", [0, 3, 4])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_reading(tmp_path: Path, linear: np.ndarray, joint: int, up: str) -> None:
    clip = read_clip(character(tmp_path / "a.usda", {joint: linear}, up=up))
    assert_same_world(clip, turned=False)


@pytest.mark.parametrize("linear", KINDS.values(), ids=KINDS)
def test_writing(tmp_path: Path, linear: np.ndarray) -> None:
    source = character(tmp_path / "a.usda", {0: linear, 3: linear})
    write_motion(find_character(source), read_clip(source), FINGERS, tmp_path / "b.usda")
    assert_as_before(source, tmp_path / "b.usda")
    run("convert", source, "-o", tmp_path / "c.usda", "--trim", "1:12")
    assert_as_before(source, tmp_path / "c.usda")


@pytest.mark.parametrize("linear", KINDS.values(), ids=KINDS)
def test_fingers_that_are_not_animated(tmp_path: Path, linear: np.ndarray) -> None:
    """What a verb changes of them is rotation; they stay in place and size where it can be held."""
    source = character(tmp_path / "a.usda", {0: KINDS["mirrored"], 7: linear, 9: linear})
    assert_same_world(read_clip(source), turned=False)
    write_motion(find_character(source), read_clip(source), FINGERS, tmp_path / "b.usda")
    assert_as_before(source, tmp_path / "b.usda")


def test_what_a_moved_joint_loses_is_said(tmp_path: Path) -> None:
    source = character(tmp_path / "a.usda", {0: KINDS["a hundredth"], 7: KINDS["sheared"]})
    clip = read_clip(source)
    turned = clip.rotations.copy()
    turned[:, [0, 7]] = [0.0, 0.6, 0.0, 0.8]
    said = write_motion(
        find_character(source), clip.with_rotations(turned), [0, *FINGERS], tmp_path / "b.usda"
    )
    assert {problem.code: problem.where for problem in said} == {
        "sheared": JOINTS[7],
        "rounded-scale": JOINTS[0],
    }


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 10**6),
    still=st.sets(st.sampled_from(range(len(JOINTS))), min_size=1, max_size=6),
)
def test_any_rest_transform(tmp_path: Path, seed: int, still: set[int]) -> None:
    random = np.random.default_rng(seed)
    linear = {}
    for joint in still:
        u, v = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
        linear[joint] = u @ np.diag(random.uniform(0.5, 2.0, 3)) @ v
    source, out = tmp_path / f"{seed}.usda", tmp_path / f"{seed}_out.usda"
    character(source, linear)
    assert_same_world(read_clip(source), turned=False)
    write_motion(find_character(source), read_clip(source), FINGERS, out, force=True)
    assert_as_before(source, out)
    source.unlink()


def test_shear_has_no_place_in_gltf(tmp_path: Path) -> None:
    source = character(tmp_path / "a.usda", {3: KINDS["sheared"]})
    said = run("convert", source, "-o", tmp_path / "a.glb")
    assert "glTF has no shear" in said.output
    source = character(tmp_path / "b.usda", {0: KINDS["a hundredth"], 3: KINDS["mirrored"]})
    run("convert", source, "-o", tmp_path / "b.glb")
    at = joint_worlds(source, stages.SKELETON, AT)[..., :3, 3]
    assert_allclose(forward_kinematics(read_clip(tmp_path / "b.glb")).positions, at, atol=1e-2)


@given(st.integers(0, 10**6))
def test_matrices_are_taken_apart_without_loss(seed: int) -> None:
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(seed).normal(size=(3, 4))
    if abs(np.linalg.det(matrix[:3, :3])) < 1e-3:
        return
    translation, turn, scale, shear = decompose(matrix[None])
    found = compose_trs(translation, turn, scale)[0]
    found[:3, :3] = found[:3, :3] @ shear[0]
    assert_allclose(found, matrix, atol=1e-9)
