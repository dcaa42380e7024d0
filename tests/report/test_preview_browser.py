"""The page of preview in a real browser: Chromium without a display, by Playwright."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.preview_pages import FLAGS, GESTURES, chromium, make_results, one_minute, page_data
from conftest import shared_data

import usdhand
from usdhand.motion import forward_kinematics
from usdhand.motion import rotations as rot

pytestmark = pytest.mark.browser
WIDTH, HEIGHT = 640, 560
READY = "() => document.documentElement.dataset.ready"
ORANGE, BLUE = (213, 94, 0), (0, 114, 178)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright, path = chromium()
    with playwright as started:
        browser = started.chromium.launch(executable_path=path, args=FLAGS, headless=True)
        yield browser
        browser.close()


@dataclass
class Opened:
    """A page that was opened, with all that it asked for and complained about."""

    page: Any
    path: Path
    session: Any
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)
        self.settle()

    def settle(self) -> None:
        """Wait until what was changed has been drawn."""
        self.page.evaluate("() => new Promise((r) => requestAnimationFrame(() => "
                           "requestAnimationFrame(() => requestAnimationFrame(r))))")  # fmt: skip

    @property
    def time(self) -> float:
        return float(self.page.input_value("#scrub"))

    @property
    def picture(self) -> np.ndarray:
        """Colours of the 3D view without its border, (rows, columns, 3)."""
        shot = self.page.locator("#view").screenshot()
        found = self.page.evaluate(DECODE, base64.b64encode(shot).decode())
        pixels = np.frombuffer(base64.b64decode(found["data"]), np.uint8)
        return pixels.reshape(found["height"], found["width"], 4)[4:-4, 4:-4, :3].astype(int)

    @property
    def thread_seconds(self) -> float:
        """Seconds of the processor that the page's main thread has taken, from its first on."""
        metrics = self.session.send("Performance.getMetrics")["metrics"]
        return float(next(m["value"] for m in metrics if m["name"] == "ThreadTime"))

    @property
    def labels(self) -> list[str]:
        shown = self.page.locator(".lane-label:visible strong")
        return list(shown.all_text_contents())


# The page may not fetch, so the picture comes as an image.
DECODE = """async (data) => {
  const image = new Image();
  image.src = `data:image/png;base64,${data}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const ink = canvas.getContext('2d');
  ink.drawImage(image, 0, 0);
  const { data: bytes } = ink.getImageData(0, 0, image.width, image.height);
  let text = '';
  for (let i = 0; i < bytes.length; i += 8192) {
    text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  }
  return { width: image.width, height: image.height, data: btoa(text) };
}"""


@dataclass
class Pages:
    """Opens pages, and sees after each test that none asked for or complained about anything."""

    browser: Any
    opened: list[Opened] = field(default_factory=list)

    def open(self, path: Path, **context: Any) -> Opened:
        context = {"viewport": {"width": WIDTH, "height": HEIGHT}, **context}
        page = self.browser.new_context(offline=True, **context).new_page()
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        opened = Opened(page, path, session)
        self.opened.append(opened)
        own = path.as_uri()

        def route(route: Any) -> None:
            opened.requests.append(route.request.url)
            route.continue_() if route.request.url == own else route.abort()

        page.route("**/*", route)
        page.on("pageerror", lambda error: opened.complaints.append(str(error)))
        page.on("console", lambda m: m.type == "error" and opened.complaints.append(m.text))
        page.goto(own)
        page.wait_for_function(READY, timeout=60_000)
        opened.settle()
        return opened

    def close(self) -> None:
        for opened in self.opened:
            outside = [u for u in opened.requests if not u.startswith(("data:", "blob:"))]
            opened.page.context.close()
            assert outside == [opened.path.as_uri()]
            assert opened.complaints == []


@pytest.fixture
def pages(browser: Any) -> Iterator[Pages]:
    pages = Pages(browser)
    yield pages
    pages.close()


@pytest.fixture(scope="module")
def folder(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of the results of all methods; none is made where there is no browser.

    Software draws bones faster than meshes, so only one page has those.
    """
    del browser
    folder = tmp_path_factory.mktemp("pages")
    made = make_results(folder)
    truth = GESTURES / "ok_03.usdc"
    figure = folder / "figure_of_test.svg"
    figure.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="60" height="40"></svg>')
    run("preview", made.filled, truth, "--with-report", made.fill_report, "--figure", figure,
        "--max-points", "0", "-o", folder / "fill.html")  # fmt: skip
    run("preview", made.spliced, GESTURES / "ok_04.usdc", "--with-report", made.splice_report,
        "--max-points", "0", "-o", folder / "splice.html")  # fmt: skip
    run("preview", made.rig, truth, "-o", folder / "reduce.html")
    return folder


def near(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Pixels of a hue: lit or in shadow, but of the same mixture."""
    bright = picture.max(axis=-1)
    mixture = picture / np.maximum(bright, 1)[..., None]
    close = np.abs(mixture - np.array(colour) / max(colour)).max(axis=-1) < 0.15
    return int((close & (bright > 60)).sum())


def test_it_opens_and_shows_a_character_on_each_lane(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
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
def test_motion_on_the_page_is_that_of_the_clip(pages: Pages, folder: Path, name: str) -> None:
    """The page's own modules, posed at whole and half frames, against our kinematics."""
    page = pages.open(folder / f"{name}.html")
    clip = usdhand.read_clip(folder / {"fill": "filled.usda", "splice": "spliced.usda"}[name])
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


def test_play_and_pause_with_button_and_key(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    play = page.page.locator("#play")
    assert (play.text_content(), page.time) == ("Play", 0.0)
    before = page.picture
    play.click()
    page.page.wait_for_function("() => Number(document.getElementById('scrub').value) > 0.3")
    assert play.text_content() == "Pause"
    play.click()
    page.settle()
    stopped = page.time
    page.settle()
    assert page.time == stopped > 0.3
    assert play.text_content() == "Play"
    assert np.abs(page.picture - before).max() > 60
    page.page.locator("#view").focus()
    page.press("Space")
    page.page.wait_for_function(
        f"() => Math.abs(document.getElementById('scrub').value - {stopped}) > 0.2"
    )
    page.press("Space")
    assert play.text_content() == "Play"


def test_playing_keeps_the_time_of_the_clock(pages: Pages, folder: Path) -> None:
    """However few pictures a browser draws; the clock is the test's."""
    page = pages.open(folder / "fill.html")
    clock = page.page.clock
    clock.install(time=0)
    clock.pause_at(1000)
    page.page.select_option("#speed", "0.5")
    page.page.click("#play")
    clock.run_for(200)
    before = page.time
    clock.run_for(1000)
    assert page.time - before == pytest.approx(0.5, abs=0.02)


def test_scrubbing_by_slider_and_on_the_rows(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    clip = usdhand.read_clip(folder / "filled.usda")
    first = page.picture
    page.page.fill("#scrub", str(clip.duration / 2))
    page.settle()
    assert page.time == pytest.approx(clip.duration / 2, abs=1e-3)
    assert np.abs(page.picture - first).max() > 60
    assert page.page.get_attribute("#scrub", "aria-valuetext").startswith(f"{page.time:.2f} s")
    track = page.page.locator(".track.spans").first
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    page.page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 5)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 40)
    page.settle()
    assert page.time == pytest.approx(0.8 * clip.duration, abs=0.02)
    page.page.mouse.up()
    page.page.mouse.move(box["x"], box["y"])
    page.settle()
    assert page.time == pytest.approx(0.8 * clip.duration, abs=0.02)
    thumb, head = page.page.evaluate("""() => {
      const [a, b] = ['scrub', 'playhead'].map((id) =>
        document.getElementById(id).getBoundingClientRect());
      const share = document.getElementById('scrub').value / document.getElementById('scrub').max;
      return [a.left + 6 + share * (a.width - 12), (b.left + b.right) / 2];
    }""")
    assert thumb == pytest.approx(head, abs=1.0)


def test_keys_step_and_jump(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    clip = usdhand.read_clip(folder / "filled.usda")
    report = json.loads((folder / "fill.json").read_text())
    page.press("ArrowRight", "ArrowRight")
    assert page.time == pytest.approx(2 / clip.fps)
    page.press("ArrowLeft", "Shift+ArrowRight")
    assert page.time == pytest.approx(11 / clip.fps)
    page.press("End")
    assert page.time == pytest.approx(clip.duration)
    page.press("Home")
    assert page.time == 0
    borders = sorted({s["end"] for hand in report["hands"].values() for s in hand["segments"]})
    page.press("n")
    assert page.time == pytest.approx(borders[0], abs=1e-3)
    page.press("n", "p")
    assert page.time == pytest.approx(borders[0], abs=1e-3)
    page.press("]", "]", "[")
    assert page.page.input_value("#speed") == "2"
    page.page.locator("#hand").focus()
    page.press("o")
    assert page.page.get_attribute("#overlay", "aria-pressed") == "false"
    page.press("Escape", "o")
    assert page.page.get_attribute("#overlay", "aria-pressed") == "true"


def test_first_and_last_frame_stop_the_playback(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    end = usdhand.read_clip(folder / "filled.usda").duration
    assert page.page.get_attribute("#loop", "aria-pressed") == "true"
    for key, time in (("End", end), ("Home", 0.0)):
        page.press("Space")
        page.page.wait_for_function("() => Number(document.getElementById('scrub').value) > 0.1")
        page.press(key)
        assert page.page.text_content("#play") == "Play"
        assert page.time == pytest.approx(time)


def test_a_lane_that_is_over_says_so(pages: Pages, tmp_path: Path) -> None:
    files = [GESTURES / "ok_03.usdc", GESTURES / "ok_04.usdc"]
    clips = [usdhand.read_clip(f) for f in files]
    run("preview", *files, "--max-points", "0", "-o", tmp_path / "two.html")
    page = pages.open(tmp_path / "two.html")
    short = int(clips[0].duration > clips[1].duration)
    numbers = page.page.locator("#curve-rows .value").first.locator(".number")

    def grey() -> list[bool]:
        colours = [numbers.nth(i).evaluate("(e) => getComputedStyle(e).color") for i in (0, 1)]
        muted = page.page.locator("footer").evaluate("(e) => getComputedStyle(e).color")
        return [colour == muted for colour in colours]

    page.page.fill("#scrub", str(clips[short].duration))
    page.settle()
    assert grey() == [False, False]
    page.page.fill("#scrub", str(clips[1 - short].duration))
    page.settle()
    assert grey() == [i == short for i in (0, 1)]
    over = page.page.evaluate("""async () => {
      const { laneEnded } = await import('playback');
      const lane = { fps: 30, duration: 2, retime: { left: [[0, 0], [1, 2], [3, 2]] } };
      return [0.9, 1.01, 1.1, 2.9].map((time) => laneEnded(lane, time, 'left'));
    }""")
    assert over == [False, False, True, True]
    # The time code is that of the first lane that is shown, as long as it plays.
    codes = [float(c.time_codes[-1]) for c in clips]
    for shown in (0, 1):
        page.page.set_checked(f"#lane-{shown}", True)
        page.page.set_checked(f"#lane-{1 - shown}", False)
        page.settle()
        said = page.page.text_content("#time")
        assert said.endswith(" s" if shown == short else f"time code {codes[shown]:g}")


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


def test_keys_can_be_turned_off_and_are_listed(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "reduce.html")
    page.press("?")
    assert page.page.locator("#help").get_attribute("open") is not None
    listed = page.page.locator("#key-list kbd").all_text_contents()
    assert {"space", "←", "Home", "1", "2", "3", "o", "[", "]", "?"} <= set(listed)
    page.page.uncheck("#keys-on")
    page.press("End")
    assert page.time == 0


def test_side_by_side_and_overlay(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
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


def test_alternatives_can_be_shown(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    page.page.check("#lane-1")
    page.settle()
    assert page.labels == ["filled choice_1", "filled choice_2", "ok_03"]
    page.page.uncheck("#lane-0")
    page.settle()
    assert page.labels == ["filled choice_2", "ok_03"]
    assert page.page.locator("#curve-rows .number:visible").count() == 2 * 5


def test_close_ups_follow_the_hands(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
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


def test_orbit_and_zoom_with_mouse_and_keys(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
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


def test_mesh_bones_and_both(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "reduce.html")
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


def test_a_hand_clip_plays_in_the_time_of_the_body(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "splice.html")
    assert "in the body’s time" in page.page.locator(".lane-label small").nth(1).text_content()
    report = json.loads((folder / "splice.json").read_text())["hands"]["right"]
    hands = usdhand.read_clip(GESTURES / "ok_04.usdc")
    channels = usdhand.find_hands(hands).encode(hands)
    body, hand = report["warp"][len(report["warp"]) // 2]
    page.page.fill("#scrub", str(body))
    page.settle()
    for row in range(5):
        name = page.page.locator("#curve-rows .label small").nth(row).text_content()
        shown = page.page.locator("#curve-rows .value").nth(row).locator(".number").nth(1)
        curve = channels.select([name]).values[:, 0]
        expected = np.interp(hand * hands.fps, np.arange(len(hands)), curve)
        assert float(shown.text_content()[:-1]) == pytest.approx(expected, abs=0.2)


def test_curves_of_the_digit_that_is_chosen(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "reduce.html")
    page.page.select_option("#hand", "left")
    page.page.select_option("#digit", "Thumb")
    names = page.page.locator("#curve-rows .label small").all_text_contents()
    assert names == ["leThumbCMCx", "leThumbCMCy", "leThumbCMCz", "leThumbMCPz", "leThumbIPz"]
    drawn = page.page.evaluate("""() => [...document.querySelectorAll('canvas.curve')].map((c) =>
      c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((x) => x).length)""")
    assert min(drawn) > 1000
    assert page.page.locator("#curve-rows .value small").count() == 5  # what the rig says


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_light_and_dark(pages: Pages, folder: Path, scheme: str) -> None:
    """Contrast of all texts is that of WCAG 2.1 AA."""
    page = pages.open(folder / "fill.html", color_scheme=scheme)
    page.press("?")
    paper = page.page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    assert (luminance(paper) < 0.5) == (scheme == "dark")
    found = page.page.evaluate("""() => {
      const solid = (e) => {
        for (; e; e = e.parentElement) {
          const colour = getComputedStyle(e).backgroundColor;
          if (!colour.includes(', 0)') && !colour.includes('/') && !colour.includes('mix')) {
            return colour;
          }
        }
        return 'rgb(255, 255, 255)';
      };
      const texts = [...document.querySelectorAll('body *')].filter((e) =>
        e.checkVisibility() && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()));
      return texts.map((e) => [e.textContent.slice(0, 40), getComputedStyle(e).color, solid(e)]);
    }""")
    assert len(found) > 60
    for text, ink, ground in found:
        high, low = sorted((luminance(ink), luminance(ground)), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text, ink, ground)


def test_marks_can_be_read_on_the_spans_below(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "splice.html", color_scheme="light")
    for scheme in ("light", "dark"):
        page.page.emulate_media(color_scheme=scheme)
        for ink, ground in inks_and_grounds(page.page):
            high, low = sorted((luminance(ink), luminance(ground)), reverse=True)
            assert (high + 0.05) / (low + 0.05) >= 4.5, (scheme, ink, ground)


def inks_and_grounds(page: Any) -> list[tuple[str, str]]:
    """Colours of the timeline's marks, each with all that they may stand on."""
    grounds = page.evaluate("""() => {
      const track = document.querySelector('.track.spans');
      return ['span', 'span odd', 'span look', ''].map((name) => {
        const made = document.createElement('span');
        made.className = name;
        track.append(made);
        const colour = getComputedStyle(name ? made : track).backgroundColor;
        made.remove();
        return colour;
      });
    }""")
    inks = page.eval_on_selector_all(".mark", "(all) => all.map((e) => getComputedStyle(e).color)")
    assert len(set(grounds)) == 4
    assert inks
    return list(product(sorted(set(inks)), grounds))


def luminance(colour: str) -> float:
    parts = [float(x) for x in re.findall(r"[\d.]+", colour)[:3]]
    values = np.array(parts) / (1 if "srgb" in colour else 255)
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_everything_can_be_reached_and_has_a_name(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "reduce.html")
    reached = set()
    for _ in range(40):
        page.page.keyboard.press("Tab")
        name, ring = page.page.evaluate("""() => {
          const e = document.activeElement;
          return [e.id || e.tagName, getComputedStyle(e).outlineStyle];
        }""")
        reached.add(name)
        assert ring == "solid" or name in ("BODY", "HTML")
    wanted = {"view", "play", "speed", "loop", "camera-body", "turning", "overlay", "show",
              "scrub", "hand", "digit", "lane-0"}  # fmt: skip
    assert wanted <= reached
    tree = page.page.locator("body").aria_snapshot()
    assert 'slider "time"' in tree
    for part in ('button "Play"', 'radio "left hand"', 'combobox "speed', 'img "3D view'):
        assert part in tree
    assert page.page.locator("#status").get_attribute("role") == "status"


def test_without_webgl_the_rest_still_works(browser: Any, folder: Path) -> None:
    page = browser.new_context(offline=True).new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = ((old) => function (kind, o) {"
                         "return kind === '2d' ? old.call(this, kind, o) : null; })"
                         "(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    page.goto((folder / "fill.html").as_uri())
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


def test_figures_and_segments_are_there(pages: Pages, folder: Path) -> None:
    page = pages.open(folder / "fill.html")
    image = page.page.locator("#figure-list img")
    assert image.get_attribute("alt") == "figure of test"
    assert image.evaluate("(i) => i.complete && i.naturalWidth") == 60
    report = json.loads((folder / "fill.json").read_text())["hands"]
    counts = [len(report[side]["segments"]) for side in ("left", "right")]
    rows = page.page.locator(".track.spans")
    assert [rows.nth(i).locator(".span").count() for i in range(2)] == counts
    assert rows.first.get_attribute("aria-label").startswith("segments, left, filled choice_1: ")
    lanes = page.page.locator("#rows .label small").all_text_contents()
    assert lanes == ["filled choice_1"] * 2
    first = report["left"]["segments"][0]
    assert first["clip"] in page.page.locator("#rows .value").first.text_content()


@pytest.mark.slow
def test_a_minute_of_two_hands_is_small_and_quick(pages: Pages, tmp_path: Path) -> None:
    """Counted is the time of the processor that the page's own thread takes, not the clock's."""
    page = tmp_path / "minute.html"
    run("preview", one_minute(tmp_path), "-o", page)
    assert page.stat().st_size < 10e6
    opened = pages.open(page)
    before = opened.thread_seconds
    assert before < 3.0
    opened.press("Space")
    frames = opened.page.evaluate("""async () => {
      const real = window.requestAnimationFrame.bind(window);
      let drawn = 0;
      window.requestAnimationFrame = (f) => real((t) => { drawn += 1; f(t); });
      await new Promise((r) => setTimeout(r, 3000));
      return drawn;
    }""")
    assert frames > 10
    assert opened.thread_seconds - before < frames / 60
