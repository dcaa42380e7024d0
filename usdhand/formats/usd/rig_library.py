"""A rig without a character: relations fitted once to a body of motion, to be applied to clips."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf

from usdhand.formats.output import check_outputs
from usdhand.formats.paths import written_files
from usdhand.formats.suffixes import USD_SUFFIXES
from usdhand.formats.usd.damage import refuses_damage
from usdhand.formats.usd.rig import RIG_NAME, find_rig, read_rig_at, rig_prims
from usdhand.formats.usd.rig_author import author_relations
from usdhand.formats.usd.stage import Character, character_on, open_stage
from usdhand.formats.usd.write import describe_layer, save_layer
from usdhand.reduce.rig import ReducedRig


def write_fitted_rig(rig: ReducedRig, output: str | Path, *, force: bool = False) -> None:
    """Write the relations of a rig, its limits and residuals, without character and motion.

    Raises
    ------
    OutputError
        if the output is refused or cannot be written.
    """
    output = Path(output)
    check_outputs(written_files(output), (), force, [s for s in USD_SUFFIXES if s != ".usdz"])
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    with Sdf.ChangeBlock():
        author_relations(layer, Sdf.Path(f"/{RIG_NAME}"), rig)
        describe_layer(layer, RIG_NAME)
    save_layer(layer, output, flatten=False)


@refuses_damage
def read_with_rig(
    path: Path, skel: str | None = None
) -> tuple[ReducedRig | None, Character | None]:
    """The rig of a USD file, if it has one, and its character.

    There is no character where the rig was fitted without one.

    Raises
    ------
    InputError
        if the file cannot be read, or holds several rigs, or one that contradicts itself.
    UsageError
        if several skeletons are there and ``skel`` does not choose one.
    """
    stage, problems = open_stage(path)
    rig = None
    if any(True for _ in rig_prims(stage)):
        prim = find_rig(stage, path, skel)
        rig = read_rig_at(prim, path)
        if not prim.GetRelationship("usdhand:skeleton"):
            return rig, None
    return rig, character_on(stage, path, problems, skel)
