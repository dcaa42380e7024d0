"""Numbers of a glTF file: accessors over buffer views, sparse, strided, normalised."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdhand.formats.gltf.document import LARGEST, Document, Element
from usdhand.motion.rotations import Array

COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES: dict[int, type[np.generic]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
MOST_ROWS = 4_000_000  # of an accessor: 18 hours at 60 fps
PACKERS = ("EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression")


def read_rows(document: Document, accessor: Element, kind: str, least: int = 1) -> Array:
    """Return the rows (count, components) of an accessor that must be of a type such as "VEC3".

    Raises
    ------
    InputError
        if it is of another type, has fewer rows than ``least``, reaches beyond its buffer, is
        compressed, or holds what is no number.
    """
    if (name := accessor.text("type")) != kind:
        accessor.refuse(f"is of type {name[:20]!r}, not {kind}")
    count = accessor.need("count").whole(1)
    if count > MOST_ROWS:
        accessor.refuse(f"has a count of more than {MOST_ROWS}")
    if count < least:
        accessor.refuse(f"has a count of {count}, not {least}")
    dtype = _dtype(accessor)
    raw = _dense(document, accessor, dtype, count, COMPONENTS[kind])
    if (sparse := accessor.get("sparse")) is not None:
        raw = _with_sparse(document, sparse, raw)
    rows = _floats(raw, accessor)
    # In one pass over all: nan and infinity are not within any bounds.
    bad = ~(np.abs(rows) <= LARGEST)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        accessor.refuse(f"holds {rows[row][bad[row]][0]:g} in row {row}, which is not plausible")
    return rows


def _dtype(accessor: Element) -> np.dtype[Any]:
    component = accessor.need("componentType")
    code = component.whole()
    if code not in TYPES:
        component.refuse(f"is {str(code)[:20]}, which is not a component type")
    return np.dtype(TYPES[code]).newbyteorder("<")


def _dense(
    document: Document, accessor: Element, dtype: np.dtype[Any], count: int, width: int
) -> NDArray[Any]:
    if accessor.get("bufferView") is None:
        return np.zeros((count, width), dtype)
    return _view(document, accessor, dtype, count, width)


def _view(
    document: Document, holder: Element, dtype: np.dtype[Any], count: int, width: int
) -> NDArray[Any]:
    """Rows (count, width) of the buffer view that an element refers to."""
    lists = document.lists
    views = lists["bufferViews"]
    view = views[holder.need("bufferView").whole(0, len(views))]
    packed = [name for name in PACKERS if view.find("extensions", name) is not None]
    if packed:
        view.refuse(f"is compressed with {packed[0]}, which is not read; export it uncompressed")
    data = document.buffer(view.need("buffer").whole(0, len(lists["buffers"])))
    start, size = view.integer("byteOffset", 0), view.need("byteLength").whole(1)
    if start + size > len(data):
        view.refuse(f"ends at byte {_size(start + size)} of a buffer of {len(data)}")
    offset, row = holder.integer("byteOffset", 0), dtype.itemsize * width
    stride = view.integer("byteStride", 0) or row
    if stride < row:
        view.refuse(f"has a byteStride of {stride}, less than the {row} bytes of a row")
    needed = offset + (count - 1) * stride + row
    if needed > size:
        holder.refuse(f"needs {_size(needed)} bytes of a bufferView of {_size(size)}")
    return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))


def _with_sparse(document: Document, sparse: Element, dense: NDArray[Any]) -> NDArray[Any]:
    """The same rows with some of them replaced."""
    count = sparse.need("count").whole(1)
    if count > len(dense):
        sparse.refuse(f"replaces more rows than the {len(dense)} that there are")
    places, values = sparse.need("indices"), sparse.need("values")
    dtype = _dtype(places)
    if dtype.kind != "u":
        places.refuse("has indices that are not unsigned integers")
    indices = _view(document, places, dtype, count, 1)[:, 0]
    if int(indices.max()) >= len(dense):
        places.refuse(f"names row {int(indices.max())} of {len(dense)}")
    result = dense.copy()
    result[indices] = _view(document, values, dense.dtype, count, dense.shape[1])
    return result


def _floats(raw: NDArray[Any], accessor: Element) -> Array:
    rows = raw.astype(np.float64)
    normalized = accessor.get("normalized")
    if normalized is None or normalized.value is not True or raw.dtype.kind == "f":
        return rows
    rows /= float(np.iinfo(raw.dtype).max)
    return np.maximum(rows, -1.0)


def _size(size: int) -> str:
    return str(size) if size < 10**15 else "huge"
