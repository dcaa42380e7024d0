"""Playing the page of preview in a real browser: time, keys, lanes of other lengths."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from builders.browser import Pages
from builders.cli_runner import run
from builders.preview_pages import GESTURES, one_minute

import usdhand

pytestmark = pytest.mark.browser


def test_play_and_pause_with_button_and_key(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
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


def test_playing_keeps_the_time_of_the_clock(pages: Pages, made_pages: Path) -> None:
    """However few pictures a browser draws; the clock is the test's."""
    page = pages.open(made_pages / "fill.html")
    clock = page.page.clock
    clock.install(time=0)
    clock.pause_at(1000)
    page.page.select_option("#speed", "0.5")
    page.page.click("#play")
    clock.run_for(200)
    before = page.time
    clock.run_for(1000)
    assert page.time - before == pytest.approx(0.5, abs=0.02)


def test_scrubbing_by_slider_and_on_the_rows(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    clip = usdhand.read_clip(made_pages / "filled.usda")
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


def test_keys_step_and_jump(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    clip = usdhand.read_clip(made_pages / "filled.usda")
    report = json.loads((made_pages / "fill.json").read_text())
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


def test_first_and_last_frame_stop_the_playback(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    end = usdhand.read_clip(made_pages / "filled.usda").duration
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


def test_a_hand_clip_plays_in_the_time_of_the_body(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "splice.html")
    assert "in the body’s time" in page.page.locator(".lane-label small").nth(1).text_content()
    report = json.loads((made_pages / "splice.json").read_text())["hands"]["right"]
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
