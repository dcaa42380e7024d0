"""Files that a file leads to: a result depends on them, too."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from usdhand.formats.suffixes import USD_SUFFIXES


def with_dependencies(paths: Iterable[Path]) -> list[Path]:
    """Return files and the layers of which the USD ones among them are composed, each once.

    Relative to the current folder where the file is.
    """
    found: dict[Path, None] = {}
    seen: set[str] = set()
    for path in paths:
        found[path] = None
        seen.add(os.path.realpath(path))
        if path.suffix.lower() in USD_SUFFIXES and path.is_file():
            for layer in _layers(path):
                if os.path.realpath(layer) not in seen:
                    seen.add(os.path.realpath(layer))
                    found[layer if path.is_absolute() else Path(os.path.relpath(layer))] = None
    return list(found)


def _layers(path: Path) -> Iterator[Path]:
    from pxr import Tf, UsdUtils

    from usdhand.formats.usd.damage import usd_diagnostics

    try:
        with usd_diagnostics():
            layers, _, _ = UsdUtils.ComputeAllDependencies(str(path))
    except Tf.ErrorException:  # what is wrong with them has been told where they were read
        return
    for layer in layers:
        if layer.realPath and os.path.isfile(layer.realPath):  # noqa: PTH113  (none in packages)
            yield Path(layer.realPath)
