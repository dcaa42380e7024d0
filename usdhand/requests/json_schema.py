"""JSON Schemas of requests, made from the types of their fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from usdhand.options import allows_none, alternatives, is_settings
from usdhand.requests.base import Request

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def request_schema(owner: type[Request]) -> dict[str, Any]:
    """Return the JSON Schema of a verb's requests."""
    schema = _object(owner)
    schema["properties"] = {"verb": {"const": owner.verb}, **schema["properties"]}
    schema["required"] = ["verb", *schema["required"]]
    return {"$schema": DRAFT, "title": f"usdhand {owner.verb}", **schema}


def _object(owner: type) -> dict[str, Any]:
    assert is_dataclass(owner)
    hints = get_type_hints(owner)
    return {
        "type": "object",
        "properties": {f.name: _property(f, hints[f.name]) for f in fields(owner)},
        "required": [f.name for f in fields(owner) if _needed(f)],
        "additionalProperties": False,
    }


def _needed(own: Field[Any]) -> bool:
    return own.default is MISSING and own.default_factory is MISSING


def _property(own: Field[Any], kind: Any) -> dict[str, Any]:
    found = _schema(kind)
    declared = own.metadata.get("option")
    if declared is not None:
        if declared.help:
            found["description"] = declared.help
        if declared.at_least is not None:
            found["minimum"] = declared.at_least
        if declared.at_most is not None:
            found["maximum"] = declared.at_most
    return found


def _schema(kind: Any) -> dict[str, Any]:
    parts = [_one(k) for k in alternatives(kind)] + [{"type": "null"}] * allows_none(kind)
    if len(parts) == 1:
        return parts[0]
    names = [p.get("type") for p in parts]
    if all(set(p) == {"type"} for p in parts):
        return {"type": names}
    return {"anyOf": parts}


def _one(kind: Any) -> dict[str, Any]:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Literal:
        return {"enum": list(inner)}
    if origin is tuple:
        if inner[1:] == (...,):
            return {"type": "array", "items": _schema(inner[0])}
        items = [_schema(k) for k in inner]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "items": False}
    if origin is Mapping:
        keys, values = (_schema(k) for k in inner)
        return {"type": "object", "propertyNames": keys, "additionalProperties": values}
    if is_settings(kind):
        return _object(kind)
    names: Mapping[Any, str] = {
        bool: "boolean",
        int: "integer",
        float: "number",
        str: "string",
        Path: "string",
    }
    return {"type": names[kind]}
