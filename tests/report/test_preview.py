"""The page of preview as a file: it leads nowhere, and what is wrong is said."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import pytest
from builders.cli_runner import edit, run
from builders.preview_pages import (
    GESTURES,
    Results,
    page_data,
    shared_results,
)
from builders.shared_work import SharedWork

from usdhand.errors import InputError
from usdhand.report.preview.page import figure

OK = GESTURES / "ok_01.usdc"
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M0 0"/></svg>'
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNk+A8AAQUBAScY42YAAAAASUVORK5CYII="
)


@pytest.fixture(scope="module")
def results(shared_work: SharedWork) -> Results:
    return shared_results(shared_work)


def test_nothing_in_a_page_leads_outside(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "all.html"
    run("preview", results.filled, "-o", page)
    text = page.read_text(encoding="utf-8")
    own, data = text.split('id="page-data">')
    assert not re.search(r"(?:src|href)\s*=\s*[\"']?(?!data:)", own.split("importmap")[0])
    assert "default-src 'none'" in own
    assert "://" not in data
    assert "MIT License" in text
    assert "Copyright \N{COPYRIGHT SIGN} 2010-2026 three.js authors" in text


def test_names_and_figures_cannot_become_markup(tmp_path: Path) -> None:
    evil = "</script><script>alert(1)</script>"
    picture = tmp_path / "curve_of_index.svg"
    picture.write_text('<svg xmlns="http://www.w3.org/2000/svg"><script>alert(1)</script></svg>')
    page = tmp_path / "evil.html"
    run("preview", OK, "-o", page, "--title", evil, "--figure", picture)
    text = page.read_text(encoding="utf-8")
    assert "alert(1)</script>" not in text
    data = page_data(page)
    assert data["title"] == evil
    assert data["figures"][0]["name"] == "curve of index"
    assert data["figures"][0]["source"].startswith("data:image/svg+xml;base64,")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.svg", SVG.encode(), None),
        ("a.svg", b"\xff\xfe" + SVG.encode("utf-16-le"), None),
        ("a.svg", SVG.encode()[:-6], "not XML"),
        ("a.svg", b"", "not XML"),
        ("a.svg", PNG, "not XML"),
        ("a.svg", b'<?xml version="1.0" encoding="nonsense"?><svg/>', "not XML"),
        ("a.svg", b"<html><svg/></html>", "its root is 'html'"),
        ("a.svg", b"<svg/>", "its root is 'svg', not 'svg' of http://www.w3.org/2000/svg"),
        ("a.PNG", PNG, None),
        ("a.png", SVG.encode(), "does not begin like one"),
        ("a.png", PNG[:20], "does not begin like one"),
        ("a.png", PNG[:19] + b"\x07" + PNG[20:], "damaged header"),
        ("a.png", PNG[:40], "not complete"),
    ],
)
def test_figures_are_what_they_are_named(
    tmp_path: Path, name: str, content: bytes, words: str | None
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    if words is None:
        assert figure(path)["source"].endswith(base64.b64encode(content).decode())
        return
    with pytest.raises(InputError) as caught:
        figure(path)
    assert words in str(caught.value)
    assert name in str(caught.value)


def test_files_of_the_same_name_are_told_apart(tmp_path: Path) -> None:
    other = tmp_path / "ok_01.usdc"
    edit(OK, other, lambda stage: stage)
    run("preview", OK, other, "-o", tmp_path / "two.html")
    names = [lane["name"] for lane in page_data(tmp_path / "two.html")["lanes"]]
    assert names == ["gestures/ok_01", f"{tmp_path.name}/ok_01"]
    assert str(tmp_path) not in (tmp_path / "two.html").read_text(encoding="utf-8")


def test_many_files_are_not_all_shown_at_first(tmp_path: Path) -> None:
    done = run("preview", *sorted(GESTURES.glob("ok_*.usdc")), "-o", tmp_path / "many.html",
               "--max-points", "0")  # fmt: skip
    assert "the first 6 of 8 lanes are shown" in done.output
    data = page_data(tmp_path / "many.html")
    assert [lane["shown"] for lane in data["lanes"]] == [True] * 6 + [False] * 2
    assert data["title"] == "ok_01, ok_02 and 6 more"


def test_json_tells_what_was_made(tmp_path: Path) -> None:
    page = tmp_path / "ok.html"
    done = run("preview", OK, "-o", page, "--json")
    result = json.loads(done.stdout)
    assert result["schema"] == "usdhand.preview/1"
    assert result["bytes"] == page.stat().st_size
    assert result["lanes"][0]["hands"] == ["left", "right"]
    assert result["lanes"][0]["meshes"] == 7


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["ok.usda"], 2, "cannot write '.usda'"),
        (["there.html"], 2, "use --force"),
        (["ok.html", "--with-report", "report.json"], 3, "no JSON"),
        (["ok.html", "--with-report", "list.json"], 3, "not a report of usdhand"),
        (["ok.html", "--with-report", "reduce.json"], 2, "a report of 'reduce'"),
        (["ok.html", "--with-report", "half.json"], 3, "not complete"),
        (["ok.html", "--with-report", "gone.json"], 3, "cannot be read"),
        (["ok.html", "--figure", "list.json"], 3, "not a figure"),
        (["ok.html", "--figure", "gone.svg"], 3, "no such file"),
        (["ok.html", "--skel", "Nobody"], 2, "Nobody"),
    ],
)
def test_what_is_wrong_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: int, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.html").write_text("mine")
    Path("report.json").write_text("{")
    Path("list.json").write_text("[1]")
    Path("reduce.json").write_text('{"schema": "usdhand.reduce/1"}')
    Path("half.json").write_text('{"schema": "usdhand.fill/1", "hands": {"left": {}}}')
    done = run("preview", OK, "-o", *arguments, code=code)
    assert words in done.output
    assert not Path("ok.html").exists()
    assert Path("there.html").read_text() == "mine"


def test_there_must_be_something_to_show() -> None:
    from usdhand.verbs.preview import preview_clips

    with pytest.raises(InputError):
        preview_clips(["nothing.usdc"])
