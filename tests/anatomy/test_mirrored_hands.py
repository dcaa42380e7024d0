"""Hands of rigs that were made by mirroring: a negative scale somewhere above the fingers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.mirroring import mirror_below
from conftest import REPOSITORY
from numpy.testing import assert_allclose

import usdhand
from usdhand.anatomy.channels import Channels
from usdhand.motion import forward_kinematics

ADA = REPOSITORY / "samples" / "gestures" / "ok_01.usdc"


@pytest.mark.parametrize(
    ("top", "signs"),
    [
        ("LeftShoulder", (-1, 1, 1)),
        ("RightHand", (1, 1, -1)),
        ("RightArm", (-1, -1, -1)),
        ("LeftForeArm", (-1, 1, -1)),
        ("RightHandIndex1", (1, -1, 1)),
    ],
)
def test_the_same_angles_and_the_same_pose(
    tmp_path: Path, top: str, signs: tuple[int, ...]
) -> None:
    plain = usdhand.read_clip(ADA)
    mirrored = usdhand.read_clip(mirror_below(ADA, tmp_path / "mirrored.usdc", top, signs))
    assert (mirrored.scales < 0).any() == (np.prod(signs) < 0)
    hands, theirs = usdhand.find_hands(plain), usdhand.find_hands(mirrored)
    channels = hands.encode(plain)
    assert_allclose(theirs.encode(mirrored).values, channels.values, atol=2e-3)
    wave = 20.0 * np.sin(np.arange(channels.values.size)).reshape(channels.values.shape)
    other = Channels(channels.names, channels.values + wave)
    expected, found = (
        forward_kinematics(h.decode(other, c)).positions
        for h, c in ((hands, plain), (theirs, mirrored))
    )
    assert_allclose(found, expected, atol=1e-3)
