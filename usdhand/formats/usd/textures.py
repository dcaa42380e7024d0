"""Files that a layer refers to inside packages, and UDIM tiles, as files of their own."""

from __future__ import annotations

import io
import itertools
import os
import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pxr import Ar, Sdf, Usd, UsdShade, UsdUtils

from usdhand.errors import InputError
from usdhand.formats.atomic import written_beside
from usdhand.formats.usd.damage import usd_diagnostics
from usdhand.problems import Problem

EARLIEST = struct.pack("<HH", 0, 1 << 5 | 1)  # 1980-01-01 00:00


@dataclass(frozen=True)
class Copies:
    """Files to copy.

    Attributes
    ----------
    files : name of a copy -> path of its source, which may be inside a package
    renamed : asset path in the layer -> name of its copy, with ``<UDIM>`` for the tile
    """

    files: dict[str, str]
    renamed: dict[str, str]


def is_udim(asset: str) -> bool:
    """Whether an asset path stands for the tiles of a UDIM texture."""
    return bool(UsdShade.UdimUtils.IsUdimIdentifier(asset))


def is_packed(asset: str) -> bool:
    """Whether an asset path leads into a package."""
    return bool(Ar.IsPackageRelativePath(asset))


def modify_paths(layer: Sdf.Layer, change: Callable[[str], str]) -> None:
    """Change all asset paths of a layer."""
    with usd_diagnostics():  # UDIM tiles inside packages are no reason to print
        UsdUtils.ModifyAssetPaths(layer, change)


def asset_paths(layer: Sdf.Layer) -> list[str]:
    """All asset paths of a layer, each once."""
    found: dict[str, None] = {}

    def note(asset: str) -> str:
        found[asset] = None
        return asset

    modify_paths(layer, note)
    return list(found)


def copies_of(layer: Sdf.Layer, wanted: Callable[[str], bool]) -> Copies:
    """Plan copies of the files that ``layer`` refers to and ``wanted`` is true of.

    Files that are not there stay as they are.
    """
    copies = Copies({}, {})
    for asset in filter(wanted, asset_paths(layer)):
        sources = _sources(layer, asset)
        plain = _inner_name(asset)
        for number in itertools.count(1):
            name = plain if number == 1 else f"{number}_{plain}"
            files = {name.replace("<UDIM>", tile): path for path, tile in sources}
            if not copies.files.keys() & files.keys():
                break
        if files:
            copies.files.update(files)
            copies.renamed[asset] = name
    return copies


def missing_files(layer: Sdf.Layer) -> list[str]:
    """Absolute asset paths of a layer that lead nowhere."""
    return [a for a in asset_paths(layer) if Path(a).is_absolute() and not _sources(layer, a)]


def outside_files(stage: Usd.Stage, layer: Sdf.Layer, *, packages_only: bool) -> list[str]:
    """Files that a stage's flat layer takes in from outside the folder of the stage's own file.

    A file from anybody may name any other, which must not leave the machine unsaid.
    """
    root = stage.GetRootLayer()
    own = root.subLayerPaths if root.anonymous else [root.realPath]
    homes = [os.path.realpath(os.path.dirname(_outer(path))) for path in own]  # noqa: PTH120
    found: dict[str, None] = {}
    for asset in asset_paths(layer):
        if packages_only and not is_packed(asset):
            continue
        for source, _ in _sources(layer, asset):
            path = Path(os.path.realpath(_outer(source)))
            if not any(path.is_relative_to(home) for home in homes):
                found[str(path)] = None
    return list(found)


def copy_files(layer: Sdf.Layer, copies: Copies, folder: Path) -> None:
    """Copy files that are not there yet to a folder, and let the layer refer to them."""
    if copies.files:
        folder.mkdir(exist_ok=True)
    for name, source in copies.files.items():
        target = folder / name
        if not target.exists():
            with written_beside(target) as temporary:
                temporary.write_bytes(_read(source))
    renamed = {asset: (folder / name).as_posix() for asset, name in copies.renamed.items()}
    modify_paths(layer, lambda asset: renamed.get(asset, asset))


@contextmanager
def unpacked_beside(layer: Sdf.Layer, output: Path) -> Iterator[tuple[Problem, ...]]:
    """Copy what ``layer`` refers to inside packages to a folder beside ``output``.

    No file is replaced: a folder that has other files of these names is left alone, and another
    one made. All is taken back if the block ends with an error.
    """
    copies = copies_of(layer, is_packed)
    if not copies.files:
        yield ()
        return
    folder = _folder(output.absolute(), copies)
    was_there = folder.exists()
    before = set(folder.iterdir()) if was_there else set()
    try:
        copy_files(layer, copies, folder)
        packages = sorted({Path(asset.split("[")[0]).name for asset in copies.renamed})
        message = f"the textures inside {', '.join(packages)} are copied to {folder.name}"
        yield (Problem("textures", message, severity="note"),)
    except BaseException:
        for name in copies.files:
            if folder / name not in before:
                (folder / name).unlink(missing_ok=True)
        if not was_there and folder.exists():
            folder.rmdir()
        raise


def _folder(output: Path, copies: Copies) -> Path:
    """Return the first folder beside ``output`` that has no other files of these names."""

    def fits(folder: Path) -> bool:
        targets = [(folder / name, source) for name, source in copies.files.items()]
        return not folder.exists() or (
            folder.is_dir()
            and all(not t.exists() or t.read_bytes() == _read(source) for t, source in targets)
        )

    names = (f"{output.stem}_textures{n if n > 1 else ''}" for n in itertools.count(1))
    return next(folder for name in names if fits(folder := output.with_name(name)))


def _sources(layer: Sdf.Layer, asset: str) -> list[tuple[str, str]]:
    """Files that an asset path stands for, each with its tile."""
    if is_udim(asset):
        with usd_diagnostics():
            return list(UsdShade.UdimUtils.ResolveUdimTilePaths(asset, layer))
    there = Ar.GetResolver().Resolve(asset)
    return [(asset, "")] if there else []


def _inner_name(asset: str) -> str:
    while is_packed(asset):
        asset = Ar.SplitPackageRelativePathOuter(asset)[1]
    return asset.rsplit("/", 1)[-1]


def _entry(data: Path | io.BytesIO, name: str, path: str) -> bytes:
    """Read a file in a package, where nothing may be compressed: small ones could be huge."""
    try:
        with zipfile.ZipFile(data) as package:
            if package.getinfo(name).compress_type != zipfile.ZIP_STORED:
                raise InputError(f"{path}: it is compressed, which a .usdz does not allow.")
            return package.read(name)
    except (KeyError, zipfile.BadZipFile, EOFError, NotImplementedError) as error:
        raise InputError(f"{path}: cannot be read from its package ({error}).") from error


def without_times(package: Path) -> None:
    """Give the files in a package the earliest date of a zip: equal content is equal bytes.

    Zip file format, PKWARE APPNOTE 6.3: dates stand in each local header and in the directory.
    """
    with zipfile.ZipFile(package) as listed:
        files, directory = listed.infolist(), listed.start_dir
    with package.open("rb+") as file:
        for info in files:
            file.seek(info.header_offset + 10)
            file.write(EARLIEST)
        for _ in files:
            file.seek(directory)
            header = file.read(46)
            file.seek(directory + 12)
            file.write(EARLIEST)
            directory += 46 + sum(struct.unpack_from("<HHH", header, 28))


def _outer(path: str) -> str:
    """The file itself, or the package that it is in."""
    return str(Ar.SplitPackageRelativePathOuter(path)[0]) if is_packed(path) else path


def _read(path: str) -> bytes:
    """Read a file, or one inside a package (inside a package ...)."""
    if not is_packed(path):
        return Path(path).read_bytes()
    outer, inner = Ar.SplitPackageRelativePathOuter(path)
    data: Path | io.BytesIO = Path(outer)
    while True:
        name, rest = Ar.SplitPackageRelativePathOuter(inner) if is_packed(inner) else (inner, "")
        content = _entry(data, name, path)
        if not rest:
            return content
        data, inner = io.BytesIO(content), rest
