"""One JSON document a command: a schema version, how it was made, and the result.

Studios script against these: keys are only ever added within a version.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from usdhand.formats.hashing import file_hash
from usdhand.requests.base import Request
from usdhand.requests.codec import to_data
from usdhand.version import __version__

SCHEMA_VERSION = 1


def document(
    request: Request,
    inputs: Sequence[Path],
    settings: Mapping[str, Any],
    result: Mapping[str, Any],
    name: str = "",
) -> dict[str, Any]:
    """Wrap a result with what is needed to make it again; ``name`` is the verb's if empty."""
    return {
        "schema": f"usdhand.{name or request.verb.split()[0]}/{SCHEMA_VERSION}",
        "usdhand": __version__,
        "request": to_data(request),
        "inputs": hashed(inputs),
        "settings": dict(settings),
        **result,
    }


def hashed(paths: Sequence[Path]) -> list[dict[str, str | None]]:
    """Files with the hash of their content, None for what is no file."""
    return [{"path": str(path), "sha256": file_hash(path)} for path in paths]


def dumps(value: Mapping[str, Any]) -> str:
    """JSON text; numbers that JSON does not know become null."""
    text = json.dumps(_plain(value), indent=2, ensure_ascii=False, allow_nan=False)
    # File names need not be text: their odd bytes become escapes, which JSON has as well.
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def rounded(value: float, digits: int = 6) -> float:
    """A plain float, rounded so that reports can be compared."""
    return round(float(value), digits)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value
