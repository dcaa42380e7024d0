"""Frame rates and frames behind the keys of glTF files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from builders.gltf_agreement import assert_agrees, read
from builders.gltf_files import moving_arm, turns

from usdhand.motion import rotations as rot

RATES = [24, 25, 30, 48, 50, 60, 90, 100, 120, 12.5, 15, 24000 / 1001, 30000 / 1001, 60000 / 1001]


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("start", [0.0, 1.0, 3600.0])
def test_rates(fps: float, start: float, tmp_path: Path) -> None:
    times = start + np.arange(150) / fps
    file = moving_arm(times)
    clip = read(file, tmp_path)
    assert clip.fps == pytest.approx(fps, rel=1e-6)
    assert len(clip) == 150
    assert clip.start == pytest.approx(start, abs=1e-3)
    assert clip.times == pytest.approx(times, abs=1e-3)
    assert rot.angle_between(clip.rotations[:, 2], turns(150, 2)).max() < 1e-4
    assert clip.origin.time_codes_per_second == clip.fps
    assert "guessed-fps" not in [p.code for p in clip.problems]


@pytest.mark.parametrize("fps", [24, 30, 60])
def test_rounded_and_summed_times(fps: float, tmp_path: Path) -> None:
    """Milliseconds, and single precision summed frame by frame, still are frames."""
    summed = np.cumsum(np.full(600, np.float32(1 / fps), np.float32), dtype=np.float32)
    for times in (np.round(np.arange(600) / fps, 3), summed):
        clip = read(moving_arm(times), tmp_path)
        assert clip.fps == fps
        assert len(clip) == 600
        assert rot.angle_between(clip.rotations[:, 2], turns(600, 2)).max() < 1e-4


def test_keys_with_gaps_lie_on_frames(tmp_path: Path) -> None:
    frames = np.array([0, 1, 2, 7, 8, 30, 31, 60])
    clip = read(moving_arm(frames / 60.0), tmp_path)
    assert (clip.fps, len(clip)) == (60.0, 61)
    assert rot.angle_between(clip.rotations[frames, 2], turns(8, 2)).max() < 1e-4
    assert not clip.problems
    assert_agrees(tmp_path / "take.glb", clip, stride=7)


def test_sparse_keys_leave_the_rate_open(tmp_path: Path) -> None:
    clip = read(moving_arm(np.array([0.0, 0.5, 2.0])), tmp_path)
    assert (clip.fps, len(clip)) == (24.0, 49)
    [note] = clip.problems
    assert (note.code, note.severity) == ("guessed-fps", "note")
    assert "24 frames a second" in note.message
    assert_agrees(tmp_path / "take.glb", clip, stride=7)


def test_unsteady_keys_are_resampled(tmp_path: Path) -> None:
    times = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.05, 80))
    clip = read(moving_arm(times), tmp_path)
    assert clip.fps == 30.0
    assert clip.start == pytest.approx(times[0])
    [note] = clip.problems
    assert note.code == "guessed-fps"
    assert "resampled at 30" in note.message
    assert_agrees(tmp_path / "take.glb", clip, stride=9)


def test_one_key_is_one_frame(tmp_path: Path) -> None:
    clip = read(moving_arm(np.array([2.0])), tmp_path)
    assert len(clip) == 1
    assert clip.start == 2.0


def test_a_jump_is_no_frame(tmp_path: Path) -> None:
    """Exporters of held poses put two keys at nearly one time."""
    file = moving_arm(np.arange(20) / 24.0)
    times = np.array([0.0, 5 / 24 - 1e-6, 5 / 24, 19 / 24])
    file.curve(3, "translation", times, np.repeat([[0.0, 0, 0], [1, 0, 0]], 2, axis=0))
    clip = read(file, tmp_path)
    assert (clip.fps, len(clip)) == (24.0, 20)
    assert clip.translations[:, 3, 0] == pytest.approx([0.0] * 5 + [100.0] * 15)
