"""The picture of preview: pages of fill, reduce and splice in a browser, in light and dark.

usage: python docs/pictures/make_preview.py (needs playwright, matplotlib and Chromium)
"""

import os
import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from playwright.sync_api import Browser, sync_playwright

import usdhand
from usdhand.report.document import document, dumps
from usdhand.report.fill import fill_result
from usdhand.verbs.preview import preview_clips, write_preview

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "samples"
TALK = SAMPLES / "conversations" / "talk_01_full.usdc"
FLAGS = ("--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader")  # fmt: skip
READY = "() => document.documentElement.dataset.ready"
SIZE = {"width": 1200, "height": 860}


def main() -> None:
    """Make the pages, press keys, put the screenshots side by side."""
    folder = Path(tempfile.mkdtemp())
    fill_page, rig_page = folder / "fill.html", folder / "rig.html"
    make_fill(folder, fill_page)
    [reduction] = usdhand.reduce_hands([usdhand.read_clip(TALK)])
    usdhand.write_rig(reduction, folder / "reduced.usdc")
    write_preview(preview_clips([folder / "reduced.usdc", TALK]), rig_page)
    path = os.environ.get("USDHAND_CHROMIUM", "/usr/bin/chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        shot(browser, fill_page, "light", 13.7, ["3"], folder / "0.png")
        shot(browser, rig_page, "dark", 19.63, ["o", "2"], folder / "1.png")
        browser.close()
    figure, axes = plt.subplots(1, 2, figsize=(16, 5.75), dpi=100)
    for number, axis in enumerate(axes):
        axis.imshow(plt.imread(folder / f"{number}.png"))
        axis.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0.01, 0)
    figure.savefig(ROOT / "docs" / "pictures" / "preview.png", facecolor="#888888")


def make_fill(folder: Path, page: Path) -> None:
    """A page of a filled body beside the true fingers."""
    clips = sorted((SAMPLES / "gestures").glob("*.usdc"))
    library = usdhand.build_library(clips, folder / "library.usdc").library
    taken = SAMPLES / "conversations" / "talk_01_body.usdc"
    body = usdhand.read_clip(taken)
    filled = usdhand.fill_fingers(body, library)
    usdhand.write_filled(filled, folder / "filled.usdc")
    report = document("fill", [taken], {}, fill_result(filled, library, body))
    report["output"] = str(folder / "filled.usdc")
    (folder / "fill.json").write_text(dumps(report), encoding="utf-8")
    files = [folder / "filled.usdc", TALK]
    write_preview(preview_clips(files, reports=[folder / "fill.json"]), page)


def shot(
    browser: Browser, page: Path, scheme: str, time: float, keys: list[str], output: Path
) -> None:
    """A screenshot at a time of the page, after some keys."""
    view = browser.new_page(viewport=SIZE, color_scheme=scheme)  # type: ignore[arg-type]
    view.goto(page.as_uri())
    view.wait_for_function(READY)
    view.fill("#scrub", str(time))
    view.locator("#view").focus()
    for key in keys:
        view.keyboard.press(key)
    view.locator("#view").blur()
    view.wait_for_timeout(1500)
    view.screenshot(path=output)
    view.close()


if __name__ == "__main__":
    main()
