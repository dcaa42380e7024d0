"""What a run is to do, as a value: a frozen dataclass a verb, in JSON and back without loss."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from usdhand.display import displayed
from usdhand.options import declared


@displayed()
@dataclass(frozen=True, kw_only=True)
class Request:
    """Base of all requests.

    The docstring of a request is the help of its verb.

    Attributes
    ----------
    verb : its name on the command line
    verbose : what ``-v`` adds to the text, "" for nothing
    """

    verb: ClassVar[str]
    verbose: ClassVar[str] = ""

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


def _settings(value: Any, key: str) -> dict[str, Any]:
    keys = {own.name: own.key for own in declared(type(value))}
    found: Mapping[str, Any] = {keys.get(k, k): v for k, v in asdict(value).items()}
    return {key: found} if key else dict(found)
