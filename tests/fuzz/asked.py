"""What is asked of a damaged file."""

from __future__ import annotations

from pathlib import Path

from usdhand.requests.base import Request
from usdhand.requests.check import CheckRequest
from usdhand.requests.compare import CompareRequest
from usdhand.requests.convert import ConvertRequest
from usdhand.requests.evaluate import EvaluateRequest
from usdhand.requests.expand import ExpandRequest
from usdhand.requests.fill import FillRequest
from usdhand.requests.inspect import InspectRequest
from usdhand.requests.library import LibraryBuildRequest, LibraryInfoRequest
from usdhand.requests.preview import PreviewRequest
from usdhand.requests.reduce import ReduceRequest
from usdhand.requests.rerun import RerunRequest
from usdhand.requests.splice import SpliceRequest

USD = ("usda", "usdc", "usdz", "rig.usda", "rig.usdc", "library.usdc")


def requests(kind: str, file: Path, seeds: Path, number: int | None = None) -> list[Request]:
    """Return what is asked of one of many files of a kind; all of it without a number."""
    first, others = _asked(kind, file, seeds)
    return first + (others if number is None else [others[number % len(others)]])


def _asked(kind: str, file: Path, seeds: Path) -> tuple[list[Request], list[Request]]:
    """Requests for every file, and those that files take turns with."""
    name, usda = str(file), file.parent / "out.usda"
    if kind == "map.toml":
        return [], [InspectRequest(files=(str(seeds / "s.bvh"),), maps=(file,))]
    if kind == "edits.json":
        body, hands = seeds / "body.usdc", seeds / "ok_01.usdc"
        return [], [SpliceRequest(body=body, hands=hands, edits=file, output=usda)]
    if kind.endswith(".json"):
        shown = str(seeds / ("filled.usdc" if kind == "fill.json" else "spliced.usdc"))
        page = file.parent / "out.html"
        return [], [
            PreviewRequest(files=(shown,), reports=(file,), output=page),
            RerunRequest(report_file=file, output=usda),
        ]
    if kind.startswith("rig."):
        return [], _of_rig(file, seeds, usda)
    if kind.startswith("library."):
        filling = FillRequest(body=seeds / "body.usdc", library=file, output=usda, replace=True)
        return [LibraryInfoRequest(library=file)], [filling, EvaluateRequest(library=file, k=1)]
    checked: list[Request] = [CheckRequest(files=(name,))] if kind in USD else []
    return [], [*_of_clip(file, seeds), *checked]


def _of_rig(file: Path, seeds: Path, usda: Path) -> list[Request]:
    clip = seeds / "ok_01.usdc"
    return [
        ExpandRequest(rig=file, output=usda),
        ExpandRequest(rig=file, output=usda),
        ExpandRequest(rig=file, output=usda, onto=seeds / "s.usdc"),
        ExpandRequest(rig=file, output=usda, variation=0.5),
        ReduceRequest(clips=(str(clip),), rig=file, output=usda),
        InspectRequest(files=(str(file),)),
        CheckRequest(files=(str(file),)),
    ]


def _of_clip(file: Path, seeds: Path) -> list[Request]:
    folder, name = file.parent, str(file)
    usda, usdc, usdz = (folder / f"out.{suffix}" for suffix in ("usda", "usdc", "usdz"))
    sound, library = seeds / "s.usdc", seeds / "library.usdc"
    return [
        InspectRequest(files=(name,)),
        InspectRequest(files=(name,)),
        ConvertRequest(files=(name,), output=usda),
        ConvertRequest(files=(name,), output=folder / "out.bvh"),
        ConvertRequest(files=(name,), output=folder / "out.glb"),
        ConvertRequest(files=(name,), output=usdc, onto=sound),
        ConvertRequest(files=(name,), output=usdz),
        ConvertRequest(files=(str(sound),), output=usda, onto=file),
        ReduceRequest(clips=(name,), output=usda),
        PreviewRequest(files=(name,), output=folder / "out.html"),
        CompareRequest(a=sound, b=file),
        SpliceRequest(body=seeds / "body.usdc", hands=file, output=usda),
        SpliceRequest(body=file, hands=sound, output=usda),
        FillRequest(body=file, library=library, output=usda, replace=True),
        LibraryBuildRequest(clips=(name,), output=usdc),
    ]
