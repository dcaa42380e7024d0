"""Hands for digital characters: reduce, fill, splice and convert finger motion over OpenUSD.

The functions are the verbs of the command line, on values.

Example
-------
>>> import usdhand                                             # doctest: +SKIP
>>> clip = usdhand.read_clip("samples/gestures/ok_01.usdc")    # doctest: +SKIP
>>> [reduction] = usdhand.reduce_hands([clip])                 # doctest: +SKIP
>>> reduction.rig.free                                         # doctest: +SKIP
>>> usdhand.write_rig(reduction, "ok_rig.usdc")                # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import Any

from usdhand.version import __version__

# Name -> module; each is imported when it is first used, since methods and USD take their time.
_HOME = {
    "Comparison": "usdhand.evaluate.compare",
    "apply_rig": "usdhand.reduce.method",
    "build_library": "usdhand.verbs.library",
    "check_file": "usdhand.formats.usd.check",
    "compare": "usdhand.verbs.compare",
    "Edits": "usdhand.requests.convert",
    "Reading": "usdhand.formats.reading",
    "animation_names": "usdhand.formats.files",
    "convert": "usdhand.verbs.convert",
    "conventions_from": "usdhand.verbs.clips",
    "expand": "usdhand.verbs.expand",
    "expand_onto": "usdhand.verbs.expand",
    "fill_fingers": "usdhand.verbs.fill",
    "find_hands": "usdhand.verbs.clips",
    "read_character": "usdhand.formats.files",
    "read_clip": "usdhand.formats.files",
    "read_library": "usdhand.formats.usd.library",
    "read_rig": "usdhand.verbs.reduce",
    "reduce_hands": "usdhand.verbs.reduce",
    "Pin": "usdhand.splice.settings",
    "SpliceSettings": "usdhand.splice.settings",
    "parse_pin": "usdhand.verbs.splice",
    "retarget_hands": "usdhand.verbs.convert",
    "PreviewSettings": "usdhand.requests.preview",
    "preview_clips": "usdhand.verbs.preview",
    "write_preview": "usdhand.verbs.preview",
    "splice_hands": "usdhand.verbs.splice",
    "write_clip": "usdhand.verbs.clips",
    "write_filled": "usdhand.verbs.fill",
    "write_library": "usdhand.formats.usd.library",
    "write_new": "usdhand.verbs.convert",
    "write_rig": "usdhand.verbs.reduce",
    "write_spliced": "usdhand.verbs.splice",
    "ReduceSettings": "usdhand.reduce.settings",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    # numpy and pxr take a quarter of a second to import: only when a verb is used.
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module 'usdhand' has no attribute '{name}'")
