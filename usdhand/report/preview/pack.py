"""Arrays for the page: quantised, differenced, deflated and each one stored once.

Motion becomes 16-bit numbers. Quaternions have a step of 1/32767, so that no joint turns by more
than 0.0035 degrees away from its clip, relative to its parent; what has a range of its own
(translations, angles) has steps of a 65534th of it.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdhand.motion.rotations import Array

QUATERNION_STEP = 1 / 32767


@dataclass(eq=False)
class Pack:
    """Collects arrays; equal ones, such as the body in all alternatives of a fill, are one."""

    _arrays: list[dict[str, Any]] = field(default_factory=list)
    _blobs: list[bytes] = field(default_factory=list)
    _known: dict[Any, int] = field(default_factory=dict)

    def rotations(self, quaternions: Array) -> int:
        """Keep (frames, 4) unit quaternions that are continuous in sign."""
        return self._quantised(quaternions, 0.0, QUATERNION_STEP)

    def curve(self, values: Array) -> int:
        """Keep (frames, n) numbers with the precision of their own range."""
        low, high = float(values.min()), float(values.max())
        step = (high - low) / 65534 if high > low else 1.0
        return self._quantised(values, (low + high) / 2, step)

    def integers(self, values: NDArray[Any]) -> int:
        """Keep an (n, m) array of whole numbers from 0 on."""
        largest = int(values.max(initial=0))
        kind = "u1" if largest < 256 else "u2" if largest < 65536 else "u4"
        return self._add(np.ascontiguousarray(values, f"<{kind}"), kind, 0.0, 1.0)

    def document(self) -> dict[str, Any]:
        """All arrays as plain data; the order of bytes is that of `_bytes`."""
        data = zlib.compress(b"".join(self._blobs), 9)
        return {"arrays": self._arrays, "data": base64.b64encode(data).decode("ascii")}

    def _quantised(self, values: Array, middle: float, step: float) -> int:
        whole = np.rint((values - middle) / step).astype("<i2")
        if (whole == whole[0]).all():
            whole = whole[:1]
        return self._add(whole, "i2", middle, step)

    def _add(self, values: NDArray[Any], kind: str, middle: float, step: float) -> int:
        key = (kind, values.shape, middle, step, values.tobytes())
        if key not in self._known:
            self._known[key] = len(self._arrays)
            rows, columns = values.shape
            entry = {"kind": kind, "rows": rows, "columns": columns, "middle": middle, "step": step}
            self._arrays.append(entry)
            self._blobs.append(_bytes(values, kind))
        return self._known[key]


def _bytes(values: NDArray[Any], kind: str) -> bytes:
    """Column after column, differences from row to row, low bytes before high ones.

    These deflate to less than half of what the numbers do as they are.
    """
    unsigned = values.T.view(f"<u{kind[1]}")
    differences = np.diff(unsigned, axis=1, prepend=unsigned.dtype.type(0))
    planes = np.ascontiguousarray(differences).view(np.uint8).reshape(-1, int(kind[1]))
    return planes.T.tobytes()
