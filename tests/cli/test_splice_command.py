"""usdhand splice: files in, files out, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.clips import frames_of
from click.testing import CliRunner, Result
from conftest import REPOSITORY
from pxr import Usd

from usdhand import find_hands, read_clip
from usdhand.cli.command import command_of
from usdhand.errors import HandNotFoundError, InputError, UsageError, UsdHandError
from usdhand.motion import Clip, Skeleton
from usdhand.splice.settings import SpliceSettings
from usdhand.verbs.splice import parse_pin, splice_hands

SAMPLES = REPOSITORY / "samples"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
FULL = SAMPLES / "conversations" / "talk_01_full.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
RIGHT = SAMPLES / "hands" / "talk_01_hands_right.usdc"
OTHER_RIG = SAMPLES / "gestures_ben"
PINS = ("--pin", "1:1", "--pin", "181:403")
Run = Callable[..., Result]


@pytest.fixture
def run() -> Run:
    def call(*arguments: object, code: int = 0) -> Result:
        result = CliRunner().invoke(command_of("splice"), [str(a) for a in arguments])
        if isinstance(result.exception, UsdHandError):
            assert result.exception.exit_code == code, result.exception
            return result
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == code, result.output
        return result

    return call


def test_forearms_filmed_again_give_the_true_fingers(run: Run, tmp_path: Path) -> None:
    """Other amplitude, timing, direction, rate and no shoulders: within 2 degrees RMS."""
    out, report = tmp_path / "talk.usda", tmp_path / "talk.json"
    text = run(BODY, HANDS, *PINS, "-o", out, "--report", report).output
    assert "the room" in text
    clip, true = read_clip(out), read_clip(FULL)
    ours, theirs = (find_hands(c).encode(c) for c in (clip, true))
    difference = (ours.values - theirs.select(ours.names).values)[1:179]
    assert np.sqrt(np.mean(difference**2)) < 2.0

    result = json.loads(report.read_text())
    assert result["schema"] == "usdhand.splice/1"
    hand = result["hands"]["right"]
    assert len(hand["warp"]) == len(clip)
    assert hand["pins"][1]["body"] == pytest.approx(6.0)
    assert set(hand) >= {"warp", "pins", "cost", "pass_lag", "phases", "look_at", "channels"}
    stage = Usd.Stage.Open(str(out))
    scope = next(p for p in stage.Traverse() if p.GetName() == "HandSplice")
    warp = scope.GetAttribute("usdhand:warp:right")
    assert len(warp.GetTimeSamples()) == len(clip)
    assert warp.Get(clip.time_codes[90]) == pytest.approx(hand["warp"][90][1], abs=1e-5)
    body = read_clip(BODY)
    wrist = find_hands(body).character.hands["left"].wrist
    assert np.array_equal(clip.rotations[:, wrist], body.rotations[:, wrist])


def test_one_hand(run: Run, tmp_path: Path) -> None:
    pins = ("--pin", "right:391:1", "--pin", "right:571:378:6")
    result = run(BODY, RIGHT, *pins, "-o", tmp_path / "o.usdc", "--json")
    assert list(json.loads(result.stdout)["hands"]) == ["right"]
    with pytest.raises(HandNotFoundError):
        splice_hands(read_clip(BODY), read_clip(RIGHT), sides=["left"])


def test_another_rig(run: Run, tmp_path: Path) -> None:
    """Ben, metres and Z up, makes Ada's gesture: his fingers come in her joints and time."""
    theirs = next(iter(sorted(OTHER_RIG.glob("ok_*.usdc"))))
    ours = SAMPLES / "gestures" / "ok_01.usdc"
    out = tmp_path / "ok.usdc"
    run(ours, theirs, "-o", out, "--wrist", "hands", "--flatten")
    a, b = read_clip(out), read_clip(theirs)
    hands_a, hands_b = find_hands(a), find_hands(b)
    result = splice_hands(read_clip(ours), b)
    warp = result.hands["right"].warp[:, 1] * b.fps
    name = "riIndexPIPy"
    got = hands_a.encode(a).select([name]).values[:, 0]
    wanted = hands_b.encode(b).select([name]).values[:, 0]
    expected = np.interp(warp, np.arange(len(b)), wanted)
    assert np.sqrt(np.mean((got - expected) ** 2)) < 2.0


def test_dry_run_writes_nothing(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "o.usda"
    run(BODY, HANDS, *PINS, "-o", out, "-n")
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--pin", "1:1", "--pin", "9000:10"), "9000 is outside the body"),
        (("--pin", "1:1", "--pin", "10:9000"), "9000 is outside the hand"),
        (("--pin", "100:200", "--pin", "120:100"), "cross"),
        (("--pin", "100:200", "--pin", "100:100"), "contradict"),
        (("--pin", "100"), "'100' is not a pin"),
        (("--pin", "a:b"), "'a:b' is not a pin"),
        (("--pin", "nan:1"), "'nan:1' is not a pin"),
        (("--band", "0.3"), "two numbers"),
        (("--band", "0,2"), "above 0"),
        (("--pin", "1:1"), "more than a factor of 3.3 apart"),
        (("--hands-skel", "foo"), "--hands-skel foo matches no"),
    ],
)
def test_refused_with_a_reason(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    out = tmp_path / "o.usda"
    result = run(BODY, HANDS, *arguments, "-o", out, code=2)
    assert message in str(result.exception) + result.output
    assert not out.exists()


def test_pins_are_read_in_the_time_codes_of_their_clips() -> None:
    body, hands = read_clip(BODY), read_clip(HANDS)
    pin = parse_pin("left:31:121:6", body, hands)
    assert parse_pin("LEFT:31:121:6", body, hands).side == "left"
    assert (pin.side, pin.body, pin.hand) == ("left", pytest.approx(1.0), pytest.approx(2.0))
    assert pin.tolerance == pytest.approx(0.1)
    assert str(pin) == "left:31:121:6"


def test_hands_that_do_not_move() -> None:
    body = read_clip(FULL)
    still = replace(body, rotations=np.repeat(body.rotations[:1], len(body), axis=0), name="still")
    with pytest.raises(InputError, match="No hand moves in the hand clip still, so nothing tells"):
        splice_hands(body, still)
    short = replace(still, rotations=still.rotations[:2])
    with pytest.raises(InputError, match="2 frames"):
        splice_hands(body, short)


def test_pins_that_place_a_part_are_advised(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "talk.usda"
    message = str(run(BODY, HANDS, "--pin", "1:1", "-o", out, code=2).exception)
    assert "After the pin 1:1 the body lasts" in message
    pins = message.rpartition("give ")[2].split()
    run(BODY, HANDS, *pins, "-o", out)
    assert finger_error(out) < 2.0
    other = SAMPLES / "conversations" / "talk_02_body.usdc"
    notes = splice_hands(read_clip(other), read_clip(HANDS)).problems
    assert any("Nothing in the longer clip resembles the shorter" in str(note) for note in notes)


def test_a_part_is_found_and_told(run: Run, tmp_path: Path) -> None:
    """The hand clip shows the first six seconds of the body, and the other way about."""
    out = tmp_path / "talk.usda"
    text = run(BODY, HANDS, "-o", out).output
    assert "of the hand clip show 0.0 to 5.9 s of the body" in text
    assert finger_error(out) < 2.0
    longer = splice_hands(read_clip(HANDS), read_clip(FULL))
    assert any("0.0 to 5.9 s of the hand clip show 0.0 to" in str(p) for p in longer.problems)


def finger_error(file: Path) -> float:
    """RMS in degrees over the six seconds that the hand clip of the samples shows."""
    clip, true = read_clip(file), read_clip(FULL)
    ours, theirs = (find_hands(c).encode(c) for c in (clip, true))
    difference = (ours.values - theirs.select(ours.names).values)[1:175]
    return float(np.sqrt(np.mean(difference**2)))


def test_hands_without_a_finger_in_common() -> None:
    """Of a body's hands only two fingers are left, of the hand clip's two other ones."""
    full = read_clip(FULL)
    index = without_fingers(full, "Ring", "Pinky", "Thumb")
    ring = without_fingers(full, "Index", "Middle", "Thumb")
    with pytest.raises(HandNotFoundError, match="no finger joint in common: the body has Index"):
        splice_hands(index, ring)
    part = splice_hands(full, ring)
    assert not any("Index" in name for name in part.hands["left"].channels)


def without_fingers(clip: Clip, *digits: str) -> Clip:
    names = clip.skeleton.names
    gone = {n for n in names if "Hand" in n and any(d in n for d in digits)}
    keep = [j for j, name in enumerate(names) if name not in gone]
    index = {j: k for k, j in enumerate(keep)}
    skeleton = clip.skeleton
    rig = Skeleton(
        tuple(skeleton.joints[j] for j in keep),
        np.array([index.get(int(skeleton.parents[j]), -1) for j in keep]),
        skeleton.bind[keep],
        skeleton.rest[keep],
    )
    q, t, s = (v[:, keep] for v in (clip.rotations, clip.translations, clip.scales))
    return replace(clip, skeleton=rig, rotations=q, translations=t, scales=s)


def test_long_differences_are_worth_a_warning() -> None:
    body, hands = read_clip(BODY), read_clip(HANDS)
    result = splice_hands(body, hands, pins=["1:1", "451:403"])
    assert any("Between the pins 1:1 and 451:403" in str(note) for note in result.problems)
    [note] = splice_hands(body, hands, pins=["1:1", "181:403"]).problems
    assert "the hand clip ends at time code 181 of the body" in str(note)
    assert "(left and right)" in str(note)
    [note] = splice_hands(body, hands, pins=["481:1", "680:403"]).problems
    assert "the hand clip begins at time code 481 of the body" in str(note)
    with pytest.raises(UsageError, match="not spliced"):
        splice_hands(body, read_clip(RIGHT), pins=["left:1:1"])
    with pytest.raises(UsageError, match="trunk"):
        splice_hands(body, hands, SpliceSettings(align="trunk"), pins=["1:1", "181:403"])


def test_lengths_decide_whatever_the_band() -> None:
    """Of a long body, clips of a few frames are refused as well; a wider band refuses nothing."""
    body, full = read_clip(BODY), read_clip(FULL)
    for count in (10, 27):
        with pytest.raises(UsageError, match=r"factor of 3\.3 apart"):
            splice_hands(body, frames_of(full, slice(0, count)))
    ours, theirs = (read_clip(SAMPLES / "gestures" / f"ok_0{k}.usdc") for k in (1, 2))
    for band in (0.05, 0.3, 1.0):
        result = splice_hands(ours, theirs, SpliceSettings(band=(band, 0.1)))
        assert set(result.hands) == {"left", "right"}


def test_fingers_that_do_not_move(run: Run, tmp_path: Path) -> None:
    """Swapped clips are refused, one still hand is told, and so is the same file twice."""
    out = tmp_path / "o.usda"
    message = str(run(FULL, BODY, "-o", out, code=3).exception)
    assert "No finger moves in the hand clip" in message
    assert "swapped" in message
    full = read_clip(FULL)
    left = find_hands(full).frames["left"].joints
    rotations = full.rotations.copy()
    rotations[:, left] = rotations[:1, left]
    [note] = splice_hands(full, full.with_rotations(rotations)).problems
    assert "the fingers of the left hand do not move in the hand clip" in str(note)
    assert "replace moving ones" in str(note)
    assert "are the same" in run(FULL, FULL, "-o", out, "-n").output


def test_exact_pins_hold_for_the_pose() -> None:
    """A hold and a jump by pins: at pinned frames the pose is the hand clip's, not a mean."""
    full = read_clip(FULL)
    shown = np.minimum(np.arange(len(full)), 100)
    shown[200:] = np.arange(200, len(full))
    at = np.arange(60, 260, 2)
    pins = [f"{k + 1}:{shown[k] + 1}" for k in at]
    hands = find_hands(full)
    result = splice_hands(full, full, SpliceSettings(wrist="hands"), pins=pins)
    got, true = hands.encode(result.clip).values[at], hands.encode(full).values[shown[at]]
    assert np.abs(got - true).max() < 0.05


def test_pins_tell_the_timing_of_arms_that_rest() -> None:
    full = read_clip(FULL)
    hands = find_hands(full)
    fingers = [j for f in hands.frames.values() for j in f.joints]
    rotations = np.repeat(full.rotations[:1], len(full), axis=0)
    rotations[:, fingers] = full.rotations[:, fingers]
    still = full.with_rotations(rotations)
    with pytest.raises(InputError, match=r"nothing tells .* Pins can"):
        splice_hands(full, still, pins=["300:300"])
    result = splice_hands(full, still, pins=["1:1", "300:350", "680:680"])
    assert any("the timing is that of the pins" in str(note) for note in result.problems)
    for alignment in result.hands.values():
        assert np.interp(299 / 30, *alignment.warp.T) == pytest.approx(349 / 30)
    one = splice_hands(full, still, pins=["left:1:1", "left:680:680"])
    assert one.hands["right"].taken_from == "left"


def test_pins_of_a_file_of_edits_are_those_of_the_option(run: Run, tmp_path: Path) -> None:
    edits = tmp_path / "edits.json"
    pins = [{"body": 1, "hand": 1}, {"body": 181, "hand": 403}]
    edits.write_text(json.dumps({"schema": "usdhand.edits/1", "splice": {"pins": pins}}))
    options = ("-n", "-o", tmp_path / "x.usda", "--json")
    by_file = json.loads(run(BODY, HANDS, "--edits", edits, *options).stdout)
    by_option = json.loads(run(BODY, HANDS, *PINS, *options).stdout)
    assert by_file["hands"] == by_option["hands"]
    assert [Path(i["path"]).name for i in by_file["inputs"]][2:] == ["edits.json"]
    run(BODY, HANDS, "--edits", BODY, "-n", "-o", tmp_path / "x.usda", code=InputError.exit_code)
