"""What `check` is to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from usdhand.display import displayed
from usdhand.options import argument, option
from usdhand.requests import shared
from usdhand.requests.base import Request


@displayed()
@dataclass(frozen=True, kw_only=True)
class CheckRequest(Request):
    """Check files with UsdValidation and additional rules.

    Finds what USD's validators do not check and other tools fail on: illegal joint names,
    missing bind, rest or scales, time codes that would be rescaled. Exit code 1 if there is an
    error.

    \b
    Example:
      usdhand check samples/gestures
    """

    verb: ClassVar[str] = "check"
    files: tuple[str, ...] = argument("Files, folders and wildcards.", several="usd")
    skel: str | None = shared.skel()
    strict: bool = option("Fail on warnings too.", default=False)
