"""Long work tells how far it is, and stops where it is told to; nothing is written then."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from builders.in_memory import SAMPLES, sample

import usdhand
from usdhand.progress import Progress, Steps

GESTURES = sorted((SAMPLES / "gestures").glob("o*.usdc"))[:4]
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
FINGERS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
NUMBERS = count()  # of libraries: a build that was stopped goes on where it was
Work = Callable[[Progress | None], object]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library."""
    folder = tmp_path_factory.mktemp("progress")
    built = usdhand.build_library(GESTURES, folder / "library.usdc")
    usdhand.write_library(built.library, folder / "library.usdc")
    return folder


def works(folder: Path) -> dict[str, Work]:
    """All functions that tell how far they are, as functions of who listens."""
    library = usdhand.read_library(folder / "library.usdc")
    body, fingers = sample("conversations/talk_01_body"), sample("hands/talk_01_hands_a")
    settings = usdhand.FillSettings()
    return {
        "build_library": lambda p: usdhand.build_library(
            GESTURES, folder / f"new{next(NUMBERS)}.usdc", progress=p
        ),
        "measure_library": lambda p: usdhand.measure_library(library, folder, settings, progress=p),
        "fill_fingers": lambda p: usdhand.fill_fingers(body, library, progress=p),
        "splice_hands": lambda p: usdhand.splice_hands(
            body, fingers, pins=["1:1", "181:403"], progress=p
        ),
    }


NAMES = ("build_library", "measure_library", "fill_fingers", "splice_hands")


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_told_in_order_up_to_the_last(name: str, folder: Path) -> None:
    told: list[tuple[int, int]] = []
    works(folder)[name](lambda done, total: told.append((done, total)))
    steps, totals = zip(*told, strict=True)
    assert len(set(totals)) == 1
    assert steps[0] == 0
    assert steps[-1] == totals[0] > 1
    assert list(steps) == sorted(steps)
    assert len(set(steps)) > 2


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("answer", [None, True, 0, ""])
def test_only_false_stops(name: str, answer: object, folder: Path) -> None:
    if name in ("fill_fingers", "splice_hands"):
        works(folder)[name](lambda *_: answer)


@pytest.mark.parametrize("name", NAMES)
def test_it_stops_at_every_step(name: str, folder: Path) -> None:
    work = works(folder)[name]
    told: list[int] = []
    work(lambda done, _: told.append(done))
    for last in range(len(told)):
        calls: list[int] = []

        def stop(done: int, _: int, last: int = last, calls: list[int] = calls) -> bool:
            calls.append(done)
            return len(calls) <= last

        with pytest.raises(usdhand.CancelledError, match=f"Stopped after {told[last]} of"):
            work(stop)
        assert calls == told[: last + 1]


def test_a_library_that_was_stopped_keeps_what_was_read(tmp_path: Path) -> None:
    output = tmp_path / "library.usdc"
    with pytest.raises(usdhand.CancelledError):
        usdhand.build_library(GESTURES, output, progress=lambda done, _: done < 2)
    assert usdhand.build_library(GESTURES, output).read == len(GESTURES) - 2


def requests(folder: Path) -> dict[str, tuple[usdhand.Request, Path]]:
    """Requests whose runs are watched, and what they would write."""
    library, clips = folder / "library.usdc", tuple(map(str, GESTURES))
    return {
        "filling": (
            usdhand.FillRequest(body=BODY, library=library, output=folder / "filled.usda"),
            folder / "filled.usda",
        ),
        "splicing": (
            usdhand.SpliceRequest(
                body=BODY,
                hands=FINGERS,
                output=folder / "spliced.usda",
                pins=("1:1", "181:403"),
            ),
            folder / "spliced.usda",
        ),
        "evaluating": (
            usdhand.EvaluateRequest(library=library, report=folder / "evaluated.json"),
            folder / "evaluated.json",
        ),
        "reading": (
            usdhand.LibraryBuildRequest(clips=clips, output=folder / "built.usdc"),
            folder / "built.usdc",
        ),
        "writing": (
            usdhand.ReduceRequest(clips=clips, output=folder / "rigs"),
            folder / "rigs" / f"{GESTURES[1].stem}.rig.usdc",
        ),
        "converting": (
            usdhand.ConvertRequest(files=clips, out_dir=folder / "converted", to="bvh"),
            folder / "converted" / f"{GESTURES[1].stem}.bvh",
        ),
    }


@pytest.mark.parametrize("doing", ["filling", "splicing", "evaluating", "reading", "writing"])
def test_a_run_that_is_stopped_writes_nothing(doing: str, folder: Path) -> None:
    request, output = requests(folder)[doing]
    told: list[str] = []

    def watch(what: str, done: int, _: int) -> bool:
        told.append(what)
        return what != doing or done < 1

    before = set(folder.iterdir())
    with pytest.raises(usdhand.CancelledError):
        usdhand.run(request, watch=watch)
    assert doing in told
    assert not output.exists()
    left = {path for path in set(folder.iterdir()) - before if path.suffix != ".usdc"}
    assert left <= {folder / "rigs"}


def test_a_run_tells_what_it_is_doing(folder: Path) -> None:
    request, output = requests(folder)["converting"]
    told: list[Any] = []
    usdhand.run(request, watch=lambda *step: told.append(step))
    assert ("converting", len(GESTURES), len(GESTURES)) in told
    assert output.exists()


def test_steps_of_several_works_are_counted_together() -> None:
    told: list[tuple[int, int]] = []
    steps = Steps(3, lambda done, total: told.append((done, total)))
    steps.add()
    steps.add(2)
    assert told == [(0, 3), (1, 3), (3, 3)]
