"""Options: what a person may set, declared once as the field of a frozen dataclass.

The field's type, default and `Option` serve the command line, environment variables, JSON, its
schema and the docs alike. No numpy: a verb's options are known before it is loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from usdhand.errors import UsageError

Role = Literal["argument", "option", "settings"]

# Simple types in words.
WORDS: Mapping[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    Path: "a path",
}


@dataclass(frozen=True)
class Option:
    """How one field is set.

    Attributes
    ----------
    help : a sentence or two for people
    role : "argument" has its place on the command line, "settings" is a dataclass of options
    flags : names on the command line; ``--`` and the field's name where empty
    metavar : what stands for the value in help
    key : its name in reports; the field's name where empty
    at_least, at_most : smallest and largest number allowed
    read : turns a text of the command line into the value; raises ValueError
    shown : text that ``read`` makes the default of
    bases : of settings: the value of ``chosen_by`` -> the settings that single options change
    chosen_by : field that names one of ``bases``
    reported : whether it is among the settings of a report
    written : whether it names something that a run writes
    several : of texts that name inputs: what a folder stands for, the "files" in it, the "usd"
        ones, or also those in the folders "below"; "" for texts that name none
    """

    help: str
    role: Role = "option"
    flags: tuple[str, ...] = ()
    metavar: str = ""
    key: str = ""
    at_least: int | None = None
    at_most: int | None = None
    read: Callable[[str], Any] | None = None
    shown: str = ""
    bases: Mapping[str, Any] | None = None
    chosen_by: str = ""
    reported: bool = True
    written: bool = False
    several: Literal["", "files", "usd", "below"] = ""


@dataclass(frozen=True)
class Declared:
    """An option with the name, type and default of its field."""

    name: str
    type: Any
    default: Any  # MISSING where a value is needed
    option: Option

    @property
    def key(self) -> str:
        """Its name in reports."""
        return self.option.key or self.name

    @property
    def flags(self) -> tuple[str, ...]:
        """Its names on the command line."""
        return self.option.flags or ("--" + self.name.replace("_", "-"),)

    @property
    def required(self) -> bool:
        """Whether there is no default."""
        return self.default is MISSING


def argument(help: str, *, default: Any = MISSING, **details: Any) -> Any:  # noqa: A002
    """Declare a field that has its place on the command line, not a flag; see `option`."""
    own = Option(help, role="argument", reported=False, **details)
    return field(default=default, metadata={"option": own})


def option(
    help: str,  # noqa: A002
    *flags: str,
    default: Any = MISSING,
    **details: Any,
) -> Any:
    """Declare a field that a flag sets; ``details`` are those of `Option`."""
    return field(default=default, metadata={"option": Option(help, flags=flags, **details)})


def settings(
    default: Any, *, bases: Mapping[str, Any] | None = None, chosen_by: str = "", key: str = ""
) -> Any:
    """Declare a field that holds a dataclass of options."""
    own = Option("", role="settings", bases=bases, chosen_by=chosen_by, key=key)
    return field(default=default, metadata={"option": own})


def declared(owner: type) -> tuple[Declared, ...]:
    """Options of a dataclass in the order of its fields, those of its settings not among them."""
    return tuple(_declared(owner))


@cache
def _declared(owner: type) -> tuple[Declared, ...]:
    hints = get_type_hints(owner)
    return tuple(
        Declared(f.name, hints[f.name], _default(f), f.metadata["option"])
        for f in fields(owner)
        if "option" in f.metadata
    )


def flat(owner: type) -> Iterator[tuple[Declared, Declared | None]]:
    """Options of a dataclass and of its settings, each with the settings that it is in."""
    for own in declared(owner):
        if own.option.role == "settings":
            yield from ((inner, own) for inner in declared(own.type))
        else:
            yield own, None


def alternatives(kind: Any) -> tuple[Any, ...]:
    """Types of a union, or the one type, without None."""
    if get_origin(kind) in (Union, UnionType):
        return tuple(a for a in get_args(kind) if a is not type(None))
    return (kind,)


def allows_none(kind: Any) -> bool:
    """Whether a type has None among its values."""
    return get_origin(kind) in (Union, UnionType) and type(None) in get_args(kind)


def check_values(value: Any) -> None:
    """Refuse a dataclass with a choice that there is not, or a value that is no number, text or so.

    Raises
    ------
    UsageError
        if a field of a Literal type has another value, or one of a simple type one of another.
    """
    owner: type = type(value)
    for name, choices in _choices(owner).items():
        chosen = getattr(value, name)
        if not any(chosen is c or (type(chosen) is type(c) and chosen == c) for c in choices):
            named = ", ".join(str(choice) for choice in choices if choice is not None)
            raise UsageError(f"There is no {name} '{chosen}'; there are {named}.")
    for name, (kinds, optional) in _simple(owner).items():
        given = getattr(value, name)
        if given is None and optional:
            continue
        if not any(_is_of(kind, given) for kind in kinds):
            wanted = " or ".join(_described(kind) for kind in kinds)
            raise UsageError(f"{name} cannot be {given!r}: {wanted} is needed.")


def _is_of(kind: Any, value: Any) -> bool:
    """Whether a value is of a simple type, or a tuple of such."""
    if inner := get_args(kind):
        if not isinstance(value, Sequence) or len(value) != len(inner):
            return False
        return all(_is_simply(one, part) for one, part in zip(inner, value, strict=True))
    return _is_simply(kind, value)


def _is_simply(kind: Any, value: Any) -> bool:
    """Whether a value is of a simple type; numbers may be numpy's."""
    if isinstance(value, bool) or kind in (bool, str, Path):
        return isinstance(value, kind) and (kind is bool) == isinstance(value, bool)
    return isinstance(value, Real if kind is float else Integral)


@cache
def _simple(owner: type) -> dict[str, tuple[tuple[Any, ...], bool]]:
    """Fields of simple types, or tuples of such, and whether each may be None."""
    hints = get_type_hints(owner)
    own = [(f.name, hints[f.name]) for f in fields(owner)]
    return {
        name: (alternatives(kind), allows_none(kind))
        for name, kind in own
        if all(_is_simple(one) for one in alternatives(kind))
    }


def _is_simple(kind: Any) -> bool:
    if get_origin(kind) is tuple:
        return all(one in WORDS for one in get_args(kind))
    return kind in WORDS


def _described(kind: Any) -> str:
    return WORDS.get(kind) or f"a list of {len(get_args(kind))} numbers"


@cache
def _choices(owner: type) -> dict[str, tuple[Any, ...]]:
    """Fields of a dataclass that are choices, and what there is to choose from."""
    hints = {name: (alternatives(kind), kind) for name, kind in get_type_hints(owner).items()}
    return {
        name: (*(choice for one in kinds for choice in get_args(one)), *[None] * allows_none(kind))
        for name, (kinds, kind) in hints.items()
        if all(get_origin(one) is Literal for one in kinds)
    }


def is_settings(kind: Any) -> bool:
    """Whether a type is a dataclass."""
    return isinstance(kind, type) and is_dataclass(kind)


def _default(own: Field[Any]) -> Any:
    if own.default_factory is not MISSING:
        return own.default_factory()
    return own.default
