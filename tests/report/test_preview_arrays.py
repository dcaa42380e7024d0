"""Numbers of the page of preview: as exact as stated, meshes as USD moves them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders.cli_runner import edit, run
from builders.preview_pages import (
    GESTURES,
    SAMPLES,
    page_data,
    unpacked,
)
from conftest import shared_data
from pxr import Usd, UsdGeom, UsdSkel

import usdhand
from usdhand.formats.usd.shown import read_shown
from usdhand.formats.usd.skins import read_skins
from usdhand.formats.usd.stage import find_character
from usdhand.formats.usd.world import world_above
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.report.preview.pack import Pack

OK = GESTURES / "ok_01.usdc"


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
    # In a copy: the file's own layer, once changed, would be saved with whatever uses it next.
    stage = Usd.Stage.Open(character.stage.Flatten())
    root = stage.GetPrimAtPath(character.root.GetPath())
    UsdSkel.BakeSkinning(UsdSkel.Root(root))
    for skin, points in zip(skins, skinned(clip, frame, skins), strict=True):
        [mesh] = [
            UsdGeom.Mesh(p)
            for p in Usd.PrimRange(root)
            if p.IsA(UsdGeom.Mesh) and p.GetName() == skin.name
        ]
        baked = np.asarray(mesh.GetPointsAttr().Get(time), float)
        place = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(time))
        units = 100.0 * UsdGeom.GetStageMetersPerUnit(stage)
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
