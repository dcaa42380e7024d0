"""Metrics and conventions as values, and settings that do what they say on their own."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.in_memory import SAMPLES, sample

import usdhand
from usdhand.fill.method import space_for
from usdhand.fill.metric import FEATURES, feature_rows
from usdhand.fill.settings import METRICS, Feature
from usdhand.motion import forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.requests.codec import make_request, to_data

GESTURES = sorted((SAMPLES / "gestures").glob("o*.usdc"))[:6]
# Joint names of nobody's convention, and the tables that tell which is which.
STUDIO = """
[studio]
about = "names of a studio"
side = ["L", "R"]
wrist = "palm_{side}"
thumb = ["thumb1_{side}", "thumb2_{side}", "thumb3_{side}"]
finger = ["{digit}1_{side}", "{digit}2_{side}", "{digit}3_{side}"]

[body]
hips = "LeftUpLeg"
"""


@pytest.fixture(scope="module")
def library() -> usdhand.MotionLibrary:
    return usdhand.build_library(GESTURES, "library.usdc").library


def test_features_that_can_be_named_are_those_that_can_be_made() -> None:
    assert set(FEATURES) == set(Feature.__args__)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", METRICS)
def test_a_metric_does_the_same_as_its_name(name: str, library: usdhand.MotionLibrary) -> None:
    body = sample("conversations/talk_01_body")
    filled = [
        usdhand.fill_fingers(body, library, usdhand.FillSettings(metric=metric))
        for metric in (name, METRICS[name])
    ]
    assert (filled[0].clips[0].rotations == filled[1].clips[0].rotations).all()


def test_a_metric_of_one_s_own_weighs_its_features(library: usdhand.MotionLibrary) -> None:
    own = usdhand.Metric("own", {"forearm": 4.0})
    arm = library.clips[0].hands["left"].arm
    np.testing.assert_allclose(feature_rows(own, arm), 2.0 * FEATURES["forearm"](arm), rtol=1e-6)
    settings = usdhand.FillSettings(metric=own)
    assert space_for(library, ("left",), settings).metric is own
    errors, left = usdhand.measure_library(library, ".", settings)
    assert not left
    assert {error.take for error in errors} == {clip.name for clip in library.clips}


def test_metrics_that_are_none_are_refused() -> None:
    with pytest.raises(usdhand.UsageError, match="metric x has no feature 'nose'"):
        usdhand.Metric("x", {"nose": 1.0})  # type: ignore[dict-item]
    for weights in ({}, {"wrist": 0.0}, {"wrist": -1.0}, {"wrist": np.nan}, {"wrist": np.inf}):
        with pytest.raises(usdhand.UsageError, match="metric x needs at least one weight above 0"):
            usdhand.Metric("x", weights)  # type: ignore[arg-type]


def test_requests_keep_a_metric_of_one_s_own() -> None:
    own = usdhand.Metric("own", {"forearm": 4.0, "wrist": 1.0})
    request = usdhand.FillRequest(
        body=Path("a.usdc"),
        library=Path("b.usdc"),
        output=Path("c.usda"),
        settings=usdhand.FillSettings(metric=own),
    )
    assert make_request(json.loads(json.dumps(to_data(request)))) == request


def renamed(clip: usdhand.Clip) -> usdhand.Clip:
    """The clip with a studio's names of hand joints."""
    names = {}
    for side, letter in (("Left", "L"), ("Right", "R")):
        names[f"{side}Hand"] = f"palm_{letter}"
        for digit in ("Thumb", "Index", "Middle", "Ring", "Pinky"):
            for number in (1, 2, 3):
                own = digit if digit != "Thumb" else "thumb"
                names[f"{side}Hand{digit}{number}"] = f"{own}{number}_{letter}"
    joints = tuple(
        "/".join(names.get(part, part) for part in joint.split("/"))
        for joint in clip.skeleton.joints
    )
    return replace(clip, skeleton=replace(clip.skeleton, joints=joints))


def test_conventions_are_tables_or_files(tmp_path: Path) -> None:
    file = tmp_path / "studio.toml"
    file.write_text(STUDIO, encoding="utf-8")
    tables = tomllib.loads(STUDIO)
    from_file, from_text, from_tables = (
        usdhand.load_conventions(given) for given in (file, str(file), tables)
    )
    assert from_file == from_text == from_tables
    clip = renamed(sample("gestures/ok_01"))
    hands = usdhand.find_hands(clip, from_tables)
    assert hands.character.convention == "studio"
    assert hands.character.hips == clip.skeleton.find("LeftUpLeg")
    assert usdhand.find_hands(clip).character.convention != "studio"


def test_tables_may_hold_tuples_and_later_ones_win() -> None:
    first = {"studio": {"wrist": "a", "finger": ("b{digit}", "c{digit}", "d{digit}")}}
    second = {"studio": {"wrist": ("e", "f"), "finger": ["b{digit}", "c{digit}", "d{digit}"]}}
    found = usdhand.load_conventions(first, second).conventions[0]
    assert (found.name, found.own) == ("studio", True)
    assert found.hands[None]["wrist"] == ("e", "f")


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"studio": {"wirst": "a"}}, r"^conventions: \[studio\] wirst: unknown key"),
        ({"studio": {"wrist": 3}}, r"^conventions: \[studio\] wrist: must be a name"),
        ({"studio": "hand"}, "^conventions: 'studio' is outside a table"),
        ({"left": {"wrist": ""}}, r"^conventions: \[left\] wrist: must be the name of a joint"),
        ({"studio": {"like": "nobody"}}, r"^conventions: \[studio\] like"),
    ],
)
def test_tables_that_are_wrong_name_the_key(tables: dict[str, object], words: str) -> None:
    with pytest.raises(usdhand.UsageError, match=words):
        usdhand.load_conventions(tables)  # type: ignore[arg-type]


def test_the_hand_clip_s_wrists_are_written_where_settings_say_so(tmp_path: Path) -> None:
    body, fingers = sample("conversations/talk_01_body"), sample("hands/talk_01_hands_a")
    written: dict[str, usdhand.Clip] = {}
    pins = ["1:1", "181:403"]
    for wrist in ("body", "hands"):
        settings = usdhand.SpliceSettings(wrist=wrist)  # type: ignore[arg-type]
        spliced = usdhand.splice_hands(body, fingers, settings, pins=pins)
        usdhand.write_spliced(spliced, tmp_path / f"{wrist}.usda")
        written[wrist] = usdhand.read_clip(tmp_path / f"{wrist}.usda")
        turned = forward_kinematics(spliced.clip).rotations
        read = forward_kinematics(written[wrist]).rotations
        assert rot.angle_between(turned, read).max() < 1e-3
    hands = usdhand.find_hands(body).character.hands
    wrists = [hand.wrist for hand in hands.values()]
    for wrist, same in (("body", True), ("hands", False)):
        away = rot.angle_between(
            forward_kinematics(body, wrists).rotations,
            forward_kinematics(written[wrist], wrists).rotations,
        )
        assert (away.max(axis=0) < 1e-3).all() if same else (away.max(axis=0) > 1.0).all()
