"""What the arm does is the same for every rig, and on both sides."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from builders.moving_hands import moved, random_turns, skeleton
from conftest import REPOSITORY
from numpy.testing import assert_allclose

import usdhand
from usdhand.anatomy import Side
from usdhand.fill.arm import (
    ArmMotion,
    arm_motion,
    mirrored,
)
from usdhand.rigs.height import REFERENCE_HEIGHT_CM, body_height

SAMPLES = REPOSITORY / "samples"


def assert_alike(a: ArmMotion, b: ArmMotion, tolerance: float = 1e-6) -> None:
    for field in fields(ArmMotion):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if one.shape[1] == 4:  # q and -q are the same rotation
            other = other * np.sign((one * other).sum(axis=1, keepdims=True))
        assert_allclose(one, other, atol=tolerance, err_msg=field.name)


def test_mirrored_twice_is_the_same() -> None:
    clip = usdhand.read_clip(SAMPLES / "gestures" / "wipe_01.usdc")
    arm = arm_motion(clip, usdhand.find_hands(clip), "left")
    assert_alike(mirrored(mirrored(arm)), arm)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_joint_axes_and_rest_make_no_difference(axes: int) -> None:
    turns = random_turns(20, 5)
    results: list[ArmMotion] = []
    for seed in (None, axes):
        rig, index = skeleton(axes=seed)
        clip = moved(rig, index, turns)
        results.append(arm_motion(clip, usdhand.find_hands(clip), "left"))
    assert_alike(*results)


def test_size_makes_no_difference() -> None:
    clip = usdhand.read_clip(SAMPLES / "gestures" / "big_01.usdc")
    rig = clip.skeleton
    bind, rest = rig.bind.copy(), rig.rest.copy()
    bind[:, :3, 3] *= 1.3
    rest[:, :3, 3] *= 1.3
    larger = replace(
        clip,
        skeleton=replace(rig, bind=bind, rest=rest),
        translations=clip.translations * 1.3,
    )
    for side in ("left", "right"):
        one = arm_motion(clip, usdhand.find_hands(clip), side)
        other = arm_motion(larger, usdhand.find_hands(larger), side)
        assert_alike(one, other)


def test_the_other_hand_is_the_mirror_image() -> None:
    rig, index = skeleton()
    clip = moved(rig, index, random_turns(20, 7))
    hands = usdhand.find_hands(clip)
    assert_alike(mirrored(arm_motion(clip, hands, "left")), arm_motion(clip, hands, "right"))


@pytest.mark.parametrize(
    ("name", "sides"),
    [("talk_01_hands_a", ("left", "right")), ("talk_01_hands_right", ("right",))],
)
def test_hands_alone_work(name: str, sides: tuple[Side, ...]) -> None:
    """Without a body to measure from there is still how the wrist bends."""
    clip = usdhand.read_clip(SAMPLES / "hands" / f"{name}.usdc")
    hands = usdhand.find_hands(clip)
    assert tuple(hands.frames) == sides
    for side in sides:
        arm = arm_motion(clip, hands, side)
        assert all(np.isfinite(getattr(arm, field.name)).all() for field in fields(arm))
        assert np.ptp(arm.wrist, axis=0).max() > 0.3


def test_a_body_in_one_place_has_the_reference_height() -> None:
    """Instead of none, by which everything would be divided."""
    clip = usdhand.read_clip(SAMPLES / "gestures" / "ok_01.usdc")
    hands = usdhand.find_hands(clip)
    bind = clip.skeleton.bind.copy()
    bind[:, :3, 3] *= 1e-6
    assert body_height(replace(clip.skeleton, bind=bind), hands.character) == REFERENCE_HEIGHT_CM
    lying = clip.skeleton.bind.copy()
    lying[:, :3, 3] = lying[:, [0, 2, 1], 3]  # the height of the head is no measure: arms are
    height = body_height(replace(clip.skeleton, bind=lying), hands.character)
    assert 100 < height < 250
