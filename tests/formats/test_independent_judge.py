"""What is written is clean for a validator that is not ours: usd-validation-nvidia."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import pytest
from builders.cli_runner import run
from conftest import REPOSITORY

judge = pytest.importorskip(
    "usd_validation_nvidia", reason="usd-validation-nvidia is not installed: pip install .[test]"
)
SAMPLES = REPOSITORY / "samples"
FULL, BODY = (SAMPLES / "conversations" / f"talk_01_{kind}.usdc" for kind in ("full", "body"))


def failures(path: Path) -> list[str]:
    """What the judge calls a failure or an error."""
    logging.getLogger("usd_validation_nvidia").setLevel(logging.CRITICAL)
    issues = judge.ValidationEngine().validate(str(path)).issues()
    return [str(i.message) for i in issues if i.severity.name in ("FAILURE", "ERROR")]


@pytest.mark.parametrize("folder", sorted(p for p in SAMPLES.iterdir() if list(p.glob("*.usdc"))))
def test_samples_are_clean(folder: Path) -> None:
    for path in sorted(folder.glob("*.usdc")):
        assert not failures(path), path


@pytest.mark.parametrize(
    "options",
    [
        ("reduce", FULL),
        ("convert", FULL),
        ("convert", FULL, "--up", "Z", "--scale", 2, "--fps", 24, "--start", 7),
        ("convert", FULL, "--root-motion", "drop"),
    ],
)
@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
def test_results_are_clean(options: Sequence[object], suffix: str, tmp_path: Path) -> None:
    target = tmp_path / f"out.{suffix}"
    run(*options, "-o", target)
    assert not failures(target)


def test_flattened_and_fitted_rigs_are_clean(tmp_path: Path) -> None:
    for name, option in (
        ("flat.usdc", "--flatten"),
        ("a.usda", "--fit-only"),
        ("b.usdc", "--fit-only"),
    ):
        run("reduce", FULL, "-o", tmp_path / name, option)
        assert not failures(tmp_path / name), name


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_libraries_and_what_comes_of_them_are_clean(suffix: str, tmp_path: Path) -> None:
    library = tmp_path / f"library.{suffix}"
    run("library", "build", SAMPLES / "gestures_ben", "-o", library)
    assert not failures(library)
    for number, more in enumerate(([], ["--alternatives", 3], ["--flatten"])):
        target = tmp_path / f"filled{number}.{'usdc' if more == ['--flatten'] else suffix}"
        run("fill", BODY, "--library", library, "-o", target, *more)
        assert not failures(target)


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usdz"])
def test_expanded_and_spliced_results_are_clean(suffix: str, tmp_path: Path) -> None:
    rig, expanded, spliced = (tmp_path / f"{name}.{suffix}" for name in ("rig", "full", "spliced"))
    run("reduce", FULL, "-o", rig)
    run("expand", rig, "-o", expanded)
    run("splice", BODY, FULL, "-o", spliced)
    for path in (expanded, spliced):
        assert not failures(path)


def test_what_comes_from_other_formats_is_clean(tmp_path: Path) -> None:
    for suffix in ("bvh", "glb"):
        middle = tmp_path / f"clip.{suffix}"
        run("convert", FULL, "-o", middle)
        for target in (tmp_path / f"{suffix}.usda", tmp_path / f"{suffix}.usdc"):
            run("convert", middle, "-o", target)
            assert not failures(target)
