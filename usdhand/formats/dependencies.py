"""Layers that a file is composed of: a result depends on them, too."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path

from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.inputs import is_text


def open_layers_below(paths: Iterable[Path]) -> list[Path]:
    """Return the files that USD files lead to by composition, as far as this process has them open.

    Nothing is opened for it. Relative to the current folder where the file is.
    """
    usd = [
        path
        for path in paths
        if path.suffix.lower() in USD_SUFFIXES and is_text(str(path.absolute()))
    ]
    if "pxr.Sdf" not in sys.modules or not usd:
        return []
    from pxr import Sdf

    seen = {os.path.realpath(path) for path in usd}
    found: dict[Path, None] = {}
    for path in usd:
        waiting = [Sdf.Layer.Find(str(path.absolute())) or Sdf.Layer.Find(str(path))]
        while waiting:
            layer = waiting.pop()
            for name in layer.GetCompositionAssetDependencies() if layer else ():
                below = Sdf.Layer.FindRelativeToLayer(layer, name)
                real = os.path.realpath(below.realPath) if below and below.realPath else ""
                if real and real not in seen and Path(real).is_file():  # none is in a package
                    seen.add(real)
                    waiting.append(below)
                    own = Path(below.realPath)
                    found[own if path.is_absolute() else Path(os.path.relpath(own))] = None
    return sorted(found)
