"""A disk that is full at any write: see `full_disk`, which needs a drive of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("full_disk.py")
APART = ("unshare", "--map-root-user", "--mount")


@pytest.fixture(scope="module", autouse=True)
def _drives_can_be_made() -> None:
    try:
        made = subprocess.run(
            [*APART, "mount", "-t", "tmpfs", "tmpfs", "/mnt"], capture_output=True
        )
    except OSError:
        pytest.skip("this system has no unshare")
    if made.returncode:
        pytest.skip("no drive can be made here, which needs namespaces of users")


def times_full(*arguments: object) -> int:
    command = [*APART, sys.executable, str(SCRIPT), *map(str, arguments)]
    path = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ) | path)
    assert done.returncode == 0, done.stderr
    return int(done.stdout.split()[-1])


@pytest.mark.slow
def test_some_sizes_leave_old_files_or_new_ones() -> None:
    assert times_full(2) > 20


@pytest.mark.slow
def test_all_sizes_leave_old_files_or_new_ones() -> None:
    assert times_full(0) > 300
