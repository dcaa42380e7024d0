"""Rigs of any depth and size, and map files of any nesting."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.cost import at_most
from builders.rigs import build, from_points, known_rigs, nonsense, same_joints

from usdhand.errors import UsageError
from usdhand.motion import Skeleton
from usdhand.rigs import load_conventions, map_character
from usdhand.rigs.body import _line_to_farthest as line_to_farthest
from usdhand.rigs.height import body_height
from usdhand.rigs.joint_names import NamedJoints

DEEP = 1500  # more than a stack takes


def with_rope(skeleton: Skeleton, on: int, length: int) -> Skeleton:
    """The same rig, first, and a rope of joints that hangs from one of them."""
    path, place = skeleton.joints[on], skeleton.bind_positions[on]
    names, points = [], []
    for i in range(length):
        path += f"/rope{i}"
        names.append(path)
        points.append(place + np.array([0.0, -0.01, -0.02]) * (i + 1))
    return from_points(
        [*skeleton.joints, *names], np.concatenate([skeleton.bind_positions, points])
    )


@pytest.mark.parametrize("names", [known_rigs()["mixamo"], nonsense()], ids=["named", "unnamed"])
def test_a_rope_on_the_hips_is_no_hand(names: dict) -> None:  # type: ignore[type-arg]
    skeleton, index = build(names)
    roped = with_rope(skeleton, index[None, "hips"], DEEP)
    found = map_character(roped)
    same_joints(found, index)
    assert body_height(roped, found) > 50


def test_the_farthest_leaf_is_the_first_of_equal_ones() -> None:
    parents = {"a": None, "b": "a", "c": "a", "d": "b", "e": "c", "f": "c"}

    def path(name: str) -> str:
        above = parents[name]
        return name if above is None else f"{path(above)}/{name}"

    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 0, 0], [5, 0, 0], [4, 0, 0]], float)
    skeleton = from_points([path(n) for n in parents], points)
    line = line_to_farthest(skeleton, 0, lambda chain: float(points[chain[-1], 0]))
    assert line == (0, 1, 3)
    assert line_to_farthest(skeleton, 2, lambda chain: float(points[chain[-1], 0])) == (2, 4)
    assert line_to_farthest(skeleton, 5, lambda chain: float(len(chain))) == (5,)


def test_joints_of_one_name_are_counted_once_each() -> None:
    still = np.tile(np.eye(4), (40_000, 1, 1))
    names = tuple(f"r{i}/bone" for i in range(40_000))
    crowd = Skeleton(names, np.full(40_000, -1, dtype=np.intp), still, still)
    with at_most(2.0):
        assert NamedJoints(crowd).by_key == {"bone": tuple(range(40_000))}


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000 + "]" * 5000, "[mine]\nfinger = " + "{a = " * 3000 + "}" * 3000]
)
def test_values_nested_without_end_are_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "deep.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=r"deep\.toml"):
        load_conventions(file)
