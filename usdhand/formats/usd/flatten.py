"""Stages as one layer: all that is composed, and variant sets that still work."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pxr import Sdf, Tf, Usd, UsdUtils

from usdhand.formats.usd.damage import usd_diagnostics
from usdhand.formats.usd.stage import compose
from usdhand.problems import Problem

EMBEDDED = "usdhand:embedded"  # in the custom data of a class: the file that it is a copy of


class _NoEmbeddingError(Exception):
    """A stage whose arcs cannot be led to copies of their files; the text says why."""


def flat_layer(stage: Usd.Stage) -> tuple[Sdf.Layer, tuple[Problem, ...]]:
    """Return one layer for all of a stage, asset paths absolute, and what it cannot keep.

    A stage without variant sets is flattened by USD. One that has some would lose all but the
    selected variants so. It is kept as it is composed instead: its layer stack becomes one layer,
    and the files that it refers to become classes of this layer.
    """
    lost: tuple[Problem, ...] = ()
    names = _variant_sets(stage)
    with usd_diagnostics():
        try:
            flat = _Embedding(stage).layer if names else _flattened(stage)
        except _NoEmbeddingError as reason:
            flat = _flattened(stage)
            message = f"only the selected variants are kept, since {reason}"
            lost = (Problem("variants", message, ", ".join(names)),)
    for layer in reversed(stage.GetLayerStack()):
        flat.comment = layer.comment or flat.comment
        flat.documentation = layer.documentation or flat.documentation
    return flat, lost


def variant_places(stage: Usd.Stage) -> list[tuple[Usd.Prim, str]]:
    """Prims of a stage and the names of their variant sets, those of prototypes included."""
    roots = [stage.GetPseudoRoot(), *stage.GetPrototypes()]
    return [
        (prim, name)
        for root in roots
        for prim in Usd.PrimRange(root, Usd.PrimAllPrimsPredicate)
        for name in prim.GetVariantSets().GetNames()
    ]


def specs(layer: Sdf.Layer) -> Iterator[Sdf.PrimSpec]:
    """All prim specs of a layer, those inside variants included."""
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    for path in paths:
        if path.IsPrimPath() or path.IsPrimVariantSelectionPath():
            prim = layer.GetPrimAtPath(path)
            if prim:
                yield prim


def _flattened(stage: Usd.Stage) -> Sdf.Layer:
    flat = stage.Flatten(addSourceFileComment=False)
    for prim in list(flat.rootPrims):
        if EMBEDDED in prim.customData:  # nothing refers to it any more
            del flat.rootPrims[prim.name]
    return flat


def _variant_sets(stage: Usd.Stage) -> list[str]:
    return [f"{prim.GetPath()} {name}" for prim, name in variant_places(stage)]


class _Embedding:
    """A stage's layer stack as one layer, with the files that it refers to inside.

    Composition stays what it is, since a reference to a file and one to a copy of it in the same
    layer are equally strong.
    """

    def __init__(self, stage: Usd.Stage) -> None:
        self.classes: dict[str, tuple[Sdf.Path, float, str]] = {}
        self.layer = _layer_stack(stage)
        # Names of the layer's own prims, which no class may take and no inherited class may have.
        self.own = {prim.name for prim in self.layer.rootPrims}
        self._lead_inside(self.layer)
        self._drop_strays()

    def _lead_inside(self, layer: Sdf.Layer) -> None:
        """Let references and payloads of a layer lead to copies of their files."""
        rate = layer.timeCodesPerSecond

        def inside(arc: Sdf.Reference | Sdf.Payload) -> Sdf.Reference | Sdf.Payload | None:
            return self._inside(arc, rate) if arc.assetPath else arc

        for prim in list(specs(layer)):
            if prim.hasReferences:
                prim.referenceList.ModifyItemEdits(inside)
            if prim.hasPayloads:
                prim.payloadList.ModifyItemEdits(inside)

    def _inside(
        self, arc: Sdf.Reference | Sdf.Payload, rate: float
    ) -> Sdf.Reference | Sdf.Payload | None:
        if arc.assetPath.startswith("`"):
            raise _NoEmbeddingError(f"{arc.assetPath} is an expression")
        if arc.assetPath not in self.classes and not self._embed(arc.assetPath):
            return None  # a file that is missing adds nothing to the stage either
        root, own_rate, default = self.classes[arc.assetPath]
        target = arc.primPath or Sdf.Path(f"/{default}" if default else "")
        if target.isEmpty:
            return None
        # Between files USD counts time codes anew; within one it does not.
        offset = arc.layerOffset
        scaled = Sdf.LayerOffset(offset.offset, offset.scale * rate / own_rate)
        path = target.ReplacePrefix(Sdf.Path.absoluteRootPath, root)
        if isinstance(arc, Sdf.Payload):
            return Sdf.Payload("", path, scaled)
        return Sdf.Reference("", path, scaled, arc.customData)

    def _embed(self, asset: str) -> bool:
        try:
            stage = compose(asset, Usd.Stage.LoadNone)
        except Tf.ErrorException:
            return False
        layer = _layer_stack(stage)
        root = self._free(asset)
        self.classes[asset] = root, layer.timeCodesPerSecond, layer.defaultPrim
        names = [prim.name for prim in layer.rootPrims]
        for prim in specs(layer):
            for inherited in (*_items(prim.inheritPathList), *_items(prim.specializesList)):
                if inherited.GetPrefixes()[0].name in self.own:
                    raise _NoEmbeddingError(f"{asset} inherits {inherited} of the file over it")
        _move_paths(layer, lambda path: path.ReplacePrefix(Sdf.Path.absoluteRootPath, root))
        self._lead_inside(layer)
        parent = Sdf.CreatePrimInLayer(self.layer, root)
        parent.specifier = Sdf.SpecifierClass
        parent.SetInfo("customData", {EMBEDDED: Path(asset).name})
        for name in names:
            source = Sdf.Path.absoluteRootPath.AppendChild(name)
            Sdf.CopySpec(layer, source, self.layer, root.AppendChild(name))
        return True

    def _drop_strays(self) -> None:
        """Delete targets outside of what is referenced: valid in one file, not between files."""
        roots = [root for root, _, _ in self.classes.values()]
        strays: list[tuple[Usd.Property, list[Sdf.Path]]] = []
        stage = compose(self.layer)
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
            for prop in prim.GetAuthoredProperties():
                related = isinstance(prop, Usd.Relationship)
                targets = prop.GetTargets() if related else prop.GetConnections()
                if found := [t for t in targets if any(t.HasPrefix(root) for root in roots)]:
                    if prim.IsInstanceProxy():
                        raise _NoEmbeddingError(f"{prop.GetPath()} leaves its file")
                    strays.append((prop, found))
        for prop, found in strays:
            spec = _local_spec(self.layer, prop)
            related = isinstance(prop, Usd.Relationship)
            paths = spec.targetPathList if related else spec.connectionPathList
            paths.deletedItems = found

    def _free(self, asset: str) -> Sdf.Path:
        name = base = "Embedded_" + re.sub(r"\W", "_", Path(asset.split("[")[0]).stem, flags=re.A)
        number = 1
        while name in self.own:
            number += 1
            name = f"{base}_{number}"
        self.own.add(name)
        return Sdf.Path.absoluteRootPath.AppendChild(name)


def _layer_stack(stage: Usd.Stage) -> Sdf.Layer:
    layer = UsdUtils.FlattenLayerStack(stage)
    if any(each.pseudoRoot.HasInfo("layerRelocates") for each in stage.GetLayerStack()):
        raise _NoEmbeddingError("prims are relocated")
    for prim in specs(layer):
        for key, what in (("clips", "has value clips"), ("relocates", "is relocated")):
            if prim.HasInfo(key):
                raise _NoEmbeddingError(f"{prim.path} {what}")
    return layer


def _local_spec(layer: Sdf.Layer, prop: Usd.Property) -> Sdf.PropertySpec:
    spec = layer.GetPropertyAtPath(prop.GetPath())
    if spec:
        return spec
    prim = Sdf.CreatePrimInLayer(layer, prop.GetPrimPath())
    if isinstance(prop, Usd.Relationship):
        return Sdf.RelationshipSpec(prim, prop.GetName(), prop.IsCustom())
    return Sdf.AttributeSpec(prim, prop.GetName(), prop.GetTypeName(), prop.GetVariability())


def _items(proxy: Any) -> list[Sdf.Path]:
    return list(proxy.GetAddedOrExplicitItems())


def _move_paths(layer: Sdf.Layer, move: Callable[[Sdf.Path], Sdf.Path]) -> None:
    """Change all paths that specs of a layer refer to."""

    def moved(arc: Sdf.Reference | Sdf.Payload) -> Sdf.Reference | Sdf.Payload:
        if arc.assetPath or not arc.primPath:
            return arc
        path = move(arc.primPath)
        if isinstance(arc, Sdf.Payload):
            return Sdf.Payload("", path, arc.layerOffset)
        return Sdf.Reference("", path, arc.layerOffset, arc.customData)

    for prim in list(specs(layer)):
        prim.inheritPathList.ModifyItemEdits(move)
        prim.specializesList.ModifyItemEdits(move)
        prim.referenceList.ModifyItemEdits(moved)
        prim.payloadList.ModifyItemEdits(moved)
        for relationship in prim.relationships:
            relationship.targetPathList.ModifyItemEdits(move)
        for attribute in prim.attributes:
            attribute.connectionPathList.ModifyItemEdits(move)
