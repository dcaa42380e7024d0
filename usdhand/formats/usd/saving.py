"""Layers as files: written beside, opened once to see that they hold, then moved."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Tf

from usdhand.errors import OutputError, UsdHandError
from usdhand.formats.atomic import pair_written_beside, written_beside
from usdhand.formats.paths import motion_crate
from usdhand.formats.usd.damage import first_line, sentence
from usdhand.formats.usd.motion_crate import own_crate, refer_to, taken_out
from usdhand.formats.usd.stage import open_stage


def save(layer: Sdf.Layer, output: Path, *, split: bool) -> None:
    """Write a layer, and with ``split`` what of an ascii file belongs into a crate beside it."""
    old, beside = own_crate(output), motion_crate(output)
    crate = taken_out(layer, output) if split and output.suffix.lower() == ".usda" else None
    if crate is None:
        with written_beside(output) as temporary:
            export(layer, temporary)
            verify(temporary)
        if old is not None:  # of the file that was replaced
            old.unlink(missing_ok=True)
    else:
        with pair_written_beside(output, beside) as pair:
            export(crate, pair.part)
            for path, part in ((pair.interim, pair.part.name), (pair.final, beside.name)):
                whole = Sdf.Layer.CreateAnonymous(".usda")
                whole.TransferContent(layer)
                refer_to(whole, pair.part, part)
                export(whole, path)
            verify(pair.interim)
        reload(beside)
    reload(output)


def reload(output: Path) -> None:
    """Let stages of this process that show the file show what it is now."""
    loaded = Sdf.Layer.Find(str(output.absolute()))
    if loaded:
        loaded.Reload(force=True)


def export(layer: Sdf.Layer, path: Path) -> None:
    """Write a layer as it is.

    Raises
    ------
    OutputError
        if USD cannot write there.
    """
    try:
        done = layer.Export(str(path))
    except Tf.ErrorException as error:
        why = first_line(*map(sentence, error.args))
        raise OutputError(f"{path.parent}: USD cannot write there ({why}).") from error
    if not done:
        raise OutputError(f"{path.parent}: USD cannot write there.")


def verify(path: Path) -> None:
    """Open what was written. What the input lacks is the input's, but it must be found."""
    try:
        stage, _ = open_stage(path)
    except UsdHandError as error:
        raise OutputError(f"What was written cannot be read back: {error}") from error
    layer = stage.GetRootLayer()
    for asset in layer.subLayerPaths:
        if not Sdf.Layer.FindRelativeToLayer(layer, asset):  # the stage has opened it
            raise OutputError(f"{asset} cannot be found from {path.parent}.")
