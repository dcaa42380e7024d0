"""Pages of preview in a real browser: Chromium without a display, by Playwright.

A plugin of the tests: all of them know its fixtures.
"""

from __future__ import annotations

import base64
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builders.cli_runner import run
from builders.preview_pages import FLAGS, GESTURES, Results, chromium, shared_results
from builders.shared_work import SharedWork

WIDTH, HEIGHT = 640, 560
READY = "() => document.documentElement.dataset.ready"
ORANGE, BLUE = (213, 94, 0), (0, 114, 178)
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
def made_pages(browser: Any, shared_work: SharedWork) -> Path:
    """Pages of the results of all methods; none is made where there is no browser."""
    del browser
    results = shared_results(shared_work)
    return shared_work.folder("pages", partial(_make_pages, results))


def _make_pages(results: Results, folder: Path) -> None:
    """Software draws bones faster than meshes, so only one page has those."""
    shutil.copytree(results.rig.parent, folder, dirs_exist_ok=True)
    made = Results.within(folder)
    truth = GESTURES / "ok_03.usdc"
    figure = folder / "figure_of_test.svg"
    figure.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="60" height="40"></svg>')
    run("preview", made.filled, truth, "--with-report", made.fill_report, "--figure", figure,
        "--max-points", "0", "-o", folder / "fill.html")  # fmt: skip
    run("preview", made.spliced, GESTURES / "ok_04.usdc", "--with-report", made.splice_report,
        "--max-points", "0", "-o", folder / "splice.html")  # fmt: skip
    run("preview", made.rig, truth, "-o", folder / "reduce.html")


def near(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Pixels of a hue: lit or in shadow, but of the same mixture."""
    bright = picture.max(axis=-1)
    mixture = picture / np.maximum(bright, 1)[..., None]
    close = np.abs(mixture - np.array(colour) / max(colour)).max(axis=-1) < 0.15
    return int((close & (bright > 60)).sum())
