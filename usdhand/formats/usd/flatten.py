"""Stages as one layer: all that is composed, and variant sets that still work."""

from __future__ import annotations

from pxr import Sdf, Tf, Usd

from usdhand.formats.usd.composed import first_difference, variant_places
from usdhand.formats.usd.damage import first_line, sentence, usd_diagnostics
from usdhand.formats.usd.embed import EMBEDDED, NotEmbeddedError, embedded
from usdhand.formats.usd.stage import compose, one_thread
from usdhand.problems import Problem


def flat_layer(stage: Usd.Stage) -> tuple[Sdf.Layer, tuple[Problem, ...]]:
    """Return one layer for all of a stage, asset paths absolute, and what it cannot keep.

    A stage without variant sets is flattened by USD. One that has some would lose all but the
    selected variants so. Its layer stack becomes one layer instead, and the files that it refers
    to classes of this layer. That is only taken where it composes to the same, whichever variant
    is selected; otherwise the values count for more than the variants, and it is said.
    """
    names = [f"{prim.GetPath()} {name}" for prim, name in variant_places(stage)]
    with usd_diagnostics(), one_thread():
        try:
            flat, lost = (_embedded(stage), ()) if names else _flattened(stage)
        except NotEmbeddedError as reason:
            flat, lost = _flattened(stage)
            message = f"only the selected variants are kept, since {reason}"
            lost = (Problem("variants", message, ", ".join(names)), *lost)
    for layer in reversed(stage.GetLayerStack()):
        flat.comment = layer.comment or flat.comment
        flat.documentation = layer.documentation or flat.documentation
    return flat, lost


def _embedded(stage: Usd.Stage) -> Sdf.Layer:
    try:
        flat = embedded(stage)
        place = first_difference(stage.GetRootLayer(), flat, variants=True)
    except Tf.ErrorException as error:  # specializes below references may be too much for USD
        why = first_line(sentence(error.args[0]))
        raise NotEmbeddedError(f"USD cannot compose some of its variants ({why})") from error
    if place:
        raise NotEmbeddedError(f"{place} would not stay the same")
    return flat


def _flattened(stage: Usd.Stage) -> tuple[Sdf.Layer, tuple[Problem, ...]]:
    root = stage.GetRootLayer()
    flat = _flatten(stage)
    if not stage.GetPrototypes() or not (place := first_difference(root, flat, variants=False)):
        return flat, ()
    # USD loses targets that lead out of an instance. What is authored below one has no effect
    # there, but would have without it.
    opened = _flatten(_without_instances(root))
    if not first_difference(root, opened, variants=False):
        return opened, ()
    message = "one file cannot keep targets that lead out of an instance"
    return flat, (Problem("targets", message, place),)


def _flatten(stage: Usd.Stage) -> Sdf.Layer:
    flat = stage.Flatten(addSourceFileComment=False)
    for prim in list(flat.rootPrims):
        if EMBEDDED in prim.customData:  # nothing refers to it any more
            del flat.rootPrims[prim.name]
    return flat


def _without_instances(root: Sdf.Layer) -> Usd.Stage:
    stage = compose(root)
    stage.SetEditTarget(stage.GetSessionLayer())
    while paths := [prim.GetPath() for prim in stage.TraverseAll() if prim.IsInstance()]:
        for path in paths:
            stage.GetPrimAtPath(path).SetInstanceable(False)
    return stage
