"""Hands for digital characters: reduce, fill, splice and convert finger motion over OpenUSD.

The functions are the verbs of the command line, on values: see `usdhand.verbs`.
"""

from __future__ import annotations

from typing import Any

from usdhand.version import __version__

__all__ = [
    "ReduceSettings",
    "__version__",
    "apply_rig",
    "build_library",
    "check_file",
    "compare",
    "conventions_from",
    "convert",
    "expand",
    "expand_onto",
    "fill_fingers",
    "find_hands",
    "preview_clips",
    "read_clip",
    "read_library",
    "read_rig",
    "reduce_hands",
    "retarget_hands",
    "splice_hands",
    "write_clip",
    "write_filled",
    "write_library",
    "write_new",
    "write_preview",
    "write_rig",
    "write_spliced",
]


def __getattr__(name: str) -> Any:
    # numpy and pxr take a quarter of a second to import: only when a verb is used.
    if name in __all__:
        from usdhand import verbs as api

        return getattr(api, name)
    raise AttributeError(f"module 'usdhand' has no attribute '{name}'")
