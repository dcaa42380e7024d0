"""The JSON of a glTF file and its buffers, read so that any damage is told with its place."""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote, unquote_to_bytes

from usdhand.errors import InputError
from usdhand.inputs import why_no_file
from usdhand.problems import CHOICES, listed

MAGIC = b"glTF"
LONG_NAME = 200  # characters
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
LARGEST = 1e9  # metres and scales beyond are damage, and would overflow in products


@dataclass(frozen=True, eq=False)
class Element:
    """A value in the JSON and where it stands, such as ``nodes[3].rotation``."""

    file: Path
    value: Any
    where: str = ""

    def refuse(self, what: str) -> NoReturn:
        """Raise the error that says what is wrong here.

        Raises
        ------
        InputError
            always.
        """
        raise InputError(f"{self.file}: {self.where or 'its JSON'} {what}.")

    def get(self, key: str) -> Element | None:
        """Return a member of this object, None where it is absent."""
        if not isinstance(self.value, dict):
            self.refuse("is not a JSON object")
        if self.value.get(key) is None:
            return None
        return Element(self.file, self.value[key], f"{self.where}.{key}" if self.where else key)

    def need(self, key: str) -> Element:
        """Return a member that must be there."""
        found = self.get(key)
        return found if found is not None else self.refuse(f"has no '{key}'")

    def find(self, *keys: str) -> Element | None:
        """Return what stands below nested objects, None where any of them is absent."""
        found: Element | None = self
        for key in keys:
            if found is None:
                return None
            found = found.get(key)
        return found

    def items(self, key: str) -> list[Element]:
        """Elements of a list that may be absent."""
        found = self.get(key)
        return [] if found is None else found.elements()

    def elements(self) -> list[Element]:
        """Elements of this list."""
        if not isinstance(self.value, list):
            self.refuse("is not a JSON list")
        return [Element(self.file, v, f"{self.where}[{i}]") for i, v in enumerate(self.value)]

    def members(self) -> Iterator[tuple[str, Element]]:
        """Keys and values of this object."""
        if not isinstance(self.value, dict):
            self.refuse("is not a JSON object")
        for key in self.value:
            if (found := self.get(key)) is not None:
                yield key, found

    def whole(self, least: int = 0, below: int | None = None) -> int:
        """Return this as a whole number in a range."""
        value = self.value
        # glTF allows 1.0 for 1.
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if not isinstance(value, int) or isinstance(value, bool):
            self.refuse("is not a whole number")
        if value < least:
            self.refuse(f"is {_short(value)}; it must be at least {least}")
        if below is not None and value >= below:
            self.refuse(f"is {_short(value)}, but there are only {below}")
        return value

    def integer(self, key: str, default: int, least: int = 0) -> int:
        """Return a whole number that may be absent."""
        found = self.get(key)
        return default if found is None else found.whole(least)

    def reference(self, key: str, count: int) -> int | None:
        """Return an index into a list of ``count`` elements, None where it is absent."""
        found = self.get(key)
        return None if found is None else found.whole(0, count)

    def numbers(self, count: int) -> list[float]:
        """Return this as a list of finite numbers."""
        found = [element.number() for element in self.elements()]
        if len(found) != count:
            self.refuse(f"has {len(found)} numbers, not {count}")
        return found

    def number(self) -> float:
        """Return this as a finite number of sensible size."""
        value = self.value
        if not isinstance(value, (int, float)) or isinstance(value, bool):
            self.refuse("is not a number")
        if not (math.isfinite(value) if isinstance(value, float) else True) or abs(value) > LARGEST:
            self.refuse(f"is {_short(value)}, which is not plausible")
        return float(value)

    def text(self, key: str) -> str:
        """Return a member's text, "" where it is absent."""
        found = self.get(key)
        if found is None:
            return ""
        if not isinstance(found.value, str):
            found.refuse("is not a text")
        return found.value.encode("utf-8", "replace").decode()  # no lone surrogates


@dataclass(frozen=True, eq=False)
class Document:
    """A glTF file: its JSON, and its buffers as they are asked for."""

    path: Path
    json: Element
    binary: bytes | None = None
    loaded: dict[int, bytes] = field(default_factory=dict)

    @cached_property
    def lists(self) -> dict[str, list[Element]]:
        """The lists of the document that other parts refer to by index."""
        names = ("accessors", "animations", "bufferViews", "buffers", "nodes", "skins")
        return {name: self.json.items(name) for name in names}

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer: of this file, of its text, or of a file beside it.

        Raises
        ------
        InputError
            if it cannot be had, or is shorter than the file says.
        """
        if index not in self.loaded:
            self.loaded[index] = self._load(index)
        return self.loaded[index]

    def _load(self, index: int) -> bytes:
        buffer = self.lists["buffers"][index]
        size = buffer.need("byteLength").whole()
        uri = buffer.text("uri")
        if not uri:
            if index or self.binary is None:
                buffer.refuse("has neither a uri nor a binary chunk in this file")
            data = self.binary
        elif uri[:5].lower() == "data:":
            data = _data_uri(buffer, uri)
        else:
            data = self._beside(buffer, uri, size)
        if len(data) < size:
            buffer.refuse(f"has {len(data)} bytes, not the {size} of its byteLength")
        return data

    def _beside(self, buffer: Element, uri: str, size: int) -> bytes:
        name = unquote(uri)
        parts = name.replace("\\", "/").split("/")
        if ":" in parts[0] or not parts[0] or _leaves(parts):
            buffer.refuse(f"names {_quoted(uri)}, which is not a file beside it or below")
        path = self.path.parent / name
        try:
            if why := why_no_file(path):
                shown = path if len(name) < LONG_NAME else _quoted(name)
                raise InputError(f"{self.path}: its buffer file {shown} is missing ({why}).")
            with path.open("rb") as file:
                return file.read(min(size, path.stat().st_size))
        except (OSError, ValueError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or "no such name"
            raise InputError(
                f"{self.path}: its buffer file {_quoted(uri)} cannot be read ({reason})."
            ) from error


def read_document(path: Path) -> Document:
    """Read a .glb or .gltf file, told apart by their first bytes.

    Raises
    ------
    InputError
        if it is none, or damaged: with the byte, or the line and column.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}).") from error
    if data[:4] == MAGIC:
        text, start, binary = _chunks(path, data)
    else:
        text, start, binary = data, 0, None
    root = Element(path, _parsed(path, text, start))
    asset = root.get("asset")
    version = asset.text("version") if asset is not None else ""
    if version and not version.startswith("2."):
        raise InputError(f"{path}: is glTF {version[:20]}; only glTF 2 is read. Export it again.")
    return Document(path, root, binary)


def _chunks(path: Path, data: bytes) -> tuple[bytes, int, bytes | None]:
    """JSON chunk, where it starts, and the binary chunk of a .glb."""
    if len(data) < 20:
        raise InputError(f"{path}: ends at byte {len(data)}, within the header of a .glb.")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise InputError(f"{path}: is .glb of version {version} (byte 4); only version 2 is read.")
    if length > len(data):
        raise InputError(
            f"{path}: ends at byte {len(data)}, but its header (byte 8) says {length}: it is cut "
            "off. Copy or export it again."
        )
    found: dict[int, bytes] = {}
    start, at = 0, 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > length:
            raise InputError(f"{path}: the chunk at byte {at} has {size} bytes, but fewer follow.")
        if at == 12 and kind != JSON_CHUNK:
            raise InputError(f"{path}: the first chunk (byte 12) is not JSON.")
        if kind not in found:
            found[kind] = data[at + 8 : at + 8 + size]
            start = at + 8 if kind == JSON_CHUNK else start
        at += 8 + size + (-size) % 4
    if JSON_CHUNK not in found:
        raise InputError(f"{path}: has no JSON chunk (byte 12).")
    return found[JSON_CHUNK], start, found.get(BINARY_CHUNK)


def _parsed(path: Path, data: bytes, start: int) -> Any:
    def constant(name: str) -> NoReturn:
        raise InputError(f"{path}: its JSON holds {name}, which is not a JSON number.")

    try:
        value = json.loads(data.decode("utf-8-sig"), parse_constant=constant)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not glTF: no text at byte {start + error.start}.") from error
    except json.JSONDecodeError as error:
        place = f"byte {start + error.pos}" if start else f"line {error.lineno}:{error.colno}"
        raise InputError(f"{path}: is not glTF: {error.msg} at {place} of its JSON.") from error
    except (RecursionError, ValueError) as error:
        raise InputError(
            f"{path}: its JSON is nested too deeply or has numbers that are too long."
        ) from error
    if not isinstance(value, dict):
        raise InputError(f"{path}: is not glTF: its JSON is not an object.")
    return value


def _leaves(parts: Sequence[str]) -> bool:
    """Whether the parts of a relative path lead out of the folder where it starts."""
    depth = 0
    for part in parts:
        depth += -1 if part == ".." else part not in ("", ".")
        if depth < 0:
            return True
    return False


def _data_uri(buffer: Element, uri: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        buffer.refuse("has a data uri without a comma")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        return base64.b64decode(body, validate=True)
    except (binascii.Error, ValueError) as error:
        return buffer.refuse(f"has a uri that is not base64 ({error})")


def _short(value: float) -> str:
    # A number of thousands of digits cannot be printed.
    if isinstance(value, float):
        return f"{value:g}"
    return str(value) if abs(value) < 10**15 else "huge"


def _quoted(text: str) -> str:
    return repr(text if len(text) < 100 else text[:100] + "...")


def choices(names: Iterable[str]) -> str:
    """Names to choose from, for a message."""
    return listed([repr(name) for name in names], CHOICES)


def unused(name: str, taken: dict[str, int]) -> str:
    """Return a name, with a number if it is taken, and take it; ``taken`` counts the tries."""
    free = name
    while free in taken:
        taken[name] += 1
        free = f"{name}_{taken[name]}"
    taken[free] = 1
    return free
