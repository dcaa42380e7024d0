"""Files of plots: whole, the same every time, refused where they exist; and `--plots`."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from builders.cli_runner import run
from builders.preview_pages import page_data
from builders.shared_work import SharedWork, few_gestures
from conftest import REPOSITORY, shared_data

import usdhand
from usdhand.errors import OutputError, UsageError
from usdhand.evaluate.agreement import Agreement
from usdhand.report.plots import evaluating, reducing, splicing, style
from usdhand.splice.markers import hand_markers
from usdhand.splice.settings import SpliceSettings
from usdhand.verbs import splice as splice_api

SAMPLES = REPOSITORY / "samples"
BODY = SAMPLES / "conversations" / "talk_01_body.usdc"
HANDS = SAMPLES / "hands" / "talk_01_hands_a.usdc"
OK = SAMPLES / "gestures" / "ok_01.usdc"
PINS = ("1:1", "181:403")


@pytest.fixture(scope="module")
def library_file(shared_work: SharedWork) -> Path:
    return few_gestures(shared_work)


def test_files_are_the_same_every_time_and_ask_for_nothing(tmp_path: Path) -> None:
    clips = usdhand.read_clip(BODY), usdhand.read_clip(HANDS)
    alignment = splice_api.splice_hands(*clips, pins=PINS).hands["left"]
    markers = [hand_markers(c, usdhand.find_hands(c), "left", 60.0) for c in clips]
    [reduction] = usdhand.reduce_hands([usdhand.read_clip(OK)])
    names = ("reduce_errors", "splice_path_left")
    for folder in ("a", "b"):
        path = splicing.path("left", alignment, *markers, SpliceSettings())
        drawn = reducing.errors([reduction]), path
        style.write_plots(tmp_path / folder, dict(zip(names, drawn, strict=True)), force=False)
    for path in sorted((tmp_path / "a").iterdir()):
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
    ids: list[str] = []
    for name in names:
        text = (tmp_path / "a" / f"{name}.svg").read_text()
        own = re.findall(r'\bid="([^"]*)"', text)
        assert all(i.startswith(f"{name}-") for i in own)
        used = re.findall(r'href="#([^"]*)"', text) + re.findall(r"url\(#([^)]*)\)", text)
        assert used
        assert set(used) <= set(own)
        assert re.findall(r'href="(?!#|data:)', text) == []
        assert "<dc:date>" not in text
        ids += own
        assert (tmp_path / "a" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert len(ids) == len(set(ids))


def test_own_settings_of_matplotlib_do_not_matter(tmp_path: Path) -> None:
    import matplotlib

    def drawn(folder: str) -> bytes:
        figure = evaluating.features([Agreement("near", ("a", "b"), 0.5, np.eye(2), 10)])
        style.write_plots(tmp_path / folder, {"x": figure}, force=False)
        return (tmp_path / folder / "x.svg").read_bytes()

    plain = drawn("plain")
    with matplotlib.rc_context({"font.size": 30, "svg.fonttype": "none", "axes.grid": True}):
        assert drawn("other") == plain


@pytest.mark.filterwarnings("error")
def test_names_are_no_formulas(tmp_path: Path) -> None:
    labels = ("$\\frac$", "a--b <&> $", "\N{CJK UNIFIED IDEOGRAPH-624B}_{^")
    agreement = Agreement("$near$", labels, 0.5, np.eye(3), 10)
    figures = evaluating.figures([agreement], [])
    style.write_plots(tmp_path, figures, force=False)
    drawn = sorted(tmp_path.glob("*.svg"))
    assert len(drawn) == len(figures) > 0
    for path in drawn:
        ElementTree.parse(path)


def test_all_or_nothing_and_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    agreement = Agreement("near", ("a", "b"), 0.5, np.eye(2), 10)
    figures = {"x": evaluating.features([agreement]), "y": evaluating.confusion(agreement)}
    (tmp_path / "y.png").write_text("mine")
    with pytest.raises(OutputError, match=r"y\.png exists; use --force"):
        style.write_plots(tmp_path, figures, force=False)
    assert [p.name for p in tmp_path.iterdir()] == ["y.png"]

    def broken(*_: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", broken)
        with pytest.raises(OutputError, match="No space left"):
            style.write_plots(tmp_path, figures, force=True)
    assert (tmp_path / "y.png").read_text() == "mine"
    assert [p.name for p in tmp_path.iterdir()] == ["y.png"]
    paths = style.write_plots(tmp_path, figures, force=True)
    assert sorted(p.name for p in paths) == ["x.png", "x.svg", "y.png", "y.svg"]
    assert (tmp_path / "y.png").read_bytes().startswith(b"\x89PNG")


def test_names_are_shortened_to_what_tells_them_apart() -> None:
    long = style.shortened(["take_of_Monday_ok_01", "take_of_Monday_palm_presentation_01"], 12)
    assert list(long.values()) == ["ok_01", "palm_p…on_01"[:7] + long_end(long)]
    assert all(len(name) <= 12 for name in long.values())
    assert style.shortened(["ok_01", "ok_02"], 12) == {"ok_01": "ok_01", "ok_02": "ok_02"}


def long_end(names: dict[str, str]) -> str:
    return list(names.values())[1][7:]


# The command line


def test_reduce_draws(tmp_path: Path) -> None:
    folder = tmp_path / "plots" / "deep"
    given = ("reduce", OK, "-n", "-o", tmp_path / "rig.usda", "--plots", folder)
    assert f"plots written to {folder}" in run(*given).output
    names = {p.stem for p in folder.glob("*.svg")}
    assert names == {p.stem for p in folder.glob("*.png")} == set(reducing.NAMES)
    assert max(p.stat().st_size for p in folder.glob("*.svg")) < 300_000
    assert not (tmp_path / "rig.usda").exists()
    assert "use --force" in run(*given, code=2).output


def test_no_plot_of_what_there_is_nothing_to_show_of(tmp_path: Path) -> None:
    """All channels that move are free here: none follows, and none is changed."""
    given = ("-n", "-o", tmp_path / "rig.usda", "--plots", tmp_path)
    run("reduce", OK, "--max-error", "0.0001", *given)
    assert {p.stem for p in tmp_path.glob("*.svg")} == {"reduce_histograms", "reduce_errors"}


def test_plots_are_refused_before_any_work(tmp_path: Path) -> None:
    """Also where it is not yet known which hands there will be."""
    (tmp_path / "fill_graph_right.png").write_text("mine")
    missing = tmp_path / "none.usdc"
    given = ("fill", BODY, "--library", missing, "-o", tmp_path / "x.usda", "--plots", tmp_path)
    assert "fill_graph_right.png exists" in run(*given, code=2).output
    file = tmp_path / "file"
    file.write_text("")
    run("reduce", OK, "-n", "-o", tmp_path / "x.usda", "--plots", file, code=2)
    inside = file / "plots"
    text = run("reduce", OK, "-n", "-o", tmp_path / "x.usda", "--plots", inside, code=2).output
    assert "is a file" in text
    text = run("reduce", OK, "-n", "-o", tmp_path / "x.usda", "--plots", "", code=2).output
    assert "a folder cannot have an empty name" in text


def test_fill_and_evaluate_draw(library_file: Path, tmp_path: Path) -> None:
    given = ("--library", library_file, "-q", "-o", tmp_path / "talk.usda", "--plots", tmp_path)
    run("fill", OK, "--replace", "--side", "right", *given)
    assert {p.name for p in tmp_path.glob("*.svg")} == {
        "fill_graph_right.svg",
        "fill_speed_right.svg",
    }
    run("evaluate", library_file, "--k", "2", "-q", "--plots", tmp_path)
    assert {p.stem for p in tmp_path.glob("evaluate_*.svg")} == set(evaluating.NAMES)


def test_couple_draws_both_hands_as_one_over_what_was_there(
    library_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "fill_graph_both.svg").write_text("old")
    given = ("--library", library_file, "-n", "-o", tmp_path / "talk.usda", "--force", "--json")
    text = run("fill", OK, "--replace", "--couple", *given, "--plots", tmp_path).stdout
    assert text.startswith("{")
    assert "<svg" in (tmp_path / "fill_graph_both.svg").read_text()
    assert {p.stem for p in tmp_path.glob("*.svg")} == {"fill_graph_both", "fill_speed_both"}


def test_splice_draws_and_the_page_shows(tmp_path: Path) -> None:
    pins = [x for pin in PINS for x in ("--pin", pin)]
    out = tmp_path / "talk.usda"
    run("splice", BODY, HANDS, *pins, "-q", "-o", out, "--side", "left", "--plots", tmp_path)
    plots = sorted(tmp_path.glob("*.svg"))
    assert [p.stem for p in plots] == ["splice_curves_left", "splice_path_left"]
    page = tmp_path / "page.html"
    figures = [x for plot in plots for x in ("--figure", plot)]
    run("preview", OK, "-q", "-o", page, *figures)
    shown = page_data(page)["figures"]
    assert [f["name"] for f in shown] == ["splice curves left", "splice path left"]
    assert all(f["source"].startswith("data:image/svg+xml") for f in shown)


def test_without_matplotlib_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = importlib.util.find_spec

    def without(name: str, package: str | None = None) -> Any:
        return None if name == "matplotlib" else there(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", without)
    with pytest.raises(UsageError, match=r"usdhand\[plots\]"):
        style.check_plots(tmp_path, ("x",), force=False)
    missing = tmp_path / "none.usdc"  # not even read
    given = ("reduce", missing, "-n", "-o", tmp_path / "rig.usda")
    assert "pip install 'usdhand[plots]'" in run(*given, "--plots", tmp_path, code=2).output


# Real takes


@pytest.mark.real_data
def test_a_real_take_spliced(tmp_path: Path) -> None:
    name = "SG_ASL_5_2023_1_29.usdc"
    full, mini = (shared_data("studiogalt", rig, name) for rig in ("full", "mini"))
    run("splice", full, mini, "-q", "-n", "-o", tmp_path / "x.usda", "--plots", tmp_path)
    # Its left hand hardly moves and follows the right one.
    drawn = {p.stem: p.stat().st_size for p in tmp_path.glob("*.svg")}
    assert set(drawn) == {"splice_curves_left", "splice_curves_right", "splice_path_right"}
    assert max(drawn.values()) < 300_000
