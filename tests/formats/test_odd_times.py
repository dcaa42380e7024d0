"""Time codes that are no frames, keys between frames, and ranges that were cut."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builders import stages
from builders.cli_runner import run
from hypothesis import given
from hypothesis import strategies as st
from oracles.usdskel import joint_worlds

from usdhand import read_clip
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.write import write_motion
from usdhand.motion.timing import Clock, find_timing

RATES = (24.0, 25.0, 30.0, 30000 / 1001, 50.0, 60.0, 120.0)
FINGERS = range(6, len(stages.JOINTS))
BODY = slice(0, 6)


def written(source: Path, out: Path) -> Path:
    """The result of a verb that changes the fingers, and nothing else."""
    clip = read_clip(source)
    write_motion(find_character(source), clip, list(FINGERS), out)
    return out


def assert_same_body(source: Path, out: Path, times: list[float]) -> None:
    between = [(a + b) / 2 for a, b in pairwise(times)]
    at = np.array([*times, *between])
    a, b = (joint_worlds(path, stages.SKELETON, at)[:, BODY] for path in (source, out))
    assert np.abs(a - b).max() < 1e-3  # 0.01 mm


@given(
    fps=st.sampled_from(RATES),
    unit=st.sampled_from([(1.0, 2), (1.0, 3), (1.0, 4), (1000.0, 0), (1000.0, 1)]),
    start=st.sampled_from([0.0, 3.2, 100.0]),
    gaps=st.sets(st.integers(1, 38), max_size=12),
)
def test_rounded_seconds_and_milliseconds(
    fps: float, unit: tuple[float, int], start: float, gaps: set[int]
) -> None:
    per_second, digits = unit
    if digits == 2 and fps > 60.0:
        return  # two digits do not tell frames that near
    frames = np.array([i for i in range(40) if i not in gaps])
    keys = np.round((start + frames / fps) * per_second, digits)
    said = per_second if per_second == 1.0 else 24.0
    timing = find_timing([keys], Clock(per_second, said))
    assert timing.fps == pytest.approx(fps, rel=2e-3)
    assert timing.count == 40
    assert set(keys) <= set(timing.times)


@pytest.mark.parametrize("rate", [1.0, 1000.0])
@pytest.mark.parametrize("gaps", [(), (3,), (2, 5, 6)])
def test_no_sample_is_lost(tmp_path: Path, rate: float, gaps: tuple[int, ...]) -> None:
    digits = 3 if rate == 1.0 else 0
    times = [round(rate * i / 30.0, digits) for i in range(12) if i not in gaps]
    source = stages.character(
        tmp_path / "a.usda", rate=rate, times=times, start=times[0], end=times[-1]
    )
    clip = read_clip(source)
    assert (clip.fps, len(clip)) == (30.0, 12)
    assert "guessed-fps" in {problem.code for problem in clip.problems}
    assert_same_body(source, written(source, tmp_path / "b.usda"), times)


@given(
    st.lists(st.integers(0, 2000), min_size=2, max_size=12, unique=True).map(
        lambda codes: [code / 97.0 for code in sorted(codes)]
    )
)
def test_keys_off_the_grid_stay(times: list[float]) -> None:
    timing = find_timing([np.array(times)], Clock(24.0, 24.0))
    own = timing.all_times
    assert (np.diff(own) > 0).all()
    assert np.abs(own[:, None] - np.array(times)).min(axis=0).max() < 1e-6 * timing.step
    assert np.abs(own[:, None] - timing.times).min(axis=0).max() < 1e-6 * timing.step


@pytest.mark.parametrize("times", [[1.0, 2.0, 3.3, 7.0, 9.1], [0.5, 1.7, 4.2, 4.9, 8.0, 8.03]])
def test_the_body_keeps_its_own_keys(tmp_path: Path, times: list[float]) -> None:
    source = stages.character(tmp_path / "a.usda", times=times, start=times[0], end=times[-1])
    for name in ("b.usda", "b.usdc"):
        out = written(source, tmp_path / name)
        assert_same_body(source, out, times)
    clip, found = read_clip(source), read_clip(tmp_path / "b.usda")
    assert found.time_codes[0] == clip.time_codes[0]


def test_a_range_that_was_cut_stays_cut(tmp_path: Path) -> None:
    source = stages.character(tmp_path / "a.usda", start=4.0, end=9.0)
    out = written(source, tmp_path / "b.usda")
    stage = stages.edited(out)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (4.0, 9.0)
    run("convert", source, "-o", tmp_path / "c.usda")
    stage = stages.edited(tmp_path / "c.usda")
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (4.0, 9.0)
    run("convert", source, "-o", tmp_path / "d.usda", "--trim", "2:6")
    stage = stages.edited(tmp_path / "d.usda")
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (2.0, 6.0)


def test_motion_beyond_its_samples_widens_a_range(tmp_path: Path) -> None:
    source = stages.character(tmp_path / "a.usda", start=None, end=None)
    stage = stages.edited(written(source, tmp_path / "b.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1.0, 12.0)
