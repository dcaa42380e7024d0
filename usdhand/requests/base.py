"""What a run is to do, as a value: a frozen dataclass a verb, in JSON and back without loss."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, get_args, get_origin

from usdhand.display import displayed
from usdhand.errors import UsageError
from usdhand.options import alternatives, check_values, declared


@displayed()
@dataclass(frozen=True, kw_only=True)
class Request:
    """Base of all requests.

    The docstring of a request is the help of its verb. Paths may be given as strings, and several
    of something as a list.

    Attributes
    ----------
    verb : its name on the command line
    verbose : what ``-v`` adds to the text, "" for nothing
    """

    verb: ClassVar[str]
    verbose: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for own in declared(type(self)):
            value = getattr(self, own.name)
            object.__setattr__(self, own.name, _as_declared(own.name, own.type, value))
        check_values(self)

    def reported(self) -> dict[str, Any]:
        """Return the settings as reports have them: by key, those of settings among the others."""
        found: dict[str, Any] = {}
        for own in declared(type(self)):
            value = getattr(self, own.name)
            if own.option.role == "settings":
                found |= _settings(value, own.key if own.option.key else "")
            elif own.option.reported:
                found[own.key] = value
        return found


def _as_declared(name: str, kind: Any, value: Any) -> Any:
    """A value as its field has it: paths of texts or texts of paths, tuples of lists."""
    for one in alternatives(kind):
        if get_origin(one) is tuple and get_args(one)[1:] == (...,):
            if isinstance(value, (str, Path)):
                raise UsageError(f"'{name}' takes several: give a list, [{str(value)!r}].")
            if isinstance(value, Iterable):
                return tuple(_as_declared(name, get_args(one)[0], item) for item in value)
        if one in (Path, str) and isinstance(value, (Path, str)):
            return one(value)
    return value


def _settings(value: Any, key: str) -> dict[str, Any]:
    keys = {own.name: own.key for own in declared(type(value))}
    found: Mapping[str, Any] = {keys.get(k, k): v for k, v in asdict(value).items()}
    return {key: found} if key else dict(found)


def named_inputs(request: Request) -> Iterator[Path]:
    """Paths of inputs that a request names; texts that may stand for several not among them."""
    for own in declared(type(request)):
        value = getattr(request, own.name)
        if own.option.role == "settings" or own.option.written:
            continue
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, Path):
                yield one
