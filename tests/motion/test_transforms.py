"""Transforms as matrices, against slow and obvious versions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders import stages
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from usdhand.motion import Clip, Origin, Skeleton, forward_kinematics, parents_from_paths
from usdhand.motion import rotations as rot
from usdhand.motion.transforms import (
    affine,
    compose_trs,
    decompose_trs,
    local_matrices,
    mean_scale,
    nearest_rotation,
    orientation,
    rigid,
    unit,
    with_even_signs,
)

SIZES = st.floats(0.01, 100.0)
SIGNS = st.sampled_from([-1.0, 1.0])
seeds = st.integers(0, 2**32 - 1)


def rotation(seed: int) -> np.ndarray:
    return np.asarray(Rotation.random(random_state=seed).as_matrix())


def distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b))


def nearest_by_search(matrix: np.ndarray) -> float:
    """Distance of the nearest rotation, found by going downhill from many rotations."""
    starts = Rotation.random(12, random_state=1).as_rotvec()

    def away(vector: np.ndarray) -> float:
        return distance(Rotation.from_rotvec(vector).as_matrix(), matrix)

    return min(minimize(away, start, method="BFGS").fun for start in starts)


MATRICES = arrays(np.float64, (3, 3), elements=st.floats(-3, 3, allow_subnormal=False))
# (3, 3) with these singular values; 0: nothing is left of a direction
SINGULAR = st.tuples(seeds, seeds, st.tuples(*[st.sampled_from([0.0, 0.3, 1.0, 2.5])] * 3)).map(
    lambda s: rotation(s[0]) @ np.diag(s[2]) @ rotation(s[1])
)


@given(MATRICES | SINGULAR, SIGNS)
def test_no_rotation_is_nearer(matrix: np.ndarray, sign: float) -> None:
    """Mirrored and singular matrices included."""
    matrix = matrix * np.array([1.0, 1.0, sign])
    found = nearest_rotation(matrix)
    assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(found) == pytest.approx(1.0)
    others = Rotation.random(200, random_state=2).as_matrix()
    assert distance(found, matrix) <= np.linalg.norm(others - matrix, axis=(1, 2)).min() + 1e-12


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_the_nearest_rotation_of_a_search(seed: int, mirror: float) -> None:
    matrix = np.random.default_rng(seed).normal(size=(3, 3))
    matrix *= np.sign(np.linalg.det(matrix)) * np.array([1.0, 1.0, mirror])
    found = distance(nearest_rotation(matrix), matrix)
    assert found == pytest.approx(nearest_by_search(matrix), abs=1e-6)


@given(seeds, st.tuples(SIZES, SIZES, SIZES))
def test_stretched_rotations_come_back(seed: int, sizes: tuple[float, float, float]) -> None:
    turn, other = rotation(seed), rotation(seed + 1)
    stretched = turn @ other @ np.diag(sizes) @ other.T  # along any axes
    assert_allclose(nearest_rotation(stretched), turn, atol=1e-9)
    assert_allclose(orientation(stretched), turn, atol=1e-9)
    assert_allclose(orientation(-stretched), turn, atol=1e-9)
    assert mean_scale(stretched) == pytest.approx(np.prod(sizes) ** (1 / 3))
    assert mean_scale(-stretched) == pytest.approx(np.prod(sizes) ** (1 / 3))


def test_flat_matrices_have_no_scale() -> None:
    flat = rotation(1) @ np.diag([1.0, 2.0, 0.0]) @ rotation(2)
    assert mean_scale(np.stack([flat, 3.0 * np.eye(3)])).tolist() == pytest.approx([0.0, 3.0])


def test_everything_is_vectorised() -> None:
    many = np.random.default_rng(3).normal(size=(4, 5, 3, 3))
    for function in (nearest_rotation, orientation, mean_scale):
        each = [[function(m) for m in row] for row in many]
        assert_allclose(function(many), each)
    matrices = affine(many, np.ones(3))
    assert matrices.shape == (4, 5, 4, 4)
    assert_allclose(rigid(matrices)[..., :3, :3], nearest_rotation(many))
    assert (rigid(matrices)[..., 3] == 1.0).all()
    t, q, s = decompose_trs(matrices)
    assert (t.shape, q.shape, s.shape) == ((4, 5, 3), (4, 5, 4), (4, 5, 3))


@given(seeds, st.tuples(SIZES, SIZES, SIZES), SIGNS, arrays(np.float64, 3, elements=SIZES))
def test_trs_and_back(
    seed: int, sizes: tuple[float, float, float], sign: float, place: np.ndarray
) -> None:
    turn, scale = rot.from_matrix(rotation(seed)), sign * np.array(sizes)
    matrix = compose_trs(place, turn, scale)
    slow = np.eye(4)
    for column in range(3):
        slow[:3, column] = Rotation.from_quat(turn).apply(np.eye(3)[column] * scale[column])
    slow[:3, 3] = place
    assert_allclose(matrix, slow, atol=1e-12)
    t, q, s = decompose_trs(matrix)
    assert_allclose(t, place)
    assert_allclose(s, scale)
    assert rot.angle_between(q, turn) < 1e-5
    assert_allclose(compose_trs(t, q, s), matrix, atol=1e-9)
    assert_allclose(compose_trs(place, turn), compose_trs(place, turn, np.ones(3)))


@given(seeds, st.lists(st.tuples(SIGNS, SIGNS, SIGNS), min_size=4, max_size=4))
def test_even_signs_are_the_same_matrices(seed: int, signs: list[tuple[float, ...]]) -> None:
    random = np.random.default_rng(seed)
    q = rot.make_continuous(rot.normalize(random.normal(size=(2, 2, 4))))
    s = (random.uniform(0.5, 2.0, (4, 3)) * signs).reshape(2, 2, 3)
    turned, even = with_even_signs(q, s)
    t = np.zeros((2, 2, 3))
    assert_allclose(compose_trs(t, turned, even), compose_trs(t, q, s), atol=1e-12)
    assert (np.sign(even) == np.sign(even[..., :1])).all()
    assert (np.sum(turned[1:] * turned[:-1], axis=-1) >= 0).all()


def test_even_signs_of_one_row_for_all_frames() -> None:
    q = rot.normalize(np.random.default_rng(1).normal(size=(5, 2, 4)))
    plain = np.broadcast_to(np.ones((2, 3)), (5, 2, 3))
    assert with_even_signs(q, plain) == (q, plain)
    mirrored = np.broadcast_to(np.array([[1.0, 1, 1], [-1, 1, 1]]), (5, 2, 3))
    turned, even = with_even_signs(q, mirrored)
    assert even.strides[0] == 0
    assert even[3].tolist() == [[1, 1, 1], [-1, -1, -1]]
    assert rot.angle_between(turned[:, 0], q[:, 0]).max() < 1e-9
    assert rot.angle_between(turned[:, 1], q[:, 1]) == pytest.approx(180.0)


@given(arrays(np.float64, (2, 3), elements=st.floats(-1e6, 1e6, allow_subnormal=False)))
def test_unit(vectors: np.ndarray) -> None:
    for vector, found in zip(vectors, unit(vectors), strict=True):
        length = np.linalg.norm(vector)
        if length > 1e-9:
            assert_allclose(found * length, vector, rtol=1e-9, atol=1e-12)
            assert np.linalg.norm(found) == pytest.approx(1.0)
    assert unit(np.zeros((2, 3))).tolist() == np.zeros((2, 3)).tolist()


# --- chains of joints ----------------------------------------------------------------------------


def bound(joints: tuple[str, ...], seed: int) -> Skeleton:
    random = np.random.default_rng(seed)
    bind = affine(
        Rotation.random(len(joints), random_state=seed).as_matrix(),
        random.uniform(-50, 50, (len(joints), 3)),
    )
    return Skeleton(joints, parents_from_paths(joints), bind, bind)


@pytest.mark.parametrize("joints", [stages.JOINTS, stages.JOINTS[::-1], ("A", "A/B", "C", "C/x/D")])
def test_locals_of_a_bind_pose(joints: tuple[str, ...]) -> None:
    skeleton = bound(joints, 4)
    for joint, parent in enumerate(skeleton.parents):
        own = skeleton.bind[joint]
        expected = own if parent < 0 else np.linalg.inv(skeleton.bind[parent]) @ own
        assert_allclose(skeleton.bind_locals[joint], expected, atol=1e-9)
    assert_allclose(skeleton.accumulated(skeleton.bind_locals), skeleton.bind, atol=1e-9)


def test_locals_below_a_placement() -> None:
    skeleton, above = bound(("A", "A/B", "C"), 5), affine(rotation(7), np.array([1.0, 2.0, 3.0]))
    local = local_matrices(skeleton.bind, skeleton.parents, above)
    assert_allclose(local[1], skeleton.bind_locals[1])
    for root in (0, 2):
        assert_allclose(above @ local[root], skeleton.bind[root], atol=1e-9)


def test_a_clip_at_the_bind_pose() -> None:
    skeleton = bound(stages.JOINTS, 6)
    clip = Clip.at_bind_pose(skeleton, "still", Origin(time_codes_per_second=25.0))
    assert (len(clip), clip.fps, clip.name) == (1, 25.0, "still")
    pose = forward_kinematics(clip)
    assert_allclose(pose.positions[0], skeleton.bind_positions, atol=1e-9)
    assert_allclose(rot.to_matrix(pose.rotations[0]), skeleton.bind_rotations, atol=1e-9)


def test_orientations_below_a_mirror_go_together() -> None:
    """Rotations of mirrored joints differ by those of the joints between them, as elsewhere."""
    plain = bound(stages.JOINTS, 8)
    below = np.array([j.startswith(stages.ARM) for j in plain.joints])
    bind = plain.bind.copy()
    bind[below, :3, :3] *= -2.0
    mirrored = replace(plain, bind=bind)
    assert_allclose(mirrored.bind_rotations, plain.bind_rotations, atol=1e-12)
