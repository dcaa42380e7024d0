"""Splice on pairs whose true alignment is known: samples always, real takes where they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from builders.known_pairs import (
    Pair,
    arms_only,
    known_pair,
    known_pairs,
    natural_offset,
    with_other_axes,
)
from builders.spliced_pairs import VISIBLE_S, real, sample, spliced
from conftest import REPOSITORY, shared_data

from usdhand import find_hands, read_clip
from usdhand.anatomy import SIDES, Side
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.resample import resample
from usdhand.splice.merge import fingers_along, with_fingers
from usdhand.splice.method import splice
from usdhand.splice.settings import Align, SpliceSettings

SAMPLES = REPOSITORY / "samples"
REAL = pytest.mark.real_data


def check(pair: Pair) -> None:
    result = spliced(pair)
    true = pair.source_channels()
    assert set(result.hands) == set(SIDES)
    for side, alignment in result.hands.items():
        moving = pair.moving(side)
        full = np.abs(pair.error(alignment.warp[:, 1])[moving])
        first = np.abs(pair.error(alignment.phase_warp)[moving])
        for error in (full, first):
            assert np.median(error) < 0.015
            assert np.percentile(error, 95) < 0.05
            assert error.max() < VISIBLE_S
        assert np.median(full) < np.median(first) + 0.002
        assert (np.diff(alignment.warp[:, 1]) >= 0).all()
        ours = pair.body_hands.encode(result.clip).select(alignment.channels).values
        assert np.sqrt(np.mean((ours - true.select(alignment.channels).values) ** 2)) < 2.0


def test_a_sample_conversation() -> None:
    check(sample())


@pytest.mark.real_data
@pytest.mark.parametrize("index", [0, 6, 20, 40])
def test_real_takes(index: int) -> None:
    check(real(index))


@pytest.mark.slow
@pytest.mark.real_data
def test_all_real_takes_by_local_turns_and_by_trunks() -> None:
    """The figures of docs/splice-figures.md, with other warps, turns and noise than there."""
    pairs = known_pairs(shared_data("studiogalt", "full"))
    errors: dict[str, list[np.ndarray]] = {"full": [], "first": []}
    for i, (body, hands) in enumerate(pairs):
        pair = known_pair(body, hands, 3000 + i)
        result = spliced(pair, SpliceSettings(align="trunk" if i % 2 else "local"))
        for side, alignment in result.hands.items():
            moving = pair.moving(side)
            errors["full"].append(np.abs(pair.error(alignment.warp[:, 1])[moving]))
            errors["first"].append(np.abs(pair.error(alignment.phase_warp)[moving]))
    full, first = (np.concatenate(errors[name]) for name in ("full", "first"))
    for error in (full, first):
        assert np.median(error) < 0.01
        assert np.percentile(error, 95) < 0.05
    assert np.mean(full > VISIBLE_S) < 0.001
    assert np.mean(first > VISIBLE_S) < 0.01
    for statistic in (np.median, np.max, lambda e: np.percentile(e, 95)):
        assert statistic(full) < statistic(first)


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name",
    [
        "SG_ASL_Abate_2_2023_2_3",
        "SG_ASL_Abscond_2023_2_8",
        "SG_ASL_7_2023_1_29",  # of the left hand, little but the clip's first frames moves
        "SG_ASL_ABC_2023_2_3",
    ],
)
def test_both_rigs_of_a_take_within_a_frame_without_being_told(name: str) -> None:
    mini = shared_data("studiogalt", "mini")
    a, b = read_clip(mini.parent / "full" / f"{name}.usdc"), read_clip(mini / f"{name}.usdc")
    hands_a, hands_b = find_hands(a), find_hands(b)
    first, second = natural_offset(a, b, hands_a, hands_b)
    result = splice(a, b, hands_a, hands_b)
    pair = Pair(name, a, b, hands_a, hands_b, b, np.empty(0))
    assert set(result.hands) == set(SIDES)
    for side, alignment in result.hands.items():
        frames = np.flatnonzero(pair.moving(side))
        off = alignment.warp[frames, 1] * b.fps - (frames - first + second)
        assert np.abs(off).max() <= 1.0


def test_only_fingers_change() -> None:
    pair = sample()
    result = spliced(pair)
    fingers = [int(j) for f in pair.body_hands.frames.values() for j in f.joints]
    others = np.setdiff1d(np.arange(len(pair.body.skeleton)), fingers)
    assert np.array_equal(result.clip.rotations[:, others], pair.body.rotations[:, others])
    assert result.clip.translations is pair.body.translations


@pytest.mark.parametrize("make", [sample, pytest.param(lambda: real(9), marks=REAL)])
def test_fingers_accelerate_no_more_than_with_the_true_warp(make: Callable[[], Pair]) -> None:
    pair = make()

    def largest(clip: Clip) -> float:
        values = pair.body_hands.encode(clip).values
        return float(np.abs(np.diff(values, n=2, axis=0)).max())

    true = pair.body
    for side, frames in pair.body_hands.frames.items():
        own = pair.hand_hands.frames[side]
        true = with_fingers(true, frames, fingers_along(pair.hands, own, frames.names, pair.truth))
    assert largest(spliced(pair).clip) < 1.3 * largest(true)


def test_wrists_come_along_where_wanted() -> None:
    pair = sample()
    hands = resample(pair.source, 60.0)
    result = splice(
        pair.body, hands, pair.body_hands, find_hands(hands), SpliceSettings(wrist="hands")
    )
    for hand in pair.body_hands.character.hands.values():
        turned = rot.angle_between(
            result.clip.rotations[:, hand.wrist], pair.source.rotations[:, hand.wrist]
        )
        assert turned.max() < 3.0
    other = pair.body.rotations.copy()
    other[:, [h.wrist for h in pair.body_hands.character.hands.values()]] = rot.IDENTITY
    fixed = splice(
        pair.body.with_rotations(other),
        hands,
        pair.body_hands,
        find_hands(hands),
        SpliceSettings(wrist="hands"),
    )
    for side, hand in pair.body_hands.character.hands.items():
        at = fixed.hands[side].warp[:, 1] * 30.0
        wanted = pair.source.rotations[np.rint(at).astype(int), hand.wrist]
        apart = rot.angle_between(fixed.clip.rotations[:, hand.wrist], wanted)
        assert np.median(apart) < 2.0


@pytest.mark.real_data
@pytest.mark.parametrize("how", ["local", "trunk"])
def test_rigs_with_other_axes_give_the_same(how: Align) -> None:
    """And wrists of another rig come as they were captured on this one."""
    full = shared_data("studiogalt", "full") / "SG_ASL_Abscond_2023_2_8.usdc"
    a, b = read_clip(full), read_clip(full.parent.parent / "mini" / full.name)
    wrists = [h.wrist for h in find_hands(a).character.hands.values()]
    stiff = a.rotations.copy()
    stiff[:, wrists] = stiff[:1, wrists]
    settings = SpliceSettings(align=how, wrist="hands")

    def result(body: Clip, hands: Clip) -> Clip:
        return splice(body, hands, find_hands(body), find_hands(hands), settings).clip

    plain = result(a.with_rotations(stiff), b)
    turned = rot.angle_between(plain.rotations[:, wrists], a.rotations[:, wrists])
    assert turned.max() < 1.5
    other = result(with_other_axes(a.with_rotations(stiff), 1), with_other_axes(b, 2))
    ours, theirs = (forward_kinematics(clip).positions for clip in (plain, other))
    assert np.abs(ours - theirs).max() < 0.01


@pytest.mark.real_data
def test_a_hand_that_hardly_moves_follows_the_other() -> None:
    """Of 7 the left hand goes a centimetre, the right one 30."""
    full = shared_data("studiogalt", "full") / "SG_ASL_7_2023_1_29.usdc"
    a, b = read_clip(full), read_clip(full.parent.parent / "mini" / full.name)
    result = splice(a, b, find_hands(a), find_hands(b))
    assert result.hands["left"].taken_from == "right"
    assert np.array_equal(result.hands["left"].warp, result.hands["right"].warp)
    assert any("left hand hardly moves" in str(note) for note in result.problems)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("sides", "role"), [(("left", "right"), "elbow"), (("right",), "elbow"), (("right",), "wrist")]
)
def test_forearms_or_hands_alone(sides: tuple[Side, ...], role: str) -> None:
    pair = real(20)
    hands = pair.hand_hands.character.hands
    part = arms_only(pair.hands, [getattr(hands[side], role) for side in sides])
    result = splice(pair.body, part, pair.body_hands, find_hands(part))
    assert tuple(result.hands) == sides
    for side, alignment in result.hands.items():
        assert alignment.origins[1] == "the room"
        error = np.abs(pair.error(alignment.warp[:, 1])[pair.moving(side)])
        assert np.median(error) < 0.01
        assert error.max() < VISIBLE_S


@pytest.mark.real_data
def test_size_rate_and_start_do_not_matter() -> None:
    full = shared_data("studiogalt", "full") / "SG_ASL_Abhor_2_2023_2_4.usdc"
    a, b = read_clip(full), read_clip(full.parent.parent / "mini" / full.name)
    hands = find_hands(a), find_hands(b)
    plain = splice(a, b, *hands).hands
    tiny = replace(
        b,
        translations=0.01 * b.translations,
        skeleton=replace(b.skeleton, bind=_scaled(b.skeleton.bind), rest=_scaled(b.skeleton.rest)),
        origin=replace(b.origin, first_time_code=1001.0),
    )
    for clip, tolerance in ((tiny, 1e-4), (resample(b, 24.0), 0.02), (resample(b, 120.0), 0.004)):
        other = splice(a, clip, hands[0], find_hands(clip)).hands
        for side, alignment in other.items():
            apart = np.abs(alignment.warp[:, 1] - plain[side].warp[:, 1])
            assert np.median(apart) < tolerance
            assert apart.max() < 5 * tolerance


def _scaled(matrices: np.ndarray) -> np.ndarray:
    """Matrices whose translation is a hundredth of what it was."""
    scaled = matrices.copy()
    scaled[:, :3, 3] *= 0.01
    return scaled


@pytest.mark.parametrize("how", ["local", "trunk"])
def test_a_turned_clip_is_aligned_as_well(how: str) -> None:
    pair = sample()
    result = spliced(pair, SpliceSettings(align=how))  # type: ignore[arg-type]
    assert set(result.hands) == set(SIDES)
    for side, alignment in result.hands.items():
        error = np.abs(pair.error(alignment.warp[:, 1])[pair.moving(side)])
        assert np.median(error) < 0.025
