"""Values at a prompt: a line that says what they are, and a table in notebooks, both short."""

from __future__ import annotations

import dataclasses
import inspect
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.in_memory import SAMPLES, sample

import usdhand
from usdhand.display import LONGEST_LINE, cut, short
from usdhand.problems import Problem

LONGEST = 200
LONG = "<b>" + "a very long name " * 40
TYPES = {
    name: kind
    for name in usdhand.__all__
    if inspect.isclass(kind := getattr(usdhand, name)) and dataclasses.is_dataclass(kind)
}


def request(kind: type[usdhand.Request]) -> usdhand.Request:
    """A request with many long paths."""
    paths = tuple(f"{LONG}{i}" for i in range(2000))
    of_type = {"Path": Path(LONG), "str": LONG, "tuple[str, ...]": paths}
    needed = [f for f in dataclasses.fields(kind) if f.default is dataclasses.MISSING]
    return kind(**{f.name: of_type[str(f.type)] for f in needed})


@pytest.fixture(scope="module")
def values(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A value of every public type, by the type's name; with long names where it has some."""
    folder = tmp_path_factory.mktemp("display")
    gestures = sorted((SAMPLES / "gestures").glob("ok_*.usdc"))
    built = usdhand.build_library(gestures, folder / "library.usdc")
    clip = replace(sample("gestures/ok_01"), name=LONG)
    body, fingers = sample("conversations/talk_01_body"), sample("hands/talk_01_hands_a")
    hands = usdhand.find_hands(clip)
    [reduction] = usdhand.reduce_hands([clip])
    filled = usdhand.fill_fingers(body, built.library)
    spliced = usdhand.splice_hands(body, fingers, pins=["1:1", "181:403"])
    library = replace(built.library, clips=tuple(built.library.clips) * 200)
    conventions = usdhand.load_conventions({"left": {"wrist": LONG}})
    found = [
        clip,
        clip.skeleton,
        replace(clip.origin, path=Path(LONG)),
        hands,
        hands.frames["left"],
        hands.character,
        hands.character.hands["left"],
        hands.encode(clip),
        library,
        replace(library.clips[0], name=LONG, label=LONG, actor=LONG),
        library.clips[0].hands["left"],
        built,
        filled,
        spliced,
        spliced.hands["left"],
        reduction,
        reduction.rig,
        reduction.rig.relations[0],
        usdhand.compare(clip, clip),
        usdhand.HandError(LONG, "left", "fill", 1.0, 2.0, 3.0, 4),
        usdhand.Agreement(LONG, (LONG,) * 50, 0.5, np.eye(50), 10),
        usdhand.Converted(clip, clip, True, (Problem("code", LONG),) * 30),
        usdhand.preview_clips([gestures[0]]),
        usdhand.run(usdhand.CheckRequest(files=(str(gestures[0]),))),
        Problem("code", LONG, LONG, file=LONG),
        conventions,
        conventions.conventions[0],
        usdhand.Grafted(clip, {"left": (LONG,) * 20}),
        usdhand.FillSettings(
            metric=usdhand.Metric(LONG, {"wrist": 1.0}),
            segmentation=usdhand.Segmentation(shortest=0.1),
        ),
        usdhand.Metric(LONG, {"wrist": 1.0, "forearm": 2.0, "hips_palm": 3.0, "upper_arm": 4.0}),
        usdhand.Segmentation(speed=3.0),
        usdhand.SpliceSettings(pins=(usdhand.Pin(0.0, 0.0, name=LONG),) * 99),
        usdhand.Pin(0.0, 0.0, name=LONG),
        usdhand.ReduceSettings(preset=4),
        usdhand.Variation(0.5, 3),
        usdhand.Edits(fps=24.0, trim=(1.0, 2.0)),
        usdhand.Reading(skel=LONG, animation=LONG),
        usdhand.PreviewSettings(max_points=0),
        usdhand.Request(),
    ]
    by_name = {type(value).__name__: value for value in found}
    requests = {n: request(k) for n, k in TYPES.items() if n.endswith("Request") and n != "Request"}
    return by_name | requests


@pytest.mark.parametrize("name", TYPES)
def test_every_public_value_is_a_short_line(name: str, values: dict[str, Any]) -> None:
    line = repr(values[name])
    assert line.startswith(f"{name}(")
    assert line.endswith(")")
    assert len(line) < LONGEST
    assert "\n" not in line


class Rows(HTMLParser):
    """Texts of cells; complains about elements that a table of texts has not."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        assert tag in ("table", "caption", "tr", "th", "td")
        assert not attrs

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.mark.parametrize("name", TYPES)
def test_every_public_value_is_a_small_table_in_notebooks(
    name: str, values: dict[str, Any]
) -> None:
    rows = Rows()
    rows.feed(values[name]._repr_html_())
    rows.close()
    assert rows.texts[0] == name
    assert all(len(text) < LONGEST for text in rows.texts)


def test_a_clip_says_what_it_is() -> None:
    clip = sample("gestures/ok_01")
    assert repr(clip) == "Clip(name='ok_01', joints=62, frames=47, fps=30, seconds=1.5333)"
    assert "<tr><th>frames</th><td>47</td></tr>" in clip._repr_html_()  # type: ignore[attr-defined]


def test_settings_say_what_differs_from_their_defaults() -> None:
    assert repr(usdhand.FillSettings()) == "FillSettings()"
    assert repr(usdhand.FillSettings(k=7, couple=True)) == "FillSettings(k=7, couple=True)"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1 / 3, "0.33333"),
        (Path("a/b"), "'a/b'"),
        (np.zeros((3, 4), np.float32), "float32[3, 4]"),
        ((1, 2), "(1, 2)"),
        (tuple(range(9)), "(0, 1, 2, 9 in all)"),
        ({"left": 1}, "{'left': 1}"),
        ([], "()"),
    ],
)
def test_values_in_a_few_words(value: object, text: str) -> None:
    assert short(value) == text


def test_texts_are_cut_where_they_are_too_long() -> None:
    assert cut("abc", 3) == "abc"
    assert cut("a" * 500, LONGEST_LINE).endswith("a...")
    assert len(cut("a" * 500, LONGEST_LINE)) == LONGEST_LINE
