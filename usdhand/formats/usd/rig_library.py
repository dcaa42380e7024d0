"""A rig without a character: relations fitted once to a body of motion, to be applied to clips."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf

from usdhand.formats.output import check_output
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.damage import damage_refused
from usdhand.formats.usd.rig import RIG_NAME, find_rig, read_rig_on, rig_prims
from usdhand.formats.usd.rig_author import author_relations
from usdhand.formats.usd.stage import open_stage
from usdhand.formats.usd.write import save_layer
from usdhand.reduce.rig import ReducedRig


def write_fitted_rig(rig: ReducedRig, output: str | Path, *, force: bool = False) -> None:
    """Write the relations of a rig, its limits and residuals, without character and motion.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written.
    """
    output = Path(output)
    check_output(output, (), force, [s for s in USD_SUFFIXES if s != ".usdz"])
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        author_relations(layer, Sdf.Path(f"/{RIG_NAME}"), rig)
        layer.defaultPrim = RIG_NAME
        layer.pseudoRoot.SetInfo("upAxis", "Y")
        layer.pseudoRoot.SetInfo("metersPerUnit", 0.01)
    save_layer(layer, output, flatten=False)


def rig_in(path: Path, skel: str | None = None) -> tuple[ReducedRig, bool] | None:
    """The rig of a USD file and whether it has a character; None if there is none.

    Raises
    ------
    InputError
        if the file cannot be read, or holds several rigs, or one that contradicts itself.
    """
    stage, _ = open_stage(path)
    with damage_refused(path):
        if not any(True for _ in rig_prims(stage)):
            return None
        prim = find_rig(stage, path, skel)
        bound = bool(prim.GetRelationship("usdhand:skeleton"))
    return read_rig_on(stage, path, skel), bound
