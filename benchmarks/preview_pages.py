"""A one-minute clip of two hands as a page of k3d, of plotly and of ours: size, opening, frames.

    python benchmarks/preview_pages.py [--folder DIR]

Needs k3d, plotly and playwright, and Chromium (USDHAND_CHROMIUM, or /usr/bin/chromium), which draws
by software here. k3d and plotly get the bones of both hands as lines; our page has the whole
character, once as bones and once with its mesh. A frame is what passes from one moment that is
drawn to the next; script is the part of it that the page's own code takes.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import usdhand
from usdhand.anatomy import Hands
from usdhand.motion import Clip, forward_kinematics
from usdhand.motion import rotations as rot
from usdhand.motion.resample import resample
from usdhand.verbs.preview import PreviewSettings, preview_clips, write_preview

SAMPLES = Path(__file__).resolve().parent.parent / "samples"
FPS, SECONDS = 60.0, 60.0
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
# Shows frame i of a page: how long until the browser has drawn it?
FRAMES = """async (step) => {
  const show = eval(step);
  const frames = [];
  let last = performance.now();
  for (let i = 0; i < 120; i++) {
    await show(i);
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    frames.push(now - last);
    last = now;
  }
  return { frames, script: [] };
}"""
PLAYED = """async () => {
  const real = window.requestAnimationFrame.bind(window);
  const [frames, script] = [[], []];
  let last = null;
  window.requestAnimationFrame = (f) => real((t) => {
    const start = performance.now();
    if (last !== null) frames.push(start - last);
    last = start;
    f(t);
    script.push(performance.now() - start);
  });
  document.getElementById('play').click();
  await new Promise((r) => setTimeout(r, 5000));
  return { frames: frames.slice(10), script: script.slice(10) };
}"""
CANVAS = "() => document.querySelector('canvas')"
K3D_STEP = "(i) => K3DInstance.then((k) => k.setTime(i / 60))"
PLOTLY_STEP = """(i) => Plotly.animate(document.querySelector('.plotly-graph-div'), [String(i)],
  { mode: 'immediate', transition: { duration: 0 }, frame: { duration: 0, redraw: true } })"""
OWN_READY = "() => document.documentElement.dataset.ready"


def main() -> None:
    """Make the pages, open them and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, help="where to keep the pages")
    folder = parser.parse_args().folder or Path(tempfile.mkdtemp())
    clip = minute()
    usdhand.write_clip(clip, folder / "minute.usdc", force=True)
    lines, points = hand_lines(clip, usdhand.find_hands(clip))
    pages: dict[str, tuple[Callable[[Path], None], str, str | None]] = {
        "k3d, both hands as lines": (lambda p: k3d_page(lines, points, p), CANVAS, K3D_STEP),
        "plotly, both hands as lines": (
            lambda p: plotly_page(lines, points, p), ".gl-container canvas", PLOTLY_STEP,
        ),
        "ours, whole body, bones": (lambda p: own_page(folder, 0, p), OWN_READY, None),
        "ours, whole body, mesh": (lambda p: own_page(folder, 40_000, p), OWN_READY, None),
    }  # fmt: skip
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, ", end="")
    print(f"load {os.getloadavg()[0]:.1f}, software rendering, 1280 x 800\n")
    print("| page | MB | opens in | frame: median, 95 % | script |\n|---|---|---|---|---|")
    for number, (name, (make, ready, step)) in enumerate(pages.items()):
        path = folder / f"page_{number}.html"
        make(path)
        opened, frames, script = measured(path, ready, step)
        own = f"{np.median(script):.1f} ms" if script else ""
        print(
            f"| {name} | {path.stat().st_size / 1e6:.2f} | {opened:.2f} s | "
            f"{np.median(frames):.0f}, {np.percentile(frames, 95):.0f} ms | {own} |"
        )


def minute() -> Clip:
    """A minute of conversations and gestures, one after the other."""
    talks = [SAMPLES / "conversations" / f"talk_0{n}_full.usdc" for n in (1, 2)]
    files = [*talks, *sorted((SAMPLES / "gestures").glob("*_0[1-4].usdc"))]
    clips = [resample(usdhand.read_clip(f), FPS) for f in files]
    along = {
        name: np.concatenate([getattr(c, name) for c in clips])[: int(SECONDS * FPS) + 1]
        for name in ("rotations", "translations", "scales")
    }
    along["rotations"] = rot.make_continuous(along["rotations"])
    return replace(clips[0], **along)


def hand_lines(clip: Clip, hands: Hands) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Bones of both hands as pairs of points, and the points (frames, n, 3)."""
    maps = hands.character.hands.values()
    joints = sorted({j for m in maps for j in (m.wrist, *m.joints.values(), *m.tips.values())})
    place = {j: i for i, j in enumerate(joints)}
    parents = clip.skeleton.parents
    lines = [(place[int(parents[j])], place[j]) for j in joints if int(parents[j]) in place]
    return lines, forward_kinematics(clip, joints).positions.astype(np.float32)


def k3d_page(lines: list[tuple[int, int]], points: np.ndarray, path: Path) -> None:
    """A snapshot with a time series of vertices."""
    import k3d

    plot = k3d.plot()
    vertices = {f"{i / FPS:.5f}": frame for i, frame in enumerate(points)}
    plot += k3d.lines(
        vertices, np.array(lines, np.uint32), indices_type="segment", width=0.5, shader="mesh"
    )
    path.write_text(plot.get_snapshot(9))


def plotly_page(lines: list[tuple[int, int]], points: np.ndarray, path: Path) -> None:
    """A scatter of lines with an animation frame a frame."""
    import plotly.graph_objects as go

    def trace(frame: np.ndarray) -> Any:
        gaps = np.full((len(lines), 3, 3), np.nan)
        gaps[:, :2] = frame[np.array(lines)].round(3)
        x, y, z = gaps.reshape(-1, 3).T
        return go.Scatter3d(x=x, y=y, z=z, mode="lines", line={"width": 8})

    frames = [go.Frame(name=str(i), data=[trace(frame)]) for i, frame in enumerate(points)]
    figure = go.Figure(data=[trace(points[0])], frames=frames)
    figure.write_html(path, include_plotlyjs=True, auto_play=False)


def own_page(folder: Path, max_points: int, path: Path) -> None:
    """Our page of the whole clip."""
    settings = PreviewSettings(max_points=max_points)
    write_preview(preview_clips([folder / "minute.usdc"], settings), path, force=True)


def measured(path: Path, ready: str, step: str | None) -> tuple[float, list[float], list[float]]:
    """Seconds until a page is there, and milliseconds of its frames and its own code in them."""
    from playwright.sync_api import sync_playwright

    browser = os.environ.get("USDHAND_CHROMIUM", "/usr/bin/chromium")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser, args=FLAGS)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        start = time.perf_counter()
        page.goto(path.as_uri())
        if ready.startswith("("):
            page.wait_for_function(ready, timeout=120_000)
        else:
            page.wait_for_selector(ready, timeout=120_000)
        opened = time.perf_counter() - start
        page.wait_for_timeout(1000)
        found = page.evaluate(FRAMES, step) if step else page.evaluate(PLAYED)
        chromium.close()
    return opened, found["frames"], found["script"]


if __name__ == "__main__":
    main()
