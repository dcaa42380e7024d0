"""Warps of splice as attributes, so that a result says which moment of the hand clip it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pxr import Sdf

SCOPE_NAME = "HandSplice"


def author_warps(
    time_codes: Sequence[float],
    warps: Mapping[str, Sequence[float]],
    takes: Mapping[str, Sequence[tuple[int, float]]] | None = None,
) -> Callable[[Sdf.Layer, Sdf.Path], None]:
    """Author of a Scope with one double attribute a hand, ``usdhand:warp:left`` or ``:right``.

    Parameters
    ----------
    time_codes : of the body's frames
    warps : side -> seconds of the hand clip, from its first frame, that these frames show
    takes : side -> numbers of the hand clip, if there are several, and time codes from which on
        it is shown: integers ``usdhand:take:left`` or ``:right``, which USD holds in between
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
        for side, changes in (takes or {}).items():
            attribute = Sdf.AttributeSpec(
                scope, f"usdhand:take:{side}", Sdf.ValueTypeNames.Int, declaresCustom=True
            )
            attribute.documentation = "Which of several hand clips is shown, from 0."
            for take, time in changes:
                layer.SetTimeSample(attribute.path, time, take)

    return author
