"""Many clips: names are told apart and characters grouped in a pass."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cost import at_most, function_calls
from builders.long_clips import long_clip, still_clip
from hypothesis import given
from hypothesis import strategies as st

from usdhand import build_library, read_library, reduce_hands, write_library, write_new
from usdhand.errors import InputError
from usdhand.fill.library import LibraryClip, MotionLibrary
from usdhand.formats.usd.library import _prim_names as prim_names
from usdhand.motion import Clip
from usdhand.motion.skeleton import same_bind
from usdhand.reduce.settings import ReduceSettings
from usdhand.report.preview.events import read_report
from usdhand.verbs import clips as clips_verb
from usdhand.verbs.clips import characters
from usdhand.verbs.library import _unique_names as unique_names

HOUR = 3600.0


def slowly_named(paths: list[Path]) -> list[str]:
    """Names as they were always given, one looked up among all others."""
    stems = [path.stem for path in paths]
    names: list[str] = []
    for path in paths:
        repeated = stems.count(path.stem) > 1
        wanted = f"{path.parent.name}_{path.stem}" if repeated else path.stem
        name, number = wanted, 1
        while name in names or (name != path.stem and name in stems):
            number += 1
            name = f"{wanted}_{number}"
        names.append(name)
    return names


words = st.sampled_from(["a", "b", "a_b", "b_2", "a_b_2", "a_a", "a_a_2"])


@given(st.lists(st.tuples(words, words, words, st.sampled_from([".usd", ".bvh"])), unique=True))
def test_clips_get_the_names_they_always_got(parts: list[tuple[str, str, str, str]]) -> None:
    paths = [Path("/shots", one, two, stem + suffix) for one, two, stem, suffix in parts]
    found = unique_names(paths)
    assert found == slowly_named(paths)
    assert len(set(found)) == len(found)


def test_ten_thousand_clips_of_one_name_are_told_apart() -> None:
    paths = [Path(f"/shots/{i}/anim/take.usdc") for i in range(10_000)]
    with at_most(3.0):
        found = unique_names(paths)
    assert found[:2] == ["anim_take", "anim_take_2"]
    assert found[-1] == "anim_take_10000"


def test_ten_thousand_names_that_usd_cannot_tell_apart_are() -> None:
    one = LibraryClip("", "", "", "", "", 1.0, 1.0, 1.0, "", {})
    clips = tuple(replace(one, name=chr(0x4E00 + i)) for i in range(10_000))
    with at_most(3.0):
        found = prim_names(MotionLibrary(clips))
    assert len(set(found)) == 10_000
    assert found[0] == found[1].removesuffix("_2")


def clips_of(counts: list[int]) -> Iterator[Clip]:
    """So many clips of each of some characters, one of each in turn; equal to within noise."""
    one = still_clip(1.0)
    random = np.random.default_rng(3)
    left = list(counts)
    while any(left):
        for number, more in enumerate(left):
            if more:
                left[number] -= 1
                bind = one.skeleton.bind * (1.0 + 0.1 * number)
                noise = 1e-6 * random.normal(size=bind.shape)
                yield replace(one, skeleton=replace(one.skeleton, bind=bind + noise))


def test_clips_of_a_character_are_grouped(monkeypatch: pytest.MonkeyPatch) -> None:
    """With one of each character, not with one another."""
    compared: list[int] = []
    monkeypatch.setattr(clips_verb, "same_bind", lambda a, b: compared.append(1) or same_bind(a, b))
    clips = list(clips_of([100, 50, 50]))
    groups = characters(clips)
    sizes = [len(group) for group in groups]
    assert sizes[:3] == [100, 50, 50]
    assert all(any(clip is own for own in group) for clip, group in zip(clips, groups, strict=True))
    assert len({id(group) for group in groups}) == 3
    assert len(compared) <= 3 * len(clips)
    other = replace(clips[0].skeleton, joints=tuple(f"x/{j}" for j in clips[0].skeleton.joints))
    assert len(characters([*clips, replace(clips[0], skeleton=other)])[-1]) == 1


def test_reducing_grows_with_the_number_of_clips() -> None:
    clips = [long_clip(2, seed=i, name=f"c{i}") for i in range(24)]
    reduce_hands(clips[:2])

    def calls(count: int) -> int:
        return function_calls(lambda: reduce_hands(clips[:count]))

    assert calls(24) < 6 * calls(6)  # four times as many; sixteen times if each met all others


@pytest.mark.parametrize("settings", [ReduceSettings(), ReduceSettings(free_channels=10)])
def test_an_hour_is_reduced(settings: ReduceSettings) -> None:
    [reduction] = reduce_hands([long_clip(HOUR)], settings)
    assert 0 < len(reduction.rig.free) <= 50
    assert len(reduction.motion) == len(reduction.clip)
    assert np.isfinite(reduction.errors.rms).all()


@pytest.mark.parametrize(
    "settings",
    [ReduceSettings(), ReduceSettings(free_channels=10), ReduceSettings(max_error=1.0)],
)
def test_an_hour_of_stillness_is_constant(settings: ReduceSettings) -> None:
    [reduction] = reduce_hands([still_clip(HOUR)], settings)
    assert reduction.rig.free == ()
    assert reduction.errors.max_deg < 1e-6


def test_a_library_is_built_of_long_and_of_still_files(tmp_path: Path) -> None:
    paths = [tmp_path / "long_01.usdc", tmp_path / "still_01.usdc"]
    write_new(long_clip(HOUR, fps=3.0), paths[0])
    write_new(still_clip(HOUR, fps=3.0), paths[1])
    built = build_library(paths, tmp_path / "library.usdc")
    [clip] = built.library.clips
    assert clip.name == "long_01"
    [left] = built.library.left_out
    assert left.file == "still_01.usdc"
    assert "do not move" in left.message
    write_library(built.library, tmp_path / "library.usdc")
    [again] = read_library(tmp_path / "library.usdc").clips
    assert again.hands["left"].segments == clip.hands["left"].segments
    assert len(again.hands["left"].segments) > HOUR


def test_a_report_nested_without_end_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "deep.json"
    file.write_text("[" * 100_000 + "]" * 100_000)
    with pytest.raises(RecursionError):
        json.loads(file.read_text())
    with pytest.raises(InputError, match=r"deep\.json"):
        read_report(file)
