"""Quaternions against scipy's, which is too slow to import for the program itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation, Slerp

from usdhand.motion import rotations as rot

NUMBERS = st.floats(-1.0, 1.0, allow_subnormal=False)


def unit(width: int) -> st.SearchStrategy[np.ndarray]:
    """Unit vectors, those along axes included."""
    vectors = arrays(np.float64, width, elements=NUMBERS | st.sampled_from([-1.0, 0.0, 1.0, 1e-9]))
    return vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(lambda v: v / np.linalg.norm(v))


QUATERNIONS, AXES = unit(4), unit(3)
VECTORS = arrays(np.float64, 3, elements=st.floats(-100, 100))


def same_rotation(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-9) -> bool:
    return min(np.abs(a - b).max(), np.abs(a + b).max()) < tolerance


@given(QUATERNIONS, QUATERNIONS)
def test_multiply(a: np.ndarray, b: np.ndarray) -> None:
    expected = (Rotation.from_quat(a) * Rotation.from_quat(b)).as_quat()
    assert same_rotation(rot.multiply(a, b), expected)


@given(QUATERNIONS)
def test_conjugate_undoes(q: np.ndarray) -> None:
    assert np.allclose(rot.multiply(q, rot.conjugate(q)), rot.IDENTITY)


@given(QUATERNIONS, VECTORS)
def test_rotate(q: np.ndarray, v: np.ndarray) -> None:
    assert np.allclose(rot.rotate(q, v), Rotation.from_quat(q).apply(v), atol=1e-9)


@given(QUATERNIONS)
def test_matrices(q: np.ndarray) -> None:
    matrix = rot.to_matrix(q)
    assert np.allclose(matrix, Rotation.from_quat(q).as_matrix(), atol=1e-12)
    assert same_rotation(rot.from_matrix(matrix), q)


@given(AXES, st.floats(-10, 10))
def test_axis_and_angle(axis: np.ndarray, angle: float) -> None:
    expected = Rotation.from_rotvec(axis * angle).as_quat()
    assert same_rotation(rot.from_axis_angle(axis, angle), expected)


@given(QUATERNIONS)
def test_rotation_vectors(q: np.ndarray) -> None:
    vector = rot.to_rotation_vector(q)
    assert np.linalg.norm(vector) <= np.pi + 1e-9
    assert same_rotation(Rotation.from_rotvec(vector).as_quat(), q)


@given(QUATERNIONS, QUATERNIONS)
def test_angle_between(a: np.ndarray, b: np.ndarray) -> None:
    expected = (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude()
    assert rot.angle_between(a, b) == pytest.approx(np.degrees(expected), abs=1e-7)


def test_small_angles_are_exact() -> None:
    tiny = rot.from_axis_angle(np.array([0.0, 1.0, 0.0]), 1e-9)
    assert rot.angle_between(rot.IDENTITY, tiny) == pytest.approx(np.degrees(1e-9), rel=1e-6)
    assert rot.to_rotation_vector(tiny)[1] == pytest.approx(1e-9, rel=1e-6)
    assert np.array_equal(rot.to_rotation_vector(rot.IDENTITY), np.zeros(3))


@given(AXES, AXES)
def test_between_vectors(a: np.ndarray, b: np.ndarray) -> None:
    q = rot.between_vectors(a, b)
    assert np.linalg.norm(q) == pytest.approx(1.0)
    assert np.allclose(rot.rotate(q, a), b, atol=1e-4 if np.dot(a, b) < -0.999 else 1e-9)
    # The shortest: no more than the angle between the vectors.
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))
    assert rot.angle_between(rot.IDENTITY, q) == pytest.approx(angle, abs=0.01)


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3)]))
def test_opposite_vectors(axis: np.ndarray) -> None:
    assert np.allclose(rot.rotate(rot.between_vectors(axis, -axis), axis), -axis)


@given(QUATERNIONS, QUATERNIONS, st.floats(0, 1))
def test_slerp(a: np.ndarray, b: np.ndarray, t: float) -> None:
    found = rot.slerp(a, b, np.float64(t))
    whole = rot.angle_between(a, b)
    if whole < 179.9:  # half a turn apart, both ways are right
        expected = Slerp([0, 1], Rotation.from_quat([a, b]))(t).as_quat()
        assert same_rotation(found, expected, 1e-6)
    assert rot.angle_between(a, found) <= whole + 1e-4


@given(arrays(np.float64, (7, 2, 4), elements=NUMBERS))
def test_make_continuous(values: np.ndarray) -> None:
    before = values.copy()
    found = rot.make_continuous(values)
    assert np.array_equal(np.abs(found), np.abs(values))
    assert np.array_equal(values, before)
    assert (np.sum(found[1:] * found[:-1], axis=-1) >= 0).all()
    assert np.array_equal(found[0], values[0])


@given(QUATERNIONS, st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=6))
def test_mean(q: np.ndarray, angles: list[float]) -> None:
    steps = rot.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(angles))
    signs = np.where(np.arange(len(angles)) % 2, -1.0, 1.0)
    turned = rot.multiply(q, steps) * signs[:, None]
    expected = Rotation.from_quat(turned).mean().as_quat()
    assert same_rotation(rot.mean(turned), expected, 1e-6)


def test_everything_broadcasts() -> None:
    random = np.random.default_rng(1)
    many = rot.normalize(random.normal(size=(5, 3, 4)))
    one = rot.normalize(random.normal(size=4))
    each = [[rot.multiply(one, q) for q in row] for row in many]
    assert np.allclose(rot.multiply(one, many), each)
    assert rot.to_matrix(many).shape == (5, 3, 3, 3)
    assert rot.rotate(many, np.ones(3)).shape == (5, 3, 3)
    assert rot.from_matrix(rot.to_matrix(many)).shape == (5, 3, 4)
    assert rot.slerp(many, one, np.full((5, 3), 0.5)).shape == (5, 3, 4)
    assert rot.angle_between(many, one).shape == (5, 3)
