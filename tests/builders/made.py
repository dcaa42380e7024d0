"""What tests of several rooms are given: the command line, a rig, a library, a body.

A plugin of the tests: all of them know its fixtures.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from builders import cli_runner
from click.testing import Result

import usdhand
from usdhand.fill.library import MotionLibrary
from usdhand.formats.usd.library import read_library
from usdhand.motion import Clip

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
OK = SAMPLES / "gestures" / "ok_01.usdc"
BEN = SAMPLES / "characters" / "ben.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
FULL = SAMPLES / "conversations" / "talk_01_full.usdc"
Run = Callable[..., Result]


@pytest.fixture
def run() -> Run:
    return cli_runner.run


@pytest.fixture
def rig(run: Run, tmp_path: Path) -> Path:
    path = tmp_path / "ok_rig.usda"
    run("reduce", OK, "-o", path)
    return path


@pytest.fixture(scope="session")
def library(gestures_library: Path) -> MotionLibrary:
    return read_library(gestures_library)


@pytest.fixture(scope="session")
def body() -> Clip:
    return usdhand.read_clip(BODY)
