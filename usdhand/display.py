"""Values as people see them at a prompt: one line, and in notebooks a small table.

Standard library only: what a request looks like is known before numpy is loaded.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator, Mapping, Sized
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import PurePath
from typing import Any, TypeVar

T = TypeVar("T")

LONGEST_LINE = 180  # characters
LONGEST_VALUE = 60
SHOWN_ITEMS = 3

# What is worth a word about a value, by name.
Facts = Mapping[str, object]


def displayed(facts: Callable[[Any], Facts] | None = None) -> Callable[[type[T]], type[T]]:
    """Give a dataclass a ``repr`` of one line, and a ``_repr_html_`` for notebooks.

    Parameters
    ----------
    facts : what they show of a value; its fields that are not as by default if None
    """
    facts = facts or changed_fields

    def decorate(cls: type[T]) -> type[T]:
        own: Any = cls
        own.__repr__ = lambda value: line(value, facts(value))
        own._repr_html_ = lambda value: table(value, facts(value))
        return cls

    return decorate


def line(value: object, facts: Facts) -> str:
    """Return a value in a line: its type and facts, cut off where it is too long."""
    shown = ", ".join(f"{name}={short(fact)}" for name, fact in facts.items())
    return f"{type(value).__name__}({cut(shown, LONGEST_LINE)})"


def table(value: object, facts: Facts) -> str:
    """Return a value as a table in HTML: its type above, a row a fact."""
    named = [(name.replace("_", " "), short(fact)) for name, fact in facts.items()]
    cells = [tuple(map(html.escape, pair)) for pair in named]
    rows = "".join(f"<tr><th>{name}</th><td>{fact}</td></tr>" for name, fact in cells)
    return f"<table><caption>{type(value).__name__}</caption>{rows}</table>"


def changed_fields(value: Any) -> Facts:
    """Fields of a dataclass that have no default, or are not as by default."""
    return {f.name: own for f, own in _fields(value) if f.repr and not _is_default(f, own)}


def short(value: object) -> str:
    """Return any value in a few words: how large an array is, the first few of many."""
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, PurePath):
        return cut(repr(str(value)))
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"{value.dtype}{list(value.shape)}"
    if isinstance(value, Mapping):
        return _some([f"{short(k)}: {short(v)}" for k, v in _first(value.items())], value, "{}")
    if isinstance(value, (tuple, list, set, frozenset)):
        return _some([short(item) for item in _first(value)], value, "()")
    return cut(repr(value))


def cut(text: str, longest: int = LONGEST_VALUE) -> str:
    """Return a text of no more than so many characters; three dots say that there was more."""
    return text if len(text) <= longest else text[: longest - 3] + "..."


def _first(items: Any) -> list[Any]:
    return [item for item, _ in zip(items, range(SHOWN_ITEMS), strict=False)]


def _some(shown: list[str], whole: Sized, brackets: str) -> str:
    more = len(whole) - len(shown)
    inside = ", ".join(shown)
    if more or len(inside) > LONGEST_VALUE:
        inside = f"{cut(inside)}, {len(whole)} in all"
    return brackets[0] + inside + brackets[1]


def _fields(value: Any) -> Iterator[tuple[Field[Any], object]]:
    assert is_dataclass(value)
    return ((f, getattr(value, f.name)) for f in fields(value))


def _is_default(field: Field[Any], own: object) -> bool:
    default = field.default
    if field.default_factory is not MISSING:
        default = field.default_factory()
    if default is MISSING or hasattr(own, "shape"):
        return False
    return bool(own is default or own == default)
