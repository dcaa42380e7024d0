"""The verbs of usdhand as functions on values; what is odd comes back beside the result.

Example
-------
>>> import usdhand                                             # doctest: +SKIP
>>> clip = usdhand.read_clip("samples/gestures/ok_01.usdc")    # doctest: +SKIP
>>> [reduction] = usdhand.reduce_hands([clip], preset=4)       # doctest: +SKIP
>>> reduction.rig.free                                         # doctest: +SKIP
>>> usdhand.write_rig(reduction, "ok_rig.usdc")                # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import Any

# Name -> module; each is imported when it is first used, since methods and USD take their time.
_HOME = {
    "Comparison": "usdhand.compare",
    "Finding": "usdhand.formats.usd.findings",
    "apply_rig": "usdhand.reduce",
    "build_library": "usdhand.api.filling",
    "check_file": "usdhand.formats.usd.check",
    "compare": "usdhand.api.clips",
    "Edits": "usdhand.api.converting",
    "Reading": "usdhand.formats.files",
    "animation_names": "usdhand.formats.files",
    "convert": "usdhand.api.converting",
    "conventions_from": "usdhand.api.clips",
    "expand": "usdhand.api.reducing",
    "expand_onto": "usdhand.api.reducing",
    "fill_fingers": "usdhand.api.filling",
    "find_hands": "usdhand.api.clips",
    "read_character": "usdhand.formats.files",
    "read_clip": "usdhand.formats.files",
    "read_library": "usdhand.api.filling",
    "read_rig": "usdhand.api.reducing",
    "reduce_hands": "usdhand.api.reducing",
    "Pin": "usdhand.splice",
    "SpliceSettings": "usdhand.splice",
    "parse_pin": "usdhand.api.splicing",
    "retarget_hands": "usdhand.api.converting",
    "PreviewSettings": "usdhand.api.previewing",
    "preview_clips": "usdhand.api.previewing",
    "write_preview": "usdhand.api.previewing",
    "reduction_target": "usdhand.api.reducing",
    "splice_hands": "usdhand.api.splicing",
    "write_clip": "usdhand.api.clips",
    "write_filled": "usdhand.api.filling",
    "write_library": "usdhand.api.filling",
    "write_new": "usdhand.api.converting",
    "write_rig": "usdhand.api.reducing",
    "write_spliced": "usdhand.api.splicing",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module 'usdhand.api' has no attribute '{name}'")
