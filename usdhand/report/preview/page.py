"""The page: template, style, viewer and data in one HTML file without any address in it."""

from __future__ import annotations

import base64
import html
import json
import struct
import zlib
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote
from xml.etree import ElementTree

from usdhand.errors import InputError
from usdhand.inputs import why_no_file
from usdhand.version import __version__

FIGURE_TYPES = {".svg": "image/svg+xml", ".png": "image/png"}
SVG_ROOT = "{http://www.w3.org/2000/svg}svg"  # without its namespace, no browser shows it
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Modules by the names that they import each other by. The three.js files are as their authors
# released them; see viewer/THREE-LICENSE.txt.
MODULES = {
    "three": "three.module.min.js",
    "three-core": "three.core.min.js",
    "orbit": "OrbitControls.js",
    "data": "data.js",
    "dom": "dom.js",
    "playback": "playback.js",
    "character": "character.js",
    "stage": "stage.js",
    "timeline": "timeline.js",
    "curves": "curves.js",
    "keys": "keys.js",
    "main": "main.js",
}
# Relative addresses mean nothing in a page of one file.
RENAMED = {'"./three.core.min.js"': '"three-core"'}
# Characters that a data address can hold as they are, inside a JSON text inside HTML.
UNESCAPED = "!$&'()*+,-./:;=?@_~ []{}|^`>"


def page(title: str, data: dict[str, Any], figures: Sequence[dict[str, str]] = ()) -> str:
    """The whole page as text; it asks no address for anything."""
    imports = {name: _module(file) for name, file in MODULES.items()}
    fields = {
        "title": html.escape(title),
        "version": __version__,
        "style": _text("page.css"),
        "licence": html.escape(_text("THREE-LICENSE.txt")),
        "imports": _json({"imports": imports}),
        "data": _json({"title": title, "figures": list(figures), **data}),
    }
    text = _text("page.html")
    for name, value in fields.items():
        before, marker, after = text.partition(f"<!--{name}-->")
        if not marker:
            raise ValueError(f"page.html has no place for {name}")
        text = f"{before}{value}{after}"
    return text


def figure(path: Path) -> dict[str, str]:
    """A figure as an image inside the page: scripts in an SVG do not run there.

    Raises
    ------
    InputError
        if it is no SVG or PNG file, or one that no browser shows.
    """
    kind = FIGURE_TYPES.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"{path}: not a figure; use one of {', '.join(FIGURE_TYPES)}.")
    if why := why_no_file(path):
        raise InputError(f"{path}: {why}.")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    wrong = _wrong_svg(content) if kind == FIGURE_TYPES[".svg"] else _wrong_png(content)
    if wrong:
        raise InputError(f"{path}: {wrong}.")
    source = f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
    return {"name": path.stem.replace("_", " "), "source": source}


def _wrong_svg(content: bytes) -> str:
    """What is wrong with an SVG, "" for nothing."""
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        return f"not an SVG, since it is not XML ({error})"
    if root.tag != SVG_ROOT:
        return f"not an SVG, since its root is '{root.tag}', not 'svg' of {SVG_ROOT[1:-4]}"
    return ""


def _wrong_png(content: bytes) -> str:
    """What is wrong with the header of a PNG, "" for nothing."""
    header = content[12:29]  # "IHDR" and its fields
    if not content.startswith(PNG_SIGNATURE) or header[:4] != b"IHDR" or len(content) < 33:
        return "not a PNG, since it does not begin like one"
    width, height = struct.unpack(">II", header[4:12])
    if zlib.crc32(header) != int.from_bytes(content[29:33], "big") or not width or not height:
        return "a PNG with a damaged header"
    if b"IDAT" not in content or b"IEND" not in content[-12:]:
        return "a PNG that is not complete"
    return ""


def _module(file: str) -> str:
    text = _text(file)
    for old, new in RENAMED.items():
        text = text.replace(old, new)
    return "data:text/javascript;charset=utf-8," + quote(text, safe=UNESCAPED)


def _text(file: str) -> str:
    viewer = resources.files("usdhand.report.preview") / "viewer" / file
    return viewer.read_text(encoding="utf-8")


def _json(value: Any) -> str:
    """JSON inside a script element: nothing in it can end the element."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
