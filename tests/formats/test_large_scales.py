"""Scales that half precision cannot hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from builders.in_memory import sample

import usdhand
from usdhand.errors import InputError


@pytest.mark.parametrize("moving", [False, True])
def test_scales_beyond_half_precision_are_refused(moving: bool, tmp_path: Path) -> None:
    clip = sample("gestures/ok_01")
    scales = clip.scales.copy()
    scales[-1 if moving else slice(None), 5, 0] = 1e5
    with pytest.raises(InputError, match=r"scales at time code .* are too large for USD"):
        usdhand.write_new(replace(clip, scales=scales, source=None), tmp_path / "a.usdc")
    assert not list(tmp_path.iterdir())
