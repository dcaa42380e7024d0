"""Fill and its library take what they are given to the end, and in proportion to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from builders.clips import frames_of
from builders.cost import processor_seconds
from builders.long_clips import followed_by, long_clip, still_clip
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import fill_2012 as oracle

from usdhand import find_hands
from usdhand.evaluate.agreement import label_agreement
from usdhand.evaluate.reconstruction import reconstruction_errors
from usdhand.fill.duplicates import LONGEST_OFFSET_S, SMALLEST_OVERLAP, FeatureCurve
from usdhand.fill.duplicates import _same_at_one_offset as same_at_one_offset
from usdhand.fill.library import ARM_FPS, MotionLibrary, library_clip
from usdhand.fill.method import fill
from usdhand.fill.results import Filled
from usdhand.fill.segment import segments
from usdhand.fill.settings import FillSettings, Segmentation
from usdhand.motion import Clip
from usdhand.motion.rotations import Array
from usdhand.search import nearest

HOUR = 3600.0


def library_of(*clips: Clip) -> MotionLibrary:
    entries = (
        library_clip(
            clip,
            find_hands(clip),
            Segmentation(),
            path=f"{clip.name}.usdc",
            content_hash=clip.name,
            label=clip.name[0],
        )
        for clip in clips
    )
    return MotionLibrary(tuple(entries))


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    return library_of(*(long_clip(20, seed=i, name=f"{'ab'[i % 2]}{i}") for i in range(1, 5)))


def filled(body: Clip, library: MotionLibrary) -> Filled:
    return fill(body, find_hands(body), library, sides=("left",), replace_motion=True)


@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.integers(1, 5), st.integers(0, 9))
@settings(max_examples=100)
def test_holds_are_cut_as_the_slow_version_cuts_them(
    seed: int, frames: int, shortest: int, more: int
) -> None:
    """Equal speeds all along, or in long runs: the earliest counts, as often as it takes."""
    random = np.random.default_rng(seed)
    speed = np.repeat(random.integers(0, 4, frames), random.integers(1, 40, frames)).astype(float)
    cutting = Segmentation(1.5, float(shortest), float(2 * shortest + more))
    found = segments(speed, 1.0, cutting)
    assert found == oracle.segments(speed.tolist(), 1.5, shortest, 2 * shortest + more)


def test_eight_hours_of_stillness_are_cut() -> None:
    frames = int(8 * HOUR * ARM_FPS)
    found = segments(np.zeros(frames), ARM_FPS, Segmentation())
    assert found[0][0] == 0
    assert found[-1][1] == frames - 1
    assert {b - a for a, b in found[:-1]} == {8}  # a quarter of a second each


@pytest.mark.parametrize("kind", ["still", "noise", "waves"])
def test_cutting_grows_with_the_motion(kind: str) -> None:
    """Twelve times the frames: if every frame met every other, 144 times the work."""
    random = np.random.default_rng(1)

    def seconds(frames: int) -> float:
        speed = {
            "still": np.zeros(frames),
            "noise": 15.0 + 10.0 * random.normal(size=frames),
            "waves": 15.0 + 10.0 * np.sin(np.arange(frames) / 7.0),
        }[kind]
        begun = processor_seconds()
        for _ in range(3):
            segments(speed, ARM_FPS, Segmentation())
        return processor_seconds() - begun

    seconds(1000)
    assert seconds(240_000) < 48 * max(seconds(20_000), 0.02)


def test_an_hour_of_gestures_is_filled(library: MotionLibrary) -> None:
    body = long_clip(HOUR, seed=77)
    result = filled(body, library)
    [part] = result.parts
    choices = part.alternatives[0].choices
    assert len(choices) > HOUR / 2
    assert choices[-1].end == pytest.approx(HOUR, abs=0.1)
    changed = np.ptp(result.clips[0].rotations[:, list(result.changed)], axis=0)
    assert (changed.max(axis=1) > 0.01).all()


def test_an_hour_of_stillness_is_filled_with_one_pose(library: MotionLibrary) -> None:
    body = still_clip(HOUR)
    result = filled(body, library)
    assert result.still == ("left",)
    assert np.ptp(result.clips[0].rotations, axis=0).max() < 1e-9


def test_a_hold_between_gestures_is_filled(library: MotionLibrary) -> None:
    body = followed_by(long_clip(20, seed=9), still_clip(HOUR / 2), long_clip(20, seed=10))
    result = filled(body, library)
    assert result.still == ()
    assert np.isfinite(result.clips[0].rotations).all()
    assert result.parts[0].alternatives[0].choices[-1].end == pytest.approx(body.duration, abs=0.2)


def test_a_library_keeps_an_hour_of_gestures_and_a_hold() -> None:
    moving, hold = long_clip(HOUR), still_clip(HOUR)
    held = hold.with_rotations(np.broadcast_to(moving.rotations[-1], hold.rotations.shape))
    library = library_of(replace(followed_by(moving, held), name="long"))
    for hand in library.clips[0].hands.values():
        assert len(hand.segments) > HOUR
        assert hand.segments[-1][1] == pytest.approx(2 * HOUR * ARM_FPS, abs=10)
    body = long_clip(20, seed=3)
    assert filled(body, library).parts[0].usable > HOUR


def test_a_still_clip_is_no_material() -> None:
    assert library_of(still_clip(HOUR)).clips[0].hands == {}


def test_cuts_of_a_hold_are_one_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """A body that holds the pose that a library holds: every cut is as near to every other."""
    answered: list[int] = []

    def counted(*arguments: object) -> object:
        answered.append(1)
        return nearest_search(*arguments)  # type: ignore[arg-type]

    nearest_search = nearest.nearest
    monkeypatch.setattr(nearest, "nearest", counted)
    gestures = long_clip(60, fps=15.0, seed=1)
    hold = frames_of(gestures, np.full(900, 40))
    library = library_of(replace(followed_by(gestures, hold), name="held"))
    body = followed_by(long_clip(60, fps=15.0, seed=2), hold)
    choices = filled(body, library).parts[0].alternatives[0].choices
    held = [choice for choice in choices if choice.start > 62.0]
    assert len(held) > 200
    assert len(answered) < len(choices) - len(held) + 20
    assert {choice.nearest.cost for choice in held[:-3]} == {0.0}


def test_the_fingers_of_a_long_clip_are_compared_with_the_truth(library: MotionLibrary) -> None:
    clip = long_clip(HOUR / 4, seed=8)
    errors = reconstruction_errors(clip, find_hands(clip), library, FillSettings(), sides=("left",))
    assert {e.method for e in errors} >= {"fill", "nearest", "rest pose"}
    assert all(np.isfinite([e.degrees, e.fingertip_mm, e.jerk]).all() for e in errors)


def test_labels_of_a_long_hold_are_compared(library: MotionLibrary) -> None:
    held = followed_by(long_clip(20, seed=5), still_clip(HOUR / 4))
    more = library_of(replace(held, name="a9"))
    both = MotionLibrary((*library.clips, *more.clips))
    [agreement] = label_agreement(both, k=2)[:1]
    assert agreement.labels == ("a", "b")
    assert agreement.segments > HOUR / 4
    assert 0.0 <= agreement.share <= 1.0


@given(st.integers(0, 2**32 - 1), st.integers(20, 90), st.integers(-40, 40), st.floats(0.2, 2.0))
@settings(max_examples=150)
def test_offsets_that_samples_rule_out_are_none(
    seed: int, frames: int, offset: int, size: float
) -> None:
    """The guard looks at a few frames first; what it finds is what looking at all would."""
    random = np.random.default_rng(seed)
    whole = np.cumsum(random.normal(size=(frames + 80, 3)), axis=0)
    one = whole[40 : 40 + frames]
    other = whole[40 + offset : 40 + offset + frames] + size * random.normal(size=one.shape)
    pairs = [(FeatureCurve(one), FeatureCurve(other))]

    def near(shift: int) -> bool:
        count = frames - abs(shift)
        if count < SMALLEST_OVERLAP * frames:
            return False
        away = one[max(-shift, 0) :][:count] - other[max(shift, 0) :][:count]
        return float(np.sqrt(np.mean(away**2))) < 1.0

    most = int(LONGEST_OFFSET_S * ARM_FPS)
    wanted = any(near(shift) for shift in range(-most, most + 1))
    assert same_at_one_offset(pairs, 1.0, 0.0) == wanted


def test_what_a_search_leaves_out_is_left_out_for_all(library: MotionLibrary) -> None:
    """Clips of the body itself are excluded however many there are."""
    body = long_clip(20, seed=2, name="b2")
    own = [replace(library.clips[1], name=f"copy{i}") for i in range(200)]
    crowded = MotionLibrary((*own, *library.clips))
    left: Array = np.array([name.startswith("copy") for name in filled(body, crowded).left_out])
    assert left.sum() == 200
    used = {
        crowded.clips[int(part.space.clips[c.segment])].name
        for part in filled(body, crowded).parts
        for choice in part.alternatives[0].choices
        for c in choice.candidates
    }
    assert not {name for name in used if name.startswith("copy") or name == "b2"}
