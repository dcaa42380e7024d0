"""What is not possible is refused in a sentence, by settings, methods and verbs alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.in_memory import SAMPLES, arrays_of, first_frame, in_memory, sample, without_fingers

import usdhand
from usdhand.fill.metric import metric_of
from usdhand.motion.editing import scaled, starting_at
from usdhand.rigs.graft import Grafted

OK = SAMPLES / "gestures" / "ok_01.usdc"
GESTURES = sorted((SAMPLES / "gestures").glob("ok_*.usdc"))[:4]

CHOICES: list[tuple[Callable[[], object], str]] = [
    (lambda: usdhand.FillSettings(blend="soft"), "no blend 'soft'; there are smooth, linear"),
    (lambda: usdhand.SpliceSettings(align="x"), "no align 'x'; there are local, trunk"),
    (lambda: usdhand.SpliceSettings(wrist="x"), "no wrist 'x'; there are body, hands"),
    (lambda: usdhand.SpliceSettings(directions="x"), "no directions 'x'; there are spread, axes"),
    (lambda: usdhand.Pin(0.0, 0.0, side="both"), "no side 'both'; there are left, right"),
    (lambda: usdhand.ReduceSettings(fit="x"), "no fit 'x'; there are paper, least-squares"),
    (lambda: usdhand.Edits(root_motion="x"), "no root_motion 'x'; there are keep, drop"),
    (lambda: usdhand.Edits(up="X"), "no up 'X'; there are Y, Z"),
    (lambda: usdhand.Reading(up="X"), "no up 'X'; there are Y, Z"),
    (
        lambda: usdhand.FillRequest(body=OK, library=OK, output=OK, side="Left"),
        "no side 'Left'; there are left, right, both",
    ),
]
NUMBERS: list[tuple[Callable[[], object], str]] = [
    (lambda: usdhand.FillSettings(k=0), "at least one candidate"),
    (lambda: usdhand.FillSettings(alternatives=0), "one alternative"),
    (lambda: usdhand.FillSettings(factor=0.9), "length factor of 0.9"),
    (lambda: usdhand.Segmentation(shortest=1.0, longest=1.5), "at least twice the shortest"),
    (lambda: usdhand.SpliceSettings(band=(0.0, 0.1)), "above 0 and at most 1"),
    (lambda: usdhand.PreviewSettings(max_frames=1), "2 or more"),
    (lambda: usdhand.ReduceSettings(preset=9).target, "no preset 9; presets are 1, 2, 3, 4"),
    (lambda: usdhand.ReduceSettings(preset=1, rmsd=0.1).target, "not both"),
    (lambda: usdhand.ReduceSettings(rmsd=3.0).target, "an rmsd from 0 to 2"),
    (lambda: metric_of("nose"), "no metric 'nose'; there are euler, chordal, arm"),
    (lambda: scaled(sample("gestures/ok_01"), 0.0), "A scale of 0 is not possible"),
    (lambda: starting_at(sample("gestures/ok_01"), np.nan), "A start of nan is not possible"),
]


@pytest.mark.parametrize(("make", "words"), [*CHOICES, *NUMBERS])
def test_settings_that_are_not_possible(make: Callable[[], object], words: str) -> None:
    with pytest.raises(usdhand.UsageError, match=words):
        make()


def test_a_choice_may_be_left_open() -> None:
    assert usdhand.Pin(0.0, 0.0).side is None
    assert usdhand.Edits(up=None).up is None


def far_away(clip: usdhand.Clip) -> usdhand.Clip:
    """The clip with its left forearm a kilometre long."""
    elbow = clip.skeleton.find("LeftHand")
    translations = clip.translations.copy()
    translations[:, elbow] *= 1e5
    return replace(clip, translations=translations)


def test_damaged_arms_name_the_joint(tmp_path: Path) -> None:
    library = usdhand.build_library(GESTURES, tmp_path / "library.usdc").library
    body = far_away(sample("conversations/talk_01_body"))
    with pytest.raises(usdhand.InputError, match=r"joint .*LeftHand goes .* cm away from the hips"):
        usdhand.fill_fingers(body, library)


def test_a_hand_without_a_direction_gets_no_fingers() -> None:
    """All joints of the arm on one spot, and nothing below the wrist."""
    clip = without_fingers(sample("gestures/ok_01"))
    bind = clip.skeleton.bind.copy()
    wrist = clip.skeleton.find("LeftHand")
    for joint in clip.skeleton.ancestors(wrist):
        bind[joint, :3, 3] = bind[wrist, :3, 3]
    bare = usdhand.Clip.from_arrays(**arrays_of(clip) | {"bind": bind})
    donor = sample("gestures/ok_01")
    names = usdhand.load_conventions({"left": {"wrist": "LeftHand", "elbow": "LeftForeArm"}})
    with pytest.raises(usdhand.HandNotFoundError, match="the direction of the hand is unknown"):
        usdhand.add_finger_joints(
            bare, donor.skeleton, usdhand.find_hands(donor), names, sides=("left",)
        )


def test_a_donor_with_one_hand_gives_both() -> None:
    body, donor = without_fingers(in_memory(sample("gestures/ok_01"))), sample("gestures/ok_01")
    hands = usdhand.find_hands(donor, sides=("right",))
    grafted: Grafted = usdhand.add_finger_joints(body, donor.skeleton, hands)
    assert set(grafted.added) == {"left", "right"}
    assert all(len(joints) >= 15 for joints in grafted.added.values())


def test_a_library_leaves_out_what_it_cannot_use(tmp_path: Path) -> None:
    single, bare = tmp_path / "single.usda", tmp_path / "bare.usda"
    usdhand.write_new(first_frame(in_memory(sample("gestures/ok_01"))), single)
    usdhand.write_new(without_fingers(sample("gestures/ok_01")), bare)
    kept = tmp_path / ".library.interrupted.usdc"
    kept.write_bytes(b"PXR-USDC nothing")
    built = usdhand.build_library([*GESTURES, single, bare], tmp_path / "library.usdc")
    reasons = {Path(p.file).name: p.message for p in built.library.left_out}
    assert reasons["single.usda"] == "it is a single frame"
    assert "no hand found" in reasons["bare.usda"]
    assert built.read == len(GESTURES)


def test_clips_of_one_name_are_told_apart(tmp_path: Path) -> None:
    paths = []
    for folder in ("a", "b/a", "c/a"):
        (tmp_path / folder).mkdir(parents=True)
        paths.append(tmp_path / folder / "wave.bvh")
        usdhand.write_new(in_memory(sample("gestures/ok_01")), paths[-1])
    built = usdhand.build_library(paths, tmp_path / "library.usdc")
    assert {clip.name for clip in built.library.clips} == {"a_wave", "a_wave_2", "a_wave_3"}


def test_clips_that_cannot_be_filled_are_left_out_of_a_measurement(tmp_path: Path) -> None:
    library = usdhand.build_library(GESTURES, tmp_path / "library.usdc").library
    errors, left = usdhand.measure_library(
        library,
        tmp_path,
        takes=[sample("gestures/ok_01"), without_fingers(sample("gestures/ok_01"))],
    )
    assert errors
    assert ["no hand found" in problem.message for problem in left] == [True]


@pytest.mark.parametrize(
    ("request_", "error", "words"),
    [
        (
            usdhand.ReduceRequest(
                clips=[str(OK)],
                output=Path("a.usda"),
                rig=OK,
                settings=usdhand.ReduceSettings(fit="least-squares"),
            ),
            usdhand.UsageError,
            "--fit and --controllers are for fitting",
        ),
        (
            usdhand.ReduceRequest(
                clips=[str(OK), str(SAMPLES / "gestures_ben" / "ok_01.usdc")], output=Path("rigs")
            ),
            usdhand.OutputError,
            "Two clips have the same name",
        ),
        (
            usdhand.ConvertRequest(files=[str(OK)], output=Path("a.bvh"), onto_skel="Ada"),
            usdhand.UsageError,
            "which is not given",
        ),
        (
            usdhand.ConvertRequest(files=[str(OK)], output=Path("a.bvh"), to="glb"),
            usdhand.UsageError,
            "contradict each other",
        ),
        (
            usdhand.ConvertRequest(files=[str(p) for p in GESTURES], output=Path("a.bvh")),
            usdhand.UsageError,
            "4 inputs need --out-dir",
        ),
        (
            usdhand.ConvertRequest(files=[str(OK)]),
            usdhand.UsageError,
            "Give either -o OUTPUT or --out-dir DIR",
        ),
        (
            usdhand.ConvertRequest(
                files=[str(OK)], output=Path("a.bvh"), edits=usdhand.Edits(fps=1e9)
            ),
            usdhand.UsageError,
            "would make over",
        ),
        (
            usdhand.EvaluateRequest(library=OK, labels_only=True),
            usdhand.InputError,
            "ok_01",
        ),
        (
            usdhand.LibraryBuildRequest(clips=[str(OK)], output=Path("a.usdc"), labels=OK),
            usdhand.InputError,
            "cannot be read as CSV",
        ),
        (usdhand.SchemaRequest(of_report="rerun"), usdhand.UsageError, "'rerun' makes no report"),
        (usdhand.SchemaRequest(of_request="fil"), usdhand.UsageError, "Did you mean 'fill'"),
    ],
    ids=lambda value: value.verb if isinstance(value, usdhand.Request) else None,
)
def test_requests_that_cannot_be_done(
    request_: usdhand.Request,
    error: type[usdhand.UsdHandError],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=words):
        usdhand.run(request_)
    assert not list(tmp_path.iterdir())


def test_a_library_is_no_body(tmp_path: Path) -> None:
    library = tmp_path / "library.usdc"
    usdhand.run(usdhand.LibraryBuildRequest(clips=[str(GESTURES[0])], output=library))
    with pytest.raises(usdhand.UsageError, match="is a motion library"):
        usdhand.run(usdhand.FillRequest(body=library, library=library, output=tmp_path / "a.usda"))
