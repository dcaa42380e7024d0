"""Several hand takes for one body: the best in every phase, joined without jumps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from builders.cli_runner import run
from builders.clips import frames_of
from builders.known_pairs import Pair, known_pair
from conftest import REPOSITORY
from pxr import Usd

from usdhand import find_hands, read_clip
from usdhand.errors import InputError, UsageError, UsdHandError
from usdhand.motion import Clip
from usdhand.report.preview.events import report_rows
from usdhand.requests.takes import read_manifest
from usdhand.splice.settings import SpliceSettings
from usdhand.splice.takes import Take, splice_takes

SAMPLES = REPOSITORY / "samples"
TALK = SAMPLES / "conversations" / "talk_01_full.usdc"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
TAKES = [SAMPLES / "hands" / f"talk_01_hands_{name}.usdc" for name in ("a", "b", "right")]


@pytest.fixture(scope="module")
def pair() -> Pair:
    return known_pair(TALK, TALK, 3)


def take_of(clip: Clip) -> Take:
    return Take(clip, find_hands(clip), SpliceSettings())


def arms_of(clip: Clip) -> list[int]:
    hands = find_hands(clip).character.hands.values()
    return [j for h in hands for j in (h.shoulder, h.elbow, h.wrist) if j is not None]


def mistaken(clip: Clip, frames: slice) -> Clip:
    """A take of which arms do something else for a while."""
    rotations = clip.rotations.copy()
    arms, inside = arms_of(clip), rotations[frames]
    inside[:, arms] = inside[::-1][:, arms]
    return clip.with_rotations(rotations)


def largest(values: np.ndarray) -> float:
    return float(np.abs(np.diff(values, n=2, axis=0)).max())


def test_every_phase_has_the_take_that_agrees(pair: Pair) -> None:
    middle = len(pair.hands) // 2
    first = replace(mistaken(pair.hands, slice(middle, None)), name="first")
    second = replace(mistaken(pair.hands, slice(0, middle)), name="second")
    found = splice_takes(
        pair.body, [take_of(first), take_of(second)], pair.body_hands, SpliceSettings()
    )
    half = np.interp(middle / pair.hands.fps, pair.truth, np.arange(len(pair.body)))
    ours = pair.body_hands.encode(found.clip)
    true = pair.source_channels().select(ours.names)
    for alignment in found.hands.values():
        shown = np.concatenate(
            [np.full(round((p.end - p.start) * 30) + 1, p.take) for p in alignment.pieces]
        )
        assert np.mean(shown[: round(half) - 30] == 0) > 0.9
        assert np.mean(shown[round(half) + 30 :] == 1) > 0.9
    assert np.sqrt(np.mean((ours.values - true.values) ** 2)) < 2.0
    assert largest(ours.values) < 1.3 * largest(true.values)


def test_parts_follow_each_other_and_what_no_take_shows_is_told(pair: Pair) -> None:
    n = len(pair.hands)
    parts = [
        replace(frames_of(pair.hands, slice(a, b)), name=name)
        for name, a, b in (("begin", 0, n * 4 // 9), ("end", n * 4 // 9, n * 8 // 9))
    ]
    found = splice_takes(pair.body, [take_of(p) for p in parts], pair.body_hands, SpliceSettings())
    for alignment in found.hands.values():
        assert [p.take for p in alignment.pieces] == [0, 1]
        border = np.interp(n * 4 / 9 / pair.hands.fps, pair.truth, np.arange(len(pair.body)) / 30)
        assert alignment.pieces[0].end == pytest.approx(border, abs=0.5)
    assert [p.code for p in found.problems].count("found-part") == 2
    held = [p for p in found.problems if p.code == "held-pose"]
    assert held
    assert all("no take shows" in p.message and "of end" in p.message for p in held)
    ours = pair.body_hands.encode(found.clip)
    true = pair.source_channels().select(ours.names)
    assert largest(ours.values) < 1.3 * largest(true.values)


def test_one_take_is_a_splice(tmp_path: Path) -> None:
    manifest = written(tmp_path, {"takes": [{"hands": str(TAKES[0]), "pins": ["1:1", "181:403"]}]})
    pins = ("--pin", "1:1", "--pin", "181:403")
    one = run("splice", str(BODY), "--manifest", str(manifest), "-o", "x.usda", "-n", "--json")
    other = run("splice", str(BODY), str(TAKES[0]), *pins, "-o", "x.usda", "-n", "--json")
    ours, theirs = (json.loads(r.stdout)["hands"] for r in (one, other))
    for side, hand in theirs.items():
        assert ours[side]["warp"] == hand["warp"]
        assert ours[side]["channels"] == hand["channels"]
        assert [p["take"] for p in ours[side]["pieces"]] == [0]
        assert hand["pieces"] == []


def written(folder: Path, content: dict[str, Any]) -> Path:
    file = folder / "takes.json"
    file.write_text(json.dumps({"schema": "usdhand.takes/1", **content}), "utf-8")
    return file


def schema(*arguments: str) -> jsonschema.Draft202012Validator:
    found = json.loads(run("schema", *arguments).stdout)
    jsonschema.Draft202012Validator.check_schema(found)
    return jsonschema.Draft202012Validator(found)


def test_takes_of_a_manifest(tmp_path: Path) -> None:
    content = {"body": str(BODY), "takes": [{"hands": str(t)} for t in TAKES]}
    manifest, out, report = written(tmp_path, content), tmp_path / "o.usda", tmp_path / "o.json"
    assert schema("--of-takes").is_valid(json.loads(manifest.read_text()))
    options = ("-o", str(out), "--report", str(report), "--wrist", "hands")
    text = run("splice", "--manifest", str(manifest), *options).stdout
    assert "talk_01_hands_b.usdc" in text
    result = json.loads(report.read_text())
    schema("--of-report", "splice").validate(result)
    assert [Path(t).name for t in result["takes"]] == [t.name for t in TAKES]
    assert [p["take"] for p in result["hands"]["right"]["pieces"]] == [0, 1, 2]
    stage = Usd.Stage.Open(str(out))
    scope = next(p for p in stage.Traverse() if p.GetName() == "HandSplice")
    take = scope.GetAttribute("usdhand:take:right")
    assert [take.Get(code) for code in (1.0, 300.0, 500.0)] == [0, 1, 2]
    clip, true = read_clip(out), read_clip(TALK)
    ours, theirs = (find_hands(c).encode(c) for c in (clip, true))
    difference = (ours.values - theirs.select(ours.names).values)[:, :45][1:380]
    assert np.sqrt(np.mean(difference**2)) < 3.0
    page = tmp_path / "page.html"
    run("preview", str(out), "--with-report", str(report), "-o", str(page))
    assert '"fingers of take 2"' in page.read_text()
    rows = report_rows(result, report)
    [seconds] = [r for r in rows if r["side"] == "right" and r["label"] == "seconds of hand clip"]
    labels = [m["label"] for m in seconds["marks"]]
    assert labels.count("2") == 3
    assert [m["time"] for m in seconds["marks"]] == sorted(m["time"] for m in seconds["marks"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({}, "at least one take"),
        ({"takes": []}, "at least one take"),
        ({"takes": [{}]}, 'take 1: give the file "hands"'),
        ({"takes": [{"hands": "a"}, {"hands": 3}]}, 'take 2: "hands" must be a text'),
        ({"takes": [{"hands": "a", "pin": []}]}, "unknown key 'pin'"),
        ({"takes": [{"hands": "a", "pins": "1:1"}]}, "list of texts"),
        ({"takes": [{"hands": "a", "side": "up"}]}, '"side" is'),
        ({"takes": [{"hands": "a"}], "clips": 1}, "unknown key 'clips'"),
        ({"takes": [{"hands": "a"}], "schema": "x"}, "not a manifest"),
    ],
)
def test_what_is_no_manifest(tmp_path: Path, content: dict[str, Any], message: str) -> None:
    file = written(tmp_path, content)
    with pytest.raises(InputError, match=message):
        read_manifest(file)
    assert not schema("--of-takes").is_valid(json.loads(file.read_text()))


def test_names_are_relative_to_the_manifest(tmp_path: Path) -> None:
    manifest = read_manifest(written(tmp_path, {"body": "b.usd", "takes": [{"hands": "h.usd"}]}))
    assert manifest.body == tmp_path / "b.usd"
    assert [t.hands for t in manifest.takes] == [tmp_path / "h.usd"]
    with pytest.raises(InputError, match="cannot be read"):
        read_manifest(tmp_path / "none.json")
    (tmp_path / "takes.json").write_text("{", "utf-8")
    with pytest.raises(InputError, match="no JSON"):
        read_manifest(tmp_path / "takes.json")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "Give the files BODY and HANDS"),
        ((str(BODY),), "Give the files BODY and HANDS"),
        (("--manifest", "M"), 'no "body"'),
        ((str(BODY), str(TAKES[0]), "--manifest", "M"), "no HANDS"),
        ((str(BODY), "--manifest", "M", "--pin", "1:1"), "of its takes"),
        ((str(BODY), "--manifest", "M", "--plots", "P"), "no --plots"),
    ],
)
def test_options_that_do_not_go_together(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    manifest = written(tmp_path, {"takes": [{"hands": str(TAKES[0])}]})
    named = {"M": str(manifest), "P": str(tmp_path / "plots")}
    result = run(
        "splice", *(named.get(a, a) for a in arguments), "-o", str(tmp_path / "o.usda"), code=2
    )
    assert message in result.stderr + str(result.exception)


def test_the_name_of_a_take_is_in_errors(pair: Pair) -> None:
    short = replace(frames_of(pair.hands, slice(0, 2)), name="short")
    with pytest.raises(UsdHandError, match=r"Take short: .*2 frames"):
        splice_takes(
            pair.body, [take_of(pair.hands), take_of(short)], pair.body_hands, SpliceSettings()
        )
    assert UsageError.exit_code == 2
