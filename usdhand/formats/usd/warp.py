"""Warps of splice as attributes, so that a result says which moment of the hand clip it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pxr import Sdf

SCOPE_NAME = "HandSplice"


def author_warps(
    time_codes: Sequence[float], warps: Mapping[str, Sequence[float]]
) -> Callable[[Sdf.Layer, Sdf.Path], None]:
    """Author of a Scope with one double attribute a hand, ``usdhand:warp:left`` or ``:right``.

    Parameters
    ----------
    time_codes : of the body's frames
    warps : side -> seconds of the hand clip, from its first frame, that these frames show
    """

    def author(layer: Sdf.Layer, root: Sdf.Path) -> None:
        scope = Sdf.CreatePrimInLayer(layer, root.AppendChild(SCOPE_NAME))
        scope.specifier = Sdf.SpecifierDef
        scope.typeName = "Scope"
        for side, seconds in warps.items():
            attribute = Sdf.AttributeSpec(
                scope,
                f"usdhand:warp:{side}",
                Sdf.ValueTypeNames.Double,
                declaresCustom=True,
            )
            attribute.documentation = "Seconds of the hand clip, from its first frame."
            path = attribute.path
            for time, value in zip(time_codes, seconds, strict=True):
                layer.SetTimeSample(path, time, value)

    return author
