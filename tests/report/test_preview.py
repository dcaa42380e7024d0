"""The page of preview: what is in it, checked without a browser."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import edit, run
from builders.preview_pages import (
    GESTURES,
    SAMPLES,
    Results,
    joined,
    make_results,
    page_data,
    unpacked,
)
from conftest import shared_data
from pxr import Usd, UsdGeom, UsdSkel

import usdhand
from usdhand.errors import InputError
from usdhand.formats.usd.shown import read_shown
from usdhand.formats.usd.skins import read_skins
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.world import world_above
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.report.preview.pack import Pack
from usdhand.report.preview.page import figure

OK = GESTURES / "ok_01.usdc"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return make_results(tmp_path_factory.mktemp("results"))


# Arrays


def test_rotations_are_as_exact_as_stated() -> None:
    clip = usdhand.read_clip(OK)
    pack = Pack()
    kept = [pack.rotations(clip.rotations[:, j]) for j in range(len(clip.skeleton))]
    tables = unpacked(pack.document())
    errors = [
        rot.angle_between(clip.rotations[:, j], rot.normalize(tables[i])).max()
        for j, i in enumerate(kept)
    ]
    assert 0 < max(errors) < 0.0035
    shown = np.stack([np.broadcast_to(rot.normalize(tables[i]), (len(clip), 4)) for i in kept], 1)
    posed = forward_kinematics(replace(clip, rotations=rot.make_continuous(shown)))
    added_up = rot.angle_between(posed.rotations, forward_kinematics(clip).rotations)
    assert max(errors) < added_up.max() < 0.02


@pytest.mark.parametrize("span", [1e-4, 1.0, 250.0, 40_000.0])
def test_curves_keep_the_precision_of_their_range(span: float) -> None:
    values = np.random.default_rng(1).uniform(-0.3 * span, 0.7 * span, (200, 3))
    pack = Pack()
    pack.curve(values)
    [table] = unpacked(pack.document())
    assert np.abs(table - values).max() <= 0.51 * np.ptp(values) / 65534


def test_what_does_not_move_is_one_row_and_equal_arrays_are_one() -> None:
    pack = Pack()
    still = np.tile([1.0, 2.0, 3.0], (100, 1))
    moving = np.linspace(0, 1, 300).reshape(100, 3)
    first, second = pack.curve(still), pack.curve(moving)
    assert pack.curve(moving.copy()) == second != first
    document = pack.document()
    assert [entry["rows"] for entry in document["arrays"]] == [1, 100]
    np.testing.assert_allclose(unpacked(document)[0], still[:1], atol=1e-4)


@pytest.mark.parametrize("largest", [200, 60_000, 3_000_000])
def test_whole_numbers_stay_whole(largest: int) -> None:
    values = np.random.default_rng(2).integers(0, largest, (50, 4), endpoint=True)
    pack = Pack()
    pack.integers(values)
    np.testing.assert_array_equal(unpacked(pack.document())[0], values)


# Meshes


def skinned(clip: Clip, frame: int, skins: tuple) -> list[np.ndarray]:
    """Points as the page moves them: weights, inverse bind, world transforms."""
    pose = forward_kinematics(clip)
    world = np.tile(np.eye(4), (len(clip.skeleton), 1, 1))
    world[:, :3, :3] = rot.to_matrix(pose.rotations[frame])
    world[:, :3, 3] = pose.positions[frame]
    found = []
    for skin in skins:
        moves = world @ skin.inverse_bind
        points = np.c_[skin.points, np.ones(len(skin.points))]
        each = np.einsum("nkij,nj->nki", moves[skin.joints], points)
        found.append(np.einsum("nki,nk->ni", each, skin.weights)[:, :3])
    return found


@pytest.mark.parametrize("name", ["gestures/ok_01", "gestures_ben/ok_01"])
def test_meshes_move_as_usd_moves_them(name: str) -> None:
    assert_same_points(SAMPLES / f"{name}.usdc", 20)


@pytest.mark.real_data
def test_a_mesh_from_maya_moves_as_usd_moves_it() -> None:
    assert_same_points(shared_data("maya", "HIK_Export.usda"), 30)


def assert_same_points(path: Path, frame: int) -> None:
    character = find_character(path)
    clip = usdhand.read_clip(path)
    skins, notes = read_skins(character)
    assert skins
    assert not notes
    time = float(clip.time_codes[frame])
    world = world_above(character.skeleton, np.array([time]))
    UsdSkel.BakeSkinning(UsdSkel.Root(character.root))
    for skin, points in zip(skins, skinned(clip, frame, skins), strict=True):
        [mesh] = [
            UsdGeom.Mesh(p)
            for p in Usd.PrimRange(character.root)
            if p.IsA(UsdGeom.Mesh) and p.GetName() == skin.name
        ]
        baked = np.asarray(mesh.GetPointsAttr().Get(time), float)
        place = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(time))
        units = 100.0 * UsdGeom.GetStageMetersPerUnit(character.stage)
        expected = (baked @ place[:3, :3] + place[3, :3]) * units @ world.axes.T
        assert np.abs(points - expected).max() < 0.05, skin.name


def test_a_mesh_whose_faces_do_not_fit_is_left_out_with_a_word(tmp_path: Path) -> None:
    def break_hands(stage: Usd.Stage) -> None:
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Ada/Geometry/Hands"))
        mesh.GetFaceVertexCountsAttr().Set([3, 3])

    path = edit(OK, tmp_path / "broken.usdc", break_hands)
    [take] = read_shown(path)
    assert "Hands" not in [skin.name for skin in take.skins]
    assert len(take.skins) == 6
    assert "Hands" in take.notes[0]


def test_large_meshes_are_left_out_with_a_word(tmp_path: Path) -> None:
    done = run("preview", OK, "-o", tmp_path / "a.html", "--max-points", "100")
    assert "the mesh is not shown: 19428 points, more than 100" in done.output
    assert not page_data(tmp_path / "a.html")["lanes"][0]["meshes"]


# Lanes


def test_alternatives_are_lanes_and_the_body_is_stored_once(
    results: Results, tmp_path: Path
) -> None:
    run("preview", results.filled, "-o", tmp_path / "fill.html")
    data = page_data(tmp_path / "fill.html")
    first, second = data["lanes"]
    assert [first["alternative"], second["alternative"]] == ["choice_1", "choice_2"]
    assert [first["shown"], second["shown"]] == [True, False]
    joint = first["joints"].index
    assert first["rotations"][joint("Hips")] == second["rotations"][joint("Hips")]
    fingers = [n for n in first["joints"] if "HandIndex" in n or "HandMiddle" in n]
    assert any(first["rotations"][joint(n)] != second["rotations"][joint(n)] for n in fingers)
    stage = Usd.Stage.Open(str(results.filled))
    variants = [p.GetVariantSet("fingers") for p in stage.Traverse() if p.HasVariantSets()]
    assert variants[0].GetVariantSelection() == "choice_1"


def test_a_lane_says_what_the_clip_says(tmp_path: Path) -> None:
    run("preview", OK, "-o", tmp_path / "ok.html")
    data = page_data(tmp_path / "ok.html")
    [lane] = data["lanes"]
    clip = usdhand.read_clip(OK)
    assert lane["frames"] == len(clip)
    assert lane["duration"] == pytest.approx(clip.duration)
    assert lane["name"] == "ok_01"
    tables = unpacked(data)
    hands = usdhand.find_hands(clip)
    channels = hands.encode(clip)
    for side in ("left", "right"):
        curves = lane["hands"][side]["channels"]
        assert len(curves) == 25
        for name, i in curves.items():
            expected = channels.select([name]).values
            assert np.abs(tables[i] - expected).max() < 0.01
    parts = [bone["part"] for bone in lane["bones"]]
    assert min(parts.count("left"), parts.count("right")) >= 19
    radius = {part: np.mean([b["radius"] for b in lane["bones"] if b["part"] == part])
              for part in ("body", "left")}  # fmt: skip
    assert radius["left"] < 0.5 * radius["body"]


def test_cameras_know_the_front(tmp_path: Path) -> None:
    """Ada looks along +Z of a Y-up stage, Ben along -Y of one that is Z up: +Z for us."""
    run("preview", OK, SAMPLES / "gestures_ben" / "ok_01.usdc", "-o", tmp_path / "a.html")
    for lane in page_data(tmp_path / "a.html")["lanes"]:
        assert abs(lane["view"]["yaw"]) < 0.2, lane["name"]


def test_characters_without_motion_or_hands_are_shown_all_the_same(tmp_path: Path) -> None:
    run("preview", SAMPLES / "characters" / "ben.usdc", "-o", tmp_path / "still.html")
    [lane] = page_data(tmp_path / "still.html")["lanes"]
    assert lane["frames"] == 1
    takes = read_shown(SAMPLES / "characters" / "ada_hand_right.usdc")
    assert len(takes[0].clip) == 1


@pytest.mark.real_data
def test_digits_that_hang_off_nothing_have_curves(tmp_path: Path) -> None:
    """Wrist and fingers of this hand are all roots."""
    file = shared_data("gltf", "webxr-generic-hand", "left.glb")
    run("preview", file, "-o", tmp_path / "hand.html")
    [lane] = page_data(tmp_path / "hand.html")["lanes"]
    assert len(lane["hands"]["left"]["channels"]) == 25
    clip = usdhand.read_character(file)
    hands = usdhand.find_hands(clip)
    again = hands.decode(hands.encode(clip), clip)
    assert rot.angle_between(again.rotations, clip.rotations).max() < 1e-6


@pytest.mark.real_data
@pytest.mark.parametrize("side", ["left", "right"])
def test_digits_of_flat_rigs_have_bones(tmp_path: Path, side: str) -> None:
    """Wrist, metacarpals, joints and tips, none of which hangs off another."""
    file = shared_data("gltf", "webxr-generic-hand", f"{side}.glb")
    run("preview", file, "-o", tmp_path / "hand.html")
    [lane] = page_data(tmp_path / "hand.html")["lanes"]
    bones = {(lane["joints"][b["joint"]], lane["joints"][b["child"]]) for b in lane["bones"]}
    assert len(bones) == len(lane["bones"]) == 24
    index = [f"index_finger_{x}" for x in ("metacarpal", "phalanx_proximal",
             "phalanx_intermediate", "phalanx_distal", "tip")]  # fmt: skip
    assert set(zip(["wrist", *index], index, strict=False)) <= bones
    assert ("wrist", "thumb_metacarpal") in bones
    clip = usdhand.read_character(file)
    at = forward_kinematics(clip).positions[0]
    for bone in lane["bones"]:
        assert bone["part"] == side
        assert bone["loose"]
        length = np.linalg.norm(at[bone["child"]] - at[bone["joint"]])
        assert np.linalg.norm(bone["to"]) == pytest.approx(length, abs=1e-3)


@pytest.mark.real_data
def test_thumbs_beside_the_wrist_belong_to_the_hand(tmp_path: Path) -> None:
    """From the wrist to the tip, though they hang off the forearm."""
    take = shared_data("studiogalt", "full", "SG_ASL_7_2023_1_29.usdc")
    run("preview", take, "-o", tmp_path / "real.html", "--max-points", "0", "--max-frames", "2")
    [lane] = page_data(tmp_path / "real.html")["lanes"]
    parts = {lane["joints"][b["child"]]: b for b in lane["bones"]}
    for side, letter in (("left", "L"), ("right", "R")):
        chain = [f"Thumb{i}_{letter}" for i in (1, 2, 3)] + [f"Thumb3_{letter}_end"]
        assert [parts[name]["part"] for name in chain] == [side] * 4
        assert [parts[name]["loose"] for name in chain] == [True, False, False, False]
        assert lane["joints"][parts[chain[0]]["joint"]] == f"Hand_{letter}"
        assert parts[f"Forearm_{letter}"]["part"] == parts[f"Hand_{letter}"]["part"] == "body"


@pytest.mark.real_data
def test_real_takes_have_bones_of_the_body_only(tmp_path: Path) -> None:
    take = sorted(shared_data("studiogalt", "full").glob("*.usdc"))[0]
    run("preview", take, "-o", tmp_path / "real.html")
    [lane] = page_data(tmp_path / "real.html")["lanes"]
    drawn = {lane["joints"][b["child"]] for b in lane["bones"]}
    assert not drawn & {"Head_Target", "Head_Target_end", "EyeController", "Locator", "Hip_Root"}
    assert all(np.linalg.norm(b["to"]) < 60 for b in lane["bones"])
    assert set(lane["hands"]) == {"left", "right"}


def test_long_clips_are_decimated_with_a_word(tmp_path: Path) -> None:
    page = tmp_path / "long.html"
    done = run("preview", OK, "-o", page, "--max-frames", "10")
    [lane] = page_data(page)["lanes"]
    clip = usdhand.read_clip(OK)
    every = -(-len(clip) // 10)
    assert every > 3
    words = f"the page has every {every}th of {len(clip)} frames"
    assert words in done.output
    assert any(note.startswith("long clip") and words in note for note in lane["notes"])
    assert done.output.count("ok_01: ") == done.output.count("long clip") == 1
    assert lane["fps"] == pytest.approx(clip.fps / every)
    tables = unpacked(page_data(page))
    moving = [tables[i] for i in lane["rotations"] if len(tables[i]) > 1]
    assert {len(t) for t in moving} == {-(-len(clip) // every)}


def test_joined_clips_of_the_measured_page_are_one_motion(tmp_path: Path) -> None:
    clip = joined([OK, GESTURES / "ok_02.usdc"], tmp_path / "two.usdc", 3.0)
    assert len(usdhand.read_clip(tmp_path / "two.usdc")) == len(clip) == 181


# Reports


def test_segments_of_a_fill_report_are_on_the_timeline(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "fill.html"
    run("preview", results.filled, "--with-report", results.fill_report, "-o", page)
    report = json.loads(results.fill_report.read_text())
    rows = page_data(page)["rows"]
    assert [(r["label"], r["side"]) for r in rows] == [("segments", "left"), ("segments", "right")]
    for row in rows:
        segments = report["hands"][row["side"]]["segments"]
        assert [(s["start"], s["end"], s["label"]) for s in row["spans"]] == [
            (s["start"], s["end"], s["clip"]) for s in segments
        ]


def rows_with(report: Path, folder: Path, *files: Path) -> list[dict[str, Any]]:
    run("preview", *files, "--with-report", report, "-o", folder / "rows.html", "--force",
        "--max-points", "0")  # fmt: skip
    return list(page_data(folder / "rows.html")["rows"])


def test_rows_name_the_lane_that_they_tell_of(results: Results, tmp_path: Path) -> None:
    """The output, wherever it stands in the order, or else the clip that was filled."""
    body, fill = GESTURES / "ok_03.usdc", results.fill_report
    for files, lane in (
        ([OK, results.filled], "filled choice_1"),
        ([body, results.filled], "filled choice_1"),
        ([OK, body], "ok_03"),
    ):
        assert {r["lane"] for r in rows_with(fill, tmp_path, *files)} == {lane}
    hands = rows_with(results.splice_report, tmp_path, GESTURES / "ok_04.usdc")
    assert {r["lane"] for r in hands} == {"ok_04"}
    moved = [tmp_path / p.name for p in (results.filled, results.fill_report)]
    for old, new in zip((results.filled, results.fill_report), moved, strict=True):
        new.write_bytes(old.read_bytes())
    assert {r["lane"] for r in rows_with(moved[1], tmp_path, moved[0])} == {"filled choice_1"}


def test_a_report_of_another_clip_is_refused(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "other.html"
    for report, words in (
        (results.fill_report, "but of filled.usda and ok_03.usdc"),
        (results.splice_report, "but of spliced.usda and ok_03.usdc and ok_04.usdc"),
    ):
        done = run("preview", OK, "--with-report", report, "-o", page, code=2)
        assert words in done.output
    # What stands where the output was, but is as long as another clip.
    report = json.loads(results.fill_report.read_text())
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(report | {"output": str(OK), "frames": report["frames"] + 1}))
    run("preview", OK, "--with-report", changed, "-o", page, code=2)
    changed.write_text(json.dumps(report | {"inputs": [{"path": "x"}]}))
    assert "not complete" in run("preview", OK, "--with-report", changed, "-o", page, code=3).output
    assert not page.exists()


def test_distance_and_cost_of_a_segment_are_told_apart(results: Results, tmp_path: Path) -> None:
    """Costs are those in the plot of the graph."""
    first = json.loads(results.fill_report.read_text())["hands"]["left"]["segments"][0]
    detail = rows_with(results.fill_report, tmp_path, results.filled)[0]["spans"][0]["detail"]
    assert detail.endswith(f"distance {first['cost']:.4g}, cost {first['node_cost']:.3g}")
    assert first["cost"] != pytest.approx(first["node_cost"], rel=0.1)


def test_a_splice_report_retimes_its_hand_clip(results: Results, tmp_path: Path) -> None:
    page = tmp_path / "splice.html"
    run("preview", results.spliced, GESTURES / "ok_04.usdc", "--with-report",
        results.splice_report, "-o", page)  # fmt: skip
    data = page_data(page)
    report = json.loads(results.splice_report.read_text())["hands"]
    assert [r["label"] for r in data["rows"]] == ["phases", "seconds of hand clip"] * len(report)
    phases, seconds = data["rows"][:2]
    assert len(phases["spans"]) == len(report["left"]["phases"])
    assert len(phases["marks"]) == len(report["left"]["pins"]) == 1
    body, hand = np.array(report["left"]["warp"]).T
    for mark in seconds["marks"]:
        assert np.interp(mark["time"], body, hand) == pytest.approx(float(mark["label"]), abs=0.02)
    spliced, hands = data["lanes"]
    assert spliced["retime"] == {}
    assert set(hands["retime"]) == set(report)


def test_warps_come_from_the_file_where_there_is_no_report(
    results: Results, tmp_path: Path
) -> None:
    run("preview", results.spliced, "-o", tmp_path / "warp.html")
    rows = page_data(tmp_path / "warp.html")["rows"]
    warp = np.array(json.loads(results.splice_report.read_text())["hands"]["left"]["warp"])
    row = next(r for r in rows if r["side"] == "left")
    assert len(row["marks"]) == int(warp[-1, 1]) + 1


def test_a_rig_says_how_its_channels_are_made(results: Results, tmp_path: Path) -> None:
    run("preview", results.rig, "-o", tmp_path / "rig.html")
    relations = page_data(tmp_path / "rig.html")["lanes"][0]["relations"]
    assert len(relations) == 50
    assert "free" in relations.values()
    linear = [words for words in relations.values() if words.startswith("= ")]
    assert linear
    assert all(re.search(r"-?\d\.\d\d \N{MULTIPLICATION SIGN} (le|ri)\w+", w) for w in linear)


# The page


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


SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M0 0"/></svg>'
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAQAAAC1HAwCAAAAC0lEQVR42mNk+A8AAQUBAScY42YAAAAASUVORK5CYII="
)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.svg", SVG.encode(), None),
        ("a.svg", b"\xff\xfe" + SVG.encode("utf-16-le"), None),
        ("a.svg", SVG.encode()[:-6], "no XML"),
        ("a.svg", b"", "no XML"),
        ("a.svg", PNG, "no XML"),
        ("a.svg", b'<?xml version="1.0" encoding="nonsense"?><svg/>', "no XML"),
        ("a.svg", b"<html><svg/></html>", "its root is 'html'"),
        ("a.svg", b"<svg/>", "its root is 'svg', not 'svg' of http://www.w3.org/2000/svg"),
        ("a.PNG", PNG, None),
        ("a.png", SVG.encode(), "does not begin as one"),
        ("a.png", PNG[:20], "does not begin as one"),
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
        (["ok.html", "--with-report", "list.json"], 3, "no report of usdhand"),
        (["ok.html", "--with-report", "reduce.json"], 2, "a report of 'reduce'"),
        (["ok.html", "--with-report", "half.json"], 3, "not complete"),
        (["ok.html", "--with-report", "gone.json"], 3, "cannot be read"),
        (["ok.html", "--figure", "list.json"], 3, "no figure"),
        (["ok.html", "--figure", "gone.svg"], 3, "cannot be read"),
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
