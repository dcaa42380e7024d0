"""A stage as one layer in which variant sets still work: files that it refers to become classes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from pxr import Sdf, Tf, Usd, UsdUtils

from usdhand.formats.usd.stage import compose
from usdhand.formats.usd.textures import modify_paths

EMBEDDED = "usdhand:embedded"  # in the custom data of a class: the file that it is a copy of
Arc: TypeAlias = Any  # Sdf.Reference | Sdf.Payload


class NotEmbeddedError(Exception):
    """A stage whose arcs cannot be led to copies of their files; the text says why."""


@dataclass(frozen=True, eq=False)
class File:
    """A file that is referred to, and the class that becomes its copy."""

    stage: Usd.Stage
    place: Sdf.Path

    @property
    def default(self) -> Sdf.Path:
        """The default prim, empty if there is none."""
        return self.stage.GetRootLayer().GetDefaultPrimAsPath()


def embedded(stage: Usd.Stage) -> Sdf.Layer:
    """Return a stage's layer stack as one layer, with the files that it refers to inside.

    Composition stays what it mostly is, since a reference to a file and one to a copy of it in
    the same layer are equally strong. A class that files share is an exception; what comes out is
    to be compared with the stage.

    Raises
    ------
    NotEmbeddedError
        if something refers to files in a way that has no equal within one layer.
    """
    return _Embedding(stage).layer


def specs(layer: Sdf.Layer) -> Iterator[Sdf.PrimSpec]:
    """All prim specs of a layer, those inside variants included."""
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    for path in paths:
        if path.IsPrimPath() or path.IsPrimVariantSelectionPath():
            prim = layer.GetPrimAtPath(path)
            if prim:
                yield prim


class _Embedding:
    def __init__(self, stage: Usd.Stage) -> None:
        # Names of the layer's own prims, which no class may take and no inherited class may have.
        self.own = {prim.GetName() for prim in stage.GetPseudoRoot().GetAllChildren()}
        self.files: dict[str, File | None] = {}
        self.pending: list[tuple[str, File]] = []
        self.layer = self._flat(File(stage, Sdf.Path.absoluteRootPath))
        while self.pending:
            self._copy(*self.pending.pop())
        self._drop_strays()

    def _flat(self, file: File) -> Sdf.Layer:
        """Merge the layers of a file, all that they refer to led to where it is in the result.

        That is done layer by layer: USD counts time codes anew between a file and the *layer*
        that refers to it, whatever the rate of the layers over that one.
        """
        layers = {layer.identifier: layer for layer in file.stage.GetLayerStack(False)}
        copies = {name: _copy_of(layer) for name, layer in layers.items()}
        for name, layer in layers.items():
            below = [Sdf.Layer.FindRelativeToLayer(layer, path) for path in layer.subLayerPaths]
            offsets = list(layer.subLayerOffsets)
            found = [(each, o) for each, o in zip(below, offsets, strict=True) if each]
            copy = copies[name]
            copy.subLayerPaths[:] = [copies[each.identifier].identifier for each, _ in found]
            for i, (_, offset) in enumerate(found):
                copy.subLayerOffsets[i] = offset
            self._lead(copy, file)
        return UsdUtils.FlattenLayerStack(compose(next(iter(copies.values()))))

    def _lead(self, layer: Sdf.Layer, file: File) -> None:
        rate = layer.timeCodesPerSecond

        def move(path: Sdf.Path) -> Sdf.Path:
            return path.ReplacePrefix(Sdf.Path.absoluteRootPath, file.place)

        def lead(arc: Arc) -> Arc | None:
            target, scale = file, 1.0  # within a file time codes are not counted anew
            if arc.assetPath:
                found = self._file(arc.assetPath)
                if found is None:
                    return None  # a file that is missing adds nothing to the stage either
                target, scale = found, rate / found.stage.GetRootLayer().timeCodesPerSecond
            path = arc.primPath or target.default
            if path.isEmpty:
                return None
            path = path.ReplacePrefix(Sdf.Path.absoluteRootPath, target.place)
            offset = Sdf.LayerOffset(arc.layerOffset.offset, arc.layerOffset.scale * scale)
            if isinstance(arc, Sdf.Payload):
                return Sdf.Payload("", path, offset)
            return Sdf.Reference("", path, offset, arc.customData)

        _change_paths(layer, move, lead)

    def _file(self, asset: str) -> File | None:
        if asset.startswith("`"):
            raise NotEmbeddedError(f"{asset} is an expression")
        if asset not in self.files:
            try:
                stage = compose(asset, Usd.Stage.LoadNone)
            except Tf.ErrorException:
                self.files[asset] = None
            else:
                file = self.files[asset] = File(stage, self._free(asset))
                self.pending.append((asset, file))
        return self.files[asset]

    def _copy(self, asset: str, file: File) -> None:
        layer = self._flat(file)
        parent = Sdf.CreatePrimInLayer(self.layer, file.place)
        parent.specifier = Sdf.SpecifierClass
        parent.SetInfo("customData", {EMBEDDED: Path(asset).name})
        for prim in specs(layer):
            for path in (*_items(prim.inheritPathList), *_items(prim.specializesList)):
                inherited = path.ReplacePrefix(file.place, Sdf.Path.absoluteRootPath)
                if inherited.GetPrefixes()[0].name in self.own:
                    raise NotEmbeddedError(f"{asset} inherits {inherited} of the file over it")
        for prim in layer.rootPrims:
            Sdf.CopySpec(layer, prim.path, self.layer, file.place.AppendChild(prim.name))

    def _drop_strays(self) -> None:
        """Delete targets outside of what is referenced: valid in one file, not between files."""
        roots = [file.place for file in self.files.values() if file is not None]
        strays: list[tuple[Usd.Property, list[Sdf.Path]]] = []
        stage = compose(self.layer)
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
            for prop in prim.GetAuthoredProperties():
                related = isinstance(prop, Usd.Relationship)
                targets = prop.GetTargets() if related else prop.GetConnections()
                if found := [t for t in targets if any(t.HasPrefix(root) for root in roots)]:
                    if prim.IsInstanceProxy():
                        raise NotEmbeddedError(f"{prop.GetPath()} leaves its file")
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


def _copy_of(layer: Sdf.Layer) -> Sdf.Layer:
    """Return a copy in memory with absolute asset paths.

    Raises
    ------
    NotEmbeddedError
        if it has what only works between files.
    """
    if layer.pseudoRoot.HasInfo("layerRelocates"):
        raise NotEmbeddedError("prims are relocated")
    for path in layer.subLayerPaths:
        if path.startswith("`"):
            raise NotEmbeddedError(f"{path} is an expression")
    for prim in specs(layer):
        for key, what in (("clips", "has value clips"), ("relocates", "is relocated")):
            if prim.HasInfo(key):
                raise NotEmbeddedError(f"{prim.path} {what}")
    copy = Sdf.Layer.CreateAnonymous(".usdc")
    copy.TransferContent(layer)
    copy.subLayerPaths.clear()
    if not layer.anonymous:  # one in memory has absolute paths
        modify_paths(copy, lambda path: _absolute(path, layer))
    return copy


def _absolute(asset: str, layer: Sdf.Layer) -> str:
    return asset if asset.startswith("`") else Sdf.ComputeAssetPathRelativeToLayer(layer, asset)


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


def _change_paths(
    layer: Sdf.Layer, move: Callable[[Sdf.Path], Sdf.Path], lead: Callable[[Arc], Arc | None]
) -> None:
    """Change all paths and arcs that specs of a layer refer to."""
    for prim in list(specs(layer)):
        prim.inheritPathList.ModifyItemEdits(move)
        prim.specializesList.ModifyItemEdits(move)
        if prim.hasReferences:
            prim.referenceList.ModifyItemEdits(lead)
        if prim.hasPayloads:
            prim.payloadList.ModifyItemEdits(lead)
        for relationship in prim.relationships:
            relationship.targetPathList.ModifyItemEdits(move)
        for attribute in prim.attributes:
            attribute.connectionPathList.ModifyItemEdits(move)
