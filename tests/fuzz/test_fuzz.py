"""Damaged files of every kind work, are refused in words, or are told to crash USD."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
CORPUS = sorted(p for p in (HERE / "corpus").iterdir() if p.is_file())
posix = pytest.mark.skipif(sys.platform == "win32", reason="this system has no fork")


def campaign(*options: object) -> str:
    command = [sys.executable, str(HERE / "campaign.py"), *map(str, options)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@posix
def test_damaged_files() -> None:
    assert "400 tries" in campaign("--tries", 400)


@posix
@pytest.mark.slow
def test_two_thousand_damaged_files() -> None:
    assert "2000 tries" in campaign("--tries", 2000, "--seed", 1)


@posix
def test_inputs_that_ever_failed() -> None:
    assert f"{len(CORPUS)} tries" in campaign("--corpus", HERE / "corpus")
