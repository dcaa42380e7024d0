"""Values of another type are refused where they are given, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import usdhand

ONE = {"quaternions": "wxyz", "units": "m", "fps": 30, "bind": [[0, 0, 0]]}
STILL = [[[1, 0, 0, 0]]]


def of_arrays(joints: Any = ("a",), rotations: Any = STILL, **more: Any) -> usdhand.Clip:
    return usdhand.Clip.from_arrays(joints, rotations, **{**ONE, **more})


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "joints": (lambda: of_arrays(None), "joints: give a list"),
    "a number as a joint": (lambda: of_arrays([1]), "joints: give a list"),
    "name": (lambda: of_arrays(name=3), "name: 3 is no text"),
    "a flag as a rate": (lambda: of_arrays(fps=True), "fps: True"),
    "a text as a rate": (lambda: of_arrays(fps="30"), "fps: '30'"),
    "a rate of nothing": (lambda: of_arrays(fps=1e-320), "fps: .* not possible"),
    "an endless rate": (lambda: of_arrays(fps=1e300), "fps: .* not possible"),
    "a unit": (lambda: of_arrays(units=1e300), "units: no unit of length has 1e.300 cm"),
    "far": (lambda: of_arrays(translations=[[1e200, 0, 0]]), "translations: frame 0, joint 'a'"),
    "large": (lambda: of_arrays(scales=[[1e300, 1, 1]]), "scales: frame 0, joint 'a': .* larger"),
    "half a character": (lambda: of_arrays(["\ud800"]), "is no text"),
    "a largest error": (lambda: usdhand.ReduceSettings(max_error=0.0), "error of 0 is not"),
    "one path for several": (lambda: usdhand.preview_clips("a.usdc"), "clips: .* give a list"),
    "one clip for several": (lambda: usdhand.fit_rig("a.usdc"), "clips: .* give a list"),
    "one file of a library": (
        lambda: usdhand.build_library("a", "b.usdc"),
        "paths: .* give a list",
    ),
    "jobs": (lambda: usdhand.build_library([], "b.usdc", jobs=-1), "jobs: .*-1"),
    "sides": (lambda: usdhand.find_hands(of_arrays(), sides="left"), "sides: .* give a list"),
    "a number as a body": (
        lambda: usdhand.FillRequest(body=3, library="l", output="o"),
        "body cannot be 3",
    ),  # type: ignore[arg-type]
    "complex": (lambda: of_arrays(rotations=np.array(STILL) * 1j), "numbers are complex"),
    "a parent": (lambda: of_arrays(parents=[-0.3]), "-0.3 is not a possible parent"),
    "a shape": (lambda: of_arrays(parents=[-1, 0]), r"shape is \(2,\).*that is \(1,\)"),
    "k": (lambda: usdhand.FillSettings(k="a"), "k cannot be 'a': a whole number"),  # type: ignore[arg-type]
    "a flag as k": (lambda: usdhand.FillSettings(k=True), "k cannot be True"),
    "half a k": (lambda: usdhand.FillSettings(k=1.5), "k cannot be 1.5"),  # type: ignore[arg-type]
    "couple": (lambda: usdhand.FillSettings(couple=1), "couple cannot be 1: true or false"),  # type: ignore[arg-type]
    "metric": (lambda: usdhand.FillSettings(metric="nope"), "no metric 'nope'; there are"),
    "pin": (lambda: usdhand.Pin("a", 1), "body cannot be 'a': a number"),  # type: ignore[arg-type]
    "band": (lambda: usdhand.SpliceSettings(band="x"), "band cannot be 'x': a list of 2"),  # type: ignore[arg-type]
    "conventions": (lambda: usdhand.load_conventions({"mine": {}}), "mine.* names no joint"),
    "no file": (lambda: usdhand.animation_names("none.usdc"), "none.usdc: no such file"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_wrong_value_is_refused_by_name(what: str) -> None:
    call, words = REFUSED[what]
    with pytest.raises(usdhand.UsdHandError, match=words):
        call()


def test_numbers_of_numpy_are_numbers() -> None:
    assert usdhand.FillSettings(k=np.int64(3)).k == 3  # type: ignore[arg-type]
    assert usdhand.Pin(np.float64(1.0), 2).body == 1.0
    assert len(of_arrays(fps=np.float32(30.0))) == 1
