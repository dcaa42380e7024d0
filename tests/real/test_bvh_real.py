"""Real BVH files: against a plain reading and a published one; what they leave open is guessed."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders.bvh_files import plain_positions
from builders.real_takes import BVH_TAKES
from conftest import REPOSITORY, shared_data

from usdhand.errors import HandNotFoundError
from usdhand.formats.bvh.read import read_clip
from usdhand.formats.reading import Reading
from usdhand.motion import Clip, forward_kinematics
from usdhand.rigs import map_character

pytestmark = pytest.mark.real_data
NEAR_CM = 0.001  # 0.01 mm


def real(name: str) -> Path:
    return shared_data(*name.split("/"))


def positions(clip: Clip) -> np.ndarray:
    return forward_kinematics(clip).positions


def as_is(path: Path) -> Clip:
    return read_clip(path, Reading(up="Y", cm_per_unit=1.0))


@pytest.mark.parametrize("name", BVH_TAKES)
def test_real_files_agree_with_a_plain_reading(name: str) -> None:
    clip = as_is(real(name))
    frames = np.unique(np.linspace(0, len(clip) - 1, 12).astype(int))
    plain = plain_positions(real(name), [int(f) for f in frames])
    assert np.abs(positions(clip)[frames] - plain).max() < NEAR_CM


@pytest.mark.parametrize("name", BVH_TAKES)
def test_real_files_agree_with_a_published_reader(name: str, tmp_path: Path) -> None:
    python = os.environ.get("USDHAND_BVH_PYTHON")
    if python is None and importlib.util.find_spec("pybvh"):
        python = sys.executable
    if python is None:
        pytest.skip("no published BVH reader: set USDHAND_BVH_PYTHON to a Python with pybvh")
    script = REPOSITORY / "tests" / "oracles" / "bvh_peer.py"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    target = tmp_path / "peer.npz"
    subprocess.run([python, str(script), str(real(name)), str(target)], check=True, env=environment)
    theirs = np.load(target)["positions"]
    assert np.abs(positions(as_is(real(name))) - theirs).max() < NEAR_CM


def test_what_real_files_do_not_say_is_guessed() -> None:
    found = {}
    for name in BVH_TAKES:
        clip = read_clip(real(name))
        assert {"guessed-units", "guessed-up-axis"} <= {problem.code for problem in clip.problems}
        found[name] = (clip.origin.cm_per_unit, clip.origin.up_axis, round(clip.fps, 2))
    cmu = pytest.approx(5.644, abs=1e-3)
    assert found == {
        "bvh/animated-drawings/jesse_dance.bvh": (1.0, "Y", 100.0),
        "bvh/animated-drawings/jumping_jacks.bvh": (cmu, "Y", 30.0),
        "bvh/animated-drawings/wave_hello.bvh": (cmu, "Z", 119.88),
        "bvh/performs/Idle.bvh": (100.0, "Y", 30.0),
    }


@pytest.mark.parametrize("name", BVH_TAKES)
def test_bodies_stand_upright_at_the_bind_pose(name: str) -> None:
    skeleton = read_clip(real(name)).skeleton
    heights = dict(zip(skeleton.names, skeleton.bind_positions[:, 1], strict=True))
    head = next(h for n, h in heights.items() if n.endswith("Head"))
    feet = [h for n, h in heights.items() if "Foot" in n or "Ankle" in n]
    hips = skeleton.bind_positions[0, 1]
    assert max(feet) + 60.0 < hips < head - 40.0


def test_a_zero_pose_that_is_no_body_is_not_the_bind_pose() -> None:
    clip = read_clip(real("bvh/animated-drawings/jesse_dance.bvh"))  # all limbs along X
    assert "zero-pose" in {problem.code for problem in clip.problems}
    assert np.allclose(clip.skeleton.bind_positions, positions(clip)[0])
    idle = read_clip(real("bvh/performs/Idle.bvh"))
    assert "zero-pose" not in {problem.code for problem in idle.problems}


@pytest.mark.parametrize("name", ["bvh/animated-drawings/jesse_dance.bvh", "bvh/performs/Idle.bvh"])
def test_hands_of_real_files_are_found_with_their_tips(name: str) -> None:
    skeleton = read_clip(real(name)).skeleton
    hands = map_character(skeleton).hands
    for side, hand in hands.items():
        assert skeleton.names[hand.wrist].endswith(f"{side.title()}Hand")
        assert len(hand.joints) == 15
        assert all(skeleton.names[tip].endswith("3_End") for tip in hand.tips.values())
        assert len(hand.tips) == 5
    assert set(hands) == {"left", "right"}


def test_a_thumb_alone_is_no_hand() -> None:
    with pytest.raises(HandNotFoundError):
        map_character(read_clip(real("bvh/animated-drawings/jumping_jacks.bvh")).skeleton)
