"""Reduced rigs: evaluated in the right order, edited rigs too, and refused where they are wrong."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from builders.clips import frames_of
from builders.moving_hands import hand_map, moved, random_turns, skeleton
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from usdhand.anatomy.channels import Channels, Hands
from usdhand.anatomy.hand import SIDES, CharacterMap
from usdhand.errors import InputError, UsageError
from usdhand.motion import Clip
from usdhand.reduce.method import apply_rig, expand, fit_rig
from usdhand.reduce.rig import ReducedRig, Relation, evaluation_order
from usdhand.reduce.settings import PRESETS, Target, Thresholds


def linear(name: str, *controllers: str, slope: float = 2.0, offset: float = 1.0) -> Relation:
    slopes = (slope,) * len(controllers)
    return Relation(name, "linear", offset, controllers, slopes)


FREE = Channels(("a",), np.arange(4.0)[:, None])


@given(
    st.permutations([Relation("a", "free"), linear("b", "a"), linear("c", "b"), linear("d", "c")])
)
def test_chains_are_followed_in_any_order(relations: list[Relation]) -> None:
    """As an edited rig may have them: d = 1 + 2 c, c = 1 + 2 b, b = 1 + 2 a."""
    rig = ReducedRig(tuple(relations))
    found = rig.evaluate(FREE)
    assert found.names == tuple(r.name for r in relations)
    values = found.select(("a", "b", "c", "d")).values
    a = np.arange(4.0)
    assert_allclose(values.T, [a, 1 + 2 * a, 3 + 4 * a, 7 + 8 * a])


def test_several_controllers_constants_and_held_channels() -> None:
    rig = ReducedRig(
        (
            Relation("a", "free"),
            Relation("k", "constant", offset=5.0),
            Relation("b", "linear", 1.0, ("a", "k"), (2.0, -1.0)),
        ),
        held={"h": 7.0},
    )
    found = rig.evaluate(FREE)
    assert found.names == ("a", "k", "b", "h")
    assert_allclose(found.values[3], [3.0, 5.0, 2.0, 7.0])
    assert rig.free == ("a",)


@pytest.mark.parametrize(
    "cycle", [("b",), ("b", "c"), ("b", "c", "d")], ids=["itself", "two", "three"]
)
def test_cycles_are_refused_by_name(cycle: tuple[str, ...]) -> None:
    ring = [linear(n, cycle[(i + 1) % len(cycle)]) for i, n in enumerate(cycle)]
    rig = ReducedRig((Relation("a", "free"), *ring))
    with pytest.raises(InputError, match="cycle: " + " -> ".join((*cycle, cycle[0]))):
        rig.evaluate(FREE)


def test_chains_of_any_length_are_followed() -> None:
    """Files are written by others: a chain may be longer than a stack."""
    names = [f"c{i}" for i in range(5000)]
    chain = [Relation("c0", "free"), *(linear(b, a) for a, b in pairwise(names))]
    order = evaluation_order(chain[::-1])
    assert [r.name for r in order] == names
    with pytest.raises(InputError, match="cycle"):
        evaluation_order([linear("c0", "c4999"), *chain[1:]])


@given(st.integers(0, 2**32 - 1), st.integers(1, 30))
def test_controllers_come_before_their_followers(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    relations = [
        linear(f"c{i}", *(f"c{j}" for j in range(i) if random.random() < 0.2)) for i in range(count)
    ]
    shuffled = [relations[i] for i in random.permutation(count)]
    place = {r.name: i for i, r in enumerate(evaluation_order(shuffled))}
    assert len(place) == count
    assert all(place[c] < place[r.name] for r in relations for c in r.controllers)


def test_a_missing_controller_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="'b' follows 'x', which is not in the rig"):
        evaluation_order((Relation("a", "free"), linear("b", "a", "x")))


def test_a_missing_curve_is_refused_by_name() -> None:
    rig = ReducedRig((Relation("a", "free"), Relation("z", "free")))
    with pytest.raises(UsageError, match="'z'"):
        rig.evaluate(FREE)


def test_a_rig_without_free_channels_is_constant() -> None:
    rig = ReducedRig((Relation("k", "constant", offset=5.0),))
    found = rig.evaluate(Channels((), np.empty((3, 0))))
    assert_allclose(found.values, np.full((3, 1), 5.0))


# --- fitted to motion ----------------------------------------------------------------------------

RIG, INDEX = skeleton(axes=2)


def take(seed: int, frames: int = 80) -> tuple[Clip, Hands]:
    clip = replace(moved(RIG, INDEX, random_turns(frames, seed)), name=f"take{seed}")
    maps = {side: hand_map(INDEX, side) for side in SIDES}
    return clip, Hands.of(clip, CharacterMap(maps, "test"))


def test_a_reduction_is_what_its_rig_says() -> None:
    clip, hands = take(1)
    rig = fit_rig([clip], [hands], Target(Thresholds(20.0, 0.8)))
    reduction = apply_rig(rig, clip, hands)
    source = hands.encode(clip)
    assert 0 < len(rig.free) < len(rig.names) == 50
    assert_allclose(reduction.free.values, source.select(rig.free).values, atol=1e-9)
    # Free channels survive the way through rotations, everything else is as the rig says.
    again = hands.encode(reduction.motion)
    wanted = rig.evaluate(reduction.free)
    assert_allclose(again.select(wanted.names).values, wanted.values, atol=1e-6)
    # The errors reported are those of the motion.
    difference = again.values - source.values
    assert_allclose(reduction.total_errors.rms, np.sqrt((difference**2).mean(axis=0)), atol=1e-6)
    tips = 10 * np.linalg.norm(hands.fingertips(reduction.motion) - hands.fingertips(clip), axis=-1)
    assert reduction.total_errors.fingertip_mean == pytest.approx(tips.mean(), abs=1e-6)
    assert reduction.total_errors.fingertip_max == pytest.approx(tips.max(), abs=1e-6)
    fitted = {r.name: r.rms_error for r in rig.relations}
    assert_allclose(reduction.errors.rms, [fitted[n] for n in reduction.errors.names], atol=1e-5)


def test_what_the_model_loses_is_apart_from_what_reduction_loses() -> None:
    clip, hands = take(1)
    rig = fit_rig([clip], [hands], Target(Thresholds(0.0, 0.0)))
    reduction = apply_rig(rig, clip, hands)
    assert len(rig.free) == 50
    assert reduction.errors.max_deg == 0.0
    assert reduction.errors.fingertip_max == 0.0
    assert set(reduction.model_errors.names) == set(hands.all_names) - set(rig.names)
    assert reduction.model_errors.rms_deg > 1.0
    assert reduction.model_errors.fingertip_max == reduction.total_errors.fingertip_max > 1.0


def test_pooled_clips_share_one_rig() -> None:
    clips, hands = zip(*(take(seed, 60 + 10 * seed) for seed in (1, 2)), strict=True)
    rig = fit_rig(clips, hands, Target(PRESETS[4]))
    pooled = np.concatenate([h.encode(c).values for c, h in zip(clips, hands, strict=True)])
    names = hands[0].all_names
    for r in rig.relations:
        if r.kind == "constant":
            assert r.offset == pytest.approx(pooled[:, names.index(r.name)].mean())
    for name, value in rig.held.items():
        assert value == pytest.approx(pooled[:, names.index(name)].mean())
    assert rig.sources == ("take1", "take2")
    encoded = [h.encode(c) for c, h in zip(clips, hands, strict=True)]
    assert fit_rig(clips, hands, Target(PRESETS[4]), sources=encoded) == rig


def test_expanding_onto_another_hand_gives_the_same_channels() -> None:
    clip, hands = take(1)
    rig = fit_rig([clip], [hands], Target(PRESETS[4]))
    reduction = apply_rig(rig, clip, hands)
    other_rig, other_index = skeleton(axes=77)
    other = moved(other_rig, other_index, random_turns(80, 9))
    maps = {side: hand_map(other_index, side) for side in SIDES}
    other_hands = Hands.of(other, CharacterMap(maps, "test"))
    expanded = expand(rig, reduction.free, other, other_hands)
    assert_allclose(other_hands.encode(expanded).values, reduction.reduced.values, atol=1e-6)


def test_what_cannot_be_fitted_or_applied() -> None:
    clip, hands = take(1)
    with pytest.raises(InputError, match="one frame"):
        fit_rig([frames_of(clip, slice(1))], [hands], Target(PRESETS[4]))
    with pytest.raises(UsageError, match="least-squares"):
        fit_rig([clip], [hands], Target(PRESETS[4]), "paper", most_controllers=2)
    left = replace(hands, frames={"left": hands.frames["left"]})
    with pytest.raises(InputError, match="other hand joints"):
        fit_rig([clip, clip], [hands, left], Target(PRESETS[4]))
    rig = fit_rig([clip], [hands], Target(PRESETS[4]))
    with pytest.raises(UsageError, match="riIndexDIP"):
        apply_rig(rig, clip, left)
    with pytest.raises(UsageError, match="Give either"):
        Target(PRESETS[4], 3)
    with pytest.raises(UsageError, match="no channel in common"):
        expand(
            ReducedRig((Relation("x", "free"),)), Channels(("x",), np.zeros((80, 1))), clip, hands
        )
