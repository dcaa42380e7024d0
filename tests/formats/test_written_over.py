"""Results over every kind of input: joints that a verb did not change stay where they were read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from builders.every_format import OTHERS, USD, reader, talk
from builders.written_over import (
    NEAR_CM,
    NEAR_DEG,
    VERBS,
    assert_shows,
    bend_to_palm,
    in_memory,
    result_of,
    small_library,
)
from numpy.testing import assert_allclose

import usdhand as api
from usdhand.fill.library import MotionLibrary
from usdhand.formats.usd.check import check_file
from usdhand.motion import Clip, Origin, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.editing import counted_in_frames
from usdhand.verbs.expand import expand

SAME_CM = 0.01  # what the rounding of the formats may make of a result


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> MotionLibrary:
    return small_library(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Clip]:
    return reader(tmp_path_factory.mktemp("inputs"))


@pytest.fixture(scope="module")
def reference(
    read: Callable[[str], Clip], library: MotionLibrary, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], np.ndarray]:
    """World positions that each verb makes of the plain USD file."""
    folder = tmp_path_factory.mktemp("reference")

    @cache
    def positions(verb: str) -> np.ndarray:
        made = result_of(verb, read("take.usdc"), library, folder).clip
        return forward_kinematics(made).positions[:, places(made)]

    return positions


def places(clip: Clip) -> list[int]:
    """Where the joints of `talk` are in a clip."""
    names = clip.skeleton.originals or clip.skeleton.names
    return [names.index(name) for name in talk().skeleton.names]


def fingers(clip: Clip) -> list[int]:
    """Joints that a verb may move, and all below them."""
    moving = {j for f in api.find_hands(clip).frames.values() for j in f.links.moving}
    skeleton = clip.skeleton
    return [j for j in range(len(skeleton)) if moving & {j, *skeleton.ancestors(j)}]


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("name", [*USD, *OTHERS])
def test_what_is_not_changed_stays_where_it_was_read(
    name: str,
    verb: str,
    read: Callable[[str], Clip],
    reference: Callable[[str], np.ndarray],
    library: MotionLibrary,
    tmp_path: Path,
) -> None:
    clip = read(name)
    result, output = result_of(verb, clip, library, tmp_path), tmp_path / "out.usdc"
    result.write(output)
    found = assert_shows(output, result.clip)
    body = sorted(set(range(len(clip.skeleton))) - set(fingers(clip)))
    before, after = forward_kinematics(clip), forward_kinematics(found)
    assert np.abs(before.positions - after.positions)[:, body].max() < NEAR_CM
    assert rot.angle_between(before.rotations, after.rotations)[:, body].max() < NEAR_DEG
    # All formats tell of the same hands, so that the fingers must come out the same.
    assert np.abs(after.positions[:, places(found)] - reference(verb)).max() < SAME_CM
    assert (bend_to_palm(found, after.positions) > 0.5).all()
    assert not [f for f in check_file(output) if f.severity == "error"]


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
@pytest.mark.parametrize("verb", [v for v in VERBS if v != "expand"])
def test_clips_made_in_memory_become_whole_characters(
    verb: str, suffix: str, library: MotionLibrary, tmp_path: Path
) -> None:
    clip = in_memory(talk())
    result, output = result_of(verb, clip, library, tmp_path), tmp_path / f"out.{suffix}"
    result.write(output)
    meant = counted_in_frames(replace(result.clip, origin=Origin(None, "", "", 30.0)))
    found = assert_shows(output, meant)
    assert found.skeleton.joints == clip.skeleton.joints
    assert_allclose(found.skeleton.bind, clip.skeleton.bind, atol=1e-6)
    assert not [f for f in check_file(output) if f.severity == "error"]
    if verb == "reduce":
        motion = expand(output)
        ours, theirs = (forward_kinematics(c).positions for c in (result.clip, motion))
        assert np.abs(ours - theirs).max() < SAME_CM
        api.write_clip(motion, tmp_path / "again.usdc")
