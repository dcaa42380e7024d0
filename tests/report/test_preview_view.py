"""The 3D view of the page of preview in a real browser."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.browser import BLUE, ORANGE, READY, WIDTH, Pages, near
from builders.cli_runner import run
from builders.preview_pages import page_data
from conftest import shared_data

import usdhand
from usdhand.motion import forward_kinematics
from usdhand.motion import rotations as rot

pytestmark = pytest.mark.browser


def test_it_opens_and_shows_a_character_on_each_lane(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    assert page.labels == ["filled choice_1", "ok_03"]
    left, right = np.array_split(page.picture, 2, axis=1)
    background = page.picture[-3, -3]
    for half in (left, right):
        drawn = np.abs(half - background).max(axis=-1) > 40
        assert drawn.mean() > 0.02
    # The same body with other fingers: both halves look alike below the labels.
    assert np.abs(left - right)[60:].max(axis=-1).mean() < 8
    assert page.page.locator("#trouble").is_hidden()


@pytest.mark.parametrize("name", ["fill", pytest.param("splice", marks=pytest.mark.slow)])
def test_motion_on_the_page_is_that_of_the_clip(pages: Pages, made_pages: Path, name: str) -> None:
    """The page's own modules, posed at whole and half frames, against our kinematics."""
    page = pages.open(made_pages / f"{name}.html")
    clip = usdhand.read_clip(made_pages / {"fill": "filled.usda", "splice": "spliced.usda"}[name])
    frames = [0, 7, len(clip) - 1]
    found = page.page.evaluate(
        """async (frames) => {
          const { unpack } = await import('data');
          const { Character } = await import('character');
          const page = JSON.parse(document.getElementById('page-data').textContent);
          const character = new Character(page.lanes[0], await unpack(page));
          return frames.map((frame) => {
            character.pose(frame / page.lanes[0].fps);
            return character.world.map((m) => [...m.elements]);
          });
        }""",
        frames,
    )
    pose = forward_kinematics(clip)
    for frame, matrices in zip(frames, np.array(found).reshape(len(frames), -1, 4, 4), strict=True):
        positions, turned = matrices[:, 3, :3], np.swapaxes(matrices[:, :3, :3], 1, 2)
        assert np.abs(positions - pose.positions[frame]).max() < 0.02  # cm
        angles = rot.angle_between(rot.from_matrix(turned), pose.rotations[frame])
        assert angles.max() < 0.03  # degrees, along the longest chain


@pytest.mark.real_data
def test_a_flat_hand_is_seen(pages: Pages, tmp_path: Path) -> None:
    """Bones end where the joints are, that hang off nothing."""
    file = shared_data("gltf", "webxr-generic-hand", "left.glb")
    run("preview", file, "-o", tmp_path / "hand.html")
    page = pages.open(tmp_path / "hand.html")
    assert near(page.picture, BLUE) > 3000
    clip = usdhand.read_character(file)
    at = forward_kinematics(clip).positions[0]
    bones = page_data(tmp_path / "hand.html")["lanes"][0]["bones"]
    found = page.page.evaluate("""async () => {
      const { unpack } = await import('data');
      const { Character } = await import('character');
      const page = JSON.parse(document.getElementById('page-data').textContent);
      const { sticks } = new Character(page.lanes[0], await unpack(page));
      return [...sticks.instanceMatrix.array];
    }""")
    matrices = np.array(found).reshape(len(bones), 4, 4)
    for bone, matrix in zip(bones, matrices, strict=True):
        assert matrix[3, :3] == pytest.approx(at[bone["joint"]], abs=1e-3)
        assert (matrix[1] + matrix[3])[:3] == pytest.approx(at[bone["child"]], abs=1e-3)


def test_side_by_side_and_overlay(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    page.page.fill("#scrub", "1")
    page.settle()
    boxes = [label.bounding_box() for label in page.page.locator(".lane-label:visible").all()]
    assert boxes[1]["x"] - boxes[0]["x"] == pytest.approx((WIDTH - 32) / 2, abs=20)
    beside = page.picture
    page.press("o")
    assert page.page.get_attribute("#overlay", "aria-pressed") == "true"
    over = page.picture
    boxes = [label.bounding_box() for label in page.page.locator(".lane-label:visible").all()]
    assert boxes[1]["x"] == boxes[0]["x"]
    assert np.abs(over - beside).max(axis=-1).mean() > 5
    # One character in the middle, in the colour of the first lane.
    first, second = (near(over, lane) for lane in ((0, 96, 168), (154, 62, 127)))
    assert first > 5 * second
    assert first > 5 * near(beside, (0, 96, 168))
    page.page.click("#overlay")
    page.settle()
    assert np.abs(page.picture - beside).max(axis=-1).mean() < 1


def test_alternatives_can_be_shown(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    page.page.check("#lane-1")
    page.settle()
    assert page.labels == ["filled choice_1", "filled choice_2", "ok_03"]
    page.page.uncheck("#lane-0")
    page.settle()
    assert page.labels == ["filled choice_2", "ok_03"]
    assert page.page.locator("#curve-rows .number:visible").count() == 2 * 5


def test_close_ups_follow_the_hands(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    page.page.fill("#scrub", "1")
    page.page.locator("#view").focus()
    page.settle()
    body = page.picture
    page.press("2")
    assert page.page.is_checked("#camera-left")
    assert page.page.input_value("#hand") == "left"
    left = page.picture
    assert near(left, BLUE) > 8 * near(body, BLUE) > 0
    page.press("3")
    right = page.picture
    assert near(right, ORANGE) > 8 * near(body, ORANGE) > 0
    page.press("t")
    turned = page.picture
    assert near(turned, ORANGE) > 8 * near(body, ORANGE)
    assert np.abs(turned - right).max(axis=-1).mean() > 3
    page.press("ArrowRight", "ArrowRight", "ArrowRight")
    middle = turned.shape[1] // 4
    centre = np.s_[turned.shape[0] // 4 : -turned.shape[0] // 4, middle - 60 : middle + 60]
    assert near(page.picture[centre], ORANGE) > 500  # the hand is still there
    page.press("1", "0")
    assert np.abs(page.picture - body).max(axis=-1).mean() < 12


def test_orbit_and_zoom_with_mouse_and_keys(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    seen = [page.picture]
    box = page.page.locator("#view").bounding_box()
    page.page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + 300, box["y"] + 220, steps=3)
    page.page.mouse.up()
    page.settle()
    seen.append(page.picture)
    page.page.mouse.wheel(0, -500)
    page.settle()
    seen.append(page.picture)
    for key in ("a", "w", "+"):
        page.press(key)
        seen.append(page.picture)
    for before, after in pairwise(seen):
        assert np.abs(before - after).max(axis=-1).mean() > 0.5
    page.press("0")
    assert np.abs(page.picture - seen[0]).max(axis=-1).mean() < 0.5


def test_mesh_bones_and_both(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "reduce.html")
    page.press("2")
    seen = []
    for _ in range(4):
        seen.append(page.picture)
        page.press("m")
    mesh, bones, both, again = seen
    assert near(bones, BLUE) > 3 * near(mesh, BLUE)
    for one, other in ((mesh, bones), (bones, both), (both, mesh)):
        assert np.abs(one - other).max(axis=-1).mean() > 3
    assert np.abs(again - mesh).max(axis=-1).mean() < 0.5


def test_curves_of_the_digit_that_is_chosen(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "reduce.html")
    page.page.select_option("#hand", "left")
    page.page.select_option("#digit", "Thumb")
    names = page.page.locator("#curve-rows .label small").all_text_contents()
    assert names == ["leThumbCMCx", "leThumbCMCy", "leThumbCMCz", "leThumbMCPz", "leThumbIPz"]
    drawn = page.page.evaluate("""() => [...document.querySelectorAll('canvas.curve')].map((c) =>
      c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((x) => x).length)""")
    assert min(drawn) > 1000
    assert page.page.locator("#curve-rows .value small").count() == 5  # what the rig says


def test_without_webgl_the_rest_still_works(browser: Any, made_pages: Path) -> None:
    page = browser.new_context(offline=True).new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = ((old) => function (kind, o) {"
                         "return kind === '2d' ? old.call(this, kind, o) : null; })"
                         "(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    page.goto((made_pages / "fill.html").as_uri())
    page.wait_for_function(READY)
    assert "The 3D view cannot be shown" in page.locator("#trouble").text_content()
    boxes = [label.bounding_box() for label in page.locator(".lane-label:visible").all()]
    assert len(boxes) == 2
    apart = [
        boxes[1][x] >= boxes[0][x] + boxes[0][size] for x, size in (("x", "width"), ("y", "height"))
    ]
    assert any(apart)
    page.uncheck("#lane-0")
    assert page.locator(".lane-label:visible strong").all_text_contents() == ["ok_03"]
    page.keyboard.press("End")
    page.wait_for_function("() => Number(document.getElementById('scrub').value) > 1")
    page.context.close()
