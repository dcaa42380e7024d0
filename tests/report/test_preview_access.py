"""The page of preview in a real browser: what can be read, reached and listed."""

from __future__ import annotations

import json
import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.browser import Pages

pytestmark = pytest.mark.browser


def test_keys_can_be_turned_off_and_are_listed(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "reduce.html")
    page.press("?")
    assert page.page.locator("#help").get_attribute("open") is not None
    listed = page.page.locator("#key-list kbd").all_text_contents()
    assert {"space", "←", "Home", "1", "2", "3", "o", "[", "]", "?"} <= set(listed)
    page.page.uncheck("#keys-on")
    page.press("End")
    assert page.time == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_light_and_dark(pages: Pages, made_pages: Path, scheme: str) -> None:
    """Contrast of all texts is that of WCAG 2.1 AA."""
    page = pages.open(made_pages / "fill.html", color_scheme=scheme)
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


def test_marks_can_be_read_on_the_spans_below(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "splice.html", color_scheme="light")
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


def test_everything_can_be_reached_and_has_a_name(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "reduce.html")
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


def test_figures_and_segments_are_there(pages: Pages, made_pages: Path) -> None:
    page = pages.open(made_pages / "fill.html")
    image = page.page.locator("#figure-list img")
    assert image.get_attribute("alt") == "figure of test"
    assert image.evaluate("(i) => i.complete && i.naturalWidth") == 60
    report = json.loads((made_pages / "fill.json").read_text())["hands"]
    counts = [len(report[side]["segments"]) for side in ("left", "right")]
    rows = page.page.locator(".track.spans")
    assert [rows.nth(i).locator(".span").count() for i in range(2)] == counts
    assert rows.first.get_attribute("aria-label").startswith("segments, left, filled choice_1: ")
    lanes = page.page.locator("#rows .label small").all_text_contents()
    assert lanes == ["filled choice_1"] * 2
    first = report["left"]["segments"][0]
    assert first["clip"] in page.page.locator("#rows .value").first.text_content()
