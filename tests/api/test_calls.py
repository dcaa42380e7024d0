"""Every public function called twice, with paths as texts and as `Path`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from builders.in_memory import SAMPLES, in_memory, without_fingers

import usdhand
from usdhand.requests.verbs import VERBS, request_class

GESTURES = sorted((SAMPLES / "gestures").glob("ok_*.usdc"))[:4]
OK = GESTURES[0]
BEN = SAMPLES / "characters" / "ben.usdc"
BODY, FINGERS = (
    SAMPLES / "conversations" / "talk_01_body.usdc",
    SAMPLES / "hands" / "talk_01_hands_a.usdc",
)
PINS = ("1:1", "181:403")
FUNCTIONS = [n for n in usdhand.__all__ if inspect.isfunction(getattr(usdhand, n))]
Kind = Callable[[Path], Any]  # str or Path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library, a rig, a report, a map file, a page and a body without fingers."""
    folder = tmp_path_factory.mktemp("calls")
    library = usdhand.build_library(GESTURES, folder / "library.usdc").library
    usdhand.write_library(library, folder / "library.usdc")
    usdhand.run(
        usdhand.ReduceRequest(
            clips=(str(OK),), output=folder / "rig.usda", report=folder / "report.json"
        )
    )
    usdhand.run(
        usdhand.SpliceRequest(
            body=BODY,
            hands=FINGERS,
            output=folder / "spliced.usda",
            pins=PINS,
            report=folder / "spliced.json",
        )
    )
    (folder / "map.toml").write_text('[left]\nwrist = "LeftHand"\n', encoding="utf-8")
    (folder / "figure.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>", "utf-8")
    return folder


def calls(kind: Kind, folder: Path) -> Mapping[str, Callable[[], object]]:
    """A call of each public function with all the paths that it takes."""
    clip, body, fingers = (usdhand.read_clip(path) for path in (OK, BODY, FINGERS))
    library = usdhand.read_library(folder / "library.usdc")
    hands = usdhand.find_hands(clip)
    [reduction] = usdhand.reduce_hands([clip])
    filled = usdhand.fill_fingers(body, library)
    spliced = usdhand.splice_hands(body, fingers, pins=PINS)
    page = usdhand.preview_clips([clip])
    bare = without_fingers(in_memory(body))

    def at(name: str) -> Any:
        return kind(folder / name)

    over = {"force": True, "inputs": [kind(OK)]}
    return {
        "add_finger_joints": lambda: usdhand.add_finger_joints(bare, clip.skeleton, hands),
        "animation_names": lambda: usdhand.animation_names(kind(OK)),
        "apply_rig": lambda: usdhand.apply_rig(reduction.rig, clip, hands),
        "build_library": lambda: usdhand.build_library(
            [kind(path) for path in GESTURES], at("built.usdc"), previous=library
        ),
        "check_file": lambda: usdhand.check_file(kind(OK)),
        "compare": lambda: usdhand.compare(kind(OK), kind(GESTURES[1])),
        "convert": lambda: usdhand.convert(kind(OK), at("ben.usdc"), onto=kind(BEN), force=True),
        "expand": lambda: usdhand.expand(at("rig.usda")),
        "expand_motion": lambda: usdhand.expand_motion(reduction.rig, clip, kind(BEN)),
        "expand_onto": lambda: usdhand.expand_onto(at("rig.usda"), kind(BEN)),
        "fill_fingers": lambda: usdhand.fill_fingers(body, library),
        "find_hands": lambda: usdhand.find_hands(clip),
        "fit_rig": lambda: usdhand.fit_rig([kind(OK)]),
        "label_agreement": lambda: usdhand.label_agreement(labelled(library)),
        "make_request": lambda: usdhand.make_request({"verb": "check", "files": [str(OK)]}),
        "load_conventions": lambda: usdhand.load_conventions(at("map.toml")),
        "measure_library": lambda: usdhand.measure_library(library, kind(folder)),
        "parse_pin": lambda: usdhand.parse_pin("1:1", body, fingers),
        "preview_clips": lambda: usdhand.preview_clips(
            [at("spliced.usda")], reports=[at("spliced.json")], figures=[at("figure.svg")]
        ),
        "read_character": lambda: usdhand.read_character(kind(BEN)),
        "read_clip": lambda: usdhand.read_clip(kind(OK)),
        "read_library": lambda: usdhand.read_library(at("library.usdc")),
        "read_rig": lambda: usdhand.read_rig(at("rig.usda")),
        "reduce_hands": lambda: usdhand.reduce_hands([clip]),
        "retarget_hands": lambda: usdhand.retarget_hands(clip, body),
        "run": lambda: usdhand.run(usdhand.InspectRequest(files=[kind(OK)])),
        "splice_hands": lambda: usdhand.splice_hands(body, fingers, pins=PINS),
        "write_clip": lambda: usdhand.write_clip(clip, at("clip.usda"), **over),
        "write_filled": lambda: usdhand.write_filled(filled, at("filled.usda"), **over),
        "write_library": lambda: usdhand.write_library(library, at("again.usdc"), force=True),
        "write_new": lambda: usdhand.write_new(clip, at("new.bvh"), force=True),
        "write_preview": lambda: usdhand.write_preview(page, at("page.html"), **over),
        "write_rig": lambda: usdhand.write_rig(reduction, at("rig_again.usda"), force=True),
        "write_spliced": lambda: usdhand.write_spliced(spliced, at("spliced_again.usda"), **over),
    }


def labelled(library: usdhand.MotionLibrary) -> usdhand.MotionLibrary:
    """The library with labels that two clips each have."""
    clips = [replace(c, label=f"label {i % 2}") for i, c in enumerate(library.clips)]
    return replace(library, clips=tuple(clips))


@pytest.mark.parametrize("kind", [str, Path])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_can_be_called_twice(name: str, kind: Kind, folder: Path) -> None:
    call = calls(kind, folder)[name]
    first, second = call(), call()
    assert type(first) is type(second)


def requests(kind: Kind, folder: Path) -> Mapping[str, dict[str, Any]]:
    """The arguments of a request of each verb."""

    def at(name: str) -> Any:
        return kind(folder / name)

    over = {"force": True, "maps": [at("map.toml")]}
    return {
        "inspect": {"files": [kind(OK)], "maps": [at("map.toml")]},
        "reduce": {"clips": [kind(OK)], "output": at("a.usda"), **over},
        "expand": {"rig": at("rig.usda"), "output": at("b.usda"), "onto": kind(BEN), "force": True},
        "library build": {"clips": [kind(p) for p in GESTURES], "output": at("c.usdc"), **over},
        "library info": {"library": at("library.usdc")},
        "fill": {"body": kind(BODY), "library": at("library.usdc"), "output": at("d.usda"), **over},
        "splice": {
            "body": kind(BODY),
            "hands": kind(FINGERS),
            "output": at("e.usda"),
            "pins": list(PINS),
            "report": at("e.json"),
            **over,
        },
        "evaluate": {"library": at("library.usdc"), "takes": [kind(OK)], "maps": [at("map.toml")]},
        "compare": {"a": kind(OK), "b": kind(GESTURES[1]), "maps": [at("map.toml")]},
        "convert": {"files": [kind(OK)], "output": at("f.bvh"), "onto": kind(BEN), "force": True},
        "preview": {
            "files": [at("spliced.usda")],
            "output": at("g.html"),
            "reports": [at("spliced.json")],
            "figures": [at("figure.svg")],
            **over,
        },
        "check": {"files": [kind(OK)]},
        "schema": {},
        "rerun": {"report_file": at("report.json"), "output": at("h.usda"), "force": True},
    }


@pytest.mark.parametrize("kind", [str, Path])
@pytest.mark.parametrize("verb", VERBS)
def test_every_request_runs_twice(verb: str, kind: Kind, folder: Path) -> None:
    given = requests(kind, folder)[verb]
    for _ in range(2):
        outcome = usdhand.run(request_class(verb)(**given))
        assert outcome.exit_code == 0
        assert all(isinstance(path, Path) for path in (*outcome.inputs, *outcome.written))
        assert outcome.to_text()
        assert verb == "schema" or outcome.to_json()  # that makes no report


def test_a_text_where_several_are_wanted_is_refused() -> None:
    with pytest.raises(
        usdhand.UsageError, match=r"'files' takes several: give a list, \['a.usd'\]"
    ):
        usdhand.InspectRequest(files="a.usd")  # type: ignore[arg-type]
