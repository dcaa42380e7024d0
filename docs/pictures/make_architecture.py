"""Draw docs/pictures/architecture.svg: the way of a clip through a verb, and the layers of imports.

    python docs/pictures/make_architecture.py

The layers are those that import-linter keeps (pyproject.toml). A test fails while the file is not
what this script makes. Standard library only.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from html import escape
from pathlib import Path

HERE = Path(__file__).resolve().parent
WIDTH, MARGIN = 980, 20

# Room, then lines of text: what happens to a clip, from left to right.
WAY = [
    ("cli", "options", "to Request"),
    ("verbs", "run the", "Request"),
    ("formats", "file", "to Clip"),
    ("methods", "Clip", "to result"),
    ("formats", "result", "to layer"),
    ("report", "result to", "JSON and text"),
    ("cli", "text and", "exit code"),
]
# What a layer does, by one of its rooms.
ABOUT = {
    "cli": "command line; the only importer of click and rich",
    "verbs": "one module a verb: Request to Outcome",
    "report": "JSON documents, texts, plots, the preview page",
    "requests": "what a run is to do: options, declared once",
    "formats": "USD (the only importer of pxr), BVH, glTF, FBX",
    "evaluate": "comparison, reconstruction, label agreement",
    "fill": "the three methods; they do not import each other",
    "rigs": "which joint is which; finger joints to add",
    "anatomy": "what a hand is: joints, channels, frames",
    "motion": "Skeleton, Clip, kinematics, time",
    "search": "kernels: nearest segments, phase alignment",
    "problems": "small modules that every room may use",
}

STYLE = """
  svg { --page: #ffffff; --ink: #1b2430; --soft: #5b6675; --line: #8a95a5; --box: #eef3fa;
        --edge: #3a6ea5; --method: #fdf0e1; --method-edge: #b3691a; }
  @media (prefers-color-scheme: dark) {
    svg { --page: #171c23; --ink: #e8edf4; --soft: #a5b0bf; --line: #76828f; --box: #222c39;
          --edge: #7fb0e6; --method: #33291b; --method-edge: #e2a45c; }
  }
  text { font: 13px system-ui, "DejaVu Sans", Arial, sans-serif; fill: var(--ink); }
  .head { font-size: 15px; font-weight: 600; }
  .room { font-weight: 600; }
  .soft { fill: var(--soft); }
  rect.box { fill: var(--box); stroke: var(--edge); }
  rect.method { fill: var(--method); stroke: var(--method-edge); }
  path { stroke: var(--line); fill: none; stroke-width: 1.5; marker-end: url(#arrow); }
  marker path { fill: var(--line); stroke: none; marker-end: none; }
"""


def layers() -> list[str]:
    """Layers of the import-linter contract, the highest first, without the package's name."""
    settings = tomllib.loads((HERE.parent.parent / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    found: list[str] = next(c["layers"] for c in contracts if c["type"] == "layers")
    return [layer.replace("usdhand.", "") for layer in found]


def picture() -> str:
    """Return the whole file."""
    parts = [*_way(), *_layers(204)]
    height = 204 + 10 + 26 * len(layers()) + MARGIN
    body = "\n".join(f"  {part}" for part in parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'width="{WIDTH}" height="{height}" role="img" aria-labelledby="title">\n'
        '  <title id="title">The way of a clip through a verb, and the layers of imports</title>\n'
        f"  <style>{STYLE}  </style>\n"
        '  <defs><marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto"><path d="M0 0 L8 4 L0 8 z"/></marker></defs>\n'
        f'  <rect width="{WIDTH}" height="{height}" rx="8" fill="var(--page)"/>\n{body}\n</svg>\n'
    )


def _way() -> Iterator[str]:
    yield _text(MARGIN, 34, "The way of a clip: one direction, no step back", "head")
    gap = 18
    width = (WIDTH - 2 * MARGIN - gap * (len(WAY) - 1)) / len(WAY)
    for i, (room, *lines) in enumerate(WAY):
        x = MARGIN + i * (width + gap)
        kind = "box method" if room == "methods" else "box"
        yield f'<rect class="{kind}" x="{x:.1f}" y="52" width="{width:.1f}" height="76" rx="6"/>'
        middle = x + width / 2
        yield _text(middle, 75, room, "room", "middle")
        for line, text in enumerate(lines):
            yield _text(middle, 97 + 18 * line, text, "soft", "middle")
        if i:
            yield f'<path d="M{x - gap + 1:.1f} 90 H{x - 2:.1f}"/>'
    yield _text(
        MARGIN,
        156,
        "Problems go into the journal of the run on the way, and reach the listener at once; "
        "with the report they make the Outcome.",
        "soft",
    )


def _layers(top: int) -> Iterator[str]:
    yield _text(MARGIN, top, "The layers: a room imports from those below it only", "head")
    for i, layer in enumerate(layers()):
        y = top + 14 + 26 * i
        kind = "box method" if "fill" in layer.split() else "box"
        yield (
            f'<rect class="{kind}" x="{MARGIN}" y="{y}" width="{WIDTH - 2 * MARGIN}" '
            'height="22" rx="4"/>'
        )
        yield _text(MARGIN + 12, y + 16, layer.replace(" | ", "    "), "room")
        for about in (ABOUT[name] for name in layer.split(" | ") if name in ABOUT):
            yield _text(WIDTH / 2 - 60, y + 16, about, "soft")


def _text(x: float, y: float, text: str, kind: str, anchor: str = "start") -> str:
    return (
        f'<text class="{kind}" x="{x:.1f}" y="{y}" text-anchor="{anchor}" '
        f'xml:space="preserve">{escape(text)}</text>'
    )


if __name__ == "__main__":
    (HERE / "architecture.svg").write_text(picture(), encoding="utf-8")
