"""What came of a damaged file."""

from __future__ import annotations

import json
import re
import shutil
import struct
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

NOT_FINITE = re.compile(r"(?<![\w.\"])(?:nan|-?inf)(?![\w\"])")
NAMED = re.compile("ROOT|JOINT")  # what comes after is a name
LONGEST = 4000  # characters of a message
FLOAT = 5126  # as glTF counts types


@dataclass(frozen=True)
class Result:
    """What came of a try: "works", "refused", "crashed", or what is wrong."""

    what: str
    detail: str = ""

    @property
    def failed(self) -> bool:
        return self.what not in ("works", "refused", "crashed")


def judge(requests: Sequence[Any], file: Path) -> Result:
    """Do what is asked of a damaged file, which stays alone in its folder."""
    result = Result("refused")
    for request in requests:
        try:
            result = _judge(request, file)
        finally:
            for path in file.parent.iterdir():
                if path != file:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
        if result.failed:
            break
    return result


def _judge(request: Any, file: Path) -> Result:
    from usdhand.errors import UnforeseenError, UsdHandError
    from usdhand.verbs.run import run

    verb = type(request).__name__.removesuffix("Request")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            outcome = run(request)
            outcome.to_json()  # judged by its schema, see builders/report_schemas.py
            outcome.to_text(True)
    except UnforeseenError as error:
        return Result("unforeseen", f"{verb}: {error}")
    except UsdHandError as error:
        if len(said := str(error)) > LONGEST:
            return Result("long message", f"{verb}: {said[:100]}")
        if left := [p.name for p in file.parent.iterdir() if p != file]:
            return Result("left behind", f"{verb} {left}: {error}")
        return Result("refused")
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)
        own = [f"{Path(f.filename).name}:{f.lineno}" for f in where if "usdhand" in f.filename]
        said = f"{verb} {' '.join(own[-3:])} {str(error)[:150]}"
        return Result(type(error).__name__, said)
    for problem in outcome.problems:
        if problem.code == "unforeseen":
            return Result("unforeseen", f"{verb}: {problem}")
        if len(str(problem)) > LONGEST:
            return Result("long message", f"{verb}: {str(problem)[:100]}")
    for path in file.parent.iterdir():
        if path != file and (bad := next(_not_finite(path, file), None)):
            return Result("not finite", f"{verb}: {path.name}: {bad}")
        if path.name.startswith("."):
            return Result("left behind", f"{verb}: {path.name}")
    return Result("refused" if outcome.exit_code else "works")


def _not_finite(path: Path, source: Path) -> Iterator[str]:
    """Where a result has a value that is not finite, and its input has not."""
    if path.suffix == ".bvh":
        lines = path.read_text().splitlines()
        yield from (x for x in lines if NOT_FINITE.search(x) and not NAMED.match(x.lstrip()))
    elif path.suffix == ".glb":
        yield from _in_glb(path.read_bytes())
    elif path.suffix in (".usda", ".usdc", ".usdz"):
        found = list(_in_usd(path))
        of_usd = found and source.suffix in (".usda", ".usdc", ".usdz")
        own = {name for _, name in _in_usd(source)} if of_usd else set()
        yield from (place for place, name in found if name not in own)


def _in_usd(path: Path) -> Iterator[tuple[str, str]]:
    """Paths of the attributes of a layer that are not finite, and their names."""
    from pxr import Sdf, Tf

    found: list[tuple[str, str]] = []
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
        text = layer.ExportToString() if layer else ""
    except (Tf.ErrorException, UnicodeDecodeError):  # the input's own, or found by whoever reads it
        return
    if NOT_FINITE.search(text):

        def look(at: Sdf.Path) -> None:
            spec = layer.GetAttributeAtPath(at)
            if not spec:
                return
            times = layer.ListTimeSamplesForPath(at)
            values = [spec.default, *(layer.QueryTimeSample(at, time) for time in times)]
            if any(NOT_FINITE.search(str(value)) for value in values if value is not None):
                found.append((str(at), at.name))

        layer.Traverse(Sdf.Path.absoluteRootPath, look)
        found = found or [("metadata", "metadata")]
    yield from found


def _in_glb(data: bytes) -> Iterator[str]:
    size = struct.unpack_from("<I", data, 12)[0]
    text, binary = data[20 : 20 + size], data[28 + size :]
    constants: list[str] = []
    document = json.loads(text, parse_constant=constants.append)
    yield from constants
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
    for number, accessor in enumerate(document.get("accessors", [])):
        if accessor["componentType"] != FLOAT or "bufferView" not in accessor:
            continue
        start = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
        count = accessor["count"] * widths[accessor["type"]]
        values = np.frombuffer(binary, "<f4", count, start + accessor.get("byteOffset", 0))
        if not np.isfinite(values).all():
            yield f"accessor {number}"
